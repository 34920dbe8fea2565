"""Weights of key frames: closed forms, continuity, rounds."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from pvibr.animation.keyframes import SLOTS, blend, blend_directions, frame_weights

gaps = st.lists(st.floats(0.1, 3), min_size=1, max_size=8)
seconds = st.floats(-30, 30)
smooth = st.sampled_from(['linear', 'quadratic', 'cubic'])
any_kind = st.sampled_from(list(SLOTS))


def keys_of(gaps, start=0.0):
    return start + np.cumsum([0.0, *gaps])


def shown(values, keys, times, kind, period=None):
    return blend(values, *frame_weights(keys, times, kind, period))


@given(gaps, seconds, any_kind, st.one_of(st.none(), st.floats(0, 2)))
def test_weights_add_up_and_frames_exist(gaps, time, kind, rest):
    keys = keys_of(gaps)
    indices, weights = frame_weights(keys, time, kind, rest if rest is None else keys[-1] + rest)
    assert indices.shape == weights.shape == (SLOTS[kind],)
    assert ((indices >= 0) & (indices < len(keys))).all()
    np.testing.assert_allclose(weights.sum(), 1, atol=1e-9)


@given(gaps, any_kind, st.booleans())
def test_each_frame_is_shown_at_its_key(gaps, kind, turning):
    keys = keys_of(gaps, start=-1.5)
    values = np.random.default_rng(0).normal(size=(len(keys), 2, 3))
    period = np.ptp(keys) + 0.7 if turning else None
    np.testing.assert_allclose(shown(values, keys, keys, kind, period), values, atol=1e-9)


@given(gaps, seconds, st.integers(0, 2))
def test_motions_up_to_its_degree_are_exact(gaps, time, degree):
    keys = keys_of(gaps)
    degree = min(degree, len(keys) - 1)
    inside = np.clip(time, keys[0], keys[-1])
    for kind in ('linear', 'quadratic', 'cubic')[max(degree - 1, 0) :]:
        np.testing.assert_allclose(
            shown(keys**degree, keys, time, kind), inside**degree, atol=1e-7
        )


def test_at_even_keys_the_cubic_is_that_of_catmull_and_rom():
    w = np.linspace(0, 0.999, 50)
    values = np.array([3.0, -1.0, 4.0, 1.0, 5.0])
    slopes = (values[[2, 3]] - values[[0, 1]])[:, None] / 2
    spline = CubicHermiteSpline([1, 2], values[1:3], [slopes[0, 0], (values[3] - values[1]) / 2])
    np.testing.assert_allclose(shown(values, np.arange(5.0), 1 + w, 'cubic'), spline(1 + w))


@given(gaps, st.one_of(st.none(), st.floats(0.01, 2)), smooth)
def test_there_are_no_jumps(gaps, rest, kind):
    keys = keys_of(gaps)
    values = np.random.default_rng(1).normal(size=len(keys))
    period = None if rest is None else keys[-1] + rest
    places = np.append(keys, keys[-1] + (rest or 0.0))
    before = shown(values, keys, places - 1e-9, kind, period)
    np.testing.assert_allclose(before, shown(values, keys, places, kind, period), atol=1e-5)


@given(st.lists(st.floats(0.3, 3), min_size=3, max_size=8), st.floats(0.3, 2))
def test_the_cubic_has_no_bends(gaps, rest):
    keys = keys_of(gaps)
    values = np.random.default_rng(2).normal(size=len(keys))
    h = 1e-5
    around = np.stack([keys - h, keys, keys + h])
    before, at, after = shown(values, keys, around, 'cubic', keys[-1] + rest)
    np.testing.assert_allclose((after - at) / h, (at - before) / h, atol=0.02)


@given(gaps, st.floats(0, 2), st.integers(-5, 5), any_kind, st.floats(0, 20))
def test_rounds_are_alike(gaps, rest, turns, kind, time):
    keys = keys_of(gaps)
    values = np.random.default_rng(3).normal(size=len(keys))
    period = keys[-1] + rest
    near = np.abs((time - np.append(keys, period)) % period)
    assume(np.minimum(near, period - near).min() > 1e-6)
    once, later = shown(values, keys, np.array([time, time + turns * period]), kind, period)
    np.testing.assert_allclose(later, once, atol=1e-5)


def test_a_last_frame_that_stands_for_the_first_is_left_out():
    indices, weights = frame_weights([0, 1, 2], 1.5, 'linear', period=2.0)
    assert indices.tolist() == [1, 0]
    assert weights.tolist() == [0.5, 0.5]
    indices, _ = frame_weights([0, 1, 2], np.linspace(0, 2, 20), 'cubic', period=2.0)
    assert indices.max() == 1


@pytest.mark.parametrize('kind', SLOTS)
@pytest.mark.parametrize('n', [1, 2])
def test_few_frames(kind, n):
    values = np.array([5.0, 7.0])[:n]
    keys = np.arange(float(n))
    times = np.array([-1.0, 0.5, 9.0])
    last = values[-1]
    middle = 5.0 if kind == 'step' or n == 1 else 6.0
    np.testing.assert_allclose(shown(values, keys, times, kind), [5, middle, last])
    assert np.isfinite(shown(values, keys, times, kind, period=n + 0.5)).all()


def test_many_times_at_once():
    keys, times = np.arange(6.0), np.linspace(-2, 9, 60).reshape(3, 4, 5)
    indices, weights = frame_weights(keys, times, 'cubic', 6.5)
    assert indices.shape == (3, 4, 5, 4)
    one = frame_weights(keys, times[1, 2, 3], 'cubic', 6.5)
    np.testing.assert_array_equal(indices[1, 2, 3], one[0])
    np.testing.assert_array_equal(weights[1, 2, 3], one[1])


def test_directions_that_cancel_are_zero():
    out = blend_directions([[1.0, 0, 0], [-1.0, 0, 0]], [0, 1], [[0.5, 0.5], [0.75, 0.25]])
    np.testing.assert_array_equal(out, [[0, 0, 0], [1, 0, 0]])
