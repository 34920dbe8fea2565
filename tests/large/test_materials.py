"""Several materials and blocks as one large mesh: as the parts that `add_mesh` draws."""

import io

import numpy as np
import pytest
import pyvista as pv
import trimesh
from PIL import Image

from pvibr.large import material_atlas
from pvibr.large.build import build_hierarchy
from pvibr.large.build_file import write_large
from pvibr.large.cut import cell_pixels, gathered, gathered_coordinates, patches_within
from pvibr.large.given_mesh import given_mesh
from pvibr.large.sources import source_of
from pvibr.meshes.parts import as_parts
from tests.large.looks import NEAR, OVER, SIZE, drawn
from tests.large.surfaces import terrain, views_of
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

Texture = trimesh.visual.texture.TextureVisuals
Material = trimesh.visual.material.PBRMaterial


def picture(seed, side):
    """Return squares of many colours, in a frame of two others."""
    squares = np.random.default_rng(seed).integers(30, 255, (side // 16, side // 16, 3))
    pixels = np.kron(squares, np.ones((16, 16, 1))).astype(np.uint8)
    pixels[:5], pixels[:, :5] = (255, 0, 0), (0, 0, 255)
    return Image.fromarray(pixels)


def pieces(count=120):
    """Yield the points, faces and normals of four pieces of a terrain, which share points."""
    mesh = terrain(count).compute_normals(cell_normals=False, consistent_normals=False)
    centers = np.asarray(mesh.cell_centers().points)
    kinds = ((3 * centers[:, 0]).astype(int) + (2.2 * centers[:, 1]).astype(int)) % 4
    for kind in range(4):
        own, places = np.unique(mesh.regular_faces[kinds == kind], return_inverse=True)
        normals = np.asarray(mesh.point_data['Normals'])[own]
        yield np.asarray(mesh.points)[own], places.reshape(-1, 3), normals


def scene(materials, count=120, factor=1.0):
    """Return pieces of a terrain with materials."""
    made = trimesh.Scene()
    for k, (points, faces, normals) in enumerate(pieces(count)):
        mesh = trimesh.Trimesh(points, faces, vertex_normals=normals, process=False)
        if k < len(materials):
            mesh.visual = Texture(uv=factor * points[:, :2], material=materials[k])
        made.add_geometry(mesh, geom_name=str(k))
    return made


def materials(**kwargs):
    """Return two materials with images of different sizes, and two without."""
    return [
        Material(baseColorTexture=picture(0, 64), roughnessFactor=0.4, **kwargs),
        Material(baseColorTexture=picture(1, 128), baseColorFactor=[200, 255, 255, 255]),
        Material(baseColorFactor=[250, 180, 30, 255], metallicFactor=0.7, roughnessFactor=0.3),
        Material(baseColorFactor=[40, 90, 200, 255], metallicFactor=0.0),
    ]


def plain(mesh, view=OVER, **look):
    """Return a picture of the parts of a mesh."""
    pl = plotter(SIZE)
    pl.set_background('magenta')
    for part in as_parts(mesh, **look):
        pl.add_actor(part.actor)
    place(pl, **view)
    pl.show(auto_close=False)
    return shot(pl)


@pytest.mark.parametrize('pbr', [False, True], ids=['plain', 'physical'])
@pytest.mark.parametrize('view', [OVER, NEAR], ids=['over', 'near'])
def test_every_part_has_its_look(view, pbr, tmp_path):
    mesh = scene(materials())
    if pbr:
        path = tmp_path / 'a.glb'
        path.write_bytes(mesh.export(file_type='glb', include_normals=True))
        mesh = path
    look = {'view': view, 'pbr': pbr or None, 'smooth_shading': True}
    truth = plain(mesh, **look)
    pl, thing = drawn(mesh, max_error=0, **look)
    # Images are as before in all but the texels at the edges of triangles.
    assert (off(shot(pl), truth) > 8).mean() < 0.01
    assert thing.n_triangles == 2 * 119**2
    coarse, thing = drawn(mesh, max_error=1, **look)
    if view is OVER:
        assert thing.report()['triangles'] < 0.7 * thing.n_triangles
    assert np.abs(shot(coarse) - truth).mean() < 6


@pytest.mark.parametrize('stored', [0, 1 << 20], ids=['seams', 'copies'])
def test_images_repeat(stored, monkeypatch):
    monkeypatch.setattr(material_atlas, '_REPEATED', stored)
    mesh = scene(materials(), factor=6.3)
    truth = plain(mesh, smooth_shading=True)
    pl, thing = drawn(mesh, max_error=0, smooth_shading=True)
    assert (off(shot(pl), truth) > 8).mean() < 0.02
    assert thing.n_triangles == 2 * 119**2


def test_too_large_images_are_reduced(monkeypatch):
    monkeypatch.setattr(material_atlas, '_TEXELS', 5000)  # without margins
    _, look = given_mesh(scene(materials()), {})
    width, height, _ = look['texture'].GetInput().GetDimensions()
    assert 2000 < width * height < 15_000


@pytest.mark.parametrize('max_error', [0.5, 4.0])
def test_no_triangle_crosses_materials(max_error):
    source = source_of(scene(materials()))
    hierarchy = build_hierarchy(source.mesh)
    colors = source.image[::-1]
    tall, wide = colors.shape[:2]
    for view in views_of(hierarchy, 5):
        patches = patches_within(hierarchy, cell_pixels(hierarchy, view), max_error)
        _, triangles = gathered(hierarchy, patches)
        own = gathered_coordinates(hierarchy, patches)[triangles]
        texels = (own * (wide, tall)).astype(int)
        # A triangle of one colour is of it at all three corners.
        seen = colors[texels[..., 1], texels[..., 0]].astype(int)
        for color in ((250, 180, 30), (40, 90, 200)):
            is_own = (np.abs(seen - color) <= 1).all(2)
            assert (is_own.all(1) == is_own.any(1)).all()
            assert is_own.any()


def test_one_colour_has_no_seams():
    own = [Material(baseColorFactor=[250, 180, 30, 255])] * 4
    mesh, look = given_mesh(scene(own), {})
    assert mesh.active_texture_coordinates is None
    assert pv.Color(look['color']).int_rgb == (250, 180, 30)


def test_colours_of_points_beside_images():
    mesh = scene(materials()[:3])
    painted = mesh.geometry['3']
    painted.visual.vertex_colors = np.tile([[0, 160, 80, 255]], (len(painted.vertices), 1))
    truth = plain(mesh, smooth_shading=True)
    pl, thing = drawn(mesh, max_error=0, smooth_shading=True)
    # Vertices at its border have the mean of both.
    assert (off(shot(pl), truth) > 8).mean() < 0.06
    thing.set_scalars(np.arange(len(thing._source.points or thing._source.mesh.points)))
    assert off(shot(pl), truth).mean() > 20


def test_what_users_give_replaces_materials():
    for look in ({'color': 'tan'}, {'scalars': np.arange(2 * 119**2)}):
        mesh, own = given_mesh(scene(materials()), look | {'opacity': 0.5})
        assert 'texture' not in own
        assert own['opacity'] == 0.5
        assert mesh.n_cells == 2 * 119**2


def test_opacities_multiply_and_cut_outs_have_one_limit():
    glass = Material(baseColorFactor=[250, 180, 30, 128], alphaMode='BLEND')
    for mesh in (scene([glass, *materials()[1:]]), next(iter(scene([glass]).geometry.values()))):
        _, look = given_mesh(mesh, {'opacity': 0.5})
        alpha = 255 if 'texture' not in look else look['texture'].to_array()[..., 3].min()
        assert look['opacity'] * alpha / 255 == pytest.approx(0.25, abs=0.01)
    holes = np.dstack([np.asarray(picture(0, 64)), np.full((64, 64), 255, np.uint8)])
    holes[20:40, 20:40, 3] = 60
    leaf = Material(baseColorTexture=Image.fromarray(holes), alphaMode='MASK', alphaCutoff=0.3)
    mesh = scene([leaf, *materials()[1:]])
    pl, _ = drawn(mesh, max_error=0)
    assert (off(shot(pl), plain(mesh)) > 8).mean() < 0.02


def test_emission_has_an_image():
    lamp = Material(baseColorFactor=[0, 0, 0, 255], emissiveFactor=[0.9, 0.1, 0.0])
    buffer = io.BytesIO(scene([lamp, *materials()[1:]]).export(file_type='glb'))
    mesh = trimesh.load_scene(buffer, file_type='glb')
    assert 'texture' in given_mesh(mesh, {})[1]


def blocks(count=80):
    """Return pieces of a terrain as blocks, one of them within another."""
    own = []
    for k, (points, faces, _) in enumerate(pieces(count)):
        own.append(pv.PolyData.from_regular_faces(points, faces))
        own[-1]['z'] = points[:, 2].astype([np.float32, np.float64][k % 2])
    return pv.MultiBlock([own[0], None, pv.MultiBlock(own[1:3]), own[3]])


@pytest.mark.parametrize(
    'look', [{'color': 'tan'}, {'scalars': 'z'}, {'scalars': 'z', 'clim': (0, 0.05)}]
)
def test_blocks_look_as_those_of_add_mesh(look):
    pl, thing = drawn(blocks(), max_error=0, **look)
    other, _ = drawn(blocks(), large=False, **look)
    assert (off(shot(pl), shot(other)) > 3).mean() < 0.01
    assert thing.n_triangles == 2 * 79**2


def test_blocks_of_other_kinds_and_arrays():
    grid = pv.ImageData(dimensions=(5, 5, 3)).cast_to_unstructured_grid()
    grid['a'], grid['b'] = np.arange(grid.n_points), np.arange(grid.n_points)
    ball = pv.Sphere(center=(9, 0, 0))
    ball['a'] = np.linspace(0, 1, ball.n_points)
    mesh, _ = given_mesh(pv.MultiBlock([grid, ball]), {})
    assert mesh.n_cells == grid.n_cells + ball.n_cells
    values = np.asarray(mesh['b'])
    assert np.isnan(values[grid.n_points :]).all()
    np.testing.assert_array_equal(values[: grid.n_points], grid['b'])
    np.testing.assert_allclose(mesh['a'][grid.n_points :], ball['a'])
    source = source_of(pv.MultiBlock([grid, ball]))
    assert source.mesh.mesh_cells.max() == mesh.n_cells - 1
    refused('no block', given_mesh, pv.MultiBlock([None, pv.PolyData()]), {})


def test_picks_count_the_cells_of_all_blocks():
    pl, thing = drawn(blocks(), max_error=0)
    hit = thing.pick(SIZE[0] // 2, SIZE[1] // 2)
    mesh, _ = given_mesh(blocks(), {})
    corners = np.asarray(mesh.get_cell(hit.index).points)
    assert np.linalg.norm(corners.mean(0) - hit.point) < 0.03
    assert pl.ibr.pick(SIZE[0] // 2, SIZE[1] // 2).index == hit.index


def test_wavefront_files_have_their_materials(tmp_path):
    path = tmp_path / 'a.obj'
    scene(materials()).export(path)
    truth = plain(path)
    pl, thing = drawn(path, max_error=0)
    assert (off(shot(pl), truth) > 8).mean() < 0.02
    assert len(np.unique(shot(pl).reshape(-1, 3), axis=0)) > 500
    assert thing.n_triangles == 2 * 119**2
    (tmp_path / 'material.mtl').unlink()
    assert isinstance(given_mesh(path, {})[0], pv.PolyData)


def test_built_files_keep_the_images(tmp_path):
    path = tmp_path / 'a.glb'
    path.write_bytes(scene(materials()).export(file_type='glb', include_normals=True))
    built = write_large(path, tmp_path / 'a.pvl', progress=False)
    look = {'max_error': 1, 'smooth_shading': True}
    (stored, _), (direct, _) = drawn(built, **look), drawn(path, **look)
    assert (off(shot(stored), shot(direct)) > 8).mean() < 0.01
    pl, _ = drawn(built, color='tan')
    assert off(shot(pl), shot(direct)).mean() > 20
