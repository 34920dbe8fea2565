"""Support function of a shape: how far it reaches in any direction.

The support function is ``h(u) = max over points p of p . u``, see Rockafellar, "Convex Analysis",
1970, section 13. It is convex and of degree one, so linear interpolation within a face of the
octahedron overestimates it: what it bounds stays within. ``cards.glsl`` holds the same formulas.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.octahedral import encode, view_directions
from pvibr.maths.posed_bounds import hull_corners

SIDE = 33  # grid points along a side of a table: odd, so that it has the six axes
_MIDDLE = SIDE // 2


def support_table(points, room=0.0):
    """Return the support function at points of the octahedron whose corners are the unit axes.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Those of the shape.
    room : float
        Distance by which the shape may reach farther, same unit.

    Returns
    -------
    numpy.ndarray, shape (33, 33), float64
        Distances from the origin times the lengths of the grid points, which lie as those of
        :func:`pvibr.maths.octahedral.view_directions`.

    Examples
    --------
    >>> from pvibr.maths.support import support_table
    >>> support_table([[0.0, 0.0, 2.0], [1.0, 0.0, 0.0]])[16, [16, 32]].tolist()
    [2.0, 1.0]
    """
    corners, grid = hull_corners(points), _grid()
    return (grid @ corners.T).max(-1) + room * np.linalg.norm(grid, axis=-1)


def support(table, vectors):
    """Return the support function in directions, or hardly more.

    Parameters
    ----------
    table : array_like, shape (33, 33)
        Of :func:`support_table`.
    vectors : array_like, shape (..., 3)
        Directions of any length but 0, by which distances are multiplied.

    Returns
    -------
    numpy.ndarray, shape (...), float64
        Distances: exact in the directions of the grid, never less in others.

    Examples
    --------
    >>> from pvibr.maths.support import support, support_table
    >>> table = support_table([[0.0, 0.0, 2.0], [1.0, 0.0, 0.0]])
    >>> support(table, [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]).tolist()
    [2.0, 0.0]
    """
    vectors = np.asarray(vectors, float)
    place = encode(vectors)
    sign, place = np.where(place >= 0.0, 1, -1), np.abs(place) * _MIDDLE
    low = np.minimum(place.astype(int), _MIDDLE - 1)
    part = place - low

    def at(x, y):
        column, row = np.moveaxis(_MIDDLE + sign * (low + np.array([x, y])), -1, 0)
        return np.asarray(table, float)[row, column]

    # Halves of a cell lie in one face each.
    beyond = part.sum(-1) > 1.0
    x, y = np.moveaxis(np.where(beyond[..., None], 1.0 - part[..., ::-1], part), -1, 0)
    first = np.where(beyond, at(1, 1), at(0, 0))
    found = first + x * (at(1, 0) - first) + y * (at(0, 1) - first)
    return found * np.abs(vectors).sum(-1)


def box_of(table):
    """Return the bounding box of the shape of a table.

    Parameters
    ----------
    table : array_like, shape (33, 33)
        Of :func:`support_table`.

    Returns
    -------
    numpy.ndarray, shape (2, 3), float64
        Lowest and highest coordinates.

    Examples
    --------
    >>> from pvibr.maths.support import box_of, support_table
    >>> box_of(support_table([[0.0, 0.0, 2.0], [1.0, 0.0, 0.0]])).tolist()
    [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]
    """
    return np.stack([-support(table, -np.eye(3)), support(table, np.eye(3))])


def _grid():
    """Return the points of the octahedron, (SIDE, SIDE, 3)."""
    directions = view_directions(SIDE)
    return directions / np.abs(directions).sum(-1, keepdims=True)
