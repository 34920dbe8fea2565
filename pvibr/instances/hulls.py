"""Convex hulls of points."""

from __future__ import annotations

import numpy as np

_MANY = 10_000  # above so many points, those deep inside are removed first
_OUTWARD = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
_ROUNDING = 1e-9  # of the size: points nearer to a face may be corners


def hull_corners(points):
    """Return the corners of the convex hull of points, (k, 3); all distinct points if coplanar."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.asarray(points, float)
    if len(points) > _MANY:
        points = points[_may_be_corners(points)]
    points = np.unique(points, axis=0)
    try:
        # Relative to the centre: far from the origin the hull would lose digits.
        return points[ConvexHull(points - points.mean(0)).vertices]
    except (QhullError, ValueError):
        return points


def _may_be_corners(points) -> np.ndarray:
    """Return which points lie outside the hull of a few extreme ones."""
    from scipy.spatial import ConvexHull, QhullError

    may_be_corner, local_points = np.zeros(len(points), bool), points - points.mean(0)
    extreme_points = np.unique([(local_points @ direction).argmax() for direction in _OUTWARD])
    try:
        planes = ConvexHull(local_points[extreme_points]).equations
    except (QhullError, ValueError):
        return ~may_be_corner
    slack = _ROUNDING * np.ptp(local_points, axis=0).max()
    for *normal, offset in planes.tolist():
        may_be_corner |= local_points @ normal > -offset - slack
    return may_be_corner
