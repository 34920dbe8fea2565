"""Hulls of many points against those of all of them."""

import numpy as np
import pytest

from pvibr.instances.hulls import hull_corners


@pytest.mark.parametrize('shape', ['cloud', 'box', 'ball', 'plane', 'line', 'place'])
@pytest.mark.parametrize('far', [0.0, 1e6])
def test_what_is_deep_inside_is_left_out_first(shape, far, monkeypatch):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(3000, 3)) * {'plane': [1, 1, 0], 'line': [1, 0, 0]}.get(shape, 1)
    points = {
        'box': rng.uniform(size=points.shape),
        'ball': points / np.linalg.norm(points, axis=1)[:, None],
        'place': np.zeros_like(points),
    }.get(shape, points) + far
    every = hull_corners(points)
    monkeypatch.setattr('pvibr.instances.hulls._MANY', 100)
    np.testing.assert_array_equal(hull_corners(points), every)
