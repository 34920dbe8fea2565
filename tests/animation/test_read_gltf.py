"""Figures from glTF files: every feature, in files written by hand."""

import base64
import dataclasses
import io
import math
import warnings

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose
from PIL import Image

import pvibr
from pvibr.io.gltf_accessors import Accessors
from pvibr.io.gltf_file import GltfFile
from pvibr.maths.tones import to_display
from tests.animation.conftest import refused
from tests.makers import png

HALF = math.sqrt(0.5)
#: Points of the square that primitives show where a test says nothing else.
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def figure(glb, **options):
    return pvibr.read_gltf(glb.write(), **options)


def uri(data, kind='application/octet-stream'):
    return f'data:{kind};base64,{base64.b64encode(data).decode()}'


def accessors(glb):
    return Accessors(GltfFile(glb.write()))


@pytest.mark.parametrize('kind', 'bBhHIf')
@pytest.mark.parametrize('normalized', [False, True])
def test_every_component_type(glb, kind, normalized):
    values = np.array([[0, 1, 2], [100, 127, 3]])
    values = -values if kind in 'bhf' else values
    index = glb.array(values, kind, normalized=normalized)
    largest = np.iinfo(kind).max if normalized and kind != 'f' else 1
    read = accessors(glb).floats(index, 'here', 'VEC3')
    assert_allclose(read, values / largest, rtol=1e-7)


def test_the_least_normalized_integer_is_minus_one(glb):
    index = glb.array([-128, -127, 127], 'b', normalized=True)
    assert accessors(glb).floats(index, 'here', 'SCALAR')[:, 0].tolist() == [-1, -1, 1]


def test_interleaved_attributes(glb):
    rows = np.arange(24, dtype='<f4').reshape(4, 6)
    view = glb.view(rows.tobytes(), byteStride=24)
    shared = {'bufferView': view, 'componentType': 5126, 'count': 4, 'type': 'VEC3'}
    glb.add('accessors', **shared)
    glb.add('accessors', **shared, byteOffset=12)
    read = accessors(glb)
    assert (read.floats(0, 'here', 'VEC3') == rows[:, :3]).all()
    assert (read.floats(1, 'here', 'VEC3') == rows[:, 3:]).all()


@pytest.mark.parametrize(('kind', 'name', 'columns'), [('B', 'MAT2', 2), ('B', 'MAT3', 3)])
def test_columns_of_small_matrices_begin_at_four_bytes(glb, kind, name, columns):
    stored = np.zeros((2, columns, 4), np.uint8)
    stored[..., :columns] = np.arange(2 * columns**2).reshape(2, columns, columns)
    view = glb.view(stored.tobytes())
    glb.add('accessors', bufferView=view, componentType=5121, count=2, type=name)
    read = accessors(glb).floats(0, 'here', name)
    assert read.ravel().tolist() == list(range(2 * columns**2))


@pytest.mark.parametrize('based', [True, False])
def test_sparse_accessors(glb, based):
    base = np.arange(12.0).reshape(4, 3) if based else np.zeros((4, 3))
    changed = np.array([[7, 8, 9], [-1, -2, -3]], dtype='<f4')
    sparse = {
        'count': 2,
        'indices': {
            'bufferView': glb.view(np.array([1, 3], '<u2').tobytes()),
            'componentType': 5123,
        },
        'values': {'bufferView': glb.view(changed.tobytes())},
    }
    glb.array(base, sparse=sparse)
    if not based:
        del glb.json['accessors'][0]['bufferView']
    base[[1, 3]] = changed
    assert_allclose(accessors(glb).floats(0, 'here', 'VEC3'), base)


@pytest.mark.parametrize('name', ['figure.glb', 'figure.gltf'])
def test_glb_and_json_are_the_same_figure(glb, name):
    glb.shown(glb.primitive())
    read = pvibr.read_gltf(glb.write(name))
    assert_allclose(read.mesh().points, SQUARE)
    assert read.name == 'figure'


def test_a_buffer_in_a_data_uri(glb):
    glb.shown(glb.primitive())
    glb.json['buffers'] = [{'uri': uri(glb.blob), 'byteLength': len(glb.blob)}]
    glb.blob = b''
    assert figure(glb).mesh().n_cells == 2


@pytest.mark.parametrize(
    ('mode', 'corners', 'count'),
    [(4, [0, 1, 2, 0, 2, 3], 2), (5, [0, 1, 3, 2], 2), (6, [0, 1, 2, 3], 2), (6, None, 2)],
)
def test_triangles_strips_and_fans_turn_the_same_way(glb, mode, corners, count):
    glb.shown(glb.primitive(corners=corners, mode=mode, attributes={'NORMAL': None}))
    mesh = figure(glb).mesh()
    assert mesh.n_cells == count
    assert mesh.area == pytest.approx(1)
    assert_allclose(mesh.compute_normals().cell_data['Normals'], [[0, 0, 1]] * count)


def test_a_mesh_without_normals_is_flat(glb):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    glb.shown(glb.primitive(points, [0, 1, 2, 0, 3, 1], attributes={'NORMAL': None}))
    mesh = figure(glb).mesh()
    assert mesh.n_points == 6
    assert_allclose(mesh.point_data['Normals'], [[0, 0, 1]] * 3 + [[0, 1, 0]] * 3, atol=1e-7)


def test_points_that_no_triangle_shows_are_left_out(glb):
    glb.shown(glb.primitive([[9, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0]], [1, 2, 3]))
    assert figure(glb).mesh().bounds == (0, 1, 0, 1, 0, 0)


def test_quantized_positions(glb):
    points = glb.array(SQUARE * 32767, 'h', normalized=True)
    glb.shown(glb.primitive(attributes={'POSITION': points}), scale=[2, 2, 2])
    glb.json['extensionsUsed'] = glb.json['extensionsRequired'] = ['KHR_mesh_quantization']
    assert_allclose(figure(glb).mesh().points, 2 * SQUARE, atol=1e-6)


def test_primitives_are_bodies_and_nodes_share_meshes(glb):
    glb.shown(glb.primitive(), glb.primitive(), name='pair')
    glb.add('nodes', mesh=0, translation=[0, 0, 5])
    bodies = figure(glb).meshes
    assert [body.node for body in bodies] == [0, 0, 1, 1]
    assert bodies[0].name == 'pair.0'
    assert bodies[0].mesh is bodies[2].mesh


def test_children_move_with_their_parents(glb):
    glb.shown(glb.primitive(), translation=[1, 0, 0], name='leaf')
    glb.add('nodes', children=[0], rotation=[0, 0, HALF, HALF], scale=[2, 2, 2], name='root')
    read = figure(glb)
    assert read.skeleton.names == ('leaf', 'root')
    assert read.skeleton.parents.tolist() == [1, -1]
    turned = [[0, 2, 0], [0, 4, 0], [-2, 4, 0], [-2, 2, 0]]
    assert_allclose(read.mesh().points, turned, atol=1e-6)


def test_matrices_that_mirror(glb):
    matrix = np.diag([-1.0, 2.0, 3.0, 1.0])
    matrix[:3, 3] = 4, 5, 6
    glb.shown(glb.primitive(), matrix=matrix.T.ravel().tolist())
    read = figure(glb)
    assert_allclose(read.skeleton.rest.matrices()[0], matrix, atol=1e-12)
    assert read.meshes[0].look['culling'] == 'back'
    a, b, c = read.mesh().points[read.mesh().regular_faces[0]]
    assert_allclose(np.cross(b - a, c - a), [0, 0, 2])


def test_up_z_stands_figures_upright(glb):
    glb.shown(glb.primitive([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0, 1, 2]))
    assert_allclose(figure(glb, up='z').mesh().points[2], [0, 0, 1], atol=1e-7)
    assert_allclose(figure(glb).mesh().points[2], [0, 1, 0])
    refused(r"up must .*got 'x'", figure, glb, up='x')


def test_scenes_by_number_and_name(glb):
    glb.shown(glb.primitive(), name='first')
    glb.shown(glb.primitive(), name='second')
    glb.json |= {'scene': 1, 'scenes': [{'nodes': [0], 'name': 'a'}, {'nodes': [1]}]}
    assert figure(glb).meshes[0].name == 'second'
    assert figure(glb, scene=0).meshes[0].name == 'first'
    assert figure(glb, scene='a').meshes[0].name == 'first'
    refused(r"scene must be an index or a name of .*, got 'b'", figure, glb, scene='b')


def test_cameras_and_lights(glb):
    lens = {'yfov': math.pi / 3, 'znear': 0.1, 'zfar': 10.0, 'aspectRatio': 2.0}
    glb.add('cameras', type='perspective', perspective=lens, name='eye')
    box = {'xmag': 4.0, 'ymag': 2.0, 'znear': 0.0, 'zfar': 5.0}
    glb.add('cameras', type='orthographic', orthographic=box)
    lamp = {'type': 'spot', 'color': [1, 0, 0], 'intensity': 8, 'spot': {'outerConeAngle': 0.5}}
    glb.json['extensions'] = {'KHR_lights_punctual': {'lights': [lamp, {'type': 'directional'}]}}
    glb.add('nodes', camera=0, translation=[1, 2, 3], scale=[2, 2, 2])
    for light, rotation in ((0, [0, 0, 0, 1]), (1, [-HALF, 0, 0, HALF])):
        extension = {'KHR_lights_punctual': {'light': light}}
        glb.add('nodes', camera=1, rotation=rotation, extensions=extension)
    read = figure(glb)
    world = read.world()
    eye, flat, _ = (camera.placed(world) for camera in read.cameras)
    assert eye.view_angle == pytest.approx(60)
    assert_allclose(eye.position, [1, 2, 3])
    assert_allclose(eye.direction, [0, 0, -1])
    assert flat.parallel_projection
    assert flat.parallel_scale == 2
    assert read.cameras[1].aspect == 2
    spot, sun = (light.placed(world, 0.5) for light in read.lights)
    assert spot.intensity == 4
    assert spot.cone_angle == pytest.approx(math.degrees(0.5))
    assert spot.diffuse_color.float_rgb == (1, 0, 0)
    # A quarter turn about x takes -z, where lights shine, to -y.
    assert_allclose(np.subtract(sun.focal_point, sun.position), [0, -1, 0], atol=1e-7)
    assert not sun.positional


def bent(glb):
    """Add a square whose upper points hang on a joint of their own, node 2."""
    joints = glb.array([[0, 0, 0, 0]] * 2 + [[1, 0, 0, 0]] * 2, 'B')
    weights = glb.array([[255, 0, 0, 0]] * 4, 'B', normalized=True)
    primitive = glb.primitive(attributes={'JOINTS_0': joints, 'WEIGHTS_0': weights})
    # The node of a skinned mesh must not matter.
    glb.shown(primitive, skin=0, translation=[50, 60, 70])
    root = glb.add('nodes', children=[2], translation=[0, 0, 1])
    joint = glb.add('nodes', translation=[0, 1, 0])
    inverse = np.array([np.eye(4)] * 2)
    inverse[1, 3, 1] = -1  # stored column by column
    glb.add('skins', joints=[root, joint], inverseBindMatrices=glb.array(inverse.reshape(2, 16)))


def test_a_skin_follows_its_joints(glb):
    bent(glb)
    glb.animate(2, 'rotation', [0, 2], [[0, 0, 0, 1], [0, 0, 1, 0]])
    read = figure(glb)
    assert_allclose(read.mesh(0).points, SQUARE + np.array([0, 0, 1]), atol=1e-6)
    turned = [[0, 0, 1], [1, 0, 1], [0, 2, 1], [0, 1, 1]]  # 90 degrees about (0, 1)
    assert_allclose(read.mesh(1.0).points, turned, atol=1e-6)


def test_eight_weights_a_vertex(glb):
    bent(glb)
    attributes = glb.json['meshes'][0]['primitives'][0]['attributes']
    attributes['JOINTS_1'] = glb.array([[1, 0, 0, 0]] * 4, 'H')
    attributes['WEIGHTS_1'] = glb.array([[1, 0, 0, 0]] * 4)
    glb.json['nodes'][2]['translation'] = [0, 3, 0]  # 2 above where it was bound
    read = figure(glb)
    assert read.meshes[0].skin.weights.shape == (4, 8)
    lifted = SQUARE + np.array([[0, 1, 1], [0, 1, 1], [0, 2, 1], [0, 2, 1]])
    assert_allclose(read.mesh().points, lifted, atol=1e-6)


def morphed(glb, **node):
    """Add two primitives with two targets each: up by one, and to the right by one."""
    targets = [
        {'POSITION': glb.array([[0, 0, 1]] * 4)},
        {'POSITION': glb.array([[1, 0, 0]] * 4), 'NORMAL': glb.array([[1, 0, 0]] * 4)},
    ]
    pair = [glb.primitive(targets=targets), glb.primitive(targets=targets)]
    mesh = {'weights': [0.25, 0], 'extras': {'targetNames': ['up', 'right']}}
    return glb.shown(*pair, mesh=mesh, **node)


@pytest.mark.parametrize(('node', 'up'), [({}, 0.25), ({'weights': [2.0, 0.0]}, 2.0)])
def test_morph_weights_of_meshes_and_nodes(glb, node, up):
    morphed(glb, **node)
    read = figure(glb)
    assert read.meshes[0].morphs.names == ('up', 'right')
    for block in read.mesh(merge=False):
        assert_allclose(block.points[:, 2], up)


@pytest.mark.parametrize(
    ('interpolation', 'values', 'half'),
    [
        ('STEP', [0, 0, 1, -1], [0, 0]),
        ('LINEAR', [0, 0, 1, -1], [0.5, -0.5]),
        # Tangents of zero: halfway of a smooth step.
        ('CUBICSPLINE', [0, 0, 0, 0, 0, 0, 0, 0, 1, -1, 0, 0], [0.5, -0.5]),
    ],
)
def test_animated_weights_drive_all_primitives(glb, interpolation, values, half):
    glb.animate(morphed(glb), 'weights', [1, 3], values, interpolation)
    read = figure(glb)
    for block in read.mesh(2.0, merge=False):
        assert_allclose(block.points, SQUARE + np.array([half[1], 0, half[0]]), atol=1e-7)


def test_targets_change_colors_and_tangents(glb):
    red, blue = glb.array([[1, 0, 0]] * 4), glb.array([[-1, 0, 0.2159]] * 4)
    along_x = {'TANGENT': glb.array([[1, 0, 0, 1]] * 4), 'COLOR_0': red}
    targets = [{'TANGENT': glb.array([[-1, 1, 0]] * 4), 'COLOR_0': blue}]
    glb.shown(glb.primitive(attributes=along_x, targets=targets), rotation=[0, 0, 1, 0])
    read = figure(glb)
    still, moved = (
        read.mesh(pose=read.rest.replaced(weights=[weight])).point_data for weight in (0, 1)
    )
    name = read.meshes[0].look['scalars']
    assert still[name][0].tolist() == [255, 0, 0]
    assert moved[name][0].tolist() == [0, 0, 128]
    assert_allclose(still['Tangents'][0], [-1, 0, 0], atol=1e-12)
    assert_allclose(moved['Tangents'][0], [0, -1, 0], atol=1e-12)


def test_targets_turn_flat_normals(glb):
    targets = [{'POSITION': glb.array([[0, 0, 0], [0, 0, 0], [0, -1, 1]])}]
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    primitive = glb.primitive(points, None, attributes={'NORMAL': None}, targets=targets)
    glb.shown(primitive, weights=[1.0])
    assert_allclose(figure(glb).mesh().point_data['Normals'], [[0, -1, 0]] * 3, atol=1e-7)


@pytest.mark.parametrize(
    ('interpolation', 'values', 'quarter'),
    [
        ('STEP', [[0, 0, 0], [4, 0, 0]], 0),
        ('LINEAR', [[0, 0, 0], [4, 0, 0]], 1),
        # From 0 with the slope 3 a second to 4 with 0: the Hermite polynomial at 1/4 of 2 s.
        ('CUBICSPLINE', [[0] * 3, [0] * 3, [3, 0, 0], [0] * 3, [4, 0, 0], [0] * 3], 1.46875),
    ],
)
def test_interpolations(glb, interpolation, values, quarter):
    glb.animate(glb.shown(glb.primitive()), 'translation', [0, 2], values, interpolation)
    assert figure(glb).mesh(0.5).points[0, 0] == pytest.approx(quarter)


def test_rotations_of_normalized_integers(glb):
    turns = (np.array([[0, 0, 0, 1], [0, 0, HALF, HALF]]) * 32767).round()
    node = glb.shown(glb.primitive())
    glb.animate(node, 'rotation', [0, 1], turns, kind='h', normalized=True)
    assert_allclose(figure(glb).mesh(0.5).points[1], [HALF, HALF, 0], atol=1e-4)


def test_clips_have_names_and_drive_what_they_name(glb):
    node = glb.shown(glb.primitive())
    glb.json['animations'] = []
    glb.animate(node, 'scale', [0, 1], [[1, 1, 1], [3, 3, 3]])
    glb.animate(node, 'translation', [0, 1], [[0, 0, 0], [0, 0, 8]])
    glb.json['animations'][1]['name'] = 'Lift'
    read = figure(glb)
    assert [clip.name for clip in read.clips] == ['animation0', 'Lift']
    assert read.mesh(0.5).bounds.x_max == pytest.approx(2)
    assert read.mesh(0.5, 'Lift').bounds.z_max == pytest.approx(4)


def look(glb, material=None, attributes=None, **options):
    if material is not None:
        glb.add('materials', **material)
    more = {} if material is None else {'material': 0}
    glb.shown(glb.primitive(attributes=attributes or {}, **more))
    return figure(glb, **options).meshes[0]


def test_colors_are_linear_light_in_the_file(glb):
    factor = {'pbrMetallicRoughness': {'baseColorFactor': [0.214, 0, 1, 0.5]}}
    body = look(glb, factor | {'alphaMode': 'BLEND', 'doubleSided': True})
    assert body.look['color'] == pytest.approx((0.5, 0, 1), abs=1e-3)
    assert body.look['opacity'] == 0.5
    assert 'culling' not in body.look


def test_opaque_ignores_alpha_and_backs_are_culled(glb):
    body = look(glb, {'pbrMetallicRoughness': {'baseColorFactor': [1, 1, 1, 0.5]}})
    assert 'opacity' not in body.look
    assert body.look['culling'] == 'back'


@pytest.mark.parametrize(
    ('alpha', 'cutoff', 'shown'),
    [
        (1, 0.3, {'alpha_cutoff': 0.3}),
        (0.8, 0.4, {'alpha_cutoff': 0.5}),
        (0.8, 0.9, {'opacity': 0.0}),
        (1, 1.1, {'opacity': 0.0}),
        (0, 0, {'alpha_cutoff': 0.0}),
    ],
)
def test_what_passes_a_mask_is_opaque(glb, alpha, cutoff, shown):
    surface = {'pbrMetallicRoughness': {'baseColorFactor': [1, 1, 1, alpha]}}
    found = look(glb, {'alphaMode': 'MASK', 'alphaCutoff': cutoff} | surface).look
    assert {k: found[k] for k in ('alpha_cutoff', 'opacity') if k in found} == shown


def test_physically_based_looks_when_asked_for(glb):
    metal = {'metallicFactor': 0.25, 'roughnessFactor': 0.75, 'baseColorFactor': [0.2] * 4}
    body = look(glb, {'pbrMetallicRoughness': metal}, pbr=True)
    assert {'pbr': True, 'metallic': 0.25, 'roughness': 0.75}.items() <= body.look.items()
    assert body.look['color'] == pytest.approx((0.2, 0.2, 0.2))


def test_unlit_and_what_only_shines(glb):
    assert look(glb, {'extensions': {'KHR_materials_unlit': {}}}).look['lighting'] is False


def test_emissive_strength(glb):
    black = {'pbrMetallicRoughness': {'baseColorFactor': [0, 0, 0, 1]}}
    strength = {'KHR_materials_emissive_strength': {'emissiveStrength': 2.0}}
    lamp = {'emissiveFactor': [0.25, 0, 0], 'extensions': strength}
    body = look(glb, black | lamp)
    assert body.look['lighting'] is False
    assert body.look['color'] == pytest.approx((float(to_display(0.5)), 0, 0))


def test_vertex_colors_times_the_material(glb):
    colors = glb.array([[255, 255, 255, 255]] * 3 + [[0, 255, 0, 255]], 'B', normalized=True)
    factor = {'pbrMetallicRoughness': {'baseColorFactor': [1, 0.2159, 0, 1]}}
    body = look(glb, factor, {'COLOR_0': colors})
    assert body.look['rgb']
    shown = body.mesh.point_data[body.look['scalars']]
    assert shown[[0, 3]].tolist() == [[255, 128, 0], [0, 128, 0]]


QUARTERS = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]]
CORNERS = [[0, 1], [1, 1], [1, 0], [0, 0]]  # glTF's v goes down: the square's top is v = 0


def textured(glb, kind, unlit=True, **info):
    data = png(QUARTERS)
    if kind == 'file':
        (glb.folder / 'four colors.png').write_bytes(data)
        glb.add('images', uri='four%20colors.png')
    elif kind == 'uri':
        glb.add('images', uri=uri(data, 'image/png'))
    else:
        glb.add('images', bufferView=glb.view(data), mimeType='image/png')
    glb.add('samplers', magFilter=9728, minFilter=9728)
    glb.add('textures', source=0, sampler=0)
    shows = {'pbrMetallicRoughness': {'baseColorTexture': {'index': 0} | info}}
    if unlit:
        shows['extensions'] = {'KHR_materials_unlit': {}}
    return look(glb, shows, {'TEXCOORD_0': glb.array(CORNERS)}, pbr=not unlit)


def quarters_of(plotter):
    """Return the colours in the middle of the four quarters of the square, as QUARTERS."""
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 0.5
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    return picture[[10, 10, 30, 30], [10, 30, 10, 30]].reshape(2, 2, 3).tolist()


def quarters_shown(body):
    plotter = pv.Plotter(off_screen=True, window_size=(40, 40), lighting='none')
    plotter.add_mesh(body.mesh, **body.look)
    return quarters_of(plotter)


@pytest.mark.parametrize('kind', ['file', 'uri', 'view'])
def test_textures_are_the_right_way_up(glb, kind):
    assert quarters_shown(textured(glb, kind)) == QUARTERS


def surfaces(glb, **material):
    """A square with a material of two pictures, 0 and 1, read as physically based."""
    for picture in (QUARTERS, [[[10, 20, 30]]]):
        glb.add('images', uri=uri(png(picture), 'image/png'))
        glb.add('textures', source=len(glb.json['images']) - 1, sampler=0)
    glb.add('samplers', magFilter=9728, minFilter=9728)
    square = {'TEXCOORD_0': glb.array(CORNERS), 'TEXCOORD_1': glb.array(CORNERS)}
    return look(glb, material, square, pbr=True)


def figure_of(body):
    return pvibr.Figure([dataclasses.replace(body, node=-1)])


def lit_quarters(figure, light=0.0):
    """As quarters_shown, of a figure, in the light of one lamp."""
    plotter = pv.Plotter(off_screen=True, window_size=(40, 40), lighting='none')
    plotter.add_light(pv.Light(position=(0, 0, 9), light_type='scene light', intensity=light))
    plotter.ibr.add_animated(figure)
    return quarters_of(plotter)


def test_what_shines_by_a_texture(glb):
    dark = {'baseColorFactor': [0, 0, 0, 1]}
    body = surfaces(
        glb, pbrMetallicRoughness=dark, emissiveTexture={'index': 0}, emissiveFactor=[1, 1, 1]
    )
    assert lit_quarters(figure_of(body)) == QUARTERS


def test_a_textured_surface_is_shaded_physically(glb):
    rough = {'baseColorTexture': {'index': 0}, 'metallicFactor': 0.0}
    body = surfaces(glb, pbrMetallicRoughness=rough)
    shown = np.array(lit_quarters(figure_of(body), 3.0)).reshape(4, 3)
    # The colours are darkened and shine somewhat.
    assert (shown.argmax(1)[:3] == [0, 1, 2]).all()
    assert (shown.max(1) > 100).all()


@pytest.mark.parametrize(
    ('names', 'pixel'),
    [
        (['metallicRoughnessTexture'], [255, 20, 30]),
        (['occlusionTexture'], [10, 255, 255]),
        (['metallicRoughnessTexture', 'occlusionTexture'], [10, 20, 30]),
    ],
)
def test_one_picture_of_occlusion_roughness_and_metal(glb, names, pixel):
    given = {name: {'index': 1} for name in names}
    occlusion = given.pop('occlusionTexture', None)
    more = {} if occlusion is None else {'occlusionTexture': occlusion}
    body = surfaces(glb, pbrMetallicRoughness=given, **more)
    assert body.look['pbr_textures']['materialTex'].to_array().tolist() == [[pixel]]


def test_textures_with_other_coordinates_are_left_out(glb):
    shows = {'baseColorTexture': {'index': 0}}
    with pytest.warns(pvibr.PvibrWarning, match='occlusion texture'):
        body = surfaces(
            glb, pbrMetallicRoughness=shows, occlusionTexture={'index': 1, 'texCoord': 1}
        )
    assert list(body.look['pbr_textures']) == ['albedoTex']


def test_a_texture_turned_by_a_quarter(glb):
    # A quarter turn takes (u, v) to (v, -u): what was the top left is shown at the top right.
    transform = {'KHR_texture_transform': {'rotation': math.pi / 2}}
    shown = quarters_shown(textured(glb, 'uri', extensions=transform))
    (a, b), (c, d) = QUARTERS
    assert shown == [[c, a], [d, b]]


def test_a_texture_scaled_and_shifted(glb):
    transform = {'KHR_texture_transform': {'scale': [0.5, 0.5], 'offset': [0.5, 0]}}
    shown = quarters_shown(textured(glb, 'uri', extensions=transform))
    assert shown == [[QUARTERS[0][1]] * 2] * 2


def test_a_grey_picture_of_16_bits(glb):
    file = io.BytesIO()
    Image.fromarray(np.array([[0x4000, 0x8000], [0xC000, 0xFFFF]], np.uint16)).save(file, 'PNG')
    glb.add('images', uri=uri(file.getvalue(), 'image/png'))
    glb.add('textures', source=0)
    shows = {'pbrMetallicRoughness': {'baseColorTexture': {'index': 0}}}
    texture = look(glb, shows, {'TEXCOORD_0': glb.array(CORNERS)}).look['texture']
    assert texture.to_array()[..., 0].tolist() == [[0x40, 0x80], [0xC0, 0xFF]]


def test_one_warning_names_all_that_is_left_out(glb):
    glb.add('materials', normalTexture={'index': 0}, emissiveFactor=[1, 1, 1])
    node = glb.shown(glb.primitive(material=0), {'attributes': {}}, {'attributes': {}})
    glb.animate(node, 'pointer', [0], [0])
    glb.json['extensionsUsed'] = ['KHR_materials_unlit', 'EXT_fur']
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        assert len(figure(glb).meshes) == 1
    assert len(caught) == 1
    assert caught[0].category is pvibr.PvibrWarning
    assert caught[0].filename == __file__
    message = str(caught[0].message)
    for what in ('EXT_fur', 'without positions', 'normal texture', "'pointer'"):
        assert message.count(what) == 1, what
    assert 'unlit' not in message


def test_an_extension_that_is_required_and_unknown(glb):
    glb.shown(glb.primitive())
    glb.json['extensionsRequired'] = ['EXT_meshopt_compression']
    refused('got EXT_meshopt', figure, glb, kind=pvibr.animation.GltfError)


def test_an_empty_file_is_an_empty_figure(glb):
    assert not figure(glb).meshes
