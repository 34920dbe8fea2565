"""The octahedral map: its own inverse, and the same on the GPU."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.maths import octahedral
from tests.maths.card_shader import evaluated

HALF = pytest.mark.parametrize('half', [False, True], ids=['full', 'half'])
POINTS = arrays(float, (5, 3), elements=st.floats(-1, 1)).filter(
    lambda a: (np.linalg.norm(a, axis=1) > 1e-3).all()
)
SQUARE = arrays(float, (5, 2), elements=st.floats(-1, 1))


FEW = settings(deadline=None, max_examples=60)


def unit(points):
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


@HALF
@FEW
@given(points=POINTS)
def test_directions_come_back(half, points):
    d = unit(points)
    if half:
        d = unit(d * [1, 1, 0] + [0, 0, 1] * np.abs(d))
    square = octahedral.encode(d, half)
    assert (np.abs(square) <= 1 + 1e-12).all()
    np.testing.assert_allclose(octahedral.decode(square, half), d, atol=1e-12)


@HALF
@FEW
@given(square=SQUARE)
def test_points_of_the_square_come_back(half, square):
    """But for the border, where two points are one direction."""
    square = square * (1 - 1e-9)
    back = octahedral.encode(octahedral.decode(square, half), half)
    inside = (np.abs(square) < 1 - 1e-6).all(1)
    np.testing.assert_allclose(back[inside], square[inside], atol=1e-8)


@HALF
def test_border_is_folded_onto_itself(half):
    t = np.linspace(-1, 1, 9)
    one = octahedral.decode(np.stack([t, np.ones(9)], 1), half)
    if half:
        np.testing.assert_allclose(one[:, 2], 0, atol=1e-12)
    else:
        other = octahedral.decode(np.stack([-t, np.ones(9)], 1))
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_poles_and_axes():
    corners = octahedral.decode([[1, 1], [-1, 1], [1, -1], [-1, -1]])
    np.testing.assert_allclose(corners, [[0, 0, -1]] * 4, atol=1e-12)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    np.testing.assert_allclose(octahedral.decode(octahedral.encode(axes)), axes, atol=1e-12)


def test_below_the_horizon_goes_to_it():
    low = octahedral.encode(unit(np.array([3.0, 4.0, -2.0])), half=True)
    np.testing.assert_allclose(octahedral.decode(low, half=True), [0.6, 0.8, 0], atol=1e-12)


def test_straight_from_below():
    with np.errstate(invalid='ignore'):
        square = octahedral.encode(np.array([0.0, 0.0, -1.0]), half=True)
    assert np.isfinite(square).all()
    assert octahedral.decode(square, half=True)[2] == pytest.approx(0, abs=1e-6)


@HALF
@pytest.mark.parametrize('n', [2, 3, 8, 16])
def test_grid_of_views(half, n):
    views = octahedral.view_directions(n, half)
    assert views.shape == (n, n, 3)
    np.testing.assert_allclose(np.linalg.norm(views, axis=2), 1)
    if half:
        assert (views[..., 2] > -1e-12).all()
    # The grid covers the sphere: nothing is farther from a view than a cell's diagonal.
    d = unit(np.random.default_rng(0).normal(size=(500, 3)))
    d[:, 2] = np.abs(d[:, 2]) if half else d[:, 2]
    nearest = (d @ views.reshape(-1, 3).T).max(1)
    assert np.degrees(np.arccos(nearest.min())) < (150 if half else 215) / (n - 1)


@FEW
@given(points=POINTS)
def test_frames_are_rotations(points):
    d = unit(points)
    axes = octahedral.frame(d)
    np.testing.assert_allclose(
        axes @ np.swapaxes(axes, 1, 2), np.tile(np.eye(3), (5, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(axes), 1)
    np.testing.assert_allclose(axes[:, 2], d)


MAIN = """
void main() {
  vec3 d = texture(points, uv).xyz;
  vec2 square = ibr_encode(d);
  gl_FragData[0] = vec4(square, 0.0, 1.0);
  gl_FragData[1] = vec4(ibr_decode(square), 1.0);
  gl_FragData[2] = vec4(ibr_frame(d) * vec3(1.0, 2.0, 3.0), 1.0);
}
"""


@HALF
def test_shader_is_the_same(half):
    d = unit(np.random.default_rng(1).normal(size=(32, 32, 3)))
    d[0, :5] = np.concatenate([np.eye(3), -np.eye(3)])[:5]
    square, decoded, turned = evaluated(MAIN, d, half=half, count=3)
    expected = octahedral.encode(d, half)
    np.testing.assert_allclose(square[..., :2], expected, atol=2e-6)
    np.testing.assert_allclose(decoded, octahedral.decode(expected, half), atol=2e-6)
    near = np.abs(np.abs(d[..., 2]) - 0.99) > 1e-6  # where rounding may choose the other helper
    np.testing.assert_allclose(turned[near], (octahedral.frame(d) @ [1, 2, 3])[near], atol=2e-5)
