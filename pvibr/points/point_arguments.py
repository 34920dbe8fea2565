"""Checked arguments of items at points: positions, sizes, opacity."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.core.arguments import as_array, check_finite, checked_lengths
from pvibr.core.nan_rows import NanRows, filled
from pvibr.io.tables import columns_table
from pvibr.meshes.posed import source_of


def points_and_scalars(name, points, scalars):
    """Return points and scalars as arrays where points are a dataset or table, NaN included."""
    array_names = [scalars] if isinstance(scalars, str) else []
    if not isinstance(points, _vtk.vtkDataSet) and columns_table(points) is None:
        if array_names:
            scalars = source_of(points, argument=name, oriented=False).scalars(scalars)
        return points, scalars
    nan_rows = NanRows('hide')
    source = source_of(points, *array_names, argument=name, oriented=False, nan_rows=nan_rows)
    points = np.array(source.poses, float)
    if nan_rows.mask is not None:
        points[nan_rows.mask] = np.nan
    return points, source.scalars(scalars) if array_names else scalars


def as_points(name, points, nan_rows=None) -> np.ndarray:
    """Return points, shape (n, 3), as a checked float64 array."""
    point_array = as_floats(name, getattr(points, 'points', points))
    if point_array.shape not in ((0,), (3,)) and point_array.shape[1:] != (3,):
        raise ValueError(f'{name} must be of shape (n, 3), got {point_array.shape}')
    point_array = filled(nan_rows, name, point_array.reshape(-1, 3))
    check_finite(name, point_array)
    return point_array


def as_floats(name, values) -> np.ndarray:
    """Return values as a float64 array."""
    try:
        return as_array(name, values, float)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} must be numbers, got {values!r:.80}') from error


def lengths_of(name, lengths, shape, nan_rows=None) -> np.ndarray:
    """Return lengths as a checked float64 array of a shape, copied."""
    length_array = as_floats(name, lengths)
    if length_array.shape not in ((), shape, shape[1:]):
        allowed = ', '.join(str(s) for s in dict.fromkeys((shape, shape[1:])) if s)
        raise ValueError(
            f'{name} must be one number or of shape {allowed}, got shape {length_array.shape}'
        )
    if length_array.shape == shape:
        length_array = filled(nan_rows, name, length_array)
    return np.broadcast_to(checked_lengths(name, length_array), shape).copy()


def checked_opacity(opacity, count, cut) -> np.ndarray:
    """Return the checked opacity of all items, shape (), or of each, shape (n,)."""
    values = as_floats('opacity', opacity)
    if values.shape not in ((), (count,)) or not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f'opacity must be one number or {count}, from 0 to 1, got {values}')
    if values.ndim and cut:
        raise ValueError('opacity must be one number for cut-outs, got an array: use cutout=None')
    return values
