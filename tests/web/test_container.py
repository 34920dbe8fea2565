"""What the chunks of a page hold."""

import json
import zlib

import numpy as np
import pytest

from pvibr.web.container import Container, Directions, Image, Points, delta_planes


def restored(planes, dtype, shape):
    """Undo the filter as the page does."""
    width = dtype.itemsize
    columns = np.frombuffer(planes, np.uint8).reshape(width, -1).T.copy().view(f'<u{width}')
    zigzag = columns.reshape(shape[1], shape[0]).T
    delta = (zigzag >> 1) ^ (0 - (zigzag & 1))
    return np.cumsum(delta, axis=0, dtype=f'<u{width}').view(dtype)


@pytest.mark.parametrize('name', ['uint8', 'uint16', 'int32', 'uint32', 'float32', 'float64'])
def test_filtered_arrays_come_back_exactly(name):
    array = np.random.default_rng(0).integers(0, 250, (40, 3)).astype(name)
    again = restored(delta_planes(array), array.dtype, array.shape)
    np.testing.assert_array_equal(again, array)


def unpacked(container, leaf):
    planes = zlib.decompress(container.chunks[leaf['chunk']])
    dtype = np.dtype(leaf['type'])
    if leaf['filter']:
        return restored(planes, dtype, leaf['shape'])
    return np.frombuffer(planes, dtype).reshape(leaf['shape'])


def test_points_are_within_half_a_step():
    points = np.random.default_rng(1).normal((5e5, 5e6, 100), size=(200, 3))
    container = Container()
    leaf = container.tree({'points': Points(points)})['points']
    again = np.array(leaf['low']) + leaf['step'] * unpacked(container, leaf)
    assert np.ptp(points) / 65535 / 2 > np.abs(again - points).max()


def test_directions_are_within_a_hundredth_of_a_degree():
    vectors = np.random.default_rng(2).normal(size=(500, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    container = Container()
    leaf = container.tree({'normals': Directions(vectors)})['normals']
    x, y = unpacked(container, leaf).T / 32767
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    again = np.stack([x - np.sign(x) * fold, y - np.sign(y) * fold, z], 1)
    again /= np.linalg.norm(again, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((again * vectors).sum(1), -1, 1))).max() < 0.01


def test_trees_are_json_and_images_exact():
    pixels = np.random.default_rng(2).integers(0, 256, (5, 7, 4), dtype=np.uint8)
    container = Container()
    tree = container.tree({'a': np.zeros((0, 3)), 'b': float('inf'), 'c': Image(pixels)})
    assert json.loads(json.dumps(tree, allow_nan=False))['c']['type'] == 'image/png'
    assert not zlib.decompress(container.chunks[0])


def test_a_tree_has_no_key_of_leaves():
    with pytest.raises(ValueError, match='leaf'):
        Container().tree({'$leaf': 1})
