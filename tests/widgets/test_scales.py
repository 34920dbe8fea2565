"""Sliders: every stop is allowed, no stop is lost, and wide ranges are in decades."""

import itertools
import math

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

import pvibr
from pvibr.core.effect import Effect
from pvibr.core.params import Param, params_of
from pvibr_widgets.scales import REACH, STOPS, Scale, scale_of

KINDS = [
    k for n in pvibr.__all__ if isinstance(k := getattr(pvibr, n), type) and issubclass(k, Effect)
]
NUMBERS = {
    f'{kind.__name__}.{name}': param
    for kind in KINDS
    for name, param in params_of(kind).items()
    if param.choices is None and param.kind in (int, float)
}


def check(param, scale):
    assert all(param.check(number) == number for number in scale.numbers)
    assert list(scale.numbers) == sorted(set(scale.numbers))
    assert 1 <= scale.last <= STOPS
    assert [scale.stop(scale.at(i)) for i in range(scale.last + 1)] == [*range(scale.last + 1)]


@pytest.mark.parametrize('param', NUMBERS.values(), ids=list(NUMBERS))
@pytest.mark.parametrize('size', [1e-9, 10.0, 1e9])
def test_every_stop_of_every_setting_is_allowed(param, size):
    scale = scale_of(param, size)
    check(param, scale)
    if param.default:
        near = scale.at(scale.stop(param.default))
        assert near == pytest.approx(param.default, rel=0.2, abs=(scale.high - scale.low) / STOPS)


@given(
    st.floats(-1e6, 1e6),
    st.floats(0.001, 1e6) | st.just(math.inf),
    st.sampled_from('[('),
    st.booleans(),
    st.sampled_from(['', *REACH]),
    st.floats(0, 1),
    st.booleans(),
)
@example(-3.0, 1.0, '[', True, 'world', 0.0, False)  # [-3, 0): what is in reach is no number of it
@example(-2.0, 1.0, '[', True, 'world', 0.0, False)
@example(-5e-324, math.inf, '[', False, '', 0.0, True)
def test_any_range(low, width, bracket, whole, unit, share, given_default):
    if whole:
        low, width = math.floor(low), width if math.isinf(width) else math.ceil(width) + 2
    high = low + width
    kind = int if whole else float
    default = kind(low + share * min(width, 1e3)) if given_default else None
    param = Param(default, 'Any.', range=f'{bracket}{low!r}, {high!r})', unit=unit, kind=kind)
    assume(default is None or param._is_allowed(default))
    check(param, scale_of(param))


@pytest.mark.parametrize(
    ('param', 'low', 'high', 'log'),
    [
        (Param(1.0, '', range='[0, 1]'), 0, 1, False),
        (Param(2048, '', range='[16, 16384]'), 16, 16384, True),
        (Param(2.0, '', range='(0, inf)'), 0.2, 20, True),
        (Param(None, '', range='(0, inf)', unit='world', kind=float), 0.005, 50, True),
        (Param(None, '', range='(-inf, inf)', unit='s', kind=float), -10, 10, False),
        (Param(0.0, '', unit='degrees'), -180, 180, False),
        (Param(1.0, '', range='[0, inf)'), 0, 4, False),
        (Param(1.0, '', range='[0, 1000]'), 0, 4, False),
    ],
)
def test_ends_that_people_want(param, low, high, log):
    scale = scale_of(param, size=5.0)
    assert (scale.low, scale.high) == pytest.approx((low, high))
    assert scale.log == log


def test_decades_have_equal_ratios():
    numbers = Scale(0.01, 100, log=True).numbers
    assert max(b / a for a, b in itertools.pairwise(numbers)) < 1.06
    assert numbers[len(numbers) // 2] == 1.0


@given(st.floats(-1e9, 1e9))
def test_grows_with_a_value_beyond_its_ends(number):
    scale = Scale(0.1, 10, log=True).holding(number)
    assert scale.low <= number <= scale.high
    step = 0 if scale.log else (scale.high - scale.low) / STOPS
    assert scale.at(scale.stop(number)) == pytest.approx(number, rel=0.1, abs=step)
    assert scale.log == (number > 0)


def test_stops_are_taken_as_near_as_they_go():
    scale = Scale(1, 4, whole=True)
    assert scale.numbers == (1, 2, 3, 4)
    assert (scale.at(-5), scale.at(99), scale.at(1.4)) == (1, 4, 2)
    assert (scale.stop(-5), scale.stop(99), scale.stop(2.6)) == (0, 3, 2)
