"""What bounds are made of, against all points of all instances."""

from types import SimpleNamespace

import numpy as np
import pytest

from pvibr.instances.placement import Placement
from pvibr.maths.blocks import morton_order


@pytest.mark.parametrize('unit', [1, 64])
@pytest.mark.parametrize('turned', [False, True])
@pytest.mark.parametrize('place', ['cube', 'grid', 'line', 'far away'])
def test_the_outermost_hold_all_that_bounds_are_made_of(unit, turned, place):
    rng = np.random.default_rng(7)
    corners = rng.normal([0.05, 0, 0], [0.002, 0.03, 0.01], (30, 3))
    middle = (corners.min(0) + corners.max(0)) / 2
    radius = np.linalg.norm(corners - middle, axis=1).max()
    points = rng.uniform(-1, 1, (5000, 3)) * [3, 1, 1]
    if place == 'grid':
        points = np.round(points, 1)
    elif place == 'line':
        points[:, 1:] = 0
    elif place == 'far away':
        points += [5e6, 0, -5e6]
    axes = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    poses = points
    if turned:
        axes, _ = np.linalg.qr(rng.normal(size=(len(points), 3, 3)))
        axes = axes * rng.uniform(0.1, 3, (len(points), 1, 1))
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = axes, points
    placement = Placement(SimpleNamespace(center=middle, radius=radius), unit)
    placement.put(poses, morton_order(points).astype(np.int32))

    reach = np.einsum('nij,kj->nki', axes, corners) + points[:, None]
    some = placement.ids[placement.outermost()]
    assert len(np.unique(some)) == len(some)
    np.testing.assert_array_equal(reach[some].min((0, 1)), reach.min((0, 1)))
    np.testing.assert_array_equal(reach[some].max((0, 1)), reach.max((0, 1)))
    if place == 'cube':
        assert len(some) < len(points) / 3
