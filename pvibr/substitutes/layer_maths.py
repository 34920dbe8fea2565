"""Warps of a picture to another view: least squares fits and their errors.

Pixels are counted from the lower left corner of the screen; warps are (3, 3) matrices that take
homogeneous pixels of the picture to those of the screen.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import corners

# Corners joined by an edge of a box: their numbers differ in one bit.
_EDGES = np.array([(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1])
_TINY = 1e-12


def to_screen(clip, size) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of clip space points (n, 4), and which are beyond the near plane."""
    clip_w = clip[:, 3]
    in_front = (clip_w > _TINY) & (clip[:, 2] >= -clip_w)
    ndc = clip[:, :2] / np.where(in_front, clip_w, 1.0)[:, None]
    return (ndc + 1) / 2 * size, in_front


def extents(clip_from_world, bounds, size) -> np.ndarray:
    """Return the pixel rectangles (left, bottom, right, top) of boxes, clipped by the near plane.

    Boxes are (n, 6) in world units; left is above right for those behind the eye.
    """
    box_corners = corners(bounds)
    clip_corners = box_corners @ clip_from_world[:, :3].T + clip_from_world[:, 3]
    near_distance = clip_corners[..., 2] + clip_corners[..., 3]  # 0 on the near plane
    starts, ends = clip_corners[:, _EDGES[:, 0]], clip_corners[:, _EDGES[:, 1]]
    room_a, room_b = near_distance[:, _EDGES[:, 0]], near_distance[:, _EDGES[:, 1]]
    crosses = (room_a > 0) != (room_b > 0)
    share = np.where(crosses, room_a / np.where(crosses, room_a - room_b, 1.0), 0.0)[..., None]
    clip_points = np.concatenate([clip_corners, starts + share * (ends - starts)], 1)
    is_valid = np.concatenate([near_distance > 0, crosses], 1) & (clip_points[..., 3] > _TINY)
    screen_points = clip_points[..., :2] / np.where(is_valid, clip_points[..., 3], 1.0)[..., None]
    screen_points = (screen_points + 1) / 2 * np.asarray(size, float)
    lower_left = np.where(is_valid[..., None], screen_points, np.inf).min(1)
    upper_right = np.where(is_valid[..., None], screen_points, -np.inf).max(1)
    return np.concatenate([lower_left, upper_right], 1)


def part_of(clip_from_view, size, rect) -> np.ndarray:
    """Return the projection of a pixel rectangle of the screen, or beyond it, (4, 4)."""
    part = np.array(clip_from_view, float)
    for axis in range(2):
        span = rect[2 + axis] - rect[axis]
        part[axis] *= size[axis] / span
        part[axis] += ((size[axis] - 2 * rect[axis]) / span - 1) * np.asarray(clip_from_view)[3]
    return part


def moved(warp, points) -> np.ndarray:
    """Return warped points, (n, 2) in pixels; inf on or beyond the horizon."""
    warped = points @ warp[:, :2].T + warp[:, 2]
    in_front = warped[:, 2:] > _TINY
    return np.where(in_front, warped[:, :2] / np.where(in_front, warped[:, 2:], 1.0), np.inf)


def fit_affine(source, target) -> np.ndarray:
    """Return the affine warp between points (n, 2) by least squares; free directions stay."""
    warp = np.eye(3)
    if not len(source):
        return warp
    source_center, target_center = source.mean(0), target.mean(0)
    source_offsets = source - source_center
    warp[:2, :2] += _solved(source_offsets, (target - target_center) - source_offsets).T
    warp[:2, 2] = target_center - warp[:2, :2] @ source_center
    return warp


def _solved(x, y):
    """Return the least squares solution of x @ a = y, zero where x spreads less than a pixel."""
    values, axes = np.linalg.eigh(x.T @ x)
    is_determined = values > len(x)
    return (axes[:, is_determined] / values[is_determined]) @ axes[:, is_determined].T @ (x.T @ y)


def fit_plane(pixels, inverse_depth) -> np.ndarray:
    """Return the plane (3,) of points in a picture, by least squares.

    Its product with a homogeneous pixel is the inverse depth (the depth in a parallel view).
    """
    if not len(pixels):
        return np.zeros(3)
    pixel_center = pixels.mean(0)
    pixel_offsets, depth_offsets = pixels - pixel_center, inverse_depth - inverse_depth.mean()
    depth_slope = _solved(pixel_offsets, depth_offsets)
    return np.array([*depth_slope, inverse_depth.mean() - depth_slope @ pixel_center])


def plane_warp(clip_from_view, view_from_pixel, plane, size, *, parallel) -> np.ndarray:
    """Return the warp of a plane to another view: exact for it, and for all if the eye stays.

    `view_from_pixel` gives the past point at distance 1; `plane` is that of :func:`fit_plane`.
    """
    unit_row = np.array([0.0, 0.0, 1.0])
    depth_rows = [-plane, unit_row] if parallel else [-unit_row, plane]
    view_from_picture = np.concatenate([view_from_pixel[:2], depth_rows])
    x, y, _, w = np.asarray(clip_from_view) @ view_from_picture
    return np.stack([(x + w) / 2 * size[0], (y + w) / 2 * size[1], w])


def stretch(warp, pixel) -> tuple[float, float]:
    """Return the largest and the smallest magnification of a warp at a pixel."""
    x, y, w = warp @ [*pixel, 1.0]
    if w <= _TINY:
        return np.inf, 0.0
    jacobian = (warp[:2, :2] - np.outer([x / w, y / w], warp[2, :2])) / w
    longest, shortest = np.linalg.svd(jacobian, compute_uv=False)
    return float(longest), float(shortest)


def reaches(warp, rect, open_sides, size) -> bool:
    """Return whether a picture covers the screen at each side where it was cut off."""
    if not any(open_sides):
        return True
    if abs(np.linalg.det(warp)) < _TINY:
        return False
    (w, h), back = size, np.linalg.inv(warp)
    back = back * np.sign(back[2] @ [w / 2, h / 2, 1.0] or 1.0)
    screen_corners = moved(back, np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]]))
    if not np.isfinite(screen_corners).all():
        return False
    low, high = screen_corners.min(0), screen_corners.max(0)
    reached = low[0] >= rect[0], low[1] >= rect[1], high[0] <= rect[2], high[1] <= rect[3]
    return all(ok or not is_open for ok, is_open in zip(reached, open_sides, strict=True))


def split_by_depth(nearest, farthest, count, *, ratio=True) -> np.ndarray:
    """Return the depth layer of each box, from 0, the nearest; `count` for very long boxes.

    Layers have equal ranges of the logarithm of distance (of distance without `ratio`).
    """
    low, high = (np.log(d) if ratio else np.asarray(d, float) for d in (nearest, farthest))
    box_middles = (low + high) / 2
    # A wide box has its middle anywhere: only the others tell how far they spread.
    span = max(np.ptp(box_middles), _TINY) / count
    is_wide = high - low > 2 * max(span, np.median(high - low)) if len(low) > 1 else high < low
    if not (~is_wide).any():
        return np.full(len(low), count)
    nearest_middle = box_middles[~is_wide].min()
    span = max(np.ptp(box_middles[~is_wide]), _TINY) / count
    layer_index = np.clip(((box_middles - nearest_middle) / span).astype(int), 0, count - 1)
    return np.where(is_wide, count, layer_index)
