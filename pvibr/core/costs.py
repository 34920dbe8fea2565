"""Measured costs: running means, and pauses after failed trials."""

from __future__ import annotations


class RunningMean:
    """Exponentially weighted mean of measured values."""

    def __init__(self, value=0.0, weight=0.2):
        self.value, self.weight = value, weight

    def add(self, sample, weight=None) -> float:
        """Include a value, and return the mean."""
        self.value += (self.weight if weight is None else weight) * (sample - self.value)
        return self.value


class Backoff:
    """A pause, in frames, that grows with each failed trial."""

    def __init__(self, first_pause, longest_pause):
        self._first_pause, self._longest_pause = first_pause, longest_pause
        self._length = self.left = 0

    def failed(self):
        """Start a pause, longer than the previous one."""
        self._length = min(2 * self._length + self._first_pause, self._longest_pause)
        self.left = self._length

    def succeeded(self):
        """Make the next pause shorter."""
        self._length = max(self._length - 1, 0)

    def waits(self) -> bool:
        """Return True during a pause, and count the frame."""
        is_waiting = self.left > 0
        self.left -= is_waiting
        return is_waiting
