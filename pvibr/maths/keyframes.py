"""Interpolation weights of key frames."""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import check_finite, check_one_of
from pvibr.maths.vectors import unit_vectors

SLOTS = {'step': 1, 'linear': 2, 'quadratic': 3, 'cubic': 4}
"""Kinds of interpolation, and how many frames each shows at a time."""

_SAME = 1e-6  # of the span: a gap from last to first that is only rounding


def frame_weights(keys, times, interpolation='linear', period=None):
    """Return the key frames blended at times, and their weights of sum 1, (..., k) for k slots.

    'cubic' is Overhauser's blend of two parabolas, "Analytic definition of curves and surfaces by
    parabolic blending", 1968; a `period` equal to the span drops the last frame.
    """
    keys = checked_keys(keys)
    check_one_of('interpolation', interpolation, SLOTS)
    times = np.asarray(times, dtype=np.float64)
    check_finite('times', times)
    line = _Line(keys) if period is None else _Ring(keys, period)
    indices, weights = _WEIGHTS[line.degree(interpolation)](line, line.local(times))
    # Whoever draws counts on k columns, however few frames there are.
    missing = SLOTS[interpolation] - weights.shape[-1]
    ends = [(0, 0)] * times.ndim + [(0, missing)]
    return line.frames(np.pad(indices, ends, mode='edge')), np.pad(weights, ends)


def checked_keys(keys, name='keys'):
    """Return finite, increasing times of keys as an array, (f,)."""
    keys = np.asarray(keys, dtype=np.float64)
    if keys.ndim != 1 or not keys.size:
        raise ValueError(
            f'{name} has the shape {keys.shape}; it must be (f,), with at least one time.'
        )
    check_finite(name, keys)
    bad = np.flatnonzero(np.diff(keys) <= 0)
    if bad.size:
        i = bad[0] + 1
        raise ValueError(
            f'{name}[{i}] is {keys[i]} after {keys[i - 1]}; times of keys must increase.'
        )
    return keys


def blend(frames, indices, weights):
    """Return the weighted sum of frames (f, ...) for each row of indices (..., k)."""
    frames = np.asarray(frames)
    weights = np.asarray(weights, dtype=np.float64)
    indices, weights = np.broadcast_arrays(indices, weights)
    weights = weights.reshape(weights.shape + (1,) * (frames.ndim - 1))
    lead = indices.ndim - 1
    # Slot after slot: all at once would hold k times as much.
    total = np.zeros(indices.shape[:-1] + frames.shape[1:])
    for slot in range(indices.shape[-1]):
        total += np.take(weights, slot, axis=lead) * frames[indices[..., slot]]
    return total


def blend_directions(frames, indices, weights):
    """Return the normalized weighted sum of directions of frames; zero where it vanishes."""
    return unit_vectors(blend(frames, indices, weights))


class _Line:
    """Keys of a finite clip, numbered 0 to f - 1."""

    def __init__(self, keys):
        self.keys, self.last = keys, len(keys) - 1

    def degree(self, interpolation):
        """Return the requested degree, limited by the number of keys."""
        # A cubic is made of parabolas, so that three keys are enough.
        return min(SLOTS[interpolation] - 1, self.last if self.last < 2 else 3)

    def local(self, times):
        return np.clip(times, self.keys[0], self.keys[-1])

    def segment(self, times):
        """Return the numbers of the keys before times."""
        before = np.searchsorted(self.keys, times, side='right') - 1
        return np.clip(before, 0, max(self.last - 1, 0))

    def began(self, times):
        return np.searchsorted(self.keys, times, side='right') - 1

    def key(self, numbers):
        return self.keys[numbers]

    def around(self, numbers):
        """Return the first of the three keys of a key's parabola."""
        return np.clip(numbers - 1, 0, self.last - 2)

    def frames(self, numbers):
        return np.minimum(numbers, self.last)


class _Ring:
    """Keys of a periodic clip, numbered from minus to plus infinity."""

    def __init__(self, keys, period):
        span = keys[-1] - keys[0]
        if not span <= period < np.inf or period <= 0:
            raise ValueError(
                f'period is {period}; it must be positive, at least {span} (first to last key).'
            )
        self.keys = keys[:-1] if period - span <= _SAME * span else keys
        self.period = period

    def degree(self, interpolation):
        return SLOTS[interpolation] - 1

    def local(self, times):
        start = self.keys[0]
        # The remainder of a tiny negative time rounds up to the period.
        turned = np.mod(times - start, self.period)
        return start + np.where(turned < self.period, turned, 0.0)

    def segment(self, times):
        return np.maximum(np.searchsorted(self.keys, times, side='right') - 1, 0)

    began = segment

    def key(self, numbers):
        turns, frames = np.divmod(numbers, len(self.keys))
        return self.keys[frames] + turns * self.period

    def around(self, numbers):
        return numbers - 1

    def frames(self, numbers):
        return np.mod(numbers, len(self.keys))


def _step(line, times):
    first = line.began(times)
    return first[..., None], np.ones((*times.shape, 1))


def _linear(line, times):
    first = line.segment(times)
    w = _part(line, first, times)
    return first[..., None] + np.arange(2), np.stack([1 - w, w], axis=-1)


def _quadratic(line, times):
    start = line.around(line.segment(times))
    return start[..., None] + np.arange(3), _parabola(line, start, times)


def _cubic(line, times):
    first = line.segment(times)
    w = _part(line, first, times)[..., None]
    start, end = line.around(first), line.around(first + 1)
    weights = np.zeros((*times.shape, 4))
    weights[..., :3] = (1 - w) * _parabola(line, start, times)
    ahead = w * _parabola(line, end, times)
    # At the ends of a line both parabolas are the same one.
    same = (end == start)[..., None]
    weights[..., :3] += np.where(same, ahead, 0.0)
    weights[..., 1:] += np.where(same, 0.0, ahead)
    return start[..., None] + np.arange(4), weights


_WEIGHTS = (_step, _linear, _quadratic, _cubic)


def _part(line, first, times):
    """Return the fractions of times between two keys, 0 to 1."""
    a, b = line.key(first), line.key(first + 1)
    return (times - a) / (b - a)


def _parabola(line, start, times):
    """Return the weights of three keys in the parabola through them."""
    a, b, c = (line.key(start + i) for i in range(3))
    to_a, to_b, to_c = times - a, times - b, times - c
    weights = [
        to_b * to_c / ((a - b) * (a - c)),
        to_a * to_c / ((b - a) * (b - c)),
        to_a * to_b / ((c - a) * (c - b)),
    ]
    return np.stack(weights, axis=-1)
