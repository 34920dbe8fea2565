"""The error of a card against rays, closed forms and random points."""

import numpy as np
import pytest

from pvibr.substitutes.impostor_maths import (
    box_corners,
    card_view,
    displacement,
    dop_corners,
    fit_cards,
    stretch_of,
)

RNG = np.random.default_rng(6)
CUBE = box_corners(np.eye(3)[None])


def boxes(n, offset=0.0):
    center = RNG.normal(size=(n, 3)) * 3 + offset
    turn = np.linalg.qr(RNG.normal(size=(n, 3, 3)))[0]
    half = turn * RNG.uniform(0.2, 1.0, (n, 3, 1))
    return center, half, np.linalg.norm(half, axis=(1, 2))


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


@pytest.mark.parametrize('toward', [None, np.array([0.6, 0.0, 0.8])])
def test_the_rectangle_is_the_smallest_that_holds_the_box(toward):
    center, half, radius = boxes(20)
    eye = np.array([30.0, -20.0, 10.0])
    card = fit_cards(center, box_corners(half), radius, eye, [0, 0, 1], toward)
    for k in range(20):
        view = card_view(card, k, np.zeros(2), parallel=toward is not None)
        points = np.c_[center[k] + box_corners(half)[k], np.ones(8)]
        clip = points @ (view.clip_from_view @ view.view_from_world).T
        seen = clip[:, :3] / clip[:, 3:]
        assert seen[:, :2].min(0) == pytest.approx([-1, -1])
        assert seen[:, :2].max(0) == pytest.approx([1, 1])
        assert np.abs(seen[:, 2]).max() <= 1


@pytest.mark.parametrize('offset', [0.0, 1e6])
def test_no_point_of_the_box_is_displaced_by_more_than_is_said(offset):
    center, half, radius = boxes(30, offset)
    eye = np.array([25.0, -20.0, 10.0]) + offset
    card = fit_cards(center, box_corners(half), radius, eye, [0, 0, 1])
    for _ in range(5):
        now = eye + RNG.normal(size=3)
        said = displacement(card, now)
        share = RNG.uniform(-1, 1, (30, 500, 3))
        point = center[:, None] + np.einsum('nki,nij->nkj', share, half)
        ray = point - eye
        back = card.axes[:, 2]
        length = np.einsum('nki,ni->nk', ray, -back)
        place = eye + ray * (card.away[:, None] / length)[..., None]
        found = angle(point - now, place - now).max(1)
        assert (found <= said * (1 + 1e-9) + 1e-12).all()
        assert (said < 6 * found).all()  # and it is no mere guess


def test_parallel_displacement_is_depth_times_sine():
    center, half, radius = boxes(10)
    toward = np.array([0.0, 0.0, 1.0])
    card = fit_cards(center, box_corners(half), radius, np.zeros(3), [0, 1, 0], toward)
    turned = np.array([np.sin(0.1), 0.0, np.cos(0.1)])
    assert displacement(card, np.zeros(3), turned) == pytest.approx(card.depth * np.sin(0.1))


def test_schauflers_errors_in_closed_form():
    thin = box_corners(np.eye(3)[None] * [1e-9, 1e-9, 1])
    card = fit_cards(np.zeros((1, 3)), thin, np.ones(1), [0, 0, 9], [0, 1, 0])
    sideways = displacement(card, [0.5, 0, 9])[0]
    assert sideways == pytest.approx(np.arctan(0.5 / 8) - np.arctan(0.5 / 9), rel=1e-6)
    flat = fit_cards(np.zeros((1, 3)), CUBE, np.ones(1), [0, 0, 9], [0, 1, 0])
    nearer = displacement(flat, [0, 0, 8])[0]
    rim = np.hypot(*flat.high[0])  # seen at the near side, and on the card
    assert nearer == pytest.approx(np.arctan(rim * 8 / 9 / 7) - np.arctan(rim / 8), rel=1e-9)


def test_an_eye_within_the_depth_has_no_image():
    card = fit_cards(np.zeros((1, 3)), CUBE, np.ones(1), [0, 0, 9], [0, 1, 0])
    assert displacement(card, [0, 0, 0.9])[0] == np.inf


def test_small_angles_are_longer_beside_the_middle():
    middle = np.array([[0.0, 0, -5], [5.0, 0, -5]])
    assert stretch_of(middle, np.zeros(2), 9.0) == pytest.approx([1.0, 2.0])
    assert stretch_of(middle, np.zeros(2), 0.5) == pytest.approx([1.0, 1.25])


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e9])
@pytest.mark.parametrize('flat', [(1, 1, 1), (1, 1, 0), (1, 0, 0)])
def test_a_dop_holds_all_points_and_little_more(flat, scale):
    points = RNG.normal(size=(500, 3)) * flat * scale + 3 * scale
    corners = dop_corners(points)
    size = np.ptp(points, axis=0).max()
    for direction in RNG.normal(size=(40, 3)):
        direction /= np.linalg.norm(direction)
        inner, outer = (points @ direction).max(), (corners @ direction).max()
        assert -1e-9 * size <= outer - inner <= 0.2 * size


def test_a_dop_of_one_point_is_that_point():
    assert dop_corners([[1.0, 2.0, 3.0]] * 4) == pytest.approx(np.tile([1.0, 2.0, 3.0], (80, 1)))
