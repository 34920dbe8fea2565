"""Validation of camera arguments."""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import as_array

#: How far R may be from a rotation; float32 and seven printed digits pass.
ROTATION_TOLERANCE = 1e-6


def points_of(points):
    """Return points as float64, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f'points have the shape {points.shape}; it must be (n, 3).')
    return points


def freeze(camera, **values):
    """Set fields of a frozen dataclass; arrays become read-only."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(camera, name, value)


def size_of(size):
    """Return width and height in pixels as integers."""
    found = as_array('size', size)
    good = found.shape == (2,) and found.dtype.kind in 'iuf' and np.isfinite(found).all()
    if not good or not (found > 0).all() or (found != np.floor(found)).any():
        raise ValueError(
            f'size is {size!r}; it must be (width, height) in pixels, whole numbers above 0.'
        )
    return int(found[0]), int(found[1])
