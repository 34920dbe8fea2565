"""Vectors beside numpy's functions."""

import numpy as np
import pytest

from pvibr.maths.vectors import cross


@pytest.mark.parametrize(
    'shapes', [((3,), (3,)), ((5, 3), (3,)), ((3,), (2, 4, 3)), ((0, 3), (3,))]
)
def test_cross_products(shapes):
    a, b = (np.random.default_rng(k).normal(size=shape) for k, shape in enumerate(shapes))
    assert np.array_equal(cross(a, b), np.cross(a, b))
