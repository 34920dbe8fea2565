"""Curves: straight lines, exact integrals, values that go elsewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation.curves import Curve
from tests.animation.conftest import refused

goes = st.lists(
    st.tuples(st.floats(0, 9), st.floats(-2, 2), st.floats(0.1, 3)), min_size=1, max_size=6
)


def gone(goes):
    curve = Curve([0.5])
    for at, value, fade in sorted(goes):
        curve.go(value, at, fade)
    return curve


@given(goes)
def test_a_curve_goes_without_jumps(goes):
    curve = gone(goes)
    times = np.linspace(-1, 13, 14001)
    assert np.abs(np.diff(curve.at(times))).max() <= 0.001 * 4 / 0.1 + 1e-9
    assert curve.at(-1) == 0.5
    assert curve.at(13.0) == pytest.approx(sorted(goes)[-1][1])


@given(goes, st.floats(-2, 14))
def test_the_integral_is_that_of_the_curve(goes, time):
    curve = gone(goes)
    corners = np.sort(np.append(curve.times[(curve.times < time) & (curve.times > 0)], [0, time]))
    middles = curve.at((corners[1:] + corners[:-1]) / 2)  # exact for lines
    exact = np.sign(time) * (middles * np.diff(corners)).sum()
    assert curve.integral(time) == pytest.approx(exact, abs=1e-9)


def test_values_may_be_vectors_and_times_of_any_shape():
    curve = Curve([[0.0, 1, 2], [2, 1, 0]], [0, 2])
    times = np.linspace(-1, 3, 20).reshape(4, 5)
    assert curve.at(times).shape == curve.integral(times).shape == (4, 5, 3)
    np.testing.assert_allclose(curve.at(times).sum(-1), 3)
    np.testing.assert_allclose(curve.integral(times)[2, 3], curve.integral(times[2, 3]))
    np.testing.assert_allclose(curve.integral(times).sum(-1), 3 * times)


def test_bad_input_is_named():
    refused(r'values must be \(1, ...\), got \(\)', Curve, 1.0)
    refused(r'values\[0\] must .*got inf', Curve, [np.inf])
    refused(r'times must increase, got 0\.0 after 0\.0 at times\[1\]', Curve, [0, 1], [0, 0])
    refused(r'not before the first key, 0\.0 s, got -1\.0', Curve([0]).go, 1.0, at=-1.0)
    refused(r'fade must .*got 0', Curve([0]).go, 1.0, at=1.0, fade=0)
    curve = Curve([0])
    refused('finite', curve.go, np.nan, at=1.0)
    assert curve.at(2.0) == 0
