"""Kernels: closed forms of their moments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pvibr.maths.kernels import gaussian_weights, vogel_disk


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


@given(st.integers(0, 40), st.floats(0.01, 100))
def test_weights_are_symmetric_and_add_up(radius, sigma):
    weights = gaussian_weights(radius, sigma)
    assert weights.shape == (2 * radius + 1,)
    np.testing.assert_allclose(weights.sum(), 1)
    np.testing.assert_array_equal(weights, weights[::-1])
    assert (np.diff(weights[radius:]) <= 0).all()


@pytest.mark.parametrize('sigma', [0.8, 1, 2.5, 7])
def test_variance_is_sigma_squared(sigma):
    radius = int(np.ceil(7 * sigma))
    weights = gaussian_weights(radius, sigma)
    variance = weights @ np.arange(-radius, radius + 1) ** 2
    # The sum over a grid is the integral but for exp(-2 pi^2 sigma^2).
    np.testing.assert_allclose(variance, sigma**2, rtol=100 * np.exp(-19.7 * sigma**2) + 1e-9)


@pytest.mark.parametrize('radius', [1, 2, 5, 20])
def test_little_is_cut_off_unless_asked(radius):
    weights = gaussian_weights(radius)
    assert weights[0] < 0.14 * weights[radius]
    wide = gaussian_weights(10 * radius, (radius + 0.5) / 3)
    assert wide[9 * radius : 11 * radius + 1].sum() > 0.99


def test_bad_input_is_named():
    with pytest.raises(ValueError, match='n is 0'):
        vogel_disk(0)
    with pytest.raises(ValueError, match='radius is -1'):
        gaussian_weights(-1)
    for sigma in (0, -1, np.nan, np.inf):
        with pytest.raises(ValueError, match='sigma is'):
            gaussian_weights(3, sigma)
    with pytest.raises(TypeError):
        vogel_disk(2.5)
