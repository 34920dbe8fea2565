"""Warps of a picture to another view: least squares fits and their errors.

Pixels are counted from the lower left corner of the screen; warps are (3, 3) matrices that take
homogeneous pixels of the picture to those of the screen.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import corners

# Corners that have an edge of a box between them: those whose numbers differ in one bit.
_EDGES = np.array([(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1])
_TINY = 1e-12


def to_screen(clip, size) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of clip space points (n, 4), and which are beyond the near plane."""
    w = clip[:, 3]
    ahead = (w > _TINY) & (clip[:, 2] >= -w)
    ndc = clip[:, :2] / np.where(ahead, w, 1.0)[:, None]
    return (ndc + 1) / 2 * size, ahead


def extents(clip_from_world, bounds, size) -> np.ndarray:
    """Return the pixel rectangles (left, bottom, right, top) of boxes, clipped by the near plane.

    Boxes are (n, 6) in world units; left is above right for those behind the eye.
    """
    points = corners(bounds)
    clip = points @ clip_from_world[:, :3].T + clip_from_world[:, 3]
    room = clip[..., 2] + clip[..., 3]  # 0 on the near plane
    first, second = clip[:, _EDGES[:, 0]], clip[:, _EDGES[:, 1]]
    a, b = room[:, _EDGES[:, 0]], room[:, _EDGES[:, 1]]
    crosses = (a > 0) != (b > 0)
    share = np.where(crosses, a / np.where(crosses, a - b, 1.0), 0.0)[..., None]
    found = np.concatenate([clip, first + share * (second - first)], 1)
    use = np.concatenate([room > 0, crosses], 1) & (found[..., 3] > _TINY)
    at = found[..., :2] / np.where(use, found[..., 3], 1.0)[..., None]
    at = (at + 1) / 2 * np.asarray(size, float)
    low = np.where(use[..., None], at, np.inf).min(1)
    high = np.where(use[..., None], at, -np.inf).max(1)
    return np.concatenate([low, high], 1)


def part_of(clip_from_view, size, rect) -> np.ndarray:
    """Return the projection of a pixel rectangle of the screen, or beyond it, (4, 4)."""
    out = np.array(clip_from_view, float)
    for k in range(2):
        span = rect[2 + k] - rect[k]
        out[k] *= size[k] / span
        out[k] += ((size[k] - 2 * rect[k]) / span - 1) * np.asarray(clip_from_view)[3]
    return out


def moved(warp, points) -> np.ndarray:
    """Return warped points, (n, 2) in pixels; inf on or beyond the horizon."""
    out = points @ warp[:, :2].T + warp[:, 2]
    ahead = out[:, 2:] > _TINY
    return np.where(ahead, out[:, :2] / np.where(ahead, out[:, 2:], 1.0), np.inf)


def fit_affine(source, target) -> np.ndarray:
    """Return the affine warp between points (n, 2) by least squares; free directions stay."""
    warp = np.eye(3)
    if not len(source):
        return warp
    middle, there = source.mean(0), target.mean(0)
    x = source - middle
    warp[:2, :2] += _solved(x, (target - there) - x).T
    warp[:2, 2] = there - warp[:2, :2] @ middle
    return warp


def _solved(x, y):
    """Return the least squares solution of x @ a = y, zero where x spreads less than a pixel."""
    values, axes = np.linalg.eigh(x.T @ x)
    good = values > len(x)
    return (axes[:, good] / values[good]) @ axes[:, good].T @ (x.T @ y)


def fit_plane(pixels, inverse_depth) -> np.ndarray:
    """Return the plane (3,) of points in a picture, by least squares.

    Its product with a homogeneous pixel is the inverse depth (the depth in a parallel view).
    """
    if not len(pixels):
        return np.zeros(3)
    middle = pixels.mean(0)
    x, y = pixels - middle, inverse_depth - inverse_depth.mean()
    slope = _solved(x, y)
    return np.array([*slope, inverse_depth.mean() - slope @ middle])


def plane_warp(clip_from_view, view_from_pixel, plane, size, *, parallel) -> np.ndarray:
    """Return the warp of a plane to another view: exact for it, and for all if the eye stays.

    `view_from_pixel` gives the past point at distance 1; `plane` is that of :func:`fit_plane`.
    """
    one = np.array([0.0, 0.0, 1.0])
    rows = [-plane, one] if parallel else [-one, plane]
    points = np.concatenate([view_from_pixel[:2], rows])
    x, y, _, w = np.asarray(clip_from_view) @ points
    return np.stack([(x + w) / 2 * size[0], (y + w) / 2 * size[1], w])


def stretch(warp, at) -> tuple[float, float]:
    """Return the largest and the smallest magnification of a warp at a pixel."""
    x, y, w = warp @ [*at, 1.0]
    if w <= _TINY:
        return np.inf, 0.0
    slope = (warp[:2, :2] - np.outer([x / w, y / w], warp[2, :2])) / w
    longest, shortest = np.linalg.svd(slope, compute_uv=False)
    return float(longest), float(shortest)


def reaches(warp, rect, open_sides, size) -> bool:
    """Return whether a picture covers the screen at each side where it was cut off."""
    if not any(open_sides):
        return True
    if abs(np.linalg.det(warp)) < _TINY:
        return False
    (w, h), back = size, np.linalg.inv(warp)
    back = back * np.sign(back[2] @ [w / 2, h / 2, 1.0] or 1.0)
    screen = moved(back, np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]]))
    if not np.isfinite(screen).all():
        return False
    low, high = screen.min(0), screen.max(0)
    within = low[0] >= rect[0], low[1] >= rect[1], high[0] <= rect[2], high[1] <= rect[3]
    return all(ok or not is_open for ok, is_open in zip(within, open_sides, strict=True))


def split_by_depth(nearest, farthest, count, *, ratio=True) -> np.ndarray:
    """Return the depth layer of each box, from 0, the nearest; `count` for very long boxes.

    Layers have equal ranges of the logarithm of distance (of distance without `ratio`).
    """
    low, high = (np.log(d) if ratio else np.asarray(d, float) for d in (nearest, farthest))
    middle = (low + high) / 2
    # What is wide has its middle anywhere: the others say how far apart they are.
    span = max(np.ptp(middle), _TINY) / count
    wide = high - low > 2 * max(span, np.median(high - low)) if len(low) > 1 else high < low
    if not (~wide).any():
        return np.full(len(low), count)
    start = middle[~wide].min()
    span = max(np.ptp(middle[~wide]), _TINY) / count
    found = np.clip(((middle - start) / span).astype(int), 0, count - 1)
    return np.where(wide, count, found)
