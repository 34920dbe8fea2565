"""Checks of camera arguments: errors name the value and the allowed ones."""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import as_array

#: How far R may be from a rotation; float32 and seven printed digits pass.
ROTATION_TOLERANCE = 1e-6


def points_of(points):
    """Return points as float64, shape (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        msg = f'points have the shape {points.shape}; it must be (n, 3).'
        raise ValueError(msg)
    return points


def freeze(camera, **values):
    """Set fields of a frozen dataclass; arrays become read-only."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(camera, name, value)


def finite(name, values):
    """Return values; raise ValueError if one is not finite."""
    if not np.isfinite(values).all():
        msg = f'{name} is {values.tolist()}; all numbers must be finite.'
        raise ValueError(msg)
    return values


def numbers(name, values, shape):
    """Return finite float64 numbers of a shape."""
    try:
        found = as_array(name, values, np.float64).copy()
    except (TypeError, ValueError) as error:
        msg = f'{name} is {values!r:.200}; it must be numbers of the shape {shape}.'
        raise ValueError(msg) from error
    # OpenCV hands vectors out as columns.
    found = found.reshape(shape) if found.size == np.prod(shape) else found
    if found.shape != shape:
        msg = f'{name} has the shape {found.shape}; it must be {shape}.'
        raise ValueError(msg)
    return finite(name, found)


def direction(name, vector):
    """Return a unit vector."""
    vector = numbers(name, vector, (3,))
    largest = np.abs(vector).max()
    if not largest:
        msg = f'{name} is zero; it must have a direction.'
        raise ValueError(msg)
    vector = vector / largest
    return vector / np.linalg.norm(vector)


def size_of(size):
    """Return width and height in pixels."""
    found = as_array('size', size)
    good = found.shape == (2,) and found.dtype.kind in 'iuf' and np.isfinite(found).all()
    if not good or not (found > 0).all() or (found != np.floor(found)).any():
        msg = f'size is {size!r}; it must be (width, height) in pixels, whole numbers above 0.'
        raise ValueError(msg)
    return int(found[0]), int(found[1])
