"""glTF files as meshes: points, poses and colours against trimesh, whose reader is another one."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial import cKDTree

from pvibr.core.errors import PvibrWarning
from pvibr.io.gltf_file import GltfError
from pvibr.maths.tones import to_display
from pvibr.maths.transforms import transform_points, trs
from pvibr.meshes.mesh_files import scene_instances
from pvibr.meshes.parts import as_parts
from tests.pictures import grab, plotter
from tests.refusals import refused

MIRROR = np.diag([-1.0, 1, 1, 1])


def placed(path):
    """Return the corners of all triangles in world space, and the colour of each."""
    meshes, index, matrices = scene_instances(path)
    corners, colors = [], []
    for which, matrix in zip(index, matrices, strict=True):
        for dataset, look in meshes[which].surfaces:
            faces = dataset.regular_faces
            corners.append(transform_points(matrix, dataset.points[faces].reshape(-1, 3)))
            base = np.multiply(look.get('color', (1, 1, 1)), 255)
            rgb = dataset.point_data[look['scalars']][..., :3] if 'scalars' in look else base
            colors.append(np.broadcast_to(rgb, (dataset.n_points, 3))[faces].reshape(-1, 3))
    return np.vstack(corners), np.vstack(colors)


def expected(path):
    """Return the same of trimesh, whose colours are linear."""
    scene = trimesh.load_scene(path, process=False)
    corners, colors = [], []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph.get(node)
        mesh = scene.geometry[name]
        corners.append(transform_points(matrix, mesh.vertices[mesh.faces].reshape(-1, 3)))
        visual, light = mesh.visual, np.ones((len(mesh.vertices), 3))
        if visual.kind == 'vertex':
            light = visual.vertex_colors[:, :3] / 255
        elif visual.material.baseColorFactor is not None:
            light = light * np.asarray(visual.material.baseColorFactor)[:3] / 255
        if visual.kind == 'texture' and 'color' in visual.vertex_attributes:
            painted = visual.vertex_attributes['color'][:, :3]
            full = np.iinfo(painted.dtype).max if painted.dtype.kind == 'u' else 1
            light = light * painted / full
        colors.append(255 * to_display(light)[mesh.faces].reshape(-1, 3))
    return np.vstack(corners), np.vstack(colors)


def assert_same(path):
    """Check that each triangle is one of trimesh's, and the other way round."""
    ours, theirs = placed(path), expected(path)
    size = np.abs(theirs[0]).max()
    # Colours differ by up to 8 of 255: trimesh rounds linear ones to bytes, coarse in the dark.
    far = 2e-6 * size, 8
    rows = [
        np.hstack(
            [values.reshape(-1, 9) / least for values, least in zip(found, far, strict=True)]
        )
        for found in (ours, theirs)
    ]
    assert len(rows[0]) == len(rows[1])
    for a, b in (rows, rows[::-1]):
        assert cKDTree(a).query(b, p=np.inf)[0].max() <= 1


def scene_of_trimesh():
    """Return a scene with colours, materials, nested nodes and a mirrored one."""
    rng = np.random.default_rng(3)
    ball, box = trimesh.creation.icosphere(subdivisions=1), trimesh.creation.box()
    ball.visual.vertex_colors = rng.integers(0, 255, (len(ball.vertices), 4))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[200, 100, 50, 255])
    box.visual = trimesh.visual.TextureVisuals(material=material)
    scene = trimesh.Scene({'box': box})
    for k in range(6):
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
        turn[:3, 3] = rng.normal(size=3) * 10
        parent = 'world' if k < 2 else f'n{k - 2}'
        scene.graph.update(f'n{k}', parent, matrix=turn, geometry=('ball', 'box')[k % 2])
    scene.geometry['ball'] = ball
    scene.graph.update('m', 'n1', matrix=MIRROR, geometry='box')
    return scene


def test_scenes_that_trimesh_writes(tmp_path):
    path = tmp_path / 'scene.glb'
    path.write_bytes(scene_of_trimesh().export(file_type='glb'))
    assert_same(path)


@pytest.mark.parametrize('kind', ['vertex', 'face'])
def test_colours_that_trimesh_writes(tmp_path, kind):
    ball = trimesh.creation.icosphere(subdivisions=2)
    n = len(ball.vertices if kind == 'vertex' else ball.faces)
    colors = np.random.default_rng(0).integers(0, 255, (n, 4))
    colors[:, 3] = 255
    ball.visual = trimesh.visual.ColorVisuals(ball, **{f'{kind}_colors': colors})
    (tmp_path / 'ball.glb').write_bytes(ball.export(file_type='glb'))
    assert_same(tmp_path / 'ball.glb')


#: Skins and morph weights, which trimesh ignores, move the others.
RIGID = ['AnimatedMorphCube', 'BoxAnimated', 'InterpolationTest', 'VertexColorTest', 'Knight']


@pytest.mark.parametrize('name', RIGID)
def test_real_files_are_those_of_trimesh(data_dir, name):
    assert_same(data_dir / f'gltf/{name}.glb')


def test_buildings_are_those_of_trimesh(data_dir):
    for path in (data_dir / 'meshes').rglob('city/*.gl*'):
        assert_same(path)


def test_nodes_share_a_mesh(glb):
    mesh = glb.shown(glb.primitive(), glb.primitive())
    glb.add('nodes', mesh=0, translation=[5, 0, 0], scale=[2, 2, 2])
    glb.add('nodes', children=[mesh, 1], rotation=[0, 0, 1, 0])
    meshes, index, matrices = scene_instances(glb.write())
    assert [len(mesh.surfaces) for mesh in meshes] == [2]
    assert index.tolist() == [0, 0]
    np.testing.assert_allclose(
        matrices, trs([[0] * 3, [-5, 0, 0]], [0, 0, 0, 1], [1, 2]), atol=1e-9
    )
    (part,) = as_parts(glb.write())
    assert part.mesh.n_cells == 8


def instanced(glb, **attributes):
    accessors = {name: glb.array(values) for name, values in attributes.items()}
    extension = {'EXT_mesh_gpu_instancing': {'attributes': accessors}}
    glb.json['extensionsRequired'] = glb.json['extensionsUsed'] = list(extension)
    child = glb.shown(glb.primitive(), extensions=extension)
    glb.add('nodes', children=[child], translation=[0, 0, 7])


def test_gpu_instancing(glb):
    rng = np.random.default_rng(1)
    moves, spins, sizes = rng.normal(size=(4, 3)), rng.normal(size=(4, 4)), rng.random((4, 3)) + 1
    spins /= np.linalg.norm(spins, axis=1, keepdims=True)
    instanced(glb, TRANSLATION=moves, ROTATION=spins, SCALE=sizes, _ID=np.arange(4))
    meshes, index, matrices = scene_instances(glb.write())
    assert len(meshes) == 1
    assert index.tolist() == [0] * 4
    shift = trs([[0, 0, 7]])[0]
    np.testing.assert_allclose(
        matrices, shift @ trs(moves, spins[:, [3, 0, 1, 2]], sizes), atol=1e-6
    )


def test_gpu_instancing_of_scales_only(glb):
    instanced(glb, SCALE=[[1, 1, 1], [0, 0, 0], [-1, 1, 1]])
    (mesh,), _, matrices = scene_instances(glb.write())
    # The one that is scaled to nothing is invisible; instances cull no back where one mirrors.
    assert matrices[:, 0, 0].tolist() == [1, -1]
    assert mesh.surfaces[0][1]['culling'] == 'back'
    pl = plotter()
    made = pl.ibr.add_instances(glb.write(), bake=False)
    assert made.prop.culling == 'none'


def test_instances_of_a_real_file(data_dir):
    meshes, index, matrices = scene_instances(data_dir / 'gltf/SimpleInstancing.glb')
    assert len(meshes) == 1
    assert not index.any()
    assert matrices.shape == (125, 4, 4)
    np.testing.assert_allclose(matrices[:, :3, 3].max(axis=0), 10)
    np.testing.assert_allclose(np.linalg.norm(matrices[:, :3, :3], axis=1).max(axis=0), 2)


@pytest.mark.parametrize(
    ('attributes', 'said'),
    [
        ({}, r'one count, got \[\]'),
        ({'TRANSLATION': np.zeros((2, 3)), 'SCALE': np.ones((3, 3))}, r'one count, got \[2, 3\]'),
        ({'TRANSLATION': np.zeros((2, 4))}, r'EXT_mesh_gpu_instancing.TRANSLATION .*VEC3'),
        ({'ROTATION': np.zeros((2, 4))}, r'nodes\[0\].*zero'),
        ({'SCALE': np.full((2, 3), np.nan)}, 'finite'),
    ],
)
def test_instances_that_are_broken(glb, attributes, said):
    instanced(glb, **attributes)
    refused(said, scene_instances, glb.write(), kind=GltfError)


def test_a_skin_moves_a_mesh_and_not_its_node(glb):
    bind = {
        'JOINTS_0': glb.array(np.zeros((4, 4)), 'B'),
        'WEIGHTS_0': glb.array(np.tile([1, 0, 0, 0], (4, 1))),
    }
    glb.shown(glb.primitive(attributes=bind), skin=0, translation=[100, 0, 0])
    glb.add('nodes', translation=[0, 3, 0])
    glb.add('skins', joints=[1])
    (part,) = as_parts(glb.write())
    assert part.mesh.bounds[:4] == (0, 1, 3, 4)
    glb.json['nodes'][0]['extensions'] = {'EXT_mesh_gpu_instancing': {'attributes': {}}}
    with pytest.warns(PvibrWarning, match='instances of a skinned mesh'):
        scene_instances(glb.write())


def test_morph_weights_are_those_of_nodes(glb):
    targets = [{'POSITION': glb.array(np.tile([0, 0, 2], (4, 1)))}]
    glb.shown(glb.primitive(targets=targets), translation=[1, 0, 0])
    glb.add('nodes', mesh=0, weights=[0.5], scale=[3, 3, 3])
    meshes, index, _ = scene_instances(glb.write())
    assert index.tolist() == [0, 1]
    assert [mesh.surfaces[0][0].bounds.z_max for mesh in meshes] == [0, 1]
    corners, _ = placed(glb.write())
    assert corners[6:, 2].tolist() == [3] * 6


def test_what_is_missing_or_empty(glb, tmp_path):
    refused('none', as_parts, tmp_path / 'none.glb', kind=FileNotFoundError)
    glb.add('nodes')
    refused('no triangle mesh', as_parts, glb.write())
    (tmp_path / 'text.glb').write_text('x')
    refused('neither GLB nor JSON', as_parts, tmp_path / 'text.glb')


def test_a_file_does_not_lead_out_of_its_folder(glb):
    glb.shown(glb.primitive())
    (glb.folder / 'inner').mkdir()
    (glb.folder / 'secret.bin').write_bytes(glb.blob)
    path = glb.folder / 'inner/a.gltf'
    buffers = [{'byteLength': len(glb.blob), 'uri': '../secret.bin'}]
    path.write_text(json.dumps(glb.json | {'buffers': buffers}))
    for read in (as_parts, scene_instances):
        refused('outside the folder', read, path)


def square(glb, material, **attributes):
    glb.add('materials', **material)
    glb.shown(glb.primitive(attributes=attributes, material=0))
    return glb.write()


def test_normals_of_a_file_stay(glb):
    tilted = np.tile([0.6, 0, 0.8], (4, 1))
    path = square(glb, {}, NORMAL=glb.array(tilted))
    for look in ({}, {'smooth_shading': True}, {'pbr': True}):
        (part,) = as_parts(path, **look)
        np.testing.assert_allclose(part.mesh.active_normals, tilted, atol=1e-6)
        assert part.actor.prop.interpolation.value == (3 if 'pbr' in look else 2)
    assert as_parts(path, smooth_shading=False)[0].actor.prop.interpolation.value == 0


def test_colours_of_factors_are_linear(glb):
    factor = {'pbrMetallicRoughness': {'baseColorFactor': [0.214, 0, 1, 0.5]}}
    (part,) = as_parts(square(glb, factor | {'alphaMode': 'BLEND'}))
    assert part.actor.prop.color.float_rgb == pytest.approx((0.5, 0, 1), abs=3e-3)
    assert part.actor.prop.opacity == 0.5
    (part,) = as_parts(square(glb, factor), pbr=True)
    assert part.actor.prop.color.float_rgb == pytest.approx((0.214, 0, 1), abs=3e-3)


def test_arguments_override_the_material(glb):
    colors = glb.array(np.zeros((4, 3)))
    path = square(glb, {'alphaMode': 'MASK'}, COLOR_0=colors)
    (part,) = as_parts(path, color='red')
    assert not part.actor.mapper.scalar_visibility
    assert part.actor.prop.color == 'red'
    assert part.alpha_cutoff is None
    assert as_parts(path)[0].alpha_cutoff == 0.5
    assert as_parts(path)[0].mesh.active_scalars.tolist() == [[0, 0, 0]] * 4


def test_backs_are_culled_unless_two_sided(glb):
    path = square(glb, {})
    assert as_parts(path)[0].actor.prop.culling == 'back'
    assert as_parts(path, culling='none')[0].actor.prop.culling == 'none'
    glb.json['materials'][0]['doubleSided'] = True
    assert as_parts(glb.write())[0].actor.prop.culling == 'none'


@pytest.mark.parametrize('mode', ['OPAQUE', 'MASK', 'BLEND'])
def test_textures_are_those_of_trimesh(tmp_path, mode):
    rng = np.random.default_rng(5)
    pixels = rng.integers(0, 256, (16, 16, 4), dtype=np.uint8)
    if mode == 'MASK':
        pixels[..., 3] = 255 * (pixels[..., 3] > 127)
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(pixels), alphaMode=mode, doubleSided=True
    )
    box = trimesh.creation.box()
    uv = box.vertices[:, :2] * 1.3 + 0.3
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    (tmp_path / 'box.glb').write_bytes(box.export(file_type='glb'))
    pictures = []
    for mesh in (box, tmp_path / 'box.glb'):
        pl = plotter((80, 60))
        for part in as_parts(mesh, lighting=False):
            part.actor.texture.mipmap = True  # a file without a sampler leaves it to the reader
            pl.add_actor(part.actor)
        pl.view_isometric()
        pictures.append(grab(pl))
    assert pictures[0].std() > 0.1
    assert np.abs(pictures[0] - pictures[1]).mean() < 1e-3


def test_specular_glossiness_has_a_base_colour(glb):
    older = {'diffuseFactor': [0.214, 0, 1, 1], 'glossinessFactor': 0.25}
    path = square(glb, {'extensions': {'KHR_materials_pbrSpecularGlossiness': older}})
    assert as_parts(path)[0].actor.prop.color.float_rgb == pytest.approx((0.5, 0, 1), abs=3e-3)
    with pytest.warns(PvibrWarning, match='specular colours'):
        (part,) = as_parts(path, pbr=True)
    assert (part.actor.prop.metallic, part.actor.prop.roughness) == (0, 0.75)
