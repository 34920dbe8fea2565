"""Support function of a shape: how far it reaches in any direction.

The support function is ``h(u) = max over points p of p . u``, see Rockafellar, "Convex Analysis",
1970, section 13. It is convex and of degree one, so linear interpolation within a face of the
octahedron overestimates it: bounds stay bounds. ``cards.glsl`` holds the same formulas.
"""

from __future__ import annotations

import numpy as np

from pvibr.instances.hulls import hull_corners
from pvibr.maths.octahedral import view_directions

SIDE = 33  # grid points along a side of a table: odd, to include the six axes


def support_table(points, room=0.0):
    """Return the support function, enlarged by `room`, at points of the octahedron, (33, 33).

    Its corners are the unit axes; points lie as in :func:`pvibr.maths.octahedral.view_directions`.
    """
    return table_of(hull_corners(points)) + room * np.linalg.norm(_grid(SIDE), axis=-1)


def table_of(corners, side=SIDE):
    """Return the support function of a hull's corners (k, 3), as :func:`support_table` does."""
    return np.stack([(row @ corners.T).max(-1) for row in _grid(side)])


def support(table, vectors):
    """Return the support function of a table at vectors: exact on its grid, never less."""
    table = np.asarray(table, float)
    side, middle = len(table), len(table) // 2
    x, y, z = np.moveaxis(np.asarray(vectors, float), -1, 0)
    column_step, row_step = np.where(x < 0.0, -1, 1), np.where(y < 0.0, -side, side)
    x, y, is_below = np.abs(x), np.abs(y), z < 0.0
    length = x + y + np.abs(z)
    # As octahedral.encode() maps them, by column and row from the middle of the table.
    x, y = (np.where(is_below, length - b, a) * (middle / length) for a, b in ((x, y), (y, x)))
    column, row = (np.minimum(grid_position.astype(int), middle - 1) for grid_position in (x, y))
    x, y = x - column, y - row
    cell = (side + 1) * middle + column_step * column + row_step * row
    # Each half of a cell lies in one face.
    beyond = x + y > 1.0
    x, y = np.where(beyond, 1.0 - y, x), np.where(beyond, 1.0 - x, y)
    flat = table.ravel()
    first = flat.take(np.where(beyond, cell + column_step + row_step, cell))
    interpolated = flat.take(cell + column_step) - first
    interpolated *= x
    interpolated += y * (flat.take(cell + row_step) - first)
    return (interpolated + first) * length


def box_of(table):
    """Return the bounding box of the shape of a table, (2, 3)."""
    return np.stack([-support(table, -np.eye(3)), support(table, np.eye(3))])


def _grid(side):
    """Return points of the octahedron, (side, side, 3)."""
    directions = view_directions(side)
    return directions / np.abs(directions).sum(-1, keepdims=True)
