"""glTF files as artists export them: what is odd is read as other readers do, and named."""

import base64
import itertools
import json
import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.makers import png
from tests.pictures import damaged_jpeg

CLAMP, MIRROR, REPEAT = 33071, 33648, 10497


def textured(glb, picture, coordinates, **sampler):
    """Add a square with a picture."""
    glb.add('images', **picture)
    glb.add('samplers', magFilter=9728, minFilter=9728, **sampler)
    glb.add('textures', source=0, sampler=0)
    glb.add('materials', pbrMetallicRoughness={'baseColorTexture': {'index': 0}})
    attributes = {'TEXCOORD_0': glb.array(coordinates)}
    return glb.shown(glb.primitive(material=0, attributes=attributes))


def named(glb, *words):
    """Read a file; one warning at this line's caller names all the words."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        figure = pvibr.read_gltf(glb.write())
    assert len(caught) == 1
    assert caught[0].filename == __file__
    for word in words:
        assert str(caught[0].message).count(word) == 1
    return figure


def shown(figure, time=0.0, **options):
    """Return which pixels a figure covers, seen along -z."""
    plotter = pv.Plotter(off_screen=True, window_size=(60, 40), lighting='none')
    plotter.ibr.add_animated(figure, color='white', culling=False, lighting=False, **options)
    plotter.background_color = 'black'
    plotter.ibr.time = time
    plotter.view_xy(bounds=(-1, 1, -1, 1, 0, 1))
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    return picture[..., 0] > 100


@pytest.mark.parametrize('kind', ['rigid', 'morphed', 'skinned'])
def test_a_node_scaled_to_nothing_hides_its_mesh_until_it_grows(glb, kind):
    more, node = {}, {}
    if kind == 'morphed':
        more = {'targets': [{'POSITION': glb.array(np.zeros((4, 3)))}]}
        node = {'weights': [1.0]}
    if kind == 'skinned':
        joints = glb.array(np.zeros((4, 4)), 'B'), glb.array(np.tile([1, 0, 0, 0], (4, 1)))
        more = {'attributes': dict(zip(('JOINTS_0', 'WEIGHTS_0'), joints, strict=True))}
        node = {'skin': 0}
        glb.add('skins', joints=[1])
    hidden = {'scale': [0, 0, 0]}
    glb.shown(glb.primitive(**more), **(node if kind == 'skinned' else node | hidden))
    glb.add('nodes', **hidden)
    which = int(kind == 'skinned')
    glb.animate(which, 'scale', [0, 1, 2], [[0] * 3, [1] * 3, [1] * 3], 'STEP')
    figure = pvibr.read_gltf(glb.write())
    assert np.isfinite(figure.mesh(0.0).points).all()
    assert not shown(figure).any()
    assert shown(figure, 1.0).any()


def test_a_matrix_without_depth_is_flat(glb):
    matrix = np.diag([2.0, 3.0, 0.0, 1.0])
    matrix[:3, 3] = 1, 2, 3
    points = np.random.default_rng(3).normal(size=(4, 3)).astype(np.float32)
    glb.shown(glb.primitive(points), matrix=matrix.T.ravel().tolist())
    figure = pvibr.read_gltf(glb.write())
    wanted = points * [2, 3, 0] + [1, 2, 3]
    np.testing.assert_allclose(figure.mesh().points, wanted, atol=1e-5)
    assert shown(figure).any()


@pytest.mark.parametrize(('roots', 'moved'), [([1], 0), ([2], 0), ([0, 1], 5), ([1, 0], 5)])
def test_roots_of_a_scene_that_have_parents_are_drawn_once(glb, roots, moved):
    """As exporters of game kits write: their parents are in no scene, or there already."""
    glb.add('nodes', children=[1], translation=[5, 0, 0])
    glb.add('nodes', children=[2])
    glb.shown(glb.primitive())
    glb.add('scenes', nodes=roots)
    figure = pvibr.read_gltf(glb.write())
    assert len(figure.meshes) == 1
    np.testing.assert_allclose(figure.mesh().bounds, [moved, 1 + moved, 0, 1, 0, 0], atol=1e-6)
    pl = pv.Plotter(off_screen=True)
    instances = pl.ibr.add_instances(str(glb.write()), cache=False)
    np.testing.assert_allclose(instances.bounds, [moved, 1 + moved, 0, 1, 0, 0], atol=1e-6)


def test_odd_weights_are_those_of_other_readers(glb):
    weights = [[0, 0, 0, 0], [0.5, -1e-8, 0.5, 0], [0, 3, 1, 0], [1, 0, 0, 0]]
    joints = glb.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [1, 1, 1, 1]], 'B')
    glb.shown(
        glb.primitive(attributes={'JOINTS_0': joints, 'WEIGHTS_0': glb.array(weights)}), skin=0
    )
    glb.add('nodes')
    glb.add('nodes')
    glb.add('skins', joints=[1, 2])
    skin = pvibr.read_gltf(glb.write()).meshes[0].skin
    wanted = [[1, 0, 0, 0], [0.5, 0, 0.5, 0], [0, 0.75, 0.25, 0], [1, 0, 0, 0]]
    np.testing.assert_allclose(skin.weights, wanted, atol=1e-7)
    assert skin.joints[0, 0] == 1
    view = glb.view(np.array([[1, -0.5, 0, 0]] * 4, '<f4').tobytes())
    assert glb.json['accessors'][1]['type'] == 'VEC4'
    glb.json['accessors'][1]['bufferView'] = view
    assert named(glb, 'negative weights').meshes[0].skin.weights[2].tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize(
    ('picture', 'said'),
    [
        (
            {'uri': 'data:image/png;base64,iVBORw0KGgo='},
            'images[0] must be PNG, JPEG or WebP, got another format',
        ),
        ({'uri': 'http://localhost/a.png'}, 'must be a data URI or relative path'),
        ({'uri': 'data:;base64,' + base64.b64encode(b'\xabKTX 20\xbb').decode()}, 'got KTX2'),
        ({}, 'images[0] must have uri or bufferView, got neither'),
        ({'uri': 'gone.png'}, 'uri: no such file'),
    ],
)
def test_a_picture_that_cannot_be_read_is_named_and_left_out(glb, picture, said):
    textured(glb, picture, np.zeros((4, 2)))
    assert 'texture' not in named(glb, said).meshes[0].look


def test_of_a_picture_whose_description_is_damaged_nothing_is_said(glb):
    textured(glb, {'bufferView': glb.view(damaged_jpeg())}, np.zeros((4, 2)))
    look = pvibr.read_gltf(glb.write()).meshes[0].look
    assert (look['texture'].to_array() == 255).all()


def test_a_texture_without_a_picture_is_named(glb):
    textured(glb, {'uri': 'a.png'}, np.zeros((4, 2)))
    glb.json['textures'][0] = {'extensions': {'KHR_texture_basisu': {'source': 0}}}
    glb.json['extensionsRequired'] = glb.json['extensionsUsed'] = ['KHR_texture_basisu']
    named(glb, 'textures[0]', 'KHR_texture_basisu')


def test_a_webp_extension_without_a_picture_falls_back(glb):
    picture = {'bufferView': glb.view(png([[[255, 0, 0]]]))}
    textured(glb, picture, np.zeros((4, 2)))
    glb.json['textures'][0]['extensions'] = {'EXT_texture_webp': {}}
    glb.json['extensionsUsed'] = ['EXT_texture_webp']
    texture = pvibr.read_gltf(glb.write()).meshes[0].look['texture']
    assert texture.to_array().tolist() == [[[255, 0, 0]]]


def wrapped(places, n, wrap):
    """Return the texels at coordinates by a wrap mode, as glTF defines."""
    cells = np.floor(places * n).astype(int)
    if wrap == CLAMP:
        return np.clip(cells, 0, n - 1)
    if wrap == REPEAT:
        return cells % n
    cells %= 2 * n
    return np.where(cells < n, cells, 2 * n - 1 - cells)


@pytest.mark.parametrize(('s', 't'), [*itertools.permutations([CLAMP, MIRROR, REPEAT], 2)])
def test_wrap_modes_that_differ(glb, s, t):
    rng = np.random.default_rng(s + t)
    pixels = rng.integers(0, 256, (3, 4, 3))
    low, high = -1.375 - rng.integers(2), 2.625 + rng.integers(3)
    corners = np.array([[low, high], [high, high], [high, low], [low, low]])
    textured(glb, {'bufferView': glb.view(png(pixels))}, corners, wrapS=s, wrapT=t)
    (mesh,) = pvibr.read_gltf(glb.write()).meshes
    plotter = pv.Plotter(off_screen=True, window_size=(96, 96), lighting='none')
    plotter.add_mesh(mesh.mesh, **mesh.look)
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 0.5
    picture = plotter.screenshot(return_img=True)
    across = low + (np.arange(96) + 0.5) / 96 * (high - low)
    wanted = pixels[np.ix_(wrapped(across, 3, t), wrapped(across, 4, s))]
    # Texels next to an edge may round to either side.
    assert (np.abs(picture.astype(int) - wanted).max(2) > 1).mean() < 0.02


def test_textures_without_a_sampler_have_mipmaps(glb):
    textured(glb, {'bufferView': glb.view(png([[[255, 0, 0]]]))}, np.zeros((4, 2)))
    del glb.json['textures'][0]['sampler']
    assert pvibr.read_gltf(glb.write()).meshes[0].look['texture'].mipmap


def test_extensions_are_named_whether_declared_or_not(glb):
    glb.shown(glb.primitive(), extensions={'KHR_interactivity': {}, 'EXT_fur': {}})
    glb.json['extensionsUsed'] = ['EXT_fur']
    named(glb, 'KHR_interactivity', 'EXT_fur')


def test_required_extensions_that_only_change_looks_are_left_out(glb):
    glb.add('materials', extensions={'KHR_materials_clearcoat': {'clearcoatFactor': 1}})
    glb.shown(glb.primitive(material=0))
    glb.json['extensionsRequired'] = glb.json['extensionsUsed'] = ['KHR_materials_clearcoat']
    assert len(named(glb, 'KHR_materials_clearcoat').meshes) == 1


def test_lights_and_unused_accessors_of_unknown_types(glb):
    glb.add('accessors', componentType=5126, count=1, type='QUAD')
    glb.shown(glb.primitive(), extensions={'KHR_lights_punctual': {'light': 0}})
    lights = {'lights': [{'type': 'sphere'}]}
    glb.json['extensions'] = {'KHR_lights_punctual': lights}
    glb.json['extensionsUsed'] = ['KHR_lights_punctual']
    assert named(glb, "a light of type 'sphere'").lights == ()


def test_whole_numbers_may_be_written_as_floats(glb):
    glb.shown(glb.primitive(), translation=[1, 2, 3])
    text = json.dumps(glb.json | {'buffers': [{'byteLength': len(glb.blob)}]})
    view = glb.json['bufferViews'][0]['byteLength']
    text = text.replace(f'"byteLength": {view}', f'"byteLength": {view}.0')
    glb.json = json.loads(text)
    assert isinstance(glb.json['bufferViews'][0]['byteLength'], float)
    figure = pvibr.read_gltf(glb.write())
    assert figure.mesh().points[0].tolist() == [1, 2, 3]


def test_keys_at_one_time(glb):
    node = glb.shown(glb.primitive())
    glb.animate(node, 'translation', [0, 1, 1, 2], [[0, 0, 0], [1, 0, 0], [9, 9, 9], [2, 0, 0]])
    (clip,) = pvibr.read_gltf(glb.write()).clips
    assert clip.tracks[0].times.tolist() == [0, 1, 2]
