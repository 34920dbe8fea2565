"""Occlusion of spheres: an estimate by what is in front, and a proof by depths."""

from __future__ import annotations

import numpy as np

_STEP = 1e-6  # rounding of window depth and distances in 32 bits


def on_screen(frame, centers, radii):
    """Return the lower left and upper right pixels of spheres in view space, (n, 2) each.

    Undefined for spheres across the eye's plane.
    """
    clip_from_view, radius_column = frame.clip_from_view, radii[:, None]
    low = centers[:, :2] - radius_column
    high = centers[:, :2] + radius_column
    offset = clip_from_view[:2, 3]
    if not frame.parallel:
        view_depth = -centers[:, 2:]
        depth_range = np.stack([view_depth - radius_column, view_depth + radius_column])
        with np.errstate(divide='ignore', invalid='ignore'):
            low = (low / depth_range).min(0)
            high = (high / depth_range).max(0)
        offset = -clip_from_view[:2, 2]
    with np.errstate(invalid='ignore'):
        shift = clip_from_view[0, 1] / clip_from_view[0, 0] * np.stack([low[:, 1], high[:, 1]])
    low[:, 0] += shift.min(0)
    high[:, 0] += shift.max(0)
    scale, size = [clip_from_view[0, 0], clip_from_view[1, 1]], np.array(frame.size)
    return tuple(((corner * scale + offset) / 2 + 0.5) * size for corner in (low, high))


def likely_seen(pixels, areas, layers, tile=32) -> np.ndarray:
    """Estimate which actors are visible: those with less than `layers` of cover in front, (n,).

    Pixels of their centres, nearest first, and covered areas, summed in squares of `tile` pixels.
    """
    if not len(pixels):
        return np.zeros(0, bool)
    screen_tile = np.clip(pixels // tile, -1e6, 1e6).astype(np.int64)
    tile_number = screen_tile[:, 0] + 2_000_003 * screen_tile[:, 1]
    order = np.argsort(tile_number, kind='stable')
    covered = np.cumsum(areas[order]) - areas[order]
    starts = np.r_[0, np.flatnonzero(np.diff(tile_number[order])) + 1]
    counts = np.diff(np.r_[starts, len(order)])
    visible = np.empty(len(order), bool)
    visible[order] = covered - np.repeat(covered[starts], counts) < layers * tile * tile
    return visible


def behind(frame, farthest, tile, centers, radii, margin=2.0) -> np.ndarray:
    """Return which spheres in view space a depth buffer certainly hides, (n,) bool.

    `farthest` (h, w) is the largest depth in each square of `tile` pixels, row 0 at the bottom.
    """
    nearest = -centers[:, 2] - radii - _STEP * np.abs(centers[:, 2])
    low, high = on_screen(frame, centers, radii)
    m = frame.clip_from_view
    with np.errstate(divide='ignore', invalid='ignore'):
        depth = (m[2, 3] - m[2, 2] * nearest) / (m[3, 3] - m[3, 2] * nearest) / 2 + 0.5
    in_front = (nearest > frame.near) & np.isfinite(low).all(1) & np.isfinite(high).all(1)
    last_tile = np.array(farthest.shape[::-1]) - 1
    low, high = (
        np.clip(np.where(in_front[:, None], corner + shift, 0) // tile, 0, last_tile).astype(
            np.int64
        )
        for corner, shift in ((low, -margin), (high, margin))
    )
    return in_front & (depth > _largest_within(farthest, low, high) + _STEP)


def _largest_within(values, lower_left, upper_right):
    """Return the largest value of rectangles of about equal sides, both corners included.

    Each is four overlapping windows of a power of two: a sparse table (Bender and
    Farach-Colton, "The LCA Problem Revisited", 2000).
    """
    window_level = np.floor(np.log2((upper_right - lower_left).max(1, initial=0) + 1)).astype(int)
    largest_values = np.empty(len(lower_left))
    for level in range(window_level.max(initial=0) + 1):
        at_level, window_side = window_level == level, 1 << level
        start = lower_left[at_level]
        end = np.maximum(lower_left[at_level], upper_right[at_level] + 1 - window_side)
        maxima = [values[y, x] for y in (start[:, 1], end[:, 1]) for x in (start[:, 0], end[:, 0])]
        largest_values[at_level] = np.max(maxima, 0)
        for axis in (0, 1):
            values = _with_next(values, window_side, axis)
    return largest_values


def _with_next(values, offset, axis):
    """Return the maximum of each value and the one at an offset."""
    pair_maximum = values.copy()
    here, there = (np.moveaxis(a, axis, 0) for a in (pair_maximum, values))
    np.maximum(here[:-offset], there[offset:], out=here[:-offset])
    return pair_maximum
