"""States of a vertex animation: ranges of key frames and the blends between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.animation.keyframes import SLOTS, frame_weights
from pvibr.animation.states import States
from pvibr.core.arguments import check_one_of, checked_positive


@dataclass(frozen=True)
class FrameRange:
    """Key frames that belong to one state.

    Parameters
    ----------
    first, last : int
        Range of frames, both included.
    fps : float
        Frames per second.
    loop : bool
        Continue from the last frame to the first; otherwise hold the last one.

    Raises
    ------
    ValueError
        If the range is empty or negative, or ``fps`` is not positive.

    Examples
    --------
    >>> from pvibr.animation import FrameRange
    >>> FrameRange(40, 45, fps=10.0).at(0.55)  # between the last frame and the first
    (array([45, 40]), array([0.5, 0.5]))
    """

    first: int
    last: int
    fps: float = 10.0
    loop: bool = True

    def __post_init__(self):
        if not 0 <= self.first <= self.last:
            raise ValueError(f'first must be from 0 to last, {self.last}, got {self.first}')
        checked_positive('fps', self.fps)

    @property
    def duration(self):
        """Seconds of one cycle."""
        return (self.last - self.first + bool(self.loop)) / self.fps

    def at(self, times, interpolation='linear'):
        """Return the frames to blend at given times, and their weights.

        Parameters
        ----------
        times : array_like, any shape
            Seconds since the state began.
        interpolation : {'linear', 'step', 'quadratic', 'cubic'}
            Interpolation between frames.

        Returns
        -------
        tuple of numpy.ndarray, shape (..., k), int64 and float64
            Frames, and their blend weights.
        """
        key_times = np.arange(self.last - self.first + 1) / self.fps
        period = self.duration if self.loop else None
        indices, weights = frame_weights(key_times, times, interpolation, period)
        return indices + self.first, weights


class VertexAnimationStates(States):
    """States of a vertex animation, with blends between them.

    A transition blends from the frames shown at the time of the request to the first frame of the
    next state, which starts playing when the blend ends.

    Parameters
    ----------
    states : dict of str to FrameRange
        Frames of the states.
    start : str, optional
        State at time 0 and before; default the first one.
    interpolation : {'linear', 'step', 'quadratic', 'cubic'}
        Interpolation between frames of a state.
    **options
        ``fade``, ``fades``, ``then``, ``rules``, ``parameters`` and ``smooth`` of
        :class:`pvibr.animation.StateGraph`.

    Raises
    ------
    ValueError
        If the interpolation is unknown, and as :class:`pvibr.animation.StateGraph` does.

    Examples
    --------
    >>> from pvibr.animation import FrameRange, VertexAnimationStates
    >>> soldier = VertexAnimationStates(
    ...     {'stand': FrameRange(0, 39), 'run': FrameRange(40, 45)}, fade=0.5
    ... )
    >>> soldier.go('run', at=1.05)
    >>> soldier.at(1.3)  # half the frames shown at 1.05, half the first frame of run
    (array([10, 11, 40, 41]), array([0.25, 0.25, 0.5 , 0.  ]))
    """

    _holds = True

    def __init__(self, states, start=None, *, interpolation='linear', **options):
        super().__init__(states, start, **options)
        check_one_of('interpolation', interpolation, SLOTS)
        self.interpolation = interpolation

    @property
    def last(self):
        """The highest frame number of all states."""
        return max(frames.last for frames in self.states.values())

    def at(self, times):
        """Return the frames to blend at given times, and their weights, which sum to one.

        Parameters
        ----------
        times : array_like, any shape
            Times in seconds.

        Returns
        -------
        tuple of numpy.ndarray, shape (..., k), int64 and float64
            Frames, and their blend weights; k is the largest number needed at any of the times.

        Raises
        ------
        ValueError
            If a time is not finite.
        """
        times = np.asarray(times, dtype=np.float64)
        visible_states = self._visible_states(times.reshape(-1))
        slot_count = SLOTS[self.interpolation]
        filled = np.zeros(times.size, dtype=np.int64)
        for _, time_indices, _, _ in visible_states:
            filled[time_indices] += slot_count
        indices = np.zeros((times.size, filled.max(initial=slot_count)), dtype=np.int64)
        weights = np.zeros(indices.shape)
        filled[:] = 0
        for name, time_indices, clocks, share in visible_states:
            frames, parts = self.states[name].at(clocks, self.interpolation)
            place = time_indices[:, None], filled[time_indices, None] + np.arange(slot_count)
            indices[place], weights[place] = frames, parts * share[:, None]
            filled[time_indices] += slot_count
        shape = *times.shape, indices.shape[1]
        return indices.reshape(shape), weights.reshape(shape)
