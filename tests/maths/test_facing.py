"""Cards face the eye from everywhere, without jumps; cameras come back from their matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.maths.facing import FACINGS, cards, eye_of
from pvibr.maths.views import look_along

number = st.floats(-1e3, 1e3)
place = arrays(float, 3, elements=number)
direction = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 1e-2)
angle = st.floats(-10, 10)
turns = {f: {'facing': f} for f in FACINGS} | {
    'plane': {'facing': 'spherical', 'towards': 'plane'},
    'upright': {'facing': 'spherical', 'axis': (0, 0, 1)},
    'about x': {'facing': 'cylindrical', 'axis': (1, 0, 0), 'towards': 'plane'},
}


def rolled(eye, ahead, roll):
    """Return a view matrix whose up is any."""
    view = look_along(eye, ahead)
    c, s = np.cos(roll), np.sin(roll)
    turn = np.eye(4)
    turn[:2, :2] = [[c, s], [-s, c]]
    return turn @ view


@given(place, direction, angle)
def test_a_camera_comes_back_from_its_matrix(position, ahead, roll):
    view = rolled(position, ahead, roll)
    eye = eye_of(view)
    ahead = ahead / np.linalg.norm(ahead)
    np.testing.assert_allclose(eye.position, position, atol=1e-9)
    np.testing.assert_allclose(eye.direction, ahead, atol=1e-12)
    np.testing.assert_allclose(np.cross(eye.right, eye.up), -ahead, atol=1e-12)
    # What is one unit up from the eye is up in view space.
    np.testing.assert_allclose(view @ [*(position + eye.up), 1], [0, 1, 0, 1], atol=1e-9)


@pytest.mark.parametrize('turn', turns.values(), ids=turns.keys())
@given(place, place, direction, angle, angle)
def test_axes_are_rotations(turn, point, eye, ahead, roll, rotation):
    (axes,) = cards([point], rolled(eye, ahead, roll), rotation=rotation, **turn)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-10)
    assert np.linalg.det(axes) > 0


@pytest.mark.parametrize('octant', np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(-1, 3))
@settings(max_examples=20)
@given(arrays(float, 3, elements=st.floats(0.3, 3)))
def test_signs_are_right_in_every_octant(octant, away):
    eye = octant * away
    view = look_along(eye, -eye, [0, 0, 1])
    camera = eye_of(view)
    for turn in [t for t in turns.values() if t['facing'] != 'world']:
        (axes,) = cards([[0, 0, 0]], view, **turn)
        assert axes[:, 2] @ eye > 0, turn
        if 'about x' not in turn and turn.get('axis') != (1, 0, 0):
            assert axes[:, 0] @ camera.right > 0.99, turn
            assert axes[:, 1] @ camera.up > 0.05, turn


@given(place, place, direction, angle)
def test_spherical_cards_look_at_the_point(point, eye, ahead, roll):
    if np.linalg.norm(point - eye) < 1e-3:
        return
    (axes,) = cards([point], rolled(eye, ahead, roll))
    toward = (eye - point) / np.linalg.norm(eye - point)
    np.testing.assert_allclose(axes[:, 2], toward, atol=1e-9)


@given(place, place, direction, direction, angle)
def test_cylindrical_cards_keep_their_axis_and_turn_to_the_eye(point, eye, ahead, axis, roll):
    (axes,) = cards([point], rolled(eye, ahead, roll), 'cylindrical', axis=axis)
    unit = axis / np.linalg.norm(axis)
    np.testing.assert_allclose(axes[:, 1], unit, atol=1e-12)
    away = eye - point
    flat = away - unit * (unit @ away)
    if np.linalg.norm(flat) > 1e-3 * max(np.linalg.norm(away), 1e-3):
        # Of all directions about the axis the normal's is the nearest to the eye.
        np.testing.assert_allclose(axes[:, 2] @ flat, np.linalg.norm(flat), rtol=1e-6)


@given(place, direction, angle, place)
def test_screen_cards_are_the_camera(eye, ahead, roll, point):
    view = rolled(eye, ahead, roll)
    (axes,) = cards([point], view, 'screen')
    np.testing.assert_allclose(view[:3, :3] @ axes, np.eye(3), atol=1e-12)


def over_the_pole(steps, span=2.0):
    """Yield view matrices of a camera that goes over the pole, its right always the same."""
    for elevation in np.pi / 2 + np.linspace(-span, span, steps):
        back = np.array([0, -np.cos(elevation), np.sin(elevation)])
        up = np.array([0, np.sin(elevation), np.cos(elevation)])
        view = np.eye(4)
        view[:3, :3] = [[1, 0, 0], up, back]
        view[:3, 3] = -view[:3, :3] @ (7 * back)
        yield view


@pytest.mark.parametrize('towards', ['point', 'plane'])
def test_nothing_jumps_when_the_camera_goes_over_the_pole(towards):
    for facing in ('spherical', 'screen'):
        before = None
        for view in over_the_pole(401):
            (axes,) = cards([[0.3, 0.2, 0.1]], view, facing, towards=towards)
            seen = view[:3, :3] @ axes
            if before is not None:
                assert np.abs(seen - before).max() < 0.02
            before = seen


def test_a_cylindrical_card_covers_the_same_pixels_on_both_sides_of_its_pole():
    # It turns round there; as it is seen edge-on its outline stays where it was.
    before = None
    for view in over_the_pole(4001, span=0.02):
        (axes,) = cards([[0.0, 0, 0]], view, 'cylindrical')
        right, up = (view[:3, :3] @ axes)[:2, :2].T
        corners = [s * right + u * up for s in (-1, 1) for u in (-1, 1)]
        box = np.array([np.min(corners, 0), np.max(corners, 0)])
        if before is not None:
            assert np.abs(box - before).max() < 1e-4
        before = box


@settings(max_examples=20)
@given(direction, angle, st.floats(0.2, np.pi / 2))
def test_nothing_jumps_wherever_the_camera_goes_round(pole, start, span):
    """A camera goes over any point of the sphere; what it sees of cards turns little by little."""
    pole = pole / np.linalg.norm(pole)
    across = np.cross(pole, np.eye(3)[np.abs(pole).argmin()])
    across /= np.linalg.norm(across)
    right = np.cos(start) * across + np.sin(start) * np.cross(pole, across)
    steps = np.linspace(-span, span, 30)
    before: dict = {}
    for step in steps:
        back = np.cos(step) * pole + np.sin(step) * np.cross(right, pole)
        view = np.eye(4)
        view[:3, :3] = [right, np.cross(back, right), back]
        view[:3, 3] = -view[:3, :3] @ (7 * back)
        for facing in ('spherical', 'screen'):
            (axes,) = cards([[0.0, 0, 0]], view, facing)
            seen = view[:3, :3] @ axes
            assert np.abs(seen - before.get(facing, seen)).max() < 2 * (steps[1] - steps[0])
            before[facing] = seen


@given(angle)
def test_where_camera_and_axis_align_the_camera_says_what_is_right(roll):
    view = rolled([0, 0, 5], [0, 0, -1], roll)
    eye = eye_of(view)
    for facing in ('cylindrical', 'spherical'):
        for parallel in (False, True):
            (axes,) = cards([[0, 0, 0]], view, facing, axis=[0, 0, 1], parallel=parallel)
            np.testing.assert_allclose(axes[:, 0], eye.right, atol=1e-12)


def test_a_point_at_the_eye_faces_the_view_plane():
    (axes,) = cards([[1, 2, 3]], look_along([1, 2, 3], [0, 1, 0], [0, 0, 1]))
    np.testing.assert_allclose(axes[:, 2], [0, -1, 0], atol=1e-12)


def test_rotation_is_counter_clockwise_as_seen_from_the_eye():
    view = look_along([0, 0, 5], [0, 0, -1], [0, 1, 0])
    (axes,) = cards([[0, 0, 0]], view, rotation=np.pi / 2)
    np.testing.assert_allclose(axes[:, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(axes[:, 1], [-1, 0, 0], atol=1e-12)


def test_world_cards_take_orientations():
    half = np.sqrt(0.5)
    axes = cards(
        [[0, 0, 0]] * 2, np.eye(4), 'world', orientation=[[1, 0, 0, 0], [half, half, 0, 0]]
    )
    np.testing.assert_allclose(axes[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes[1][:, 2], [0, -1, 0], atol=1e-12)
