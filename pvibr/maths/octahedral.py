"""Octahedral map of the sphere and the grid of views that an impostor is baked from.

The map is that of Cigolle et al., "A Survey of Efficient Representations for Independent Unit
Vectors", JCGT 3(2), 2014, section 3.1; the half-sphere variant is Brian Karis's and Ryan
Brucks's "hemi-octahedron" (the same square turned by 45 degrees over the upper half).
``cards.glsl`` holds the same formulas; tests compare the two.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.vectors import unit_vectors

_POLE = 0.99  # |z| above which the frame's helper axis is y instead of z


def encode(directions, half=False):
    """Map unit vectors to the square [-1, 1]^2; `half` clamps those below the equator to it."""
    d = np.asarray(directions, float)
    if half:
        # Straight from below all views of the horizon are equally close: take that of x.
        d = np.concatenate([d[..., :1] + 1e-15, d[..., 1:2], np.maximum(d[..., 2:], 0.0)], -1)
    p = d[..., :2] / np.add.reduce(np.abs(d), -1, keepdims=True)
    if half:
        return np.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], -1)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0.0, 1.0, -1.0)
    return np.where(d[..., 2:] < 0.0, folded, p)


def decode(points, half=False):
    """Map points (..., 2) of the square [-1, 1]^2 back to unit vectors."""
    p = np.asarray(points, float)
    if half:
        p = 0.5 * np.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], -1)
    z = 1.0 - np.abs(p).sum(-1, keepdims=True)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0.0, 1.0, -1.0)
    d = np.concatenate([np.where(z < 0.0, folded, p), z], -1)
    return unit_vectors(d)


def cells(directions, n, half=False):
    """Return the cells, numbered row by row, of an n x n division that directions lie in.

    And how far they are inside, from the next cell, in sides of a cell.
    """
    # By ufuncs alone: numpy's functions around them take longer than few directions do.
    grid_position = (encode(directions, half) + 1.0) * (n / 2)
    cell_index = np.minimum(np.maximum(grid_position.astype(int), 0), n - 1)
    if half:  # there is no cell beyond the border
        grid_position = np.minimum(np.maximum(grid_position, 0.5), n - 0.5)
    cell_margin = 0.5 - np.maximum.reduce(np.abs(grid_position - cell_index - 0.5), -1)
    return cell_index[..., 1] * n + cell_index[..., 0], cell_margin


def view_directions(n, half=False):
    """Return the directions toward the eye of an n x n grid of views, (n, n, 3)."""
    grid_line = np.linspace(-1.0, 1.0, n)
    x, y = np.meshgrid(grid_line, grid_line)
    return decode(np.stack([x, y], -1), half)


def frame(directions):
    """Return the axes of views as rows right, up, toward the eye, (..., 3, 3)."""
    toward_eye = np.asarray(directions, float)
    helper_axis = np.where(np.abs(toward_eye[..., 2:]) < _POLE, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    right = np.cross(helper_axis, toward_eye)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    return np.stack([right, np.cross(toward_eye, right), toward_eye], -2)
