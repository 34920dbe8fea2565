"""Poses of instances as checked arrays."""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import as_array

#: Smallest |det| / (product of the column lengths) of an invertible matrix: tiny scales pass,
#: collapsed axes fail.
SINGULAR = 1e-12
_AT_ONCE = 8192  # matrices whose numbers stay in the processor's cache


def as_poses(poses):
    """Return poses as a checked float64 array, (n, 3) or (n, 4, 4)."""
    array = _as_array(getattr(poses, 'points', poses))
    _check_finite(array)
    if array.ndim == 3:
        _check_matrices(array)
    return array


def placed_by(matrix, poses):
    """Return poses moved by a matrix, (4, 4); points stay points if it only translates."""
    if poses.ndim == 3:
        return matrix @ poses
    if (matrix[:3, :3] == np.eye(3)).all():
        return poses + matrix[:3, 3]
    out = np.tile(matrix, (len(poses), 1, 1))
    out[:, :3, 3] = poses @ matrix[:3, :3].T + matrix[:3, 3]
    return out


def mirror(poses) -> bool:
    """Return True if any pose mirrors."""
    return poses.ndim == 3 and any((_volumes(rows) < 0).any() for rows in _columns(poses))


def _as_array(poses):
    try:
        array = as_array('poses', poses, np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f'poses must be an array of numbers, (n, 3) or (n, 4, 4); {error}.'
        ) from error
    if array.size == 0 and array.ndim <= 2 and array.shape[-1] in (0, 3):
        return array.reshape(0, 3)
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if array.shape[1:] not in ((3,), (4, 4)):
        raise ValueError(
            f'poses has shape {np.shape(poses)}; it must be (n, 3) points or (n, 4, 4) matrices.'
        )
    return array


def _check_finite(array):
    # The sum is not finite if any value is not: one fast pass without a copy. It may also
    # overflow; then the full test decides.
    with np.errstate(over='ignore', invalid='ignore'):
        if np.isfinite(array.sum()):
            return
    good = np.isfinite(array).reshape(len(array), -1).all(axis=1)
    _complain(array, ~good, 'it must be finite')


def _check_matrices(array):
    if all(map(_invertible, _columns(array))):
        return
    _complain(
        array, (array[:, 3] != (0, 0, 0, 1)).any(axis=1), 'its last row must be (0, 0, 0, 1)'
    )
    linear = array[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    # Normalise columns, so that the determinant of tiny or huge scales stays in range.
    unit = linear / np.where(lengths > 0, lengths, 1)[:, None, :]
    singular = ~(np.abs(np.linalg.det(unit)) > SINGULAR)
    _complain(array, singular, 'it must have an inverse (no axis scaled to zero)')


def _columns(array):
    """Yield some matrices at a time, each number of them in one piece of memory, (4, 4, k)."""
    for start in range(0, len(array), _AT_ONCE):
        part = array[start : start + _AT_ONCE].reshape(-1, 16)
        yield np.ascontiguousarray(part.T).reshape(4, 4, -1)


def _volumes(rows):
    (a, b, c), (d, e, f), (g, h, i) = rows[:3, :3]
    with np.errstate(over='ignore', under='ignore', invalid='ignore'):
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def _invertible(rows) -> bool:
    """Return True for sound matrices; False also where tiny or huge numbers leave it open."""
    if rows[3, :3].any() or (rows[3, 3] != 1).any():
        return False
    with np.errstate(over='ignore', under='ignore', invalid='ignore'):
        x, y, z = np.sqrt((rows[:3, :3] * rows[:3, :3]).sum(0))
        lengths = x * y * z
        return bool((np.abs(_volumes(rows)) > 2 * SINGULAR * lengths).all() and lengths.all())


def _complain(array, bad, demand):
    rows = np.flatnonzero(bad)
    if rows.size:
        raise ValueError(
            f'poses[{rows[0]}] is {array[rows[0]].tolist()}; {demand} ({rows.size} such rows).'
        )
