"""Sample patterns around a texel."""

from __future__ import annotations

import operator

import numpy as np

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def vogel_disk(n):
    """Return n points that fill the unit disk evenly, from the middle out, (n, 2).

    Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 44, 1979.
    """
    if operator.index(n) < 1:
        raise ValueError(f'n must be at least 1, got {n}')
    point_index = np.arange(n)
    radii = np.sqrt((point_index + 0.5) / n)
    angles = _GOLDEN_ANGLE * point_index
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
