"""glTF files that lie: one error that names the place, and nothing allocated on a lie."""

import base64
import copy
import functools
import json
import operator
import os
import re
import struct
import tracemalloc
import warnings
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import pvibr
from pvibr.animation import GltfError
from tests.animation.conftest import refused

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def full(glb):
    """Fill a file with a bit of everything; accessors 0 to 13, nodes 0 to 3."""
    image = base64.b64encode(PNG).decode()
    glb.add('images', uri=f'data:image/png;base64,{image}')
    glb.add('samplers')
    glb.add('textures', source=0, sampler=0)
    color = {'baseColorTexture': {'index': 0}}
    glb.add('materials', pbrMetallicRoughness=color)
    attributes = {
        'TEXCOORD_0': glb.array(np.zeros((4, 2))),
        'JOINTS_0': glb.array(np.tile([0, 1, 0, 0], (4, 1)), 'B'),
        'WEIGHTS_0': glb.array(np.tile([0.5, 0.5, 0, 0], (4, 1))),
    }
    targets = [{'POSITION': glb.array(np.ones((4, 3)))}]
    primitive = glb.primitive(attributes=attributes, targets=targets, material=0)
    camera = {'yfov': 1.0, 'znear': 0.1}
    glb.add('cameras', type='perspective', perspective=camera)
    glb.shown(primitive, mesh={'weights': [0.5]}, skin=0, camera=0, name='body')
    glb.add('nodes', children=[2], name='hip')
    glb.add('nodes', children=[3], translation=[0, 1, 0], name='knee')
    glb.add('nodes', name='foot')
    inverse = glb.array(np.tile(np.eye(4).ravel(), (2, 1)))
    glb.add('skins', joints=[1, 2], inverseBindMatrices=inverse)
    glb.add('scenes', nodes=[0, 1])
    glb.json['scene'] = 0
    glb.animate(2, 'rotation', [0, 1], [[0, 0, 0, 1], [0, 0, 1, 0]])
    glb.animate(0, 'weights', [0, 1], [0.0, 1.0], 'STEP')
    return glb


PNG = base64.b64decode(
    'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=='
)


@pytest.fixture
def rich(glb):
    return full(glb)


def put(document, place, value):
    """Set ``'nodes.0.mesh'`` of a document."""
    *way, last = [int(part) if part.isdigit() else part for part in place.split('.')]
    functools.reduce(operator.getitem, way, document)[last] = value


def places(value, way=()):
    """Yield the way to everything in a JSON."""
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield (*way, key)
            yield from places(value[key], (*way, key))


def test_the_file_itself_is_sound(rich):
    figure = pvibr.read_gltf(rich.write())
    assert figure.mesh(0.5, 1).n_cells == 2


#: Places of references, and numbers that nothing has.
REFERENCES = {
    'scene': 5,
    'scenes.0.nodes.0': 9,
    'nodes.0.mesh': 1,
    'nodes.0.skin': 1,
    'nodes.0.camera': 1,
    'nodes.1.children.0': 7,
    'skins.0.joints.1': 4,
    'skins.0.inverseBindMatrices': 99,
    'meshes.0.primitives.0.indices': 99,
    'meshes.0.primitives.0.material': 2,
    'textures.0.source': 3,
    'textures.0.sampler': 3,
    'accessors.4.bufferView': 99,
    'bufferViews.4.buffer': 1,
    'animations.0.channels.0.sampler': 4,
    'animations.0.channels.0.target.node': 4,
    'animations.0.samplers.0.input': 99,
}


@pytest.mark.parametrize(
    ('place', 'value', 'said'),
    [
        *(
            (
                place,
                value,
                re.sub(r'\.(\d+)', r'\[\1\]', place) + rf' must be below .*, got {value}',
            )
            for place, value in REFERENCES.items()
        ),
        ('scenes.0.nodes.0', 9, r'must be below 4 .nodes., got 9'),
        ('materials.0.pbrMetallicRoughness.baseColorTexture.index', 3, r'index must be .*, got 3'),
        # Offsets, counts and strides
        ('bufferViews.4.byteOffset', 10**6, r'bufferViews\[4\] must end within .* got 1000048'),
        ('bufferViews.4.byteLength', 10**15, r'bufferViews\[4\] must end within'),
        ('accessors.4.byteOffset', 4, r'accessors\[4\] must end within the 48 bytes .* got 52'),
        ('accessors.4.count', 2**40, r'must have 1099511627776 elements'),
        ('accessors.6.count', 2**40, r'accessors\[6\] must end within'),
        ('bufferViews.4.byteStride', 8, r'byteStride must be at least 12, got 8'),
        ('bufferViews.4.byteStride', 2, r'bufferViews\[4\].byteStride: Expected `int` >= 4'),
        ('accessors.4.count', 0, r'accessors\[4\].count: Expected `int` >= 1'),
        ('accessors.4.count', -1, r'accessors\[4\].count'),
        ('accessors.4.count', 10**30, r'accessors\[4\].count'),
        ('accessors.4.componentType', 5124, r'accessors\[4\].componentType: Invalid enum value'),
        ('accessors.4.type', 'VEC5', r'attributes.POSITION must be .* got accessors\[4\] of VEC5'),
        ('accessors.4.type', 'VEC2', r'attributes.POSITION must be .* got accessors\[4\] of VEC2'),
        ('accessors.5.count', 3, r'attributes.NORMAL must have 4 elements, as POSITION, got 3'),
        ('accessors.3.count', 3, r'targets\[0\].POSITION must have 4 elements, got 3'),
        ('accessors.6.componentType', 5126, r'must be unsigned integers: accessors\[6\]'),
        (
            'accessors.7.count',
            1,
            r'inverseBindMatrices must have 2 matrices, one per joint, got 1',
        ),
        ('meshes.0.primitives.0.mode', 9, r'mode: Expected `int` <= 6'),
        # Graph
        ('nodes.3.children', [2], r'nodes\[3\].children\[0\] .* got 2, a child of'),
        ('nodes.3.children', [1], r'nodes\[1\] must not be in or below a cycle'),
        ('nodes.3.children', [3], r'nodes\[3\].children\[0\] must .* got 3, a child'),
        ('nodes.1.matrix', [0.0] * 16, r'nodes\[1\].matrix must be affine'),
        (
            'nodes.1.matrix',
            [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
            r'must be free of shear',
        ),
        ('nodes.1.matrix', [1.0] * 15, r'nodes\[1\].matrix: Expected `array` of length >?=? ?16'),
        ('nodes.1.rotation', [0, 0, 0, 0], r'nodes: '),
        ('nodes.1.scale', [1e31, 1, 1], r'nodes\[1\].scale\[0\]: Expected `float` <= 1e'),
        # Morphs and clips
        ('nodes.0.weights', [1, 2], r'nodes\[0\] must have 1 weights, got 2'),
        ('animations.0.samplers.0.output', 0, r'output must be .* got accessors\[0\] of VEC2'),
        (
            'animations.0.samplers.0.interpolation',
            'CUBICSPLINE',
            r'must have 24 numbers for 2 keys',
        ),
        ('animations.0.samplers.0.interpolation', 'SPLINE', r'samplers\[0\].interpolation'),
        # What is not glTF 2.0, or no JSON
        ('asset.version', '1.0', r"asset.version must be 2.x, got '1.0'"),
        ('asset.minVersion', '2.1', r"asset.minVersion must be 2.0, got '2.1'"),
        ('asset', {}, r'asset: Object missing required field `version`'),
        ('nodes', None, r'nodes: Expected `array`, got `null`'),
        ('nodes.1.translation', [0, '1', 0], r'nodes\[1\].translation\[1\]'),
        ('cameras.0.perspective', None, r"cameras\[0\] must have 'perspective'"),
        ('cameras.0.type', 'orthographic', r"cameras\[0\] must have 'orthographic'"),
    ],
)
def test_an_error_names_the_place(rich, place, value, said):
    put(rich.json, place, value)
    refused(said, pvibr.read_gltf, rich.write(), kind=GltfError)


@pytest.mark.parametrize(
    ('accessor', 'element', 'value', 'said'),
    [
        (4, 5, 'nan', r'accessors\[4\]: element 1 must be finite, got nan'),
        (3, 0, 'inf', r'accessors\[3\]: element 0 must be finite, got inf'),
        (7, 3, 'nan', r'accessors\[7\]: .* must be finite, got nan'),
        (8, 1, 'nan', r'accessors\[8\]: .* must be finite, got nan'),
        (9, 0, '-inf', r'accessors\[9\]: .* must be finite, got -inf'),
        (2, 0, 'nan', r'accessors\[2\]: element 0 must be finite, got nan'),
        (7, 3, '0.5', r'skins\[0\].inverseBindMatrices\[0\] must be affine'),
    ],
)
def test_numbers_that_are_none(rich, accessor, element, value, said):
    view = rich.json['bufferViews'][rich.json['accessors'][accessor]['bufferView']]
    at = view['byteOffset'] + 4 * element
    rich.blob = rich.blob[:at] + struct.pack('<f', float(value)) + rich.blob[at + 4 :]
    refused(said, pvibr.read_gltf, rich.write(), kind=GltfError)


def primitive(file):
    return file.json['meshes'][0]['primitives'][0]


LIES = {
    r'skins\[0\]: joints\[0, 1\] must be from 0 to 1, got 2': lambda file: primitive(file)[
        'attributes'
    ].update(JOINTS_0=file.array([[0, 2, 0, 0]] * 4, 'B')),
    r'indices\[2\] must be below 4': lambda file: primitive(file).update(
        indices=file.array([0, 1, 4], 'H')
    ),
    'indices, got 4': lambda file: primitive(file).update(indices=file.array([0, 1, 2, 3], 'H')),
    r'animations\[2\].channels\[0\]: times must increase': lambda file: file.animate(
        3, 'scale', [0, 2, 1], np.ones((3, 3))
    ),
    r'channels\[1\] .* got rotation of nodes\[2\] again': lambda file: file.json['animations'][0][
        'channels'
    ].extend(file.json['animations'][0]['channels']),
    r'nodes\[2\] must .* by less than 1e\+30': lambda file: [
        node.update(scale=[1e20] * 3) for node in file.json['nodes'][1:3]
    ],
}


@pytest.mark.parametrize('said', LIES)
def test_what_does_not_go_together(rich, said):
    LIES[said](rich)
    refused(said, pvibr.read_gltf, rich.write(), kind=GltfError)


def test_messages_stay_short(rich):
    rich.json['extensionsUsed'] = [f'EXT_{i}' for i in range(1000)]
    with pytest.warns(pvibr.PvibrWarning) as caught:
        pvibr.read_gltf(rich.write())
    assert len(str(caught[0].message)) == 1000
    rich.json['nodes'][0]['camera'] = 0
    rich.json['cameras'][0] |= {'name': 'x' * 10**6, 'type': 'y' * 10**6}
    with pytest.raises(GltfError, match='cameras') as refused:
        pvibr.read_gltf(rich.write())
    assert len(str(refused.value)) == 1000


@pytest.mark.parametrize('fault', ['order', 'range', 'count', 'cut'])
def test_sparse_accessors_that_lie(glb, fault):
    indices = {'order': [2, 1], 'range': [1, 9], 'count': [0, 1], 'cut': [0, 1]}[fault]
    values = glb.view(np.zeros(6 if fault != 'cut' else 5, '<f4').tobytes())
    sparse = {
        'count': 5 if fault == 'count' else 2,
        'indices': {'bufferView': glb.view(bytes(indices)), 'componentType': 5121},
        'values': {'bufferView': values},
    }
    glb.shown(glb.primitive(attributes={'POSITION': glb.array(SQUARE, sparse=sparse)}))
    refused(r'accessors\[0\].sparse', pvibr.read_gltf, glb.write(), kind=GltfError)


def refused_within(path, megabytes):
    """Read a file that is refused before much memory is used."""
    tracemalloc.start()
    try:
        with pytest.raises(GltfError):
            pvibr.read_gltf(path)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < megabytes * 2**20


@pytest.mark.parametrize('count', [2**28, 2**40, 2**53])
def test_zeros_without_bytes_are_not_allocated(glb, count):
    zeros = {'componentType': 5126, 'type': 'VEC3', 'count': count}
    position, normal = glb.add('accessors', **zeros), glb.add('accessors', **zeros)
    glb.add('meshes', primitives=[{'attributes': {'POSITION': position, 'NORMAL': normal}}])
    glb.add('nodes', mesh=0)
    refused_within(glb.write(), 8)


def test_many_accessors_of_the_same_bytes(glb):
    shared = glb.array(np.zeros((50_000, 3)))
    accessors = glb.json['accessors']
    accessors += [accessors[shared]] * 3000
    targets = [{'POSITION': index} for index in range(3000)]
    glb.shown(glb.primitive(np.zeros((50_000, 3)), targets=targets))
    refused_within(glb.write(), 700)


def test_nodes_of_one_mesh_share_its_arrays(glb):
    n = 50_000
    everywhere = glb.array(np.zeros((n, 4)), 'B'), glb.array(np.tile([1, 0, 0, 0], (n, 1)))
    attributes = dict(zip(('JOINTS_0', 'WEIGHTS_0'), everywhere, strict=True))
    targets = [{'POSITION': glb.array(np.zeros((n, 3)))}]
    glb.shown(glb.primitive(np.zeros((n, 3)), targets=targets, attributes=attributes))
    for i in range(1000):
        glb.add('nodes', mesh=0, weights=[i / 1000])
    tracemalloc.start()
    figure = pvibr.read_gltf(glb.write())
    assert tracemalloc.get_traced_memory()[1] < 100 * 2**20
    tracemalloc.stop()
    assert figure.meshes[500].morphs.weights.tolist() == [0.499]
    for i in range(1000):  # as many copies of joints and weights as there are skins
        glb.add('skins', joints=[0])
        glb.json['nodes'][i]['skin'] = i
    refused_within(glb.write(), 900)


def test_many_nodes_of_many_primitives(glb):
    glb.shown(*[glb.primitive()] * 2000)
    for _ in range(2000):
        glb.add('nodes', mesh=0)
    refused_within(glb.write(), 700)


def test_a_small_picture_that_unpacks_to_a_huge_one(glb):
    side = 30_000

    def chunk(kind, data):
        checked = kind + data
        return struct.pack('>I', len(data)) + checked + struct.pack('>I', zlib.crc32(checked))

    header = struct.pack('>IIBBBBB', side, side, 8, 2, 0, 0, 0)
    data = chunk(b'IHDR', header) + chunk(b'IDAT', zlib.compress(b'')) + chunk(b'IEND', b'')
    glb.add('images', bufferView=glb.view(b'\x89PNG\r\n\x1a\n' + data))
    glb.add('textures', source=0)
    glb.add('materials', pbrMetallicRoughness={'baseColorTexture': {'index': 0}})
    coordinates = {'TEXCOORD_0': glb.array(np.zeros((4, 2)))}
    glb.shown(glb.primitive(material=0, attributes=coordinates))
    path = glb.write()
    tracemalloc.start()
    with pytest.warns(pvibr.PvibrWarning, match=r'images\[0\]'):
        pvibr.read_gltf(path)
    assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    tracemalloc.stop()


def test_numbers_near_the_largest_float32(glb):
    huge = np.full((4, 3), 3e38)
    normals = {'NORMAL': glb.array(huge)}
    glb.shown(glb.primitive(attributes=normals), glb.primitive(SQUARE * 3e38 - 2e38))
    figure = pvibr.read_gltf(glb.write())
    np.testing.assert_allclose(figure.posed(0)[1], np.full((4, 3), 3**-0.5), rtol=1e-6)
    assert np.isfinite(figure.posed(1)[0]).all()


def test_very_deep_nodes(glb):
    for i in range(3000):
        glb.add('nodes', children=[i + 1])
    glb.add('nodes')
    with pytest.raises(GltfError, match=r'must be less than \d+ nodes below its root'):
        pvibr.read_gltf(glb.write())


@pytest.mark.parametrize(
    ('content', 'said'),
    [
        (b'', 'neither GLB nor JSON'),
        (b'PK\3\4', 'neither GLB nor JSON'),
        (b'glTF', 'truncated at 4 bytes'),
        (b'\xff\xfe{\0}\0', 'neither GLB nor JSON'),
        (b'[]', 'the file: Expected `object`, got `array`'),
        (b'{"asset": {"version": "2.0"}', 'neither GLB nor JSON'),
        (b'{"asset": {"version": "2.0"}, "extras": ' + b'[' * 10**5, 'nested too deeply'),
        (b'{"asset": {"version": "2.0"}, "scene": NaN}', 'neither GLB nor JSON'),
        (b'{"asset": {"version": "\xff"}}', 'neither GLB nor JSON'),
        (b'{"asset": {"version": "1.0"}, "accessors": {}}', r"version must be 2.x, got '1.0'"),
        (b'{"nodes": 3, "asset": {"version": "\xff"}}', 'nodes: Expected `array`, got `int`'),
        (struct.pack('<4sIII4s', b'glTF', 1, 20, 0, b'JSON'), 'version must be 2, got 1'),
        (struct.pack('<4sIII4s', b'glTF', 2, 99, 0, b'JSON'), '99 bytes declared, 20 present'),
        (
            struct.pack('<4sIII4s', b'glTF', 2, 20, 9, b'JSON'),
            'chunk 0 must end within the 20 bytes, got 29',
        ),
        (struct.pack('<4sIII4s', b'glTF', 2, 20, 0, b'BIN\0'), 'chunk 0 .* must be'),
    ],
)
def test_files_that_are_none(tmp_path, content, said):
    path = tmp_path / 'a.glb'
    path.write_bytes(content)
    refused(said, pvibr.read_gltf, path, kind=GltfError)


def test_a_file_cut_off_anywhere(rich):
    whole = rich.bytes()
    path = rich.folder / 'cut.glb'
    for size in range(0, len(whole), 41):
        path.write_bytes(whole[:size])
        with pytest.raises(GltfError):
            pvibr.read_gltf(path)


def test_no_such_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        pvibr.read_gltf(tmp_path / 'none.glb')


URIS = [
    r'/etc/hostname',
    r'../secret.bin',
    r'folder/../../secret.bin',
    r'%2e%2e/secret.bin',
    r'..%2Fsecret.bin',
    r'%2Fetc%2Fhostname',
    r'file:///etc/hostname',
    r'http://localhost/a.bin',
    r'FILE:a.bin',
    r'//localhost/a.bin',
    r'C:\a.bin',
    r'..\secret.bin',
    r'link.bin',
    r'linked/secret.bin',
    r'a%00.bin',
    r'circle.bin',
    r'gone.bin',
    r'.',
    r'pipe',
    r'data:application/octet-stream,abc',
    r'data:application/octet-stream;base64,a',
    r'data:application/octet-stream;base64,!!!!',
    r'data:;base64',
]


@pytest.mark.parametrize('uri', [*URIS, '', 'a' * 5000])
@pytest.mark.parametrize('kind', ['buffers', 'images'])
def test_uris_that_lead_elsewhere(rich, uri, kind):
    inner = rich.folder / 'inner'
    inner.mkdir()
    (rich.folder / 'secret.bin').write_bytes(b'\0' * 10**4)
    (inner / 'link.bin').symlink_to('../secret.bin')
    (inner / 'linked').symlink_to('..')
    (inner / 'circle.bin').symlink_to('circle.bin')
    os.mkfifo(inner / 'pipe')
    rich.folder = inner
    document = rich.json
    if kind == 'buffers':
        document['buffers'] = [{'uri': uri, 'byteLength': len(rich.blob)}]
    else:
        document['images'] = [{'uri': uri}]
    expected = pvibr.PvibrWarning if kind == 'images' else GltfError  # pictures are left out
    path = rich.write()
    with pytest.raises(expected, match=rf'{kind}\[0\].uri') as caught:
        pvibr.read_gltf(path)
    assert len(str(caught.value)) < 300


def test_a_file_in_a_folder_below_may_be_named(glb):
    glb.shown(glb.primitive())
    (glb.folder / 'parts').mkdir()
    (glb.folder / 'parts' / 'a b.bin').write_bytes(glb.blob)
    glb.json['buffers'] = [{'uri': './parts/a%20b.bin', 'byteLength': len(glb.blob)}]
    glb.blob = b''
    assert pvibr.read_gltf(glb.write()).mesh().n_cells == 2


def test_a_buffer_shorter_than_it_says(glb):
    glb.shown(glb.primitive())
    glb.json['buffers'] = [{'byteLength': 2**50}]
    with pytest.raises(
        GltfError, match=r'buffers\[0\].byteLength must be .* got 1125899906842624'
    ):
        pvibr.read_gltf(glb.write())


def test_a_buffer_without_bytes(glb):
    glb.shown(glb.primitive())
    path = glb.folder / 'a.gltf'
    path.write_text(json.dumps(glb.json | {'buffers': [{'byteLength': 4}]}), encoding='utf-8')
    refused(r'buffers\[0\] must have a uri', pvibr.read_gltf, path, kind=GltfError)


def survives(path):
    """Read a file: our error, or a figure whose every pose is finite."""
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        warnings.simplefilter('ignore', pvibr.PvibrWarning)
        try:
            figure = pvibr.read_gltf(path)
        except GltfError:
            return
        for i in range(len(figure.meshes)):
            pose = figure.sample(0.3)
            assert np.isfinite(figure.posed(i, pose)[0]).all()


FUZZ = settings(
    max_examples=int(os.environ.get('PVIBR_SOAK', '200')),  # more, for an hour of it
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@FUZZ
@given(data=st.data())
def test_flipped_bytes(rich, data):
    broken = bytearray(rich.bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        broken[data.draw(st.integers(0, len(broken) - 1))] = data.draw(st.integers(0, 255))
    path = rich.folder / 'broken.glb'
    path.write_bytes(broken)
    survives(path)


NUMBERS = st.one_of(
    st.integers(-2, 20),
    st.sampled_from([2**31, 2**32, 2**53, 2**64, 10**300, -(2**63), 1e308, 1e-320, 0.5]),
    st.none(),
    st.sampled_from(['', 'VEC2', [], {}, [0], True]),
)


@FUZZ
@given(seed=st.integers(0, 10**6), value=NUMBERS)
@example(seed=0, value=None)
def test_any_value_replaced(rich, seed, value):
    sound, ways = rich.json, list(places(rich.json))
    way = ways[seed % len(ways)]
    rich.json = copy.deepcopy(sound)
    try:
        functools.reduce(operator.getitem, way[:-1], rich.json)[way[-1]] = value
        survives(rich.write())
    finally:
        rich.json = sound
