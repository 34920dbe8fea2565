"""What the chunks of a page hold."""

import json
import zlib

import numpy as np
import pytest

from pvibr.web.container import Container, Image, Points, delta_planes


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


def test_points_are_within_the_error_that_is_said():
    points = np.random.default_rng(1).normal((5e5, 5e6, 100), size=(200, 3))
    container = Container()
    leaf = container.tree({'points': Points(points)})['points']
    assert leaf['filter'] in ('', 'delta')
    assert 0 < container.point_error < 1e-4


def test_trees_are_json_and_images_exact():
    pixels = np.random.default_rng(2).integers(0, 256, (5, 7, 4), dtype=np.uint8)
    container = Container()
    tree = container.tree({'a': np.zeros((0, 3)), 'b': float('inf'), 'c': Image(pixels)})
    assert json.loads(json.dumps(tree, allow_nan=False))['c']['type'] == 'image/png'
    assert not zlib.decompress(container.chunks[0])


def test_a_tree_has_no_key_of_leaves():
    with pytest.raises(ValueError, match='leaf'):
        Container().tree({'$leaf': 1})
