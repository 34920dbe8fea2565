"""Occlusion of spheres: an estimate by the number in front, and a proof by depths."""

from __future__ import annotations

import numpy as np

_STEP = 1e-6  # what 32 bits may lose, of window depth and of distances


def on_screen(frame, centers, radii):
    """Return the bounding rectangles of projected spheres.

    Parameters
    ----------
    frame : pvibr.core.frame.Frame
        Camera and size.
    centers, radii : numpy.ndarray, shape (n, 3) and (n,)
        Spheres in view space.

    Returns
    -------
    tuple of 2 numpy.ndarray, shape (n, 2)
        Lower left and upper right corners, pixels; undefined for spheres across the eye's plane.

    Examples
    --------
    >>> from pvibr.core.frame import Frame
    >>> from pvibr.maths.occlusion import on_screen
    >>> from pvibr.maths.views import View
    >>> view = View(np.eye(4), np.diag([1.0, 1, -1, 1]), near=0.0, far=10.0, parallel=True)
    >>> frame = Frame(None, None, (8, 8), (0, 0), view)
    >>> low, high = on_screen(frame, np.array([[0, 0, -3.0]]), np.array([0.5]))
    >>> low.tolist(), high.tolist()
    ([[2.0, 2.0]], [[6.0, 6.0]])
    """
    m, r = frame.clip_from_view, radii[:, None]
    low, high, offset = centers[:, :2] - r, centers[:, :2] + r, m[:2, 3]
    if not frame.parallel:
        away = -centers[:, 2:]
        ends = np.stack([away - r, away + r])
        with np.errstate(divide='ignore', invalid='ignore'):
            low, high = (low / ends).min(0), (high / ends).max(0)
        offset = -m[:2, 2]
    scale, size = [m[0, 0], m[1, 1]], np.array(frame.size)
    return tuple(((x * scale + offset) / 2 + 0.5) * size for x in (low, high))


def likely_seen(pixels, areas, layers, tile=32) -> np.ndarray:
    """Estimate the visible actors: those with little in front of them.

    Parameters
    ----------
    pixels, areas : numpy.ndarray, shape (n, 2) and (n,)
        Their centres on the screen, the nearest first, and covered areas, pixels.
    layers : float
        Covered area in front, relative to the screen's, beyond which an actor is hidden.
    tile : float
        Side of the squares in which areas are added, pixels.

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
        True if visible.

    Examples
    --------
    >>> from pvibr.maths.occlusion import likely_seen
    >>> likely_seen(np.array([[4, 4], [5, 4], [6, 4.0]]), np.full(3, 1500.0), 2).tolist()
    [True, True, False]
    """
    if not len(pixels):
        return np.zeros(0, bool)
    square = np.clip(pixels // tile, -1e6, 1e6).astype(np.int64)
    number = square[:, 0] + 2_000_003 * square[:, 1]
    order = np.argsort(number, kind='stable')
    covered = np.cumsum(areas[order]) - areas[order]
    first = np.r_[0, np.flatnonzero(np.diff(number[order])) + 1]
    counts = np.diff(np.r_[first, len(order)])
    seen = np.empty(len(order), bool)
    seen[order] = covered - np.repeat(covered[first], counts) < layers * tile * tile
    return seen


def behind(frame, farthest, tile, centers, radii, margin=2.0) -> np.ndarray:
    """Return the spheres certainly hidden by a depth buffer.

    Parameters
    ----------
    frame : pvibr.core.frame.Frame
        Camera and size.
    farthest : numpy.ndarray, shape (h, w)
        Maximum depth, 0 near to 1 far, of each square of the screen, row 0 at the bottom.
    tile : int
        Side of the squares, pixels.
    centers, radii : numpy.ndarray, shape (n, 3) and (n,)
        Spheres in view space.
    margin : float
        Margin around the spheres, pixels.

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
        True if hidden.

    Examples
    --------
    >>> from pvibr.core.frame import Frame
    >>> from pvibr.maths.occlusion import behind
    >>> from pvibr.maths.views import View
    >>> view = View(np.eye(4), np.diag([1.0, 1, -0.2, 1]), near=0.0, far=10.0, parallel=True)
    >>> frame = Frame(None, None, (8, 8), (0, 0), view)
    >>> centers = np.array([[0, 0, -1.0], [0, 0, -4]])
    >>> behind(frame, np.full((1, 1), 0.7), 8, centers, np.full(2, 0.5)).tolist()
    [False, True]
    """
    nearest = -centers[:, 2] - radii - _STEP * np.abs(centers[:, 2])
    low, high = on_screen(frame, centers, radii)
    m = frame.clip_from_view
    with np.errstate(divide='ignore', invalid='ignore'):
        depth = (m[2, 3] - m[2, 2] * nearest) / (m[3, 3] - m[3, 2] * nearest) / 2 + 0.5
    ahead = (nearest > frame.near) & np.isfinite(low).all(1) & np.isfinite(high).all(1)
    last = np.array(farthest.shape[::-1]) - 1
    low, high = (
        np.clip(np.where(ahead[:, None], x + d, 0) // tile, 0, last).astype(np.int64)
        for x, d in ((low, -margin), (high, margin))
    )
    return ahead & (depth > _largest_within(farthest, low, high) + _STEP)


def _largest_within(values, low, high):
    """Return the largest value of rectangles of about equal sides, both corners included.

    Each is four windows of a power of two, which overlap: a sparse table (Bender and
    Farach-Colton, "The LCA Problem Revisited", 2000).
    """
    level = np.floor(np.log2((high - low).max(1, initial=0) + 1)).astype(int)
    found = np.empty(len(low))
    for k in range(level.max(initial=0) + 1):
        some, step = level == k, 1 << k
        first, second = low[some], np.maximum(low[some], high[some] + 1 - step)
        corners = [
            values[y, x] for y in (first[:, 1], second[:, 1]) for x in (first[:, 0], second[:, 0])
        ]
        found[some] = np.max(corners, 0)
        for axis in (0, 1):
            values = _with_next(values, step, axis)
    return found


def _with_next(values, step, axis):
    """Return the maximum of each value and the one at an offset."""
    out = values.copy()
    here, there = (np.moveaxis(a, axis, 0) for a in (out, values))
    np.maximum(here[:-step], there[step:], out=here[:-step])
    return out
