"""Packing of rectangles into a square."""

from __future__ import annotations

import numpy as np


def shelves(sizes, width):
    """Pack rectangles on shelves in order of descending height.

    Parameters
    ----------
    sizes : array_like of int, shape (n, 2)
        Width and height of each.
    width : int
        Width of all shelves.

    Returns
    -------
    corners : numpy.ndarray of int, shape (n, 2)
        The lower left corner of each.
    height : int
        Total height; the largest integer if a rectangle is too wide.

    Examples
    --------
    >>> from pvibr.maths.packing import shelves
    >>> corners, height = shelves([(2, 1), (3, 3), (3, 2)], 6)
    >>> corners.tolist(), height
    ([[0, 3], [0, 0], [3, 0]], 4)
    """
    sizes = np.asarray(sizes, int)
    corners = np.zeros_like(sizes)
    if (sizes[:, 0] > width).any():
        return corners, np.iinfo(int).max
    x = y = shelf = 0
    for k in np.lexsort((-sizes[:, 0], -sizes[:, 1])):
        w, h = sizes[k]
        if x + w > width:
            x, y, shelf = 0, y + shelf, 0
        corners[k] = x, y
        x, shelf = x + w, max(shelf, h)
    return corners, int(y + shelf)


def largest_scale(sizes, side, margin):
    """Return the maximum number of texels per unit such that rectangles fit into a square.

    Parameters
    ----------
    sizes : array_like, shape (n, 2)
        Width and height of each, in any unit.
    side, margin : int
        Texels of the square's side, and around each rectangle.

    Returns
    -------
    scale : float
        Texels per unit.
    texels, corners : numpy.ndarray of int, shape (n, 2)
        Size with margins, and lower left corner of each.

    Raises
    ------
    ValueError
        If they do not fit with a texel each.

    Examples
    --------
    >>> from pvibr.maths.packing import largest_scale
    >>> scale, texels, _ = largest_scale([(1, 1), (1, 1), (2, 1)], 64, 2)
    >>> round(scale), texels.tolist()
    (28, [[32, 32], [32, 32], [60, 32]])
    """
    sizes = np.asarray(sizes, float)

    def tried(scale):
        texels = np.maximum(np.ceil(sizes * scale - 1e-9), 1).astype(int) + 2 * margin
        return texels, *shelves(texels, side)

    low, high = 0.0, side / max(sizes.max(), 1e-300)
    if tried(low)[2] > side:
        raise ValueError(f'{len(sizes)} rectangles do not fit into {side} x {side} texels.')
    for _ in range(30):
        middle = (low + high) / 2
        if tried(middle)[2] <= side:
            low = middle
        else:
            high = middle
    return low, *tried(low)[:2]
