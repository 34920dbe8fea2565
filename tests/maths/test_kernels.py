"""Kernels: closed forms of their moments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pvibr.maths.kernels import vogel_disk


@given(st.integers(1, 500))
def test_the_disk_has_the_moments_of_a_disk(n):
    points = vogel_disk(n)
    assert points.shape == (n, 2)
    assert (np.linalg.norm(points, axis=1) < 1).all()
    np.testing.assert_allclose((points**2).sum(axis=1).mean(), 0.5)
    # The middle of n points: n steps of less than 1 around a circle do not add up.
    assert np.linalg.norm(points.mean(axis=0)) <= 1 / np.sqrt(n)


@pytest.mark.parametrize('n', [16, 64, 256])
def test_the_disk_is_even(n):
    points = vogel_disk(n)
    second = points.T @ points / n
    np.testing.assert_allclose(second, np.eye(2) / 4, atol=1.0 / n)
    nearest = cKDTree(points).query(points, k=2)[0][:, 1] * np.sqrt(n)
    assert nearest.min() > 0.9
    # Each ring of the same area holds as many.
    rings = np.floor((points**2).sum(axis=1) * 8).astype(int)
    assert (np.bincount(rings) == n // 8).all()


def test_the_number_of_points_is_whole():
    with pytest.raises(TypeError):
        vogel_disk(2.5)
