"""Occlusion of spheres: an estimate by what is in front, and a proof by depths."""

from __future__ import annotations

import numpy as np

_STEP = 1e-6  # what 32 bits may lose, of window depth and of distances


def on_screen(frame, centers, radii):
    """Return the lower left and upper right pixels of spheres in view space, (n, 2) each.

    Undefined for spheres across the eye's plane.
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
    """Estimate which actors are visible: those with less than `layers` of cover in front, (n,).

    Pixels of their centres, nearest first, and covered areas, summed in squares of `tile` pixels.
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
    """Return which spheres in view space a depth buffer certainly hides, (n,) bool.

    `farthest` (h, w) is the largest depth in each square of `tile` pixels, row 0 at the bottom.
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

    Each is four overlapping windows of a power of two: a sparse table (Bender and
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
