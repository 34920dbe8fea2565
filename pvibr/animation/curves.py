"""Values over time: weights that rise and fall."""

from __future__ import annotations

import numpy as np

from pvibr.animation.keyframes import blend, checked_keys, frame_weights
from pvibr.core.arguments import check_finite, checked_positive


class Curve:
    """A piecewise linear function of time; the end values are held.

    Parameters
    ----------
    values : array_like, shape (f, ...)
        Values at the keys; a single one without a time is constant.
    times : array_like, shape (f,), optional
        Key times in seconds, increasing; default 0.

    Raises
    ------
    ValueError
        If values are not finite or not as many as times, or times do not increase.

    Examples
    --------
    >>> from pvibr.animation import Curve
    >>> weight = Curve([0.0])
    >>> weight.go(1.0, at=1.0, fade=1.0)
    >>> weight.go(0.0, at=1.5, fade=1.0)  # half way up
    >>> weight.at([1.5, 2.0, 2.5]).tolist()
    [0.5, 0.25, 0.0]
    """

    def __init__(self, values, times=None):
        self.values = np.asarray(values, dtype=np.float64)
        self.times = checked_keys([0.0] if times is None else times, 'times')
        if self.values.shape[:1] != self.times.shape:
            raise ValueError(f'values must be ({len(self.times)}, ...), got {self.values.shape}')
        check_finite('values', self.values)

    def __repr__(self):
        return f'Curve({len(self.times)} times, {self.times[0]:g} to {self.times[-1]:g} s)'

    def at(self, times):
        """Return the values at given times, float64.

        Parameters
        ----------
        times : array_like, any shape
            Times in seconds.

        Raises
        ------
        ValueError
            If a time is not finite.
        """
        return blend(self.values, *frame_weights(self.times, times))

    def integral(self, times):
        """Return the exact integral from the first key on: value times seconds.

        Parameters
        ----------
        times : array_like, any shape
            Times in seconds.

        Examples
        --------
        >>> from pvibr.animation import Curve
        >>> Curve([0.0, 1.0], [0.0, 2.0]).integral([-1.0, 2.0, 5.0]).tolist()
        [0.0, 1.0, 4.0]
        """
        times = np.asarray(times, dtype=np.float64)
        values = self.values.reshape(len(self.times), -1)
        key_spacing = np.diff(self.times)[:, None]
        slopes = np.diff(values, axis=0) / key_spacing
        elapsed_times = np.clip(times[..., None, None] - self.times[:-1, None], 0, key_spacing)
        inside = (elapsed_times * (values[:-1] + slopes * elapsed_times / 2)).sum(-2)
        before = values[0] * np.minimum(times[..., None] - self.times[0], 0)
        after = values[-1] * np.maximum(times[..., None] - self.times[-1], 0)
        return (before + inside + after).reshape(times.shape + self.values.shape[1:])

    def go(self, value, at, fade=0.2):
        """Fade from the value at a time to another one; later keys are dropped.

        Parameters
        ----------
        value : array_like
            Target value, of the shape of one value.
        at : float
            Start of the fade in seconds; not before the first key.
        fade : float
            Duration of the fade in seconds, above 0.

        Raises
        ------
        ValueError
            If the value is not finite or does not fit, ``at`` is before the first key or the fade
            is not above 0.
        """
        if not self.times[0] <= at < np.inf:
            raise ValueError(
                f'at must be finite and not before the first key, {self.times[0]} s, got {at}'
            )
        checked_positive('fade', fade)
        earlier_keys = self.times < at
        value = np.broadcast_to(np.asarray(value, dtype=np.float64), self.values.shape[1:])
        fade_values = np.stack([self.at(at), value])
        faded_curve = Curve(
            np.concatenate([self.values[earlier_keys], fade_values]),
            [*self.times[earlier_keys], at, at + fade],
        )
        self.values, self.times = faded_curve.values, faded_curve.times
