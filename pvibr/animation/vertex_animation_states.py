"""States of a mesh that is animated by key frames: which frames are shown on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.animation.states import States
from pvibr.maths.keyframes import SLOTS, frame_weights


@dataclass(frozen=True)
class FrameRange:
    """Key frames that belong to a state.

    Parameters
    ----------
    first, last : int
        Its frames, both included.
    fps : float
        Frames per second.
    loop : bool
        Go on from the last frame to the first; otherwise the last one stays.

    Raises
    ------
    ValueError
        If the range is empty or negative, or ``fps`` is not positive.

    Examples
    --------
    >>> from pvibr.animation.vertex_animation_states import FrameRange
    >>> FrameRange(40, 45, fps=10.0).at(0.55)  # between the last and the first
    (array([45, 40]), array([0.5, 0.5]))
    """

    first: int
    last: int
    fps: float = 10.0
    loop: bool = True

    def __post_init__(self):
        if not 0 <= self.first <= self.last:
            msg = f'frames {self.first} to {self.last} are no range; 0 <= first <= last.'
            raise ValueError(msg)
        if not 0 < self.fps < np.inf:
            msg = f'fps is {self.fps}; it must be positive and finite.'
            raise ValueError(msg)

    @property
    def duration(self):
        """Seconds that it takes once."""
        return (self.last - self.first + bool(self.loop)) / self.fps

    def at(self, times, interpolation='linear'):
        """Return which frames are shown at times.

        Parameters
        ----------
        times : array_like, any shape
            Seconds since the state began.
        interpolation : {'linear', 'step', 'quadratic', 'cubic'}
            How frames are blended.

        Returns
        -------
        indices : numpy.ndarray, shape (..., k), int64
            Frames.
        weights : numpy.ndarray, shape (..., k), float64
            Their weights.

        Examples
        --------
        >>> from pvibr.animation.vertex_animation_states import FrameRange
        >>> FrameRange(66, 71, fps=10.0, loop=False).at(9.0)
        (array([70, 71]), array([0., 1.]))
        """
        keys = np.arange(self.last - self.first + 1) / self.fps
        period = self.duration if self.loop else None
        indices, weights = frame_weights(keys, times, interpolation, period)
        return indices + self.first, weights


class VertexAnimationStates(States):
    """States of a mesh that is animated by key frames, and the ways between them.

    On the way from one state to another the weight goes from 0 to 1 between what is shown when
    the order is given, whatever frames that is made of, and the first frame of the next state,
    which begins when it is reached.

    Parameters
    ----------
    states : dict of str to FrameRange
        Frames of the states.
    start : str, optional
        State at time 0 and before; default the first one.
    interpolation : {'linear', 'step', 'quadratic', 'cubic'}
        How frames are blended within a state.
    **options
        ``fade``, ``fades``, ``then``, ``rules``, ``parameters`` and ``smooth``, as
        :class:`pvibr.animation.states.StateGraph` has them.

    Raises
    ------
    ValueError
        If a state is not known or has no end where one is needed, a fade is negative, or the
        interpolation is not known.

    Examples
    --------
    >>> from pvibr.animation.vertex_animation_states import FrameRange, VertexAnimationStates
    >>> soldier = VertexAnimationStates(
    ...     {'stand': FrameRange(0, 39), 'run': FrameRange(40, 45)}, fade=0.5
    ... )
    >>> soldier.go('run', at=1.05)
    >>> indices, weights = soldier.at(1.3)
    >>> indices, weights  # half of what was shown at 1.05, half of the first frame of run
    (array([10, 11, 40, 41]), array([0.25, 0.25, 0.5 , 0.  ]))
    """

    _holds = True

    def __init__(self, states, start=None, *, interpolation='linear', **options):
        super().__init__(states, start, **options)
        if interpolation not in SLOTS:
            msg = f'interpolation is {interpolation!r}; it must be one of {", ".join(SLOTS)}.'
            raise ValueError(msg)
        self.interpolation = interpolation

    @property
    def last(self):
        """The highest frame that is shown."""
        return max(frames.last for frames in self.states.values())

    def at(self, times):
        """Return which frames are shown at times.

        Parameters
        ----------
        times : array_like, any shape
            Seconds.

        Returns
        -------
        indices : numpy.ndarray, shape (..., k), int64
            Frames. As many columns as the time with the most states needs: one set for each
            state that is seen, two on a way, one more for each way that was cut short.
        weights : numpy.ndarray, shape (..., k), float64
            Their weights, with the sum 1.

        Raises
        ------
        ValueError
            If a time is not finite.

        Examples
        --------
        >>> from pvibr.animation.vertex_animation_states import FrameRange, VertexAnimationStates
        >>> VertexAnimationStates({'stand': FrameRange(0, 9, fps=1.0)}).at(2.5)
        (array([2, 3]), array([0.5, 0.5]))
        """
        times = np.asarray(times, dtype=np.float64)
        shown = self._shown(times.reshape(-1))
        slots = SLOTS[self.interpolation]
        filled = np.zeros(times.size, dtype=np.int64)
        for _, where, _, _ in shown:
            filled[where] += slots
        indices = np.zeros((times.size, filled.max(initial=slots)), dtype=np.int64)
        weights = np.zeros(indices.shape)
        filled[:] = 0
        for name, where, clocks, share in shown:
            frames, parts = self.states[name].at(clocks, self.interpolation)
            place = where[:, None], filled[where, None] + np.arange(slots)
            indices[place], weights[place] = frames, parts * share[:, None]
            filled[where] += slots
        shape = (*times.shape, indices.shape[1])
        return indices.reshape(shape), weights.reshape(shape)
