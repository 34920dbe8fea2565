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
    """Map unit vectors to the square.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Unit vectors; with ``half``, those below the equator are moved to it.
    half : bool
        Use the half-sphere map (z >= 0).

    Returns
    -------
    numpy.ndarray, shape (..., 2)
        Points of [-1, 1]^2.

    Examples
    --------
    >>> from pvibr.maths import octahedral
    >>> octahedral.encode([0.0, 0.0, 1.0]).tolist()
    [0.0, 0.0]
    """
    d = np.asarray(directions, float)
    if half:
        # Straight from below every view of the horizon is as near: take that of x.
        d = np.concatenate([d[..., :1] + 1e-15, d[..., 1:2], np.maximum(d[..., 2:], 0.0)], -1)
    p = d[..., :2] / np.abs(d).sum(-1, keepdims=True)
    if half:
        return np.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], -1)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0.0, 1.0, -1.0)
    return np.where(d[..., 2:] < 0.0, folded, p)


def decode(points, half=False):
    """Map points of the square back to unit vectors.

    Parameters
    ----------
    points : array_like, shape (..., 2)
        Points of [-1, 1]^2.
    half : bool
        Use the half-sphere map.

    Returns
    -------
    numpy.ndarray, shape (..., 3)
        Unit vectors.

    Examples
    --------
    >>> from pvibr.maths import octahedral
    >>> octahedral.decode([1.0, 0.0]).tolist()
    [1.0, 0.0, 0.0]
    """
    p = np.asarray(points, float)
    if half:
        p = 0.5 * np.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], -1)
    z = 1.0 - np.abs(p).sum(-1, keepdims=True)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0.0, 1.0, -1.0)
    d = np.concatenate([np.where(z < 0.0, folded, p), z], -1)
    return unit_vectors(d)


def cells(directions, n, half=False):
    """Return the cells of an n x n division of the square that directions lie in.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Unit vectors.
    n : int
        Cells along a side.
    half : bool
        Use the half-sphere map.

    Returns
    -------
    cells : numpy.ndarray, shape (...), intp
        Numbers of the cells, row by row.
    inside : numpy.ndarray, shape (...), float
        How far they are from the next cell, in sides of a cell.

    Examples
    --------
    >>> from pvibr.maths import octahedral
    >>> cells, inside = octahedral.cells([[0.6, 0.48, 0.64]], 4)
    >>> cells, inside.round(2)
    (array([10]), array([0.3]))
    """
    place = (encode(directions, half) + 1.0) * (n / 2)
    found = np.clip(place.astype(int), 0, n - 1)
    if half:  # beyond the outer border there is none
        place = np.clip(place, 0.5, n - 0.5)
    inside = 0.5 - np.abs(place - found - 0.5).max(-1)
    return found[..., 1] * n + found[..., 0], inside


def view_directions(n, half=False):
    """Return the directions of an n x n grid of views, from the object toward the eye.

    Parameters
    ----------
    n : int
        Views along a side; grid points lie on the border, so the fold is hit exactly.
    half : bool
        Views of the upper half only.

    Returns
    -------
    numpy.ndarray, shape (n, n, 3)
        Unit vectors; the first index is the row (second coordinate of the square).

    Examples
    --------
    >>> from pvibr.maths import octahedral
    >>> octahedral.view_directions(3)[1, 1].tolist()
    [0.0, 0.0, 1.0]
    """
    side = np.linspace(-1.0, 1.0, n)
    x, y = np.meshgrid(side, side)
    return decode(np.stack([x, y], -1), half)


def frame(directions):
    """Return right, up and toward-eye axes of views: the rows of a rotation.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Unit vectors from the object toward the eye.

    Returns
    -------
    numpy.ndarray, shape (..., 3, 3)
        Rows are right, up, direction: ``frame @ p`` is ``p`` in the view's axes.

    Examples
    --------
    >>> from pvibr.maths import octahedral
    >>> octahedral.frame([1.0, 0.0, 0.0]).tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    """
    d = np.asarray(directions, float)
    helper = np.where(np.abs(d[..., 2:]) < _POLE, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    right = np.cross(helper, d)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    return np.stack([right, np.cross(d, right), d], -2)
