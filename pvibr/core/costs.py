"""Adaptive costs: running means of measured times, and pauses after trials in vain."""

from __future__ import annotations

from contextlib import contextmanager
from time import perf_counter
from types import SimpleNamespace

from pvibr.core.determinism import elapsed

#: Seconds of an actor and of each of its cells, before any was measured.
ACTOR, CELL = 5e-5, 7e-8


def expected_seconds(cells) -> float:
    """Return the seconds that a mesh takes to be drawn, before it was measured."""
    return ACTOR + CELL * cells


@contextmanager
def timed(window, nominal):
    """Measure seconds of GPU work; deterministic runs take the nominal ones."""
    spent = SimpleNamespace(seconds=nominal)
    window.WaitForCompletion()
    start = perf_counter()
    yield spent
    window.WaitForCompletion()
    spent.seconds = elapsed(start, nominal)


class RunningMean:
    """Exponentially weighted mean of measured values."""

    def __init__(self, value=0.0, weight=0.2):
        self.value, self.weight = value, weight

    def add(self, new, weight=None) -> float:
        """Take a new value into account, and return the mean."""
        self.value += (self.weight if weight is None else weight) * (new - self.value)
        return self.value


class Backoff:
    """A pause in frames that grows with each trial in vain."""

    def __init__(self, first, most):
        self._first, self._most = first, most
        self._length = self.left = 0

    def failed(self):
        """Start a pause, longer than the one before."""
        self._length = min(2 * self._length + self._first, self._most)
        self.left = self._length

    def succeeded(self):
        """Make the next pause shorter."""
        self._length = max(self._length - 1, 0)

    def waits(self) -> bool:
        """Return True within a pause, and count the frame."""
        waiting = self.left > 0
        self.left -= waiting
        return waiting
