"""Clips as glTF can express them: keys to the end, one track for all weights of a mesh."""

from __future__ import annotations

import numpy as np

from pvibr.animation.clip import Clip, Track


def one_hot(frames):
    """Return the weights of all key frames but the first, at each frame's time."""
    return np.eye(len(frames.times))[:, 1:]


def lasting(clip):
    """Return a clip whose last keys are at its end, since glTF stores no duration."""
    last_key = max((track.times[-1] for track in clip.tracks), default=0.0)
    if clip.duration < last_key:
        raise ValueError(
            f'clip {clip.name!r} must last until its last key at {last_key} s to be '
            f'written as glTF, got {clip.duration} s; cut its tracks first'
        )
    if clip.duration == last_key:
        return clip
    tracks = [_extended_track(track, clip.duration) for track in clip.tracks]
    return Clip(clip.name, tracks, clip.duration)


def weights_track(clip, first_column, mesh):
    """Return the weights of a mesh's frames and morph targets as one track."""
    tracks, rest_weights = [], np.zeros(0)
    if mesh.frames is not None:
        tracks.append((0, _frame_track(clip, mesh.frames)))
        rest_weights = np.zeros(len(mesh.frames.times) - 1)
    for track in clip.tracks:
        offset = track.node - first_column  # among the mesh's own targets
        if track.path == 'weights' and -track.width < offset < mesh.n_targets:
            mesh_values = track.values[..., max(-offset, 0) : mesh.n_targets - offset]
            mesh_track = Track(0, 'weights', track.times, mesh_values, track.interpolation)
            tracks.append((len(rest_weights) + max(offset, 0), mesh_track))
    if mesh.morphs is not None:
        rest_weights = np.concatenate([rest_weights, mesh.morphs.weights])
    return _merged_track(clip, tracks, rest_weights) if tracks else None


def _extended_track(track, time):
    """Return a track with one more key that holds the last value."""
    values = track.values.copy()
    end_values = values[-1:].copy()
    if track.interpolation == 'cubic':
        values[-1, 2], end_values[0, 0] = 0, 0  # nothing moves between the two keys
    times = np.append(track.times, time)
    values = np.concatenate([values, end_values])
    return Track(track.node, track.path, times, values, track.interpolation)


def _frame_track(clip, frames):
    period = f'a period of {frames.period} s' if frames.period is not None else None
    frame_kind = 'states' if frames.states is not None else period or frames.interpolation
    if frame_kind not in ('linear', 'step'):
        raise ValueError(
            'vertex animation must be linear or stepped key frames to be written as glTF, '
            f'got {frame_kind}; convert it by Figure.series'
        )
    times, values = frames.times, one_hot(frames)
    keep = times <= clip.duration
    if not keep.all():
        frame_indices, frame_weights = frames.at(clip.duration)
        end = (np.eye(len(times))[frame_indices] * frame_weights[:, None]).sum(0)[1:]
        times, values = np.append(times[keep], clip.duration), np.vstack([values[keep], end])
        times, index = np.unique(times, return_index=True)
        values = values[index]
    return Track(0, 'weights', times, values, frames.interpolation)


def _merged_track(clip, tracks, rest):
    """Return one track of all weights from tracks of some of them."""
    first_track = tracks[0][1]
    same_keys = all(
        track.interpolation == first_track.interpolation
        and np.array_equal(track.times, first_track.times)
        for _, track in tracks
    )
    if not same_keys:
        raise ValueError(
            f'clip {clip.name!r} must drive the weights of a mesh by equal keys to be '
            'written as glTF, got different ones; merge its tracks'
        )
    values = np.zeros((*first_track.values.shape[:-1], len(rest)))
    values[(slice(None), 1) if first_track.interpolation == 'cubic' else slice(None)] = rest
    for first_target, track in tracks:
        values[..., first_target : first_target + track.width] = track.values
    return Track(0, 'weights', first_track.times, values, first_track.interpolation)
