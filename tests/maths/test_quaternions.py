"""Quaternions: against SciPy's rotations, closed forms and inverses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pvibr.maths import quaternions as quat

ANY = arrays(np.float64, (5, 4), elements=st.floats(-1, 1)).filter(
    lambda q: (np.abs(q).max(axis=1) > 1e-3).all()
)
UNIT = ANY.map(quat.normalized)
VECTORS = arrays(np.float64, (5, 3), elements=st.floats(-1, 1)).filter(
    lambda v: (np.abs(v).max(axis=1) > 1e-3).all()
)


def scipy(q):
    return Rotation.from_quat(q, scalar_first=True)


def same(a, b, atol=1e-12):
    """Whether two arrays of quaternions are the same rotations."""
    np.testing.assert_allclose(a * np.sign((a * b).sum(-1, keepdims=True)), b, atol=atol)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@given(ANY, st.sampled_from([1e-200, 1e-9, 1.0, 1e9, 1e200]))
def test_matrices_agree_with_scipy_at_any_length(q, length):
    matrices = quat.to_matrices(q * length)
    np.testing.assert_allclose(matrices, scipy(q).as_matrix(), atol=1e-12)
    same(quat.from_matrices(matrices), quat.normalized(q))


@given(UNIT, UNIT, VECTORS)
def test_products_and_turned_vectors_agree_with_scipy(a, b, v):
    same(quat.multiply(a, b), (scipy(a) * scipy(b)).as_quat(scalar_first=True))
    np.testing.assert_allclose(quat.rotate(a, v), scipy(a).apply(v), atol=1e-12)
    np.testing.assert_allclose(quat.rotate(quat.conjugate(a), quat.rotate(a, v)), v, atol=1e-12)


@given(UNIT)
def test_rotation_vectors_agree_with_scipy_and_come_back(q):
    vectors = quat.log(q)
    assert (np.linalg.norm(vectors, axis=1) <= np.pi + 1e-9).all()
    same(quat.exp(vectors), q)
    away = np.abs(q[:, 0]) > 1e-6  # At a half turn the axis has two signs.
    np.testing.assert_allclose(vectors[away], scipy(q).as_rotvec()[away], atol=1e-9)


@pytest.mark.parametrize('angle', [0, 1e-300, 1e-12, 1e-7])
def test_small_rotations_keep_their_digits(angle):
    np.testing.assert_allclose(quat.log(quat.exp([0, angle, 0])), [0, angle, 0], rtol=1e-12)


@given(VECTORS, st.floats(-7, 7))
def test_axis_and_angle(axes, angle):
    expected = Rotation.from_rotvec(unit(axes) * angle).as_quat(scalar_first=True)
    same(quat.from_axis_angle(axes * 1e-160, angle), expected)


@given(VECTORS, VECTORS)
def test_between_is_the_shortest_way(u, v):
    q = quat.between(u, v)
    np.testing.assert_allclose(quat.rotate(q, unit(u)), unit(v), atol=1e-7)
    angles = np.arccos(np.clip((unit(u) * unit(v)).sum(1), -1, 1))
    np.testing.assert_allclose(np.linalg.norm(quat.log(q), axis=1), angles, atol=1e-7)


@given(VECTORS, st.sampled_from([0, 1e-300, 1e-17, 1e-12, 1e-9, 1e-8, 1e-7, 1e-3]))
def test_between_nearly_opposite_directions(u, off):
    v = -u + off * unit(np.cross(u, np.eye(3)[np.abs(u).argmin(1)]))
    q = quat.between(u, v)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(quat.rotate(q, unit(u)), unit(v), atol=1e-7)


@given(UNIT, UNIT, st.floats(0, 1))
def test_slerp_is_uniform_and_shortest(a, b, t):
    q = quat.slerp(a, b, t)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-12)

    def angle(x, y):
        return np.linalg.norm(quat.log(quat.multiply(x, quat.conjugate(y))), axis=1)

    np.testing.assert_allclose(angle(q, a), t * angle(a, b), atol=1e-7)
    np.testing.assert_allclose(angle(q, b), (1 - t) * angle(a, b), atol=1e-7)


def test_slerp_ends_and_axes():
    a, b = quat.normalized([[1, 2, 3, 4], [4, -3, 2, 1]])
    same(quat.slerp(a, b, [0.0, 1.0]), np.stack([a, b]))
    assert quat.slerp(a, b, np.zeros((2, 3))).shape == (2, 3, 4)
    same(quat.slerp(a, -a, 0.3), a)


@given(UNIT, VECTORS)
def test_swing_and_twist_make_the_whole(q, axis):
    swing, twist = quat.swing_twist(q, axis)
    same(quat.multiply(swing, twist), q)
    np.testing.assert_allclose((swing[:, 1:] * unit(axis)).sum(1), 0, atol=1e-9)
    np.testing.assert_allclose(np.cross(twist[:, 1:], unit(axis)), 0, atol=1e-9)


def test_a_half_turn_of_the_axis_has_no_twist():
    swing, twist = quat.swing_twist([0, 1, 0, 0], [0, 0, 1])
    assert twist.tolist() == [1, 0, 0, 0]
    assert swing.tolist() == [0, 1, 0, 0]


def test_no_rows():
    none = np.zeros((0, 4))
    assert quat.to_matrices(none).shape == (0, 3, 3)
    assert quat.from_matrices(np.zeros((0, 3, 3))).shape == (0, 4)
    assert quat.slerp(none, none, 0.5).shape == (0, 4)
    assert quat.between(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0, 4)
