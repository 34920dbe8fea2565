"""Warps of pictures to other views."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.maths.views import look_along, perspective
from pvibr.substitutes.layer_maths import (
    extents,
    fit_affine,
    fit_plane,
    moved,
    part_of,
    plane_warp,
    reaches,
    split_by_depth,
    stretch,
    to_screen,
)

SIZE = 640, 360
NUMBERS = st.floats(-3, 3)


def camera(eye=(0, 0, 9), direction=(0, 0, -1), up=(0, 1, 0)):
    """Return clip from view and view from world of a view of 640 by 360 pixels."""
    clip = perspective((0, 0, 0), (0, 0, -1), 0.4, 0.1, 100.0).clip_from_view.copy()
    clip[0, 0] *= SIZE[1] / SIZE[0]
    return clip, look_along(eye, direction, up)


def homogeneous(points):
    return np.concatenate([points, np.ones((len(points), 1))], 1)


@given(st.lists(NUMBERS, min_size=6, max_size=6), st.integers(0, 99))
def test_an_affine_map_is_found_again(numbers, seed):
    matrix = np.eye(3)
    matrix[:2] += np.reshape(numbers, (2, 3))
    points = 100 * np.random.default_rng(seed).random((20, 2))
    assert np.allclose(fit_affine(points, moved(matrix, points)), matrix, atol=1e-6)


@given(st.integers(0, 99))
def test_no_affine_map_is_nearer_in_squares(seed):
    rng = np.random.default_rng(seed)
    source, target = 100 * rng.random((2, 12, 2))
    warp = fit_affine(source, target)
    least = ((moved(warp, source) - target) ** 2).sum()
    for _ in range(8):
        other = warp.copy()
        other[:2] += 1e-3 * rng.standard_normal((2, 3))
        assert ((moved(other, source) - target) ** 2).sum() >= least


@pytest.mark.parametrize('count', [0, 1, 2, 9])
def test_too_few_points_and_those_on_a_line_only_shift_or_stretch_along_it(count):
    line = np.stack([np.arange(count) * 10.0, np.full(count, 5.0)], 1)
    warp = fit_affine(line, line + np.array([7.0, -2.0]))
    assert np.allclose(warp[:2, :2], np.eye(2))
    if count:
        assert np.allclose(warp[:2, 2], [7.0, -2.0])


def test_a_plane_is_warped_exactly_wherever_the_eye_goes():
    clip, view = camera()
    other = look_along((1.0, 0.5, 8.0), (-0.1, 0.05, -1), (0.1, 1, 0))
    rng = np.random.default_rng(0)
    places = np.c_[rng.random((40, 2)) * 4 - 2, np.zeros(40)]
    places[:, 2] = 0.3 * places[:, 0] - 0.4 * places[:, 1]
    seen = homogeneous(places) @ view.T
    pixels, _ = to_screen(seen @ clip.T, SIZE)
    plane = fit_plane(pixels, -1 / seen[:, 2])
    turn = clip @ other @ np.linalg.inv(view)
    there, ahead = to_screen(seen @ turn.T, SIZE)
    assert ahead.all()
    warp = plane_warp(turn, from_pixel(clip), plane, SIZE, parallel=False)
    assert np.allclose(moved(warp, pixels), there, atol=1e-6)


def from_pixel(clip):
    out = np.eye(3)
    for k, n in enumerate(SIZE):
        out[k, k], out[k, 2] = 2 / n / clip[k, k], -1 / clip[k, k]
    return out


def test_where_the_eye_stays_every_depth_is_warped_exactly():
    clip, view = camera()
    other = look_along((0, 0, 9), (0.2, 0.1, -1), (0.1, 1, 0))
    places = np.random.default_rng(0).random((40, 3)) * [3, 2, 5]
    seen = homogeneous(places) @ view.T
    pixels, _ = to_screen(seen @ clip.T, SIZE)
    turn = clip @ other @ np.linalg.inv(view)
    warp = plane_warp(turn, from_pixel(clip), np.zeros(3), SIZE, parallel=False)
    assert np.allclose(moved(warp, pixels), to_screen(seen @ turn.T, SIZE)[0], atol=1e-6)


def test_what_is_behind_the_eye_is_nowhere_on_the_screen():
    clip, view = camera()
    places = homogeneous(np.array([[0.0, 0, 0], [0, 0, 20], [0, 0, 9], [0, 0, 8.95]]))
    _, ahead = to_screen(places @ (clip @ view).T, SIZE)
    assert ahead.tolist() == [True, False, False, False]


def test_boxes_through_the_eye_cover_what_is_before_the_near_plane():
    clip, view = camera()
    boxes = [[-1, 1, -1, 1, -1, 1], [-50, 50, -1, -0.5, -50, 50], [-1, 1, -1, 1, 20, 30]]
    found = extents(clip @ view, boxes, SIZE)
    corners = homogeneous(np.array([[x, y, 1.0] for x in (-1, 1) for y in (-1, 1)]))
    at, _ = to_screen(corners @ (clip @ view).T, SIZE)
    assert np.allclose(found[0], [*at.min(0), *at.max(0)])
    left, bottom, right, top = found[1]
    assert left < 0
    assert right > SIZE[0]
    assert bottom < 0
    assert top < SIZE[1] / 2
    assert found[2, 0] > found[2, 2]


@given(st.integers(0, 99))
def test_a_part_of_the_screen_shows_things_where_they_were(seed):
    clip, view = camera()
    places = homogeneous(np.random.default_rng(seed).random((9, 3)))
    whole, _ = to_screen(places @ (clip @ view).T, SIZE)
    rect = -100.0, 20.0, 700.0, 320.0
    part, _ = to_screen(places @ (part_of(clip, SIZE, rect) @ view).T, (800, 300))
    assert np.allclose(part + rect[:2], whole)


def test_a_picture_that_was_cut_must_reach_beyond_the_screen():
    rect, cut = (-50.0, -50.0, 690.0, 410.0), (True, True, True, True)
    shift = np.eye(3)
    assert reaches(shift, rect, cut, SIZE)
    shift[0, 2] = 49.0
    assert reaches(shift, rect, cut, SIZE)
    shift[0, 2] = 51.0
    assert not reaches(shift, rect, cut, SIZE)
    assert reaches(shift, rect, (False, True, True, True), SIZE)
    assert not reaches(np.zeros((3, 3)), rect, cut, SIZE)


def test_how_much_a_warp_stretches():
    assert stretch(np.diag([2.0, 0.5, 1.0]), (3, 4)) == pytest.approx((2.0, 0.5))
    assert stretch(np.diag([2.0, 2.0, 2.0]), (3, 4)) == pytest.approx((1.0, 1.0))
    assert stretch(np.diag([1.0, 1.0, -1.0]), (3, 4)) == (np.inf, 0.0)


def test_layers_by_depth_keep_the_order_and_leave_the_ground_to_itself():
    rng = np.random.default_rng(0)
    near = np.exp(rng.random(50) * 4)
    near[7] = 0.5
    far = near * 1.2
    far[7] = 100.0
    found = split_by_depth(near, far, 4)
    assert found[7] == 4
    others = np.delete(np.arange(50), 7)
    order = others[np.argsort(near[others])]
    assert (np.diff(found[order]) >= 0).all()
    assert set(found[others].tolist()) == {0, 1, 2, 3}


def test_one_box_and_equal_ones_are_one_layer():
    assert len(set(split_by_depth(np.array([2.0]), np.array([3.0]), 4).tolist())) == 1
    assert len(set(split_by_depth(np.full(5, 2.0), np.full(5, 3.0), 4).tolist())) == 1
