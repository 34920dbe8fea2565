"""Mapping of numbers to slider stops: finite ends, and decades for wide ranges."""

from __future__ import annotations

import bisect
import functools
import math
from dataclasses import dataclass

from pvibr.core.params import Interval

#: How far numbers of a unit usually go; those of the world are shares of the scene's size.
REACH = {
    'px': 32,
    'texels': 64,
    'degrees': 180,
    'ms': 100,
    's': 10,
    'Hz': 60,
    '1/s': 60,
    'stops': 8,
    'bytes': 2.0**30,
    'world': 0.1,
}
#: The last stop of a slider, unless there are fewer whole numbers.
STOPS = 200
_TINY = 1e-300  # a smaller default is no size: what is derived from it would be rounded away
_FAR = 50  # a larger ratio of ends, or of an end to the default, is shown in decades


@dataclass(frozen=True)
class Scale:
    """The ends of a slider and its stops."""

    low: float
    high: float
    log: bool = False
    whole: bool = False

    @functools.cached_property
    def numbers(self) -> tuple:
        """The distinct values of the stops, in order."""
        steps = STOPS if self.log or not self.whole else min(STOPS, max(self.high - self.low, 1))
        shares = [i / round(steps) for i in range(round(steps) + 1)]
        if self.log:
            found = [float(f'{self.low * (self.high / self.low) ** s:.3g}') for s in shares]
        else:
            span = self.high - self.low
            digits = 1 - math.floor(math.log10(span / steps)) if span else 0
            found = [round(self.low + span * s, digits) for s in shares]
        found = [min(max(x, self.low), self.high) for x in found]
        return tuple(sorted({round(x) if self.whole else x for x in found}))

    @property
    def last(self) -> int:
        """Number of the last stop; the first is 0."""
        return len(self.numbers) - 1

    def at(self, stop) -> float:
        """Return the number at a stop."""
        return self.numbers[min(max(round(stop), 0), self.last)]

    def stop(self, number) -> int:
        """Return the stop nearest to a number."""
        after = bisect.bisect_left(self.numbers, number)
        if after == 0 or after > self.last:
            return min(after, self.last)
        return after - (number - self.numbers[after - 1] < self.numbers[after] - number)

    def holding(self, number) -> Scale:
        """Return this scale, extended to include a number."""
        if self.low <= number <= self.high:
            return self
        low, high = min(self.low, number), max(self.high, number)
        return Scale(low, high, self.log and low > 0, self.whole)


def scale_of(param, size=1.0) -> Scale:
    """Return the scale of a numeric setting."""
    interval, whole = param.range or Interval('(-inf, inf)'), param.kind is int
    default = abs(param.default or 0.0)
    default = default if default > _TINY else 0.0
    reach = REACH.get(param.unit, 1.0) * (size if param.unit == 'world' else 1.0)
    far = _FAR * default or math.inf
    if interval.low >= 0 and 0 not in interval and interval.high >= far:
        (low, high), log = _decades(interval, default, reach), True
    else:
        if param.unit in REACH:
            far = reach = max(reach, 4 * default)
        low, high = _finite(interval, 4 * default or reach, far)
        log = interval.low > 0 and high > _FAR * low
    low, high = _inner(interval, low, high, whole)
    return Scale(low, high, log, whole)


def _decades(interval, default, reach):
    """Return the ends of a range of positive numbers: decades around the default."""
    usual, spread = (default, 10.0) if default else (reach, 100.0)
    high = max(usual, interval.low) * spread
    return max(interval.low, usual / spread), min(high, interval.high)


def _finite(interval, reach, far):
    """Return the ends of a range; very distant ones are moved closer to the default."""
    low, high = interval.low, interval.high
    if math.isinf(high) or high - max(low, 0) > far:
        high = max(low, 0) + reach
    if math.isinf(low) or min(high, 0) - low > far:
        low = min(high, 0) - reach
    return low, high


def _inner(interval, low, high, whole):
    """Return ends within the range, integers for integer settings."""
    if whole:
        return _whole(interval, math.ceil(low), math.floor(high))
    step = (high - low) / STOPS
    low = low if low in interval else low + step
    return low, high if high in interval else high - step


def _whole(interval, low, high):
    """Return two integers near the ends of a range."""
    starts = (low, low + 1, low - 1, low - 2)
    low = next((n for n in starts if n in interval and n + 1 in interval), low)
    return low, next((n for n in (high, high - 1) if n in interval and n > low), low + 1)
