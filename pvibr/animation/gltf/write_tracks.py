"""Clips as glTF can say them: keys to the end, one track for all weights of a mesh."""

from __future__ import annotations

import numpy as np

from pvibr.animation.clip import Clip, Track


def one_hot(frames):
    """Return the weights of all key frames but the first, at each frame's time."""
    return np.eye(len(frames.times))[:, 1:]


def lasting(clip):
    """Return a clip whose last keys are at its end, since glTF knows no other duration."""
    last = max((track.times[-1] for track in clip.tracks), default=0.0)
    if clip.duration < last:
        raise ValueError(
            f'clip {clip.name!r} ends at {clip.duration} s, before its last key at {last} s, '
            'which glTF cannot say: cut its tracks first.'
        )
    if clip.duration == last:
        return clip
    return Clip(clip.name, [_held(track, clip.duration) for track in clip.tracks], clip.duration)


def weights_track(clip, first, mesh):
    """Return the weights of a mesh's frames and morph targets as one track."""
    tracks, rest = [], np.zeros(0)
    if mesh.frames is not None:
        tracks.append((0, _frame_track(clip, mesh.frames)))
        rest = np.zeros(len(mesh.frames.times) - 1)
    for track in clip.tracks:
        start = track.node - first  # among the mesh's own targets
        if track.path == 'weights' and -track.width < start < mesh.n_targets:
            own = track.values[..., max(-start, 0) : mesh.n_targets - start]
            part = Track(0, 'weights', track.times, own, track.interpolation)
            tracks.append((len(rest) + max(start, 0), part))
    if mesh.morphs is not None:
        rest = np.concatenate([rest, mesh.morphs.weights])
    return _together(clip, tracks, rest) if tracks else None


def _held(track, time):
    """Return a track with one more key that holds the last value."""
    values = track.values.copy()
    end = values[-1:].copy()
    if track.interpolation == 'cubic':
        values[-1, 2], end[0, 0] = 0, 0  # nothing moves between the two keys
    times = np.append(track.times, time)
    values = np.concatenate([values, end])
    return Track(track.node, track.path, times, values, track.interpolation)


def _frame_track(clip, frames):
    if frames.states is not None:
        raise ValueError(
            'key frames that states choose are no clip: make linear ones of Figure.series first.'
        )
    if frames.interpolation not in ('linear', 'step') or frames.period is not None:
        kind = frames.interpolation if frames.period is None else f'period of {frames.period} s'
        raise ValueError(
            f'key frames of {kind} are no morph targets: make linear ones of Figure.series.'
        )
    times, values = frames.times, one_hot(frames)
    keep = times <= clip.duration
    if not keep.all():
        rows, shares = frames.at(clip.duration)
        end = (np.eye(len(times))[rows] * shares[:, None]).sum(0)[1:]
        times, values = np.append(times[keep], clip.duration), np.vstack([values[keep], end])
        times, index = np.unique(times, return_index=True)
        values = values[index]
    return Track(0, 'weights', times, values, frames.interpolation)


def _together(clip, tracks, rest):
    """Return one track of all weights from tracks of some of them."""
    one = tracks[0][1]
    same = all(
        track.interpolation == one.interpolation and np.array_equal(track.times, one.times)
        for _, track in tracks
    )
    if not same:
        raise ValueError(
            f'clip {clip.name!r} drives the weights of one mesh by tracks with different keys, '
            'which glTF cannot say: give one track for all.'
        )
    values = np.zeros((*one.values.shape[:-1], len(rest)))
    values[(slice(None), 1) if one.interpolation == 'cubic' else slice(None)] = rest
    for start, track in tracks:
        values[..., start : start + track.width] = track.values
    return Track(0, 'weights', one.times, values, one.interpolation)
