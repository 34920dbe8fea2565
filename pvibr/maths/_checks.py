"""Validation of camera arguments."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array

#: How far R may be from a rotation; float32 and seven printed digits pass.
ROTATION_TOLERANCE = 1e-6


def points_of(points):
    """Return points as float64, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f'points must have shape (n, 3), got {points.shape}')
    return points


def freeze(camera, **values):
    """Set fields of a frozen dataclass; arrays become read-only."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(camera, name, value)


def size_of(size):
    """Return width and height in pixels as integers."""
    pixels = as_array('size', size)
    numeric = pixels.shape == (2,) and pixels.dtype.kind in 'iuf' and np.isfinite(pixels).all()
    if not numeric or not (pixels > 0).all() or (pixels != np.floor(pixels)).any():
        raise ValueError(
            f'size must be (width, height), whole numbers of pixels above 0, got {size!r}'
        )
    return int(pixels[0]), int(pixels[1])
