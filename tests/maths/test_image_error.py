"""How far pictures are apart: closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr.maths import image_error as ie


def disc(radius, middle=(32.0, 32.0), size=64, samples=8):
    """Return the coverage of a disc, by samples within each pixel."""
    t = (np.arange(size * samples) + 0.5) / samples
    x, y = np.meshgrid(t, t)
    inside = np.hypot(x - middle[0], y - middle[1]) <= radius
    return ie.box_reduce(inside, samples)


def test_box_reduce():
    image = np.arange(24.0).reshape(4, 6)
    np.testing.assert_allclose(ie.box_reduce(image, 2), [[3.5, 5.5, 7.5], [15.5, 17.5, 19.5]])
    color = np.dstack([image, 2 * image])
    np.testing.assert_allclose(ie.box_reduce(color, 2)[..., 1], 2 * ie.box_reduce(image, 2))
    np.testing.assert_array_equal(ie.box_reduce(image, 1), image)
    assert disc(20).sum() == pytest.approx(np.pi * 400, rel=0.002)


def test_outline_of_a_square():
    square = np.zeros((9, 9))
    square[2:7, 2:7] = 1
    edge = ie.outline(square)
    assert edge.sum() == 16
    assert not edge[3:6, 3:6].any()
    np.testing.assert_array_equal(edge, ie.crossed(square))
    assert ie.outline(np.ones((4, 4))).sum() == 12
    assert not ie.outline(np.zeros((4, 4))).any()


@settings(deadline=None, max_examples=20)
@given(st.floats(3, 25), st.floats(-3, 3), st.floats(-3, 3))
def test_the_same_is_not_displaced(radius, dx, dy):
    smooth = disc(radius, (32 + dx, 32 + dy))
    assert ie.displacements(smooth, smooth).max() == 0
    # One sample a pixel of the same disc is right as well.
    once = disc(radius, (32 + dx, 32 + dy), samples=1)
    assert ie.displacements(once, smooth).max() <= 1


@pytest.mark.parametrize('shift', [2, 5])
def test_what_is_moved_is_displaced_by_that(shift):
    one, other = disc(12), disc(12, (32.0 + shift, 32.0))
    away = ie.displacements(one, other)
    assert away.max() == pytest.approx(shift, abs=1.0)
    np.testing.assert_allclose(np.sort(away), np.sort(ie.displacements(other, one)))


def test_where_an_outline_is_displaced():
    holed = disc(20)
    holed[32, 32] = 0
    pixels, away = ie.outline_distances(holed, disc(20))
    np.testing.assert_array_equal(pixels, np.argwhere(ie.outline(holed)))
    around = np.abs(pixels - 32).sum(1) == 1
    assert around.sum() == 4
    assert away[around].min() >= 17
    assert away[~around].max() == 0


@pytest.mark.parametrize('growth', [2, 4])
def test_what_grows_is_displaced_by_that(growth):
    away = ie.displacements(disc(12), disc(12 + growth))
    assert np.median(away) == pytest.approx(growth, abs=0.8)


def test_displacement_where_one_is_empty():
    empty, one = np.zeros((30, 40)), np.zeros((30, 40))
    one[10:20, 10:20] = 1
    assert ie.displacements(empty, empty).size == 0
    assert ie.displacements(one, empty).max() == 50
    assert ie.displacements(empty, one).max() == 50


def test_overlap():
    one, other = np.zeros((10, 10)), np.zeros((10, 10))
    one[:, :6], other[:, 3:] = 1, 1
    assert ie.silhouette_iou(one, other) == pytest.approx(0.3)
    assert ie.silhouette_iou(one, one) == 1
    assert ie.silhouette_iou(0 * one, 0 * one) == 1
    assert ie.silhouette_iou(one, 0 * one) == 0
    assert ie.silhouette_iou(one * 0.5, one) == pytest.approx(0.5)


def test_psnr():
    image = np.random.default_rng(0).random((8, 8, 3))
    assert ie.psnr(image, image) == float('inf')
    assert ie.psnr(image + 0.1, image) == pytest.approx(20)
    assert ie.psnr(np.ones((2, 2)), np.zeros((2, 2))) == pytest.approx(0)
