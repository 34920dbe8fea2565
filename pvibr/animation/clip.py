"""Clips: key frames over time and the interpolation between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.animation.keyframes import checked_keys
from pvibr.animation.pose import unchecked_pose
from pvibr.core.arguments import check_finite, check_one_of
from pvibr.maths import quaternions

#: Components per value, by property; None for any number.
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
            raise ValueError(f'node must be 0 or more, got {self.node}')
        key_times = checked_keys(self.times, 'times')
        key_values = np.asarray(self.values, dtype=np.float64)
        self._check_values(key_values, len(key_times))
        if self.path == 'rotation':
            key_values = self._unit(key_values)
        object.__setattr__(self, 'times', key_times)
        object.__setattr__(self, 'values', key_values)

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

    def _check_values(self, values, count):
        is_cubic = self.interpolation == 'cubic'
        width = WIDTHS[self.path] or (values.shape[-1] if values.ndim else 1)
        shape = (count, 3, width) if is_cubic else (count, width)
        if values.shape != shape:
            name = f'values of a {self.interpolation} track of {self.path} with {count} keys'
            raise ValueError(f'{name} must have shape {shape}, got {values.shape}')
        check_finite('values', values)

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
        last_key = max((track.times[-1] for track in self.tracks), default=0.0)
        self.duration = float(last_key if duration is None else duration)
        if not 0 <= self.duration < np.inf:
            raise ValueError(f'duration of clip {self.name!r} must be 0 s or more, got {duration}')

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
            Restart at the end, hold the last pose, or play back and forth.

        Raises
        ------
        ValueError
            If a track drives a joint or a weight that ``rest`` lacks.
        """
        self._check_fit(rest)
        times = self.local_time(times, loop)
        check_finite('time', times)
        rest_parts = ((name, getattr(rest, name)) for name in WIDTHS)
        pose_parts = {k: np.broadcast_to(v, times.shape + v.shape).copy() for k, v in rest_parts}
        for lanes, track_places in self._lanes:
            joints = [self.joint_tracks[i].node for i in track_places]
            lane_values = lanes.at(times[..., None], np.arange(len(joints)))
            pose_parts[lanes.path][..., joints, :] = lane_values
        for track in self._weight_tracks:
            weight_columns = slice(track.node, track.node + track.width)
            pose_parts['weights'][..., weight_columns] = track.sample(times)
        return unchecked_pose(**pose_parts, time=times)

    def local_time(self, times, loop=True, count=None):
        """Return times within the clip, in seconds; a loop restarts at the duration itself.

        After a count of cycles, forth and back for 'pingpong', the last moment is held.
        """
        return local_times(np.asarray(times, dtype=np.float64), *self.cycle(loop, count))

    def cycle(self, loop=True, count=None) -> tuple:
        """Return the durations of clip, cycle and all cycles, and the moment held after them."""
        check_one_of('loop', loop, (True, False, 'pingpong'))
        cycle = 2 * self.duration if loop == 'pingpong' else self.duration
        if loop is False:
            count = 1
        if count is None:
            return self.duration, cycle, np.inf, 0.0
        return self.duration, cycle, count * cycle, (count % 1 or 1) * cycle

    def fits(self, rest) -> bool:
        """Return whether it drives only joints, all of which a pose has."""
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
        for kind, last, count in (
            ('joint', self._last_joint, rest.n_joints),
            ('weight', self._last_weight, rest.weights.shape[-1]),
        ):
            if last >= count:
                raise ValueError(
                    f'{kind}s of clip {self.name!r} must be below {count}, got {last}'
                )

    @cached_property
    def _last_joint(self):
        return max((t.node for t in self.tracks if t.path != 'weights'), default=-1)

    @cached_property
    def _last_weight(self):
        return max((t.node + t.width - 1 for t in self._weight_tracks), default=-1)


class Lanes:
    """Tracks of one property and interpolation, evaluated together."""

    def __init__(self, tracks):
        key_counts = np.array([len(track.times) for track in tracks])
        self.path, self._interpolation = tracks[0].path, tracks[0].interpolation
        self._last = np.cumsum(key_counts) - 1
        self._first = self._last - key_counts + 1
        self._keys = np.concatenate([track.times for track in tracks])
        self._values = np.concatenate([track.values for track in tracks])
        # numpy orders complex numbers by their real parts first: by track, then by time.
        self._order = np.repeat(np.arange(len(tracks)), key_counts) + 1j * self._keys

    def at(self, times, lanes):
        """Return values (..., n, c) at times (..., n) of tracks by their numbers (n,)."""
        key_times, last_keys = self._keys, self._last[lanes]
        times = np.minimum(np.maximum(times, key_times[self._first[lanes]]), key_times[last_keys])
        before = np.searchsorted(self._order, lanes + 1j * times, side='right') - 1
        if self._interpolation == 'step':
            return self._values[before]
        after = np.minimum(before + 1, last_keys)
        spacing = key_times[after] - key_times[before]
        fraction = (times - key_times[before]) / np.where(spacing > 0, spacing, 1.0)
        start, end = self._values[before], self._values[after]
        if self._interpolation == 'cubic':
            return _hermite(self.path, start, end, fraction[..., None], spacing[..., None])
        if self.path == 'rotation':
            return quaternions.slerp(start, end, fraction)
        return (1 - fraction[..., None]) * start + fraction[..., None] * end


def by_kind(tracks) -> list[tuple[Lanes, list[int]]]:
    """Return lanes by property and interpolation, and the places of their tracks."""
    places_by_kind: dict[tuple, list[int]] = {}
    for i, track in enumerate(tracks):
        places_by_kind.setdefault((track.path, track.interpolation), []).append(i)
    return [(Lanes([tracks[i] for i in places]), places) for places in places_by_kind.values()]


def local_times(times, duration, cycle_duration, total_duration, held_moment):
    """Return times within clips from what :meth:`Clip.cycle` returns, numbers or arrays."""
    local = times % np.where(cycle_duration > 0, cycle_duration, 1.0)
    held = np.where(times < 0, 0.0, np.where(times >= total_duration, held_moment, local))
    local = np.where(total_duration < np.inf, held, local)
    mirrored_time = duration - np.abs(duration - local)
    return np.where(cycle_duration > duration, mirrored_time, np.minimum(local, duration))


def _hermite(path, key_before, key_after, t, key_spacing):
    """Blend keys (..., 3, c) by Hermite polynomials (glTF 2.0, appendix C.5)."""
    before, out_tangent = key_before[..., 1, :], key_before[..., 2, :] * key_spacing
    after, in_tangent = key_after[..., 1, :], key_after[..., 0, :] * key_spacing
    t2, t3 = t**2, t**3
    hermite_value = (2 * t3 - 3 * t2 + 1) * before + (t3 - 2 * t2 + t) * out_tangent
    hermite_value = hermite_value + (3 * t2 - 2 * t3) * after + (t3 - t2) * in_tangent
    return quaternions.normalized(hermite_value) if path == 'rotation' else hermite_value
