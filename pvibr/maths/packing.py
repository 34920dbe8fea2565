"""Packing of rectangles into a square."""

from __future__ import annotations

import numpy as np


def shelves(sizes, width):
    """Pack rectangles (n, 2) on shelves, tallest first; return lower left corners and height.

    The height is the largest integer if one is too wide.
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
    """Return the most texels per unit at which rectangles (n, 2) fit into a square.

    And their sizes with margins, and lower left corners, in texels.
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
