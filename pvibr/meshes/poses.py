"""Poses of instances as checked arrays."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.nan_rows import filled

#: Smallest |det| / (product of column lengths) of an invertible matrix: tiny scales pass,
#: collapsed axes fail.
SINGULAR = 1e-12
_CHUNK = 8192  # matrices that fit the processor's cache


def as_poses(poses, nan_rows=None):
    """Return poses as a checked float64 array, (n, 3) or (n, 4, 4)."""
    array = filled(nan_rows, 'poses', _as_array(getattr(poses, 'points', poses)))
    _check_finite(array)
    if array.ndim == 3:
        _check_matrices(array)
    return array


def placed_by(matrix, poses):
    """Return poses transformed by a matrix, (4, 4); points stay points if it only translates."""
    if poses.ndim == 3:
        return matrix @ poses
    if (matrix[:3, :3] == np.eye(3)).all():
        return poses + matrix[:3, 3]
    matrices = np.tile(matrix, (len(poses), 1, 1))
    matrices[:, :3, 3] = poses @ matrix[:3, :3].T + matrix[:3, 3]
    return matrices


def mirror(poses) -> bool:
    """Return True if any pose mirrors."""
    return poses.ndim == 3 and any((_volumes(chunk) < 0).any() for chunk in _columns(poses))


def _as_array(poses):
    try:
        array = as_array('poses', poses, np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f'poses must be numbers, (n, 3) or (n, 4, 4): {error}') from error
    if array.size == 0 and array.ndim <= 2 and array.shape[-1] in (0, 3):
        return array.reshape(0, 3)
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if array.shape[1:] not in ((3,), (4, 4)):
        raise ValueError(
            f'poses must be (n, 3) points or (n, 4, 4) matrices, got shape {np.shape(poses)}'
        )
    return array


def _check_finite(array):
    # The sum is finite only if all values are: one fast pass without a copy. If it overflows, the
    # full test decides.
    with np.errstate(over='ignore', invalid='ignore'):
        if np.isfinite(array.sum()):
            return
    is_finite = np.isfinite(array).reshape(len(array), -1).all(axis=1)
    _complain(array, ~is_finite, 'be finite')


def _check_matrices(array):
    if all(map(_invertible, _columns(array))):
        return
    _complain(
        array, (array[:, 3] != (0, 0, 0, 1)).any(axis=1), 'have (0, 0, 0, 1) as its last row'
    )
    linear = array[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    # Normalise columns, so that the determinant of tiny or huge scales stays in range.
    unit = linear / np.where(lengths > 0, lengths, 1)[:, None, :]
    singular = ~(np.abs(np.linalg.det(unit)) > SINGULAR)
    _complain(array, singular, 'have an inverse, no axis scaled to zero')


def _columns(array):
    """Yield chunks of matrices with contiguous components, (4, 4, k)."""
    for start in range(0, len(array), _CHUNK):
        chunk = array[start : start + _CHUNK].reshape(-1, 16)
        yield np.ascontiguousarray(chunk.T).reshape(4, 4, -1)


def _volumes(components):
    (a, b, c), (d, e, f), (g, h, i) = components[:3, :3]
    with np.errstate(over='ignore', under='ignore', invalid='ignore'):
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def _invertible(components) -> bool:
    """Return True if all are affine and invertible; False also if numbers are out of range."""
    if components[3, :3].any() or (components[3, 3] != 1).any():
        return False
    with np.errstate(over='ignore', under='ignore', invalid='ignore'):
        x, y, z = np.sqrt((components[:3, :3] * components[:3, :3]).sum(0))
        lengths = x * y * z
        return bool(
            (np.abs(_volumes(components)) > 2 * SINGULAR * lengths).all() and lengths.all()
        )


def _complain(array, is_invalid, demand):
    invalid = np.flatnonzero(is_invalid)
    if invalid.size:
        first = invalid[0]
        raise ValueError(
            f'poses[{first}] must {demand}, got {array[first].tolist()} ({invalid.size} such)'
        )
