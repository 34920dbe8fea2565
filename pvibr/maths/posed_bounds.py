"""Tight bounds of a shape at many poses."""

from __future__ import annotations

import numpy as np

_CHUNK = 4_000_000  # products of rows and corners at once
_MANY = 10_000  # points from which those deep inside are left out first
_OUTWARD = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
_ROUNDING = 1e-9  # of the size: a point that is less far inside may be a corner


def hull_corners(points):
    """Return the points on the convex hull of a shape.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Any units.

    Returns
    -------
    numpy.ndarray, shape (k, 3), float64
        Corners of the hull; all distinct points if these lie in a plane.

    Examples
    --------
    >>> from pvibr.maths.posed_bounds import hull_corners
    >>> cube = np.stack(np.meshgrid([0, 1, 2], [0, 1, 2], [0, 1, 2]), -1).reshape(-1, 3)
    >>> len(cube), len(hull_corners(cube))
    (27, 8)
    """
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
    """Return a mask of the points that are not inside the hull of some extreme ones."""
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


def posed_bounds(corners, poses, center=None, spheres=None):
    """Return the bounds of a shape at all of some poses, exact up to rounding.

    Bounding spheres and boxes rule out most poses on each side; the corners decide among the rest.

    Parameters
    ----------
    corners : array_like, shape (k, 3)
        Corners of the shape, model units, as :func:`hull_corners` returns.
    poses : array_like, shape (n, 3) or (n, 4, 4)
        Points, or matrices from model to world; at least one.
    center : array_like, shape (3,), optional
        A point of the shape, model units; by default the middle of its box.
    spheres : (numpy.ndarray, numpy.ndarray), optional
        Where the poses place that point, shape (3, n), and radii of spheres around it that hold
        the shape, shape (n,), world units: what is known need not be found again.

    Returns
    -------
    numpy.ndarray, shape (2, 3), float64
        Lowest and highest coordinates, world units.

    Examples
    --------
    >>> from pvibr.maths.posed_bounds import posed_bounds
    >>> ends = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    >>> posed_bounds(ends, [[0.0, 0.0, 0.0], [5.0, 0.0, 2.0]]).tolist()
    [[0.0, 0.0, 0.0], [6.0, 0.0, 2.0]]
    """
    corners, poses = np.asarray(corners, float), np.asarray(poses, float)
    if poses.ndim == 2:
        return np.stack([corners.min(0) + poses.min(0), corners.max(0) + poses.max(0)])
    if center is None:
        center, spheres = (corners.min(0) + corners.max(0)) / 2, None
    if spheres is None:
        linear = poses[:, :3, :3]
        radius = np.linalg.norm(corners - center, axis=1).max()
        radii = np.linalg.norm(linear, axis=(1, 2)) * radius
        spheres = (linear @ center + poses[:, :3, 3]).T, radii
    places, radii = spheres
    corners = corners - center
    out = np.empty((2, 3))
    for axis in range(3):
        rows, along = poses[:, axis, :3], places[axis]
        out[0, axis] = -_highest(rows, -along, radii, -corners)
        out[1, axis] = _highest(rows, along, radii, corners)
    return out


def _highest(rows, along, radii, corners):
    """Return the highest of ``along + row . corner``, where no product is above its radius."""
    bounds = along + radii
    best = _exact(rows, along, bounds.argmax(keepdims=True), corners)
    left = np.flatnonzero(bounds > best)
    bounds = along[left] + np.abs(rows[left]) @ np.abs(corners).max(0)
    if len(left):
        best = max(best, _exact(rows, along, left[bounds.argmax(keepdims=True)], corners))
    left = left[bounds > best]
    # Poses that turn about one axis share a row of their matrices: the farthest of these will do.
    left = left[np.lexsort((along[left], *rows[left].T))]
    if len(left):
        left = left[np.append((np.diff(rows[left], axis=0) != 0).any(1), True)]
    step = max(1, _CHUNK // len(corners))
    chunks = (left[k : k + step] for k in range(0, len(left), step))
    return max([best, *(_exact(rows, along, chunk, corners) for chunk in chunks)])


def _exact(rows, along, which, corners):
    return (along[which] + (rows[which] @ corners.T).max(1)).max()
