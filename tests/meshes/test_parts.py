"""Parts: the same picture as add_mesh, whatever the mesh; the mesh itself untouched."""

import numpy as np
import pytest
import pyvista as pv
import trimesh
from PIL import Image

from pvibr.meshes.mesh_files import scene_instances
from pvibr.meshes.parts import Part, as_meshes, as_parts
from pvibr.textures.material_textures import copy_property
from tests.refusals import refused


def _picture(fill):
    plotter = pv.Plotter(off_screen=True, window_size=(96, 64))
    try:
        fill(plotter)
        plotter.camera_position = 'iso'
        plotter.reset_camera()
        return plotter.screenshot(return_img=True).astype(int)
    finally:
        plotter.close()


def _drawn(parts):
    return _picture(lambda pl: [pl.add_actor(part.actor) for part in parts])


def _ball():
    ball = pv.Sphere(theta_resolution=12, phi_resolution=12)
    ball['height'] = ball.points[:, 2].copy()
    ball['height'][:20] = np.nan
    ball.cell_data['cells'] = np.arange(ball.n_cells, dtype=float)
    ball['paint_rgb'] = (np.abs(ball.points) * 500).astype(np.uint8)
    ball.set_active_scalars('height')
    return ball.texture_map_to_sphere()


def _grid():
    grid = pv.ImageData(dimensions=(4, 4, 4)).cast_to_unstructured_grid()
    grid.cell_data['cells'] = np.arange(grid.n_cells, dtype=float)
    grid['height'] = grid.points[:, 2].copy()
    return grid


CHECKS = np.kron(np.indices((4, 4)).sum(0) % 2, np.ones((4, 4)))[..., None] * 255
IMAGE = np.concatenate([CHECKS, 255 - CHECKS, CHECKS * 0 + 90], axis=2).astype(np.uint8)

LOOKS = {
    'plain': {'color': 'orange'},
    'active scalars': {},
    'scalars': {
        'scalars': 'height',
        'cmap': 'plasma',
        'clim': [-0.2, 0.3],
        'nan_color': 'lime',
        'below_color': 'blue',
        'above_color': 'red',
    },
    'cell scalars': {'scalars': 'cells', 'n_colors': 5, 'cmap': 'viridis'},
    'array': {'scalars': np.linspace(-1, 1, 122), 'smooth_shading': True},
    'array of cells': {'scalars': np.arange(240)},
    'rgb': {'scalars': 'paint_rgb'},
    'texture': {'texture': pv.Texture(IMAGE)},
    'opacity': {'color': 'w', 'opacity': 0.4},
    'opacity array': {'scalars': 'height', 'opacity': np.linspace(0, 1, 122)},
    'opacity curve': {'scalars': 'cells', 'opacity': 'sigmoid'},
    'smooth': {'color': 'w', 'smooth_shading': True, 'specular': 0.7},
    'sharp': {'color': 'w', 'smooth_shading': True, 'split_sharp_edges': True},
    'pbr': {'color': 'w', 'pbr': True, 'metallic': 0.6, 'roughness': 0.3},
    'culled': {'color': 'w', 'culling': 'front'},
    'unlit': {'color': 'w', 'lighting': False},
    'points': {'color': 'w', 'style': 'points', 'point_size': 4},
    'moved': {'color': 'w', 'user_matrix': np.diag([1.0, 2, -1, 1])},
}


@pytest.mark.parametrize('look', LOOKS.values(), ids=LOOKS.keys())
def test_same_picture_as_add_mesh(look):
    expected = _picture(lambda pl: pl.add_mesh(_ball(), show_scalar_bar=False, **look))
    parts = as_parts(_ball(), **look)
    # VTK's own mirrored actors are lit as if turned inside out; the points are compared then.
    if 'user_matrix' not in look:
        np.testing.assert_array_equal(_drawn(parts), expected)
    assert parts[0].actor.mapper.dataset.n_points == parts[0].mesh.n_points
    assert parts[0].mesh.is_all_triangles


@pytest.mark.parametrize('scalars', ['cells', 'height', None])
def test_grids_give_their_surface(scalars):
    grid = _grid()
    expected = _picture(lambda pl: pl.add_mesh(grid, scalars=scalars, show_scalar_bar=False))
    parts = as_parts(grid, scalars=scalars)
    # Drivers may round an edge of two cells to either side.
    assert (np.abs(_drawn(parts) - expected.astype(float)) > 1).sum() <= 6
    assert parts[0].mesh.n_cells == 9 * 6 * 2
    assert set(parts[0].mesh.array_names) <= {scalars or 'cells', 'height'}


def test_theme_gives_the_defaults():
    theme = pv.themes.DarkTheme()
    theme.color = 'red'
    assert as_parts(pv.Cube(), theme=theme)[0].actor.prop.color.name == 'red'


def test_input_is_left_alone():
    ball = _ball()
    before = ball.copy(deep=True)
    parts = as_parts(ball, scalars='cells', user_matrix=np.diag([2.0, 2, 2, 1]))
    parts[0].mesh.points += 1
    assert ball == before
    assert ball.active_scalars_name == before.active_scalars_name


def test_blocks_are_parts_with_one_range():
    blocks = pv.MultiBlock({'a': pv.Cube(), 'b': pv.MultiBlock([pv.Sphere(), None])})
    blocks['a']['h'] = np.arange(8.0)
    blocks['b'][0]['h'] = np.full(842, 20.0)
    parts = as_parts(blocks, scalars='h')
    assert [tuple(part.actor.mapper.scalar_range) for part in parts] == [(0, 20)] * 2
    blocks['b'][0].clear_data()
    parts = as_parts(blocks, scalars='h', texture=pv.Texture(IMAGE), cmap='hot')
    assert [part.actor.mapper.scalar_visibility for part in parts] == [True, False]


def test_actors_are_copied_with_look_and_matrix():
    plotter = pv.Plotter(off_screen=True)
    actor = plotter.add_mesh(_ball(), scalars='height', cmap='hot', opacity=0.5)
    actor.position = (1, 2, 3)
    actor.scale = (1, 1, 4)
    expected = _picture(lambda pl: pl.add_actor(actor))
    part = as_parts(actor)[0]
    np.testing.assert_allclose(_drawn([part]), expected, atol=1)
    np.testing.assert_allclose(part.mesh.center, (1, 2, 3), atol=1e-6)
    part.actor.prop.opacity = 1
    part.actor.mapper.lookup_table.cmap = 'gray'
    assert actor.prop.opacity == 0.5
    np.testing.assert_array_equal(_picture(lambda pl: pl.add_actor(actor)), expected)


def test_composite_actor_keeps_the_colours_of_its_blocks():
    plotter = pv.Plotter(off_screen=True)
    actor, mapper = plotter.add_composite(pv.MultiBlock([pv.Cube(), pv.Sphere()]), color='w')
    mapper.block_attr[1].color = 'blue'
    mapper.block_attr[2].visible = False
    parts = as_parts(actor)
    assert [part.actor.prop.color.name for part in parts] == ['blue']


def test_mirrored_surfaces_stay_right_side_out():
    part = as_parts(pv.Cube(), user_matrix=np.diag([1.0, 1, -1, 1]))[0]
    faces = part.mesh.compute_normals(
        point_normals=False, consistent_normals=False, auto_orient_normals=False
    )
    outward = faces.cell_centers().points - part.mesh.center
    assert ((faces['Normals'] * outward).sum(axis=1) > 0).all()


def _box(**visual):
    box = trimesh.creation.box()
    box.visual = trimesh.visual.ColorVisuals(box, **visual)
    return box


def test_trimesh_colours():
    red, green = [255, 0, 0, 255], [0, 200, 0, 255]
    part = as_parts(_box(face_colors=[red] * 12), lighting=False)[0]
    colors = {tuple(color) for color in _drawn([part]).reshape(-1, 3)}
    assert (255, 0, 0) in colors
    assert len(colors) == 2
    assert part.mesh.cell_data.active_scalars.shape == (12, 3)
    part = as_parts(_box(vertex_colors=[green] * 8), color='blue')[0]
    assert not part.actor.mapper.scalar_visibility
    assert part.mesh.array_names == []


def _textured(mode='OPAQUE', factor=(255, 255, 255, 255)):
    pixels = np.zeros((8, 8, 4), np.uint8)
    pixels[:4] = 255, 0, 0, 255  # The upper half of the picture is red and opaque,
    pixels[4:] = 0, 0, 255, 0  # the lower one blue and transparent.
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(pixels),
        alphaMode=mode,
        baseColorFactor=factor,
        metallicFactor=0.25,
    )
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return mesh


@pytest.mark.parametrize(('mode', 'below'), [('OPAQUE', (0, 0, 255)), ('MASK', (255,) * 3)])
def test_trimesh_texture_stands_upright_and_is_cut(mode, below):
    parts = as_parts(_textured(mode), lighting=False)
    picture = _drawn(parts)
    painted = np.argwhere((picture == (255, 0, 0)).all(axis=2))
    assert painted[:, 0].max() < 40
    assert tuple(picture[44, 48]) == below
    assert parts[0].alpha_cutoff == (0.5 if mode == 'MASK' else None)
    assert not parts[0].actor.HasTranslucentPolygonalGeometry()


def test_trimesh_material_factors():
    part = as_parts(_textured(factor=(255, 0, 0, 255)), pbr=True)[0]
    assert part.actor.prop.metallic == 0.25
    assert part.actor.prop.color.float_rgb == (1, 0, 0)
    part = as_parts(_textured(), color='green')[0]
    assert part.actor.texture is None


def test_scenes_join_what_looks_alike():
    scene = trimesh.Scene({'box': _textured()})
    scene.graph.update('b', matrix=np.diag([2.0, 2, 2, 1]), geometry='box')
    scene.add_geometry(trimesh.creation.icosphere(), geom_name='ball')
    parts = as_parts(scene)
    assert [part.mesh.n_cells for part in parts] == [4, 1280]
    meshes, index, matrices = scene_instances(scene)
    assert len(meshes) == 2
    assert index.tolist() == [0, 0, 1]
    assert sorted(matrices[:, 0, 0]) == [1, 1, 2]


def test_several_meshes():
    part = as_parts(pv.Cube())
    assert [len(parts) for parts in as_meshes([pv.Cube(), part, trimesh.creation.box()])] == [
        1
    ] * 3
    assert as_meshes(part) == [part]
    assert isinstance(as_meshes(part[0])[0][0], Part)


def test_cut_outs_are_opaque():
    image = np.dstack([IMAGE, IMAGE[..., 0]])
    plane = pv.Plane()
    cut = as_parts(plane, texture=pv.Texture(image), alpha_cutoff=0.5, lighting=False)[0]
    assert not cut.actor.HasTranslucentPolygonalGeometry()
    colors, counts = np.unique(_drawn([cut]).reshape(-1, 3), axis=0, return_counts=True)
    assert colors.tolist() == [[255, 0, 90], [255, 255, 255]]
    whole = as_parts(plane, color='k', lighting=False)[0]
    assert np.isclose(counts[0], (_drawn([whole]) == 0).all(axis=2).sum() / 2, rtol=0.1)


def test_mapper_for_attributes_draws_the_same():
    part = as_parts(_ball(), scalars='height', cmap='hot')[0]
    expected = _drawn([part])
    mapper = part.polydata_mapper()
    part.actor.SetMapper(mapper)
    np.testing.assert_array_equal(_drawn([part]), expected)


def _with_nan():
    mesh = pv.Sphere()
    mesh.points[7] = np.nan
    return mesh


@pytest.mark.parametrize(
    ('mesh', 'kwargs', 'error', 'match'),
    [
        (pv.PolyData(), {}, ValueError, 'must have points'),
        (pv.MultiBlock([None]), {}, ValueError, 'no block'),
        (_with_nan(), {}, ValueError, r'points\[7\]'),
        (42, {}, TypeError, 'got int'),
        (None, {}, TypeError, 'got NoneType'),
        ('no/such/file.obj', {}, FileNotFoundError, 'no/such/file.obj'),
        (__file__, {}, ValueError, 'test_parts.py'),
        (pv.Actor(), {}, ValueError, 'no input'),
        (
            pv.Actor(pv.DataSetMapper(pv.Cube())),
            {'color': 'r'},
            ValueError,
            'color must be left out for an actor',
        ),
        (trimesh.Scene(), {}, ValueError, 'no triangle'),
        (pv.Cube(), {'colour': 'r'}, TypeError, 'colour'),
        (pv.Cube(), {'cmap': 'nope', 'scalars': np.arange(6)}, ValueError, 'nope'),
        (pv.Cube(), {'scalars': np.arange(7)}, ValueError, '7'),
        (pv.Cube(), {'alpha_cutoff': 2}, ValueError, 'alpha_cutoff'),
        (pv.Cube(), {'silhouette': True}, ValueError, 'silhouette'),
        (pv.Cube(), {'style': 'points_gaussian'}, ValueError, 'add_billboards'),
    ],
)
def test_bad_meshes_are_named(mesh, kwargs, error, match):
    refused(match, as_parts, mesh, kind=error, **kwargs)


def test_bad_lists():
    refused('at least one', as_meshes, [])
    refused(r'meshes\[1\]: mesh must have points', as_meshes, [pv.Cube(), pv.PolyData()])


@pytest.mark.parametrize(
    ('file', 'parts'),
    [
        ('meshes/koala.obj', 1),
        ('meshes/city/building_A.gltf', 1),
        ('meshes/kenney/city/building-garage.glb', 1),
        ('gltf/Knight.glb', 1),
        ('gltf/VertexColorTest.glb', 2),
    ],
)
def test_real_files(data_dir, file, parts):
    found = as_parts(data_dir / file)
    assert len(found) == parts
    assert all(np.isfinite(part.mesh.points).all() for part in found)
    assert (found[0].actor.texture is None) == file.endswith('.obj')


def test_copies_of_a_property_share_its_textures():
    picture = pv.Texture(np.zeros((2, 2, 3), np.uint8))
    picture.SetUseSRGBColorSpace(True)
    (part,) = as_parts(pv.Plane(), pbr=True, pbr_textures={'albedoTex': picture})
    before = picture.GetReferenceCount()
    copies = [pv.Property() for _ in range(9)]
    for copy in copies:
        copy_property(copy, part.actor.prop)
    assert picture.GetReferenceCount() == before + 9
    del copies, copy
    assert picture.GetReferenceCount() == before


@pytest.mark.parametrize('is_binary', [True, False])
def test_cut_files_of_quads_are_refused_before_vtk_reads_them(tmp_path, is_binary):
    path = tmp_path / 'quads.ply'
    pv.Plane(i_resolution=12, j_resolution=9).save(path, binary=is_binary)
    content = path.read_bytes()
    assert as_parts(path)[0].mesh.n_cells == 216
    for share in (0.9, 0.5, 0.3):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(ValueError, match=r'quads.ply: .*it is cut|quads.ply: .*is wrong'):
            as_parts(path)
