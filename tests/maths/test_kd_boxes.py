"""Boxes of a k-d tree hold each point once."""

import numpy as np
import pytest

from pvibr.maths.kd_boxes import divided, inside


@pytest.mark.parametrize('count', [1, 3, 8, 200])
def test_divided_by_space(count):
    points = np.random.default_rng(0).random((100, 3))
    shards = divided(points, count)
    np.testing.assert_array_equal(np.sort(np.concatenate([ids for ids, _ in shards])), range(100))
    sizes = [len(ids) for ids, _ in shards]
    assert max(sizes) - min(sizes) <= 2
    for ids, box in shards:
        np.testing.assert_array_equal(np.flatnonzero(inside(points, box)), ids)
    others = np.random.default_rng(1).normal(size=(500, 3))
    assert (np.sum([inside(others, box) for _, box in shards], 0) == 1).all()
