"""Clips: key frames over time and the interpolation between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.animation.pose import unchecked_pose
from pvibr.maths import quaternions
from pvibr.maths.arguments import check_finite, check_one_of
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
        check_one_of('path', self.path, tuple(WIDTHS))
        check_one_of('interpolation', self.interpolation, INTERPOLATIONS)
        if self.node < 0:
            raise ValueError(f'node is {self.node}; it must be 0 or more.')
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
        times = np.asarray(times, dtype=np.float64)[..., None]
        return self._lane.at(times, np.zeros(1, int))[..., 0, :]

    @cached_property
    def _lane(self):
        return Lanes([self])

    def _check_values(self, values, k):
        cubic = self.interpolation == 'cubic'
        width = WIDTHS[self.path] or (values.shape[-1] if values.ndim else 1)
        shape = (k, 3, width) if cubic else (k, width)
        if values.shape != shape:
            what = f'a {self.interpolation} track of {self.path} with {k} keys'
            raise ValueError(f'values of {what} must be {shape}, not of shape {values.shape}.')
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            place = ', '.join(str(int(i)) for i in bad[0])
            raise ValueError(f'values[{place}] is {values[tuple(bad[0])]}; it must be finite.')

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
            raise ValueError(
                f'duration of the clip {self.name!r} is {duration}; it must be >= 0 seconds.'
            )

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
        loop : bool or 'pingpong'
            Restart at the end, hold the last pose, or go there and back.

        Raises
        ------
        ValueError
            If a track drives a joint or a weight that ``rest`` lacks.
        """
        self._check_fit(rest)
        times = self.local_time(times, loop)
        check_finite('time', times)
        parts = {name: _repeated(getattr(rest, name), times.shape) for name in WIDTHS}
        for lanes, places in self._lanes:
            nodes = [self.joint_tracks[i].node for i in places]
            parts[lanes.path][..., nodes, :] = lanes.at(times[..., None], np.arange(len(nodes)))
        for track in self._weight_tracks:
            columns = slice(track.node, track.node + track.width)
            parts['weights'][..., columns] = track.sample(times)
        return unchecked_pose(**parts, time=times)

    def local_time(self, times, loop=True, count=None):
        """Return times within the clip, in seconds; a loop restarts at the duration itself.

        After a count of cycles, there and back for 'pingpong', the last moment is held.
        """
        return local_times(np.asarray(times, dtype=np.float64), *self.cycle(loop, count))

    def cycle(self, loop=True, count=None) -> tuple:
        """Return its duration, that of a cycle and of all, and the moment held after them.

        Parameters
        ----------
        loop : bool or 'pingpong'
            Restart at the end, hold the last pose, or go there and back.
        count : float, optional
            Cycles until the last moment is held; default no end.
        """
        check_one_of('loop', loop, (True, False, 'pingpong'))
        span = 2 * self.duration if loop == 'pingpong' else self.duration
        if loop is False:
            count = 1
        if count is None:
            return self.duration, span, np.inf, 0.0
        return self.duration, span, count * span, (count % 1 or 1) * span

    def fits(self, rest) -> bool:
        """Return whether it drives nothing but joints that a pose has.

        Parameters
        ----------
        rest : Pose
            The pose.
        """
        return not self._weight_tracks and self._last_joint < rest.n_joints

    @cached_property
    def _weight_tracks(self):
        return [track for track in self.tracks if track.path == 'weights']

    @cached_property
    def joint_tracks(self) -> list[Track]:
        """Tracks of joints; the later of two for the same property wins."""
        return list({(t.node, t.path): t for t in self.tracks if t.path != 'weights'}.values())

    @cached_property
    def _lanes(self):
        return by_kind(self.joint_tracks)

    def _check_fit(self, rest):
        for what, last, many in self._ends(rest):
            if last >= many:
                raise ValueError(
                    f'clip {self.name!r} drives {what} {last}; the figure has {many}.'
                )

    def _ends(self, rest):
        yield 'joint', self._last_joint, rest.n_joints
        yield 'weight', self._last_weight, rest.weights.shape[-1]

    @cached_property
    def _last_joint(self):
        return max((t.node for t in self.tracks if t.path != 'weights'), default=-1)

    @cached_property
    def _last_weight(self):
        return max((t.node + t.width - 1 for t in self._weight_tracks), default=-1)


def _repeated(value, shape):
    out = np.empty(shape + value.shape)
    out[...] = value
    return out


class Lanes:
    """Tracks of one property and interpolation, evaluated together."""

    def __init__(self, tracks):
        sizes = np.array([len(track.times) for track in tracks])
        self.path, self._how = tracks[0].path, tracks[0].interpolation
        self._last = np.cumsum(sizes) - 1
        self._first = self._last - sizes + 1
        self._keys = np.concatenate([track.times for track in tracks])
        self._values = np.concatenate([track.values for track in tracks])
        # Complex numbers are in order by their real parts first: by track, then by time.
        self._order = np.repeat(np.arange(len(tracks)), sizes) + 1j * self._keys

    def at(self, times, lanes):
        """Return values (..., n, c) at times (..., n) of tracks by their numbers (n,)."""
        keys, last = self._keys, self._last[lanes]
        times = np.minimum(np.maximum(times, keys[self._first[lanes]]), keys[last])
        before = np.searchsorted(self._order, lanes + 1j * times, side='right') - 1
        if self._how == 'step':
            return self._values[before]
        after = np.minimum(before + 1, last)
        step = keys[after] - keys[before]
        part = (times - keys[before]) / np.where(step > 0, step, 1.0)
        a, b = self._values[before], self._values[after]
        if self._how == 'cubic':
            return _hermite(self.path, a, b, part[..., None], step[..., None])
        if self.path == 'rotation':
            return quaternions.slerp(a, b, part)
        return (1 - part[..., None]) * a + part[..., None] * b


def by_kind(tracks) -> list[tuple[Lanes, list[int]]]:
    """Return lanes by property and interpolation, and the places of their tracks."""
    alike: dict[tuple, list[int]] = {}
    for i, track in enumerate(tracks):
        alike.setdefault((track.path, track.interpolation), []).append(i)
    return [(Lanes([tracks[i] for i in places]), places) for places in alike.values()]


def local_times(times, duration, span, length, end):
    """Return times within clips from what :meth:`Clip.cycle` returns, numbers or arrays."""
    local = times % np.where(span > 0, span, 1.0)
    ended = np.where(times < 0, 0.0, np.where(times >= length, end, local))
    local = np.where(length < np.inf, ended, local)
    back = duration - np.abs(duration - local)
    return np.where(span > duration, back, np.minimum(local, duration))


def _hermite(path, before, after, part, step):
    """Blend keys (..., 3, c) by Hermite polynomials (glTF 2.0, appendix C.5)."""
    a, leaving = before[..., 1, :], before[..., 2, :] * step
    b, arriving = after[..., 1, :], after[..., 0, :] * step
    t2, t3 = part**2, part**3
    value = (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + part) * leaving
    value = value + (3 * t2 - 2 * t3) * b + (t3 - t2) * arriving
    return quaternions.normalized(value) if path == 'rotation' else value
