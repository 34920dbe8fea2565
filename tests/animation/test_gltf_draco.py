"""glTF primitives that Draco compresses."""

import sys
import types

import numpy as np
import pytest

import pvibr
from tests.animation.conftest import refused

RNG = np.random.default_rng(5)
POINTS = RNG.normal(size=(5, 3)).astype(np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])


def sequential(faces=3, points=5, flags=0):
    """Return the beginning of a compressed mesh, as its numbers are stored."""
    return b'DRACO\2\2\1\0' + flags.to_bytes(2, 'little') + bytes([faces, points, 1])


def packed(glb, data, attributes=None, **more):
    """Add a primitive of five points whose bytes are compressed."""
    position = glb.add('accessors', componentType=5126, count=5, type='VEC3')
    indices = glb.add('accessors', componentType=5125, count=9, type='SCALAR')
    draco = {'bufferView': glb.view(data), 'attributes': attributes or {'POSITION': 7}}
    glb.shown(
        {
            'attributes': {'POSITION': position},
            'indices': indices,
            'extensions': {'KHR_draco_mesh_compression': draco},
            **more,
        }
    )
    names = ['KHR_draco_mesh_compression']
    glb.json['extensionsUsed'] = glb.json['extensionsRequired'] = names


@pytest.fixture
def decoder(monkeypatch):
    """Stand in for DracoPy."""

    def decode(data):
        if len(data) < 20:
            msg = 'broken'
            raise ValueError(msg)
        attribute = {'unique_id': 7, 'data': POINTS}
        return types.SimpleNamespace(attributes=[attribute], faces=FACES)

    monkeypatch.setitem(sys.modules, 'DracoPy', types.SimpleNamespace(decode=decode))


def check(figure):
    mesh = figure.mesh()
    corners = mesh.points[mesh.regular_faces]
    np.testing.assert_allclose(corners, POINTS[FACES], atol=1e-3)


@pytest.mark.parametrize('mode', [4, 5])
def test_attributes_are_found_by_their_numbers(glb, decoder, mode):
    packed(glb, sequential() + bytes(9), mode=mode)
    check(pvibr.read_gltf(glb.write()))


def test_a_mesh_of_the_decoder_itself(glb):
    draco = pytest.importorskip('DracoPy')
    data = draco.encode(POINTS, FACES, quantization_bits=16)
    number = draco.decode(data).attributes[0]['unique_id']
    packed(glb, data, {'POSITION': number})
    mesh = pvibr.read_gltf(glb.write()).mesh()
    found = mesh.points[mesh.regular_faces].mean(1)
    wanted = POINTS[FACES].mean(1)
    np.testing.assert_allclose(np.sort(found, 0), np.sort(wanted, 0), atol=1e-3)


@pytest.mark.parametrize(
    ('data', 'attributes', 'said'),
    [
        (sequential(faces=4), None, '5 vertices and 3 faces of its accessors, got 5 and 4'),
        (sequential(points=6), None, 'got 6 and 3'),
        (b'DRACO\2\2\1\1\0\0\0\6\3', None, 'got 6 and 3'),
        (b'DRACO\2\2\1\0\0\0\xff\xff\xff\xff\x0f\5', None, 'and 4294967295'),
        (sequential(flags=0x8000), None, 'has metadata'),
        (b'DRACO\1\1\1\0\0\0', None, 'must be a Draco mesh of version 2.2'),
        (b'', None, 'must be a Draco mesh'),
        (sequential(), None, 'cannot be decoded: broken'),
        (sequential() + bytes(9), {'POSITION': 8}, 'POSITION 8 is missing'),
        (sequential() + bytes(9), {'POSITION': 7, 'NORMAL': 1}, 'accessors of all its'),
    ],
)
def test_compressed_meshes_that_lie(glb, decoder, data, attributes, said):
    packed(glb, data or b'\0', attributes)
    refused(said, pvibr.read_gltf, glb.write(), kind=pvibr.animation.GltfError)


def test_accessors_of_another_shape(glb, decoder):
    packed(glb, sequential() + bytes(9))
    glb.json['accessors'][1]['count'] = 12
    with pytest.raises(
        pvibr.animation.GltfError, match=r'\(12, 1\) as accessors\[1\], got \(9, 1\)'
    ):
        pvibr.read_gltf(glb.write())


def test_bytes_beside_the_compressed_ones_are_read_without_a_decoder(glb, monkeypatch):
    monkeypatch.setitem(sys.modules, 'DracoPy', None)
    primitive = glb.primitive()
    draco = {'bufferView': 0, 'attributes': {'POSITION': 0}}
    glb.shown(primitive | {'extensions': {'KHR_draco_mesh_compression': draco}})
    assert pvibr.read_gltf(glb.write()).mesh().n_cells == 2


def test_the_extra_is_named(glb, monkeypatch):
    monkeypatch.setitem(sys.modules, 'DracoPy', None)
    packed(glb, sequential() + bytes(9))
    refused(r"pip install 'pvibr\[draco\]'", pvibr.read_gltf, glb.write(), kind=ImportError)
