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

    def packed(scale):
        texels = np.maximum(np.ceil(sizes * scale - 1e-9), 1).astype(int) + 2 * margin
        return texels, *shelves(texels, side)

    fitting_scale, upper_scale = 0.0, side / max(sizes.max(), 1e-300)
    if packed(fitting_scale)[2] > side:
        raise ValueError(f'side must be larger for {len(sizes)} rectangles, got {side}')
    for _ in range(30):
        middle_scale = (fitting_scale + upper_scale) / 2
        if packed(middle_scale)[2] <= side:
            fitting_scale = middle_scale
        else:
            upper_scale = middle_scale
    return fitting_scale, *packed(fitting_scale)[:2]
