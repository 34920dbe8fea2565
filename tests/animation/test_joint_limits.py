"""Limits of joints: closed forms, and that what is cut is inside."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pvibr.animation.joint_limits import JointLimit, Limits
from pvibr.maths import quaternions as quat
from tests.animation.conftest import refused

AXES = arrays(np.float64, 3, elements=st.floats(-1, 1)).filter(lambda a: np.abs(a).max() > 1e-3)
UNITS = arrays(np.float64, (4, 4), elements=st.floats(-1, 1)).filter(
    lambda q: (np.abs(q).max(axis=1) > 1e-3).all()
)
UNITS = UNITS.map(quat.normalized)


@st.composite
def some_limits(draw):
    low = draw(st.floats(-4, 4))
    swing = draw(st.sampled_from([0.0, math.pi]) | st.floats(0, math.pi))
    return JointLimit(tuple(draw(AXES)), swing, (low, low + draw(st.floats(0, 2 * math.pi))))


LIMITS = st.dictionaries(st.integers(0, 3), some_limits())


@given(LIMITS, UNITS, UNITS)
def test_what_is_cut_keeps_the_limits_and_stays(limits, rest, rotations):
    limits = Limits(limits, rest)
    cut = limits.clamped(rotations)
    np.testing.assert_allclose(np.linalg.norm(cut, axis=1), 1, atol=1e-12)
    assert limits.excess(cut).max() < 1e-9
    same = np.abs((limits.clamped(cut) * cut).sum(1))
    np.testing.assert_allclose(same, 1, atol=1e-9)
    free = np.setdiff1d(range(4), limits.limited_joints)
    np.testing.assert_array_equal(cut[free], rotations[free])


@given(LIMITS, UNITS, UNITS)
def test_what_keeps_the_limits_is_not_touched(limits, rest, rotations):
    limits = Limits(limits, rest)
    inside = limits.excess(rotations) == 0
    same = np.abs((limits.clamped(rotations) * rotations).sum(1))
    np.testing.assert_allclose(same[inside], 1, atol=1e-9)


def test_a_swing_of_half_a_turn_has_any_twist():
    limits = Limits({0: JointLimit((0, 0, 1), math.pi, (1.0, 1.0))}, [[1, 0, 0, 0]])
    half_turn = np.array([[0.0, 0.6, 0.8, 0.0]])
    assert limits.excess(half_turn) == 0
    np.testing.assert_allclose(np.abs((limits.clamped(half_turn) * half_turn).sum()), 1)


@pytest.mark.parametrize('low', [-3.0, -0.5, 0.2, 2.0])
@pytest.mark.parametrize('angle', [-3.1, -1.0, 0.0, 0.4, 2.9])
def test_a_hinge_goes_to_the_end_that_is_nearer_round_the_circle(low, angle):
    limits = Limits({0: JointLimit.hinge([0, 1, 0], low, low + 1.0)}, [[1, 0, 0, 0]])
    cut = quat.log(limits.clamped(quat.from_axis_angle([[0, 1, 0]], angle)))[0, 1]

    def away(a, b):
        return abs(math.remainder(a - b, 2 * math.pi))

    expected = min([low, low + 1.0], key=lambda end: away(end, angle))
    if away(angle, low + 0.5) <= 0.5:
        expected = angle
    assert away(cut, expected) < 1e-9


@given(UNITS, AXES, st.floats(0, 3))
def test_a_cone_bounds_where_its_axis_points(rotations, axis, swing):
    limits = Limits(dict.fromkeys(range(4), JointLimit(tuple(axis), swing)), [[1, 0, 0, 0]] * 4)
    turned = Rotation.from_quat(limits.clamped(rotations), scalar_first=True).apply(axis)
    axis = axis / np.linalg.norm(axis)
    cosines = turned @ axis / np.linalg.norm(turned, axis=1)
    assert (cosines >= math.cos(swing) - 1e-9).all()


def test_limits_count_from_rest():
    rest = quat.from_axis_angle([[0, 0, 1]], 1.0)
    limits = Limits({0: JointLimit.hinge([0, 0, 1], 0.0, 0.5)}, rest)
    cut = limits.clamped(quat.from_axis_angle([[0, 0, 1]], 2.0))
    np.testing.assert_allclose(quat.log(cut), [[0, 0, 1.5]], atol=1e-12)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (([0, 0, 0],), 'axis must not be zero'),
        (([0, 0, math.nan],), 'finite'),
        (([0, 1],), r'axis must have shape'),
        (([0, 0, 1], -0.1), 'swing must be from 0 to pi, in radians, got -0.1'),
        (([0, 0, 1], 4.0), 'from 0 to pi'),
        (([0, 0, 1], 1.0, (1.0, 0.0)), r'twist must be .* got \(1.0, 0.0\)'),
        (([0, 0, 1], 1.0, (0.0, 7.0)), '2 pi apart'),
    ],
)
def test_bad_limits_are_named(arguments, message):
    refused(message, JointLimit, *arguments)
