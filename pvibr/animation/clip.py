"""Clips: key frames over time and the interpolation between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.animation.pose import Pose
from pvibr.maths import quaternions
from pvibr.maths.keyframes import checked_keys

#: Components of a value by property; weights have any number.
WIDTHS = {'translation': 3, 'rotation': 4, 'scale': 3, 'weights': None}
INTERPOLATIONS = ('step', 'linear', 'cubic')


@dataclass(frozen=True, eq=False)
class Track:
    """Key frames of one property of one joint.

    Parameters
    ----------
    node : int
        The joint; for ``'weights'`` the first driven column of :attr:`Pose.weights`.
    path : {'translation', 'rotation', 'scale', 'weights'}
        The animated property.
    times : array_like, shape (k,)
        Key times in seconds, increasing; k > 0.
    values : array_like, shape (k, c), or (k, 3, c) for 'cubic'
        Key values: c is 3, 4 (w, x, y, z) or the number of weights. A 'cubic' key holds its
        in-tangent, value and out-tangent (per second), as in glTF.
    interpolation : {'linear', 'step', 'cubic'}
        Interpolation between keys; 'linear' turns rotations along the shortest arc.

    Raises
    ------
    ValueError
        If keys are out of order, shapes do not fit or a value is not finite.

    Examples
    --------
    >>> from pvibr.animation import Track
    >>> Track(0, 'translation', [0, 1], [[0, 0, 0], [2, 0, 0]]).sample(0.25).tolist()
    [0.5, 0.0, 0.0]
    """

    node: int
    path: str
    times: np.ndarray
    values: np.ndarray
    interpolation: str = 'linear'

    def __post_init__(self):
        _one_of('path', self.path, tuple(WIDTHS))
        _one_of('interpolation', self.interpolation, INTERPOLATIONS)
        if self.node < 0:
            msg = f'node is {self.node}; it must be 0 or more.'
            raise ValueError(msg)
        times = checked_keys(self.times, 'times')
        values = np.asarray(self.values, dtype=np.float64)
        self._check_values(values, len(times))
        if self.path == 'rotation':
            values = self._unit(values)
        object.__setattr__(self, 'times', times)
        object.__setattr__(self, 'values', values)

    @property
    def width(self):
        """Components of a value."""
        return self.values.shape[-1]

    def sample(self, times):
        """Return values at given times, (..., c) float64; the first and the last key are held.

        Parameters
        ----------
        times : array_like, shape (...)
            Times in seconds.
        """
        times = np.asarray(times, dtype=np.float64)
        return _between(self.path, self.interpolation, self.times, self.values, times)

    def _check_values(self, values, k):
        cubic = self.interpolation == 'cubic'
        width = WIDTHS[self.path] or (values.shape[-1] if values.ndim else 1)
        shape = (k, 3, width) if cubic else (k, width)
        if values.shape != shape:
            what = f'a {self.interpolation} track of {self.path} with {k} keys'
            msg = f'values of {what} must be {shape}, not of shape {values.shape}.'
            raise ValueError(msg)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            place = ', '.join(str(int(i)) for i in bad[0])
            msg = f'values[{place}] is {values[tuple(bad[0])]}; it must be finite.'
            raise ValueError(msg)

    def _unit(self, values):
        """Return unit quaternions; tangents stay as they are."""
        if self.interpolation != 'cubic':
            return quaternions.normalized(values)
        values = values.copy()
        values[:, 1] = quaternions.normalized(values[:, 1])
        return values


class Clip:
    """A named animation: tracks that play together.

    Parameters
    ----------
    name : str
        Name of the clip.
    tracks : sequence of Track
        What is animated; everything else stays at rest.
    duration : float, optional
        Duration in seconds; default the time of the last key.

    Raises
    ------
    ValueError
        If the duration is negative or not finite.

    Examples
    --------
    >>> from pvibr.animation import Clip, Pose, Track
    >>> up = Clip('up', [Track(0, 'translation', [0, 2], [[0, 0, 0], [0, 0, 1]])])
    >>> up.sample([0.0, 1.0, 3.0], Pose([[0.0, 0.0, 0.0]])).translation[:, 0, 2].tolist()
    [0.0, 0.5, 0.5]
    """

    def __init__(self, name, tracks, duration=None):
        self.name = str(name)
        self.tracks = tuple(tracks)
        last = max((track.times[-1] for track in self.tracks), default=0.0)
        self.duration = float(last if duration is None else duration)
        if not 0 <= self.duration < np.inf:
            msg = f'duration of the clip {self.name!r} is {duration}; it must be >= 0 seconds.'
            raise ValueError(msg)

    def __repr__(self):
        return f'Clip({self.name!r}, {len(self.tracks)} tracks, {self.duration:g} s)'

    def sample(self, times, rest, loop=True):
        """Return the poses at given times, of shape ``times.shape``.

        Parameters
        ----------
        times : array_like, shape (...)
            Times in seconds.
        rest : Pose
            A single pose: the values that no track drives.
        loop : bool
            Restart at the end; otherwise hold the last pose.

        Raises
        ------
        ValueError
            If a track drives a joint or a weight that ``rest`` lacks.
        """
        self._check_fit(rest)
        times = self.local_time(times, loop)
        parts = {
            name: np.array(np.broadcast_to(value, times.shape + value.shape))
            for name in WIDTHS
            for value in [getattr(rest, name)]
        }
        for path, how, keys, nodes, values in self._groups:
            parts[path][..., nodes, :] = _between(path, how, keys, values, times)
        for track in self._weight_tracks:
            columns = slice(track.node, track.node + track.width)
            parts['weights'][..., columns] = track.sample(times)
        return Pose(**parts, time=times)

    def local_time(self, times, loop=True):
        """Return times within the clip, in seconds; a loop restarts at the duration itself."""
        times = np.asarray(times, dtype=np.float64)
        if not self.duration:
            return np.zeros_like(times)
        return times % self.duration if loop else np.clip(times, 0.0, self.duration)

    @cached_property
    def _weight_tracks(self):
        return [track for track in self.tracks if track.path == 'weights']

    @cached_property
    def _groups(self):
        """Tracks of joints grouped by key times, to be evaluated together."""
        # The later of two tracks for the same property wins.
        tracks = {(t.node, t.path): t for t in self.tracks if t.path != 'weights'}.values()
        alike: dict[tuple, list[Track]] = {}
        for track in tracks:
            key = (track.path, track.interpolation, track.times.tobytes())
            alike.setdefault(key, []).append(track)
        return [
            (path, how, group[0].times, [t.node for t in group], np.stack(values, -2))
            for (path, how, _), group in alike.items()
            for values in [[t.values for t in group]]
        ]

    def _check_fit(self, rest):
        for what, last, many in self._ends(rest):
            if last >= many:
                msg = f'clip {self.name!r} drives {what} {last}; the figure has {many}.'
                raise ValueError(msg)

    def _ends(self, rest):
        yield 'joint', self._last_joint, rest.n_joints
        yield 'weight', self._last_weight, rest.weights.shape[-1]

    @cached_property
    def _last_joint(self):
        return max((t.node for t in self.tracks if t.path != 'weights'), default=-1)

    @cached_property
    def _last_weight(self):
        return max((t.node + t.width - 1 for t in self._weight_tracks), default=-1)


def _between(path, how, keys, values, times):
    """Return values at times: (..., c), or (..., g, c) for g tracks with the same keys."""
    times = np.minimum(np.maximum(times, keys[0]), keys[-1])
    before = np.searchsorted(keys, times, side='right') - 1
    if how == 'step':
        return values[before]
    after = np.minimum(before + 1, len(keys) - 1)
    step = keys[after] - keys[before]
    part = (times - keys[before]) / np.where(step > 0, step, 1.0)
    rank = values.ndim - 1 - (how == 'cubic')
    step, part = (x.reshape(x.shape + (1,) * rank) for x in (step, part))
    if how == 'cubic':
        before, after = (np.moveaxis(values[i], times.ndim, 0) for i in (before, after))
        return _hermite(path, before, after, part, step)
    if path == 'rotation':
        return quaternions.slerp(values[before], values[after], part[..., 0])
    return (1 - part) * values[before] + part * values[after]


def _hermite(path, before, after, part, step):
    """Blend keys (3, ..., c) by Hermite polynomials (glTF 2.0, appendix C.5)."""
    a, leaving, b, arriving = before[1], before[2] * step, after[1], after[0] * step
    t2, t3 = part**2, part**3
    value = (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + part) * leaving
    value = value + (3 * t2 - 2 * t3) * b + (t3 - t2) * arriving
    return quaternions.normalized(value) if path == 'rotation' else value


def _one_of(name, value, allowed):
    if value not in allowed:
        msg = f'{name} is {value!r}; it must be one of {", ".join(map(repr, allowed))}.'
        raise ValueError(msg)
