"""Closedness of triangle meshes."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

_THIN = 1e-6  # thickness, of the whole size, below which a piece's sides are not told apart


def encloses(points, faces) -> bool:
    """Return True if triangles are closed and oriented outward.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Any units; points of equal coordinates are one.
    faces : array_like of int, shape (m, 3)
        Indices of points, counter-clockwise seen from outside.

    Returns
    -------
    bool
        True if each edge is used as often in one direction as in the other, and each connected
        component has a positive volume.

    Examples
    --------
    >>> from pvibr.maths.surfaces import encloses
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> encloses(corners, sides), encloses(corners, sides[1:]), encloses(corners, sides[:, ::-1])
    (True, False, False)
    """
    return winding(points, faces) > 0


def winding(points, faces) -> int:
    """Return the side from which triangles that are closed run counter-clockwise.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Any units; points of equal coordinates are one.
    faces : array_like of int, shape (m, 3)
        Indices of points.

    Returns
    -------
    int
        1 seen from outside, -1 seen from inside, 0 if triangles are not closed or if it is not
        the same for all connected components.

    Examples
    --------
    >>> from pvibr.maths.surfaces import winding
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> winding(corners, sides), winding(corners, sides[1:]), winding(corners, sides[:, ::-1])
    (1, 0, -1)
    """
    faces = np.asarray(faces)
    if not len(faces):
        return 0
    points, same = np.unique(np.asarray(points), axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    count = len(points)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if not np.array_equal(np.sort(begin * count + end), np.sort(end * count + begin)):
        return 0
    graph = coo_array((np.ones(len(begin), np.int8), (begin, end)), shape=(count, count))
    _, pieces = connected_components(graph, directed=False)
    local = (points - points.mean(0)).astype(float)
    a, b, c = (local / (np.ptp(local, axis=0).max() or 1.0))[faces.T]
    piece = pieces[faces[:, 0]]
    volumes = np.bincount(piece, (a * np.cross(b, c)).sum(1) / 6)
    areas = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    if (volumes > _THIN * areas)[piece].all():
        return 1
    return -1 if (volumes < -_THIN * areas)[piece].all() else 0
