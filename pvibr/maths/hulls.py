"""Convex hulls of points."""

from __future__ import annotations

import numpy as np

_MANY = 10_000  # points from which those deep inside are left out first
_OUTWARD = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
_ROUNDING = 1e-9  # of the size: a point that is less far inside may be a corner


def hull_corners(points):
    """Return the corners of the convex hull of points, (k, 3); all distinct points if coplanar."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.asarray(points, float)
    if len(points) > _MANY:
        points = points[_may_be_corners(points)]
    points = np.unique(points, axis=0)
    try:
        # Relative to the middle: the hull of what is far from the origin loses digits.
        return points[ConvexHull(points - points.mean(0)).vertices]
    except (QhullError, ValueError):
        return points


def _may_be_corners(points) -> np.ndarray:
    """Return which points lie outside the hull of a few extreme ones."""
    from scipy.spatial import ConvexHull, QhullError

    outside, places = np.zeros(len(points), bool), points - points.mean(0)
    extreme = np.unique([(places @ direction).argmax() for direction in _OUTWARD])
    try:
        planes = ConvexHull(places[extreme]).equations
    except (QhullError, ValueError):
        return ~outside
    slack = _ROUNDING * np.ptp(places, axis=0).max()
    for *normal, offset in planes.tolist():
        outside |= places @ normal > -offset - slack
    return outside
