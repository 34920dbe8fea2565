"""Bounds at many poses against those of all points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pvibr.instances.hulls import hull_corners
from pvibr.instances.posed_bounds import PosedShape


def made(seed, kind, flat=False):
    """Return points and matrices."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(1, 60), 3)) * [1, 2, 0 if flat else 5] + rng.normal(3)
    poses = np.tile(np.eye(4), (rng.integers(1, 80), 1, 1))
    turns = rng.normal(size=(len(poses), 3)) * ([0, 0, 1] if kind == 'about z' else 1)
    if kind != 'moved':
        poses[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    if kind == 'stretched':
        poses[:, :3, :3] *= rng.uniform(-2, 2, (len(poses), 1, 3))
    poses[:, :3, 3] = rng.normal(size=(len(poses), 3)) * ([9, 9, 0] if kind == 'about z' else 3)
    return points, poses


def bounds(corners, poses, center=None, ids=None):
    """Return the bounds at poses, or some of them."""
    center = corners.mean(0) if center is None else center
    ids = np.arange(len(poses)) if ids is None else ids
    radius = np.linalg.norm(corners - center, axis=1).max() * (1 + 1e-12)
    spheres = None
    if poses.ndim == 3:
        linear = poses[ids, :3, :3]
        radii = np.linalg.norm(linear, 2, axis=(1, 2)) * radius
        spheres = (linear @ center + poses[ids, :3, 3]).T, radii
    return PosedShape(corners, center).bounds(poses, ids, spheres)


@pytest.mark.parametrize('kind', ['moved', 'turned', 'about z', 'stretched'])
@given(seed=st.integers(0, 10_000), flat=st.booleans())
def test_bounds_are_those_of_all_points(kind, seed, flat):
    points, poses = made(seed, kind, flat)
    every = np.einsum('nij,pj->npi', poses[:, :3, :3], points) + poses[:, None, :3, 3]
    truth = [every.min((0, 1)), every.max((0, 1))]
    corners = hull_corners(points)
    assert len(corners) <= len(points)
    np.testing.assert_allclose(bounds(corners, poses, points.mean(0)), truth, atol=1e-12)
    if kind == 'moved':
        np.testing.assert_allclose(bounds(points, poses[:, :3, 3]), truth, atol=1e-12)


def test_only_some_poses_count():
    points, poses = made(1, 'turned')
    ids = np.arange(len(poses))[::3]
    np.testing.assert_array_equal(bounds(points, poses, ids=ids), bounds(points, poses[ids]))


@pytest.mark.parametrize('turns', ['any', 'about z', 'the same'])
@pytest.mark.parametrize('shape', ['ball', 'fine ball', 'lens', 'box'])
def test_many_that_reach_as_far(shape, turns):
    """Hold all points of shapes that lie on a plane, and hardly more."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=({'box': 8, 'fine ball': 9000}.get(shape, 600), 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    points *= [1, 1, 0.3] if shape == 'lens' else 1
    poses = np.tile(np.eye(4), (3000, 1, 1))
    axes = {'any': [1, 1, 1], 'about z': [0, 0, 1], 'the same': [0, 0, 0]}[turns]
    tilt = Rotation.from_rotvec([0.3, 0.2, 0.1])
    turned = Rotation.from_rotvec(rng.normal(size=(len(poses), 3)) * axes) * tilt
    poses[:, :3, :3] = turned.as_matrix()
    poses[:, :2, 3] = rng.uniform(-50, 50, (len(poses), 2))
    every = [turned.as_matrix()[:, k] @ points.T + poses[:, k, 3:] for k in range(3)]
    truth = np.array([[along.min() for along in every], [along.max() for along in every]])
    off = (bounds(points, poses) - truth) * [[-1], [1]]
    assert off.min() >= -1e-12
    assert off.max() <= (1e-3 if shape == 'fine ball' else 1e-12)
