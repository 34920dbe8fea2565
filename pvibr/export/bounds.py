"""Boxes around points."""

from __future__ import annotations

import numpy as np


def bounds_of(sets):
    """Return the corners of the smallest box around sets of points, (2, 3); zeros if empty."""
    points = np.concatenate([np.zeros((0, 3)), *sets])
    return np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 3))
