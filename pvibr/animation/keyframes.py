"""Interpolation weights of key frames."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import check_finite, check_one_of
from pvibr.maths.vectors import unit_vectors

#: Kinds of interpolation, and how many frames each blends.
SLOTS = {'step': 1, 'linear': 2, 'quadratic': 3, 'cubic': 4}

_SAME = 1e-6  # of the span: a gap from last to first key that is only rounding


def frame_weights(keys, times, interpolation='linear', period=None):
    """Return the key frames blended at times, and their weights of sum 1, (..., k) for k slots.

    'cubic' is Overhauser's blend of two parabolas, "Analytic definition of curves and surfaces by
    parabolic blending", 1968; a `period` equal to the span drops the last frame.
    """
    keys = checked_keys(keys)
    check_one_of('interpolation', interpolation, SLOTS)
    times = np.asarray(times, dtype=np.float64)
    check_finite('times', times)
    timeline = _Line(keys) if period is None else _Ring(keys, period)
    indices, weights = _WEIGHTS[timeline.degree(interpolation)](timeline, timeline.local(times))
    # The renderer expects k columns, however few frames there are.
    padding = SLOTS[interpolation] - weights.shape[-1]
    pad_widths = [(0, 0)] * times.ndim + [(0, padding)]
    return timeline.frames(np.pad(indices, pad_widths, mode='edge')), np.pad(weights, pad_widths)


def checked_keys(keys, name='keys'):
    """Return finite, increasing times of keys as an array, (f,)."""
    keys = np.asarray(keys, dtype=np.float64)
    if keys.ndim != 1 or not keys.size:
        raise ValueError(f'{name} must have shape (f,) with at least one time, got {keys.shape}')
    check_finite(name, keys)
    not_increasing = np.flatnonzero(np.diff(keys) <= 0)
    if not_increasing.size:
        index = not_increasing[0] + 1
        raise ValueError(
            f'{name} must increase, got {keys[index]} after {keys[index - 1]} at {name}[{index}]'
        )
    return keys


def blend(frames, indices, weights):
    """Return the weighted sum of frames (f, ...) for each row of indices (..., k)."""
    frames = np.asarray(frames)
    weights = np.asarray(weights, dtype=np.float64)
    indices, weights = np.broadcast_arrays(indices, weights)
    weights = weights.reshape(weights.shape + (1,) * (frames.ndim - 1))
    slot_axis = indices.ndim - 1
    # Slot by slot: all at once would need k times the memory.
    weighted_sum = np.zeros(indices.shape[:-1] + frames.shape[1:])
    for slot in range(indices.shape[-1]):
        weighted_sum += np.take(weights, slot, axis=slot_axis) * frames[indices[..., slot]]
    return weighted_sum


def blend_directions(frames, indices, weights):
    """Return the normalized weighted sum of directions of frames; zero where it vanishes."""
    return unit_vectors(blend(frames, indices, weights))


class _Line:
    """Keys of a finite clip, numbered 0 to f - 1."""

    def __init__(self, keys):
        self.keys, self.last = keys, len(keys) - 1

    def degree(self, interpolation):
        """Return the requested degree, limited by the number of keys."""
        # A cubic is made of parabolas, so three keys suffice.
        return min(SLOTS[interpolation] - 1, self.last if self.last < 2 else 3)

    def local(self, times):
        return np.clip(times, self.keys[0], self.keys[-1])

    def segment(self, times):
        """Return the numbers of the keys before times."""
        last_begun = np.searchsorted(self.keys, times, side='right') - 1
        return np.clip(last_begun, 0, max(self.last - 1, 0))

    def began(self, times):
        return np.searchsorted(self.keys, times, side='right') - 1

    def key(self, key_numbers):
        return self.keys[key_numbers]

    def around(self, key_numbers):
        """Return the first of the three keys of a key's parabola."""
        return np.clip(key_numbers - 1, 0, self.last - 2)

    def frames(self, key_numbers):
        return np.minimum(key_numbers, self.last)


class _Ring:
    """Keys of a periodic clip, numbered from minus to plus infinity."""

    def __init__(self, keys, period):
        key_span = keys[-1] - keys[0]
        if not key_span <= period < np.inf or period <= 0:
            raise ValueError(
                f'period must be positive and at least {key_span}, first to last key, got {period}'
            )
        self.keys = keys[:-1] if period - key_span <= _SAME * key_span else keys
        self.period = period

    def degree(self, interpolation):
        return SLOTS[interpolation] - 1

    def local(self, times):
        first_key = self.keys[0]
        # The remainder of a tiny negative time may round up to the period.
        phases = np.mod(times - first_key, self.period)
        return first_key + np.where(phases < self.period, phases, 0.0)

    def segment(self, times):
        return np.maximum(np.searchsorted(self.keys, times, side='right') - 1, 0)

    began = segment

    def key(self, key_numbers):
        turn_count, frames = np.divmod(key_numbers, len(self.keys))
        return self.keys[frames] + turn_count * self.period

    def around(self, key_numbers):
        return key_numbers - 1

    def frames(self, key_numbers):
        return np.mod(key_numbers, len(self.keys))


def _step(timeline, times):
    last_begun = timeline.began(times)
    return last_begun[..., None], np.ones((*times.shape, 1))


def _linear(timeline, times):
    start_key = timeline.segment(times)
    end_share = _part(timeline, start_key, times)
    return start_key[..., None] + np.arange(2), np.stack([1 - end_share, end_share], axis=-1)


def _quadratic(timeline, times):
    first_key = timeline.around(timeline.segment(times))
    return first_key[..., None] + np.arange(3), _parabola(timeline, first_key, times)


def _cubic(timeline, times):
    segment_start = timeline.segment(times)
    end_share = _part(timeline, segment_start, times)[..., None]
    first_key, second_key = timeline.around(segment_start), timeline.around(segment_start + 1)
    weights = np.zeros((*times.shape, 4))
    weights[..., :3] = (1 - end_share) * _parabola(timeline, first_key, times)
    end_weights = end_share * _parabola(timeline, second_key, times)
    # At either end of a line both parabolas are the same.
    is_same = (second_key == first_key)[..., None]
    weights[..., :3] += np.where(is_same, end_weights, 0.0)
    weights[..., 1:] += np.where(is_same, 0.0, end_weights)
    return first_key[..., None] + np.arange(4), weights


_WEIGHTS = _step, _linear, _quadratic, _cubic


def _part(timeline, start_key, times):
    """Return the fractions of times between two keys, 0 to 1."""
    start_time, end_time = timeline.key(start_key), timeline.key(start_key + 1)
    return (times - start_time) / (end_time - start_time)


def _parabola(timeline, first_key, times):
    """Return the weights of three keys in the parabola through them."""
    a, b, c = (timeline.key(first_key + i) for i in range(3))
    to_a, to_b, to_c = times - a, times - b, times - c
    weights = [
        to_b * to_c / ((a - b) * (a - c)),
        to_a * to_c / ((b - a) * (b - c)),
        to_a * to_b / ((c - a) * (c - b)),
    ]
    return np.stack(weights, axis=-1)
