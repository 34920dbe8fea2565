"""Bounds at many poses against those of all points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pvibr.maths.posed_bounds import hull_corners, posed_bounds


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


@pytest.mark.parametrize('kind', ['moved', 'turned', 'about z', 'stretched'])
@given(seed=st.integers(0, 10_000), flat=st.booleans())
def test_bounds_are_those_of_all_points(kind, seed, flat):
    points, poses = made(seed, kind, flat)
    every = np.einsum('nij,pj->npi', poses[:, :3, :3], points) + poses[:, None, :3, 3]
    truth = [every.min((0, 1)), every.max((0, 1))]
    corners = hull_corners(points)
    assert len(corners) <= len(points)
    np.testing.assert_allclose(posed_bounds(corners, poses), truth, atol=1e-12)
    center = points.mean(0)
    radius = np.linalg.norm(points - center, axis=1).max()
    places = poses[:, :3, :3] @ center + poses[:, :3, 3]
    radii = np.linalg.norm(poses[:, :3, :3], 2, axis=(1, 2)) * radius
    found = posed_bounds(corners, poses, center, (places.T, radii * (1 + 1e-12)))
    np.testing.assert_allclose(found, truth, atol=1e-12)
    if kind == 'moved':
        np.testing.assert_allclose(posed_bounds(points, poses[:, :3, 3]), truth, atol=1e-12)


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
    monkeypatch.setattr('pvibr.maths.posed_bounds._MANY', 100)
    np.testing.assert_array_equal(hull_corners(points), every)
