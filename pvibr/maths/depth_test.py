"""Whether a depth view sees points: the float64 twin of ``receiver.glsl``."""

from __future__ import annotations

import numpy as np

#: Rise of a blocker away from a receiver, in texels per texel, up to which it may touch it.
_STEEPEST = 4.0


def texel_size(view, resolution) -> float:
    """Return the width of a texel of a view, world units; in perspective at a distance of 1."""
    scale = np.linalg.norm(view.clip_from_view[:2, :2], axis=1).min()
    return float(2 / scale / resolution)


def seen(view, depth, points, normals, offset=0.25):
    """Return the visibility of points in a depth view, (m,), 0 to 1; 1 outside the view.

    Depth (n, n) from 0 near to 1 far, bottom row first; normals face the eye; `offset` in texels.
    """
    matrix, points = view.texture_from_world(), np.asarray(points, float)
    normals = np.asarray(normals, float)
    q, s, within = _placed(matrix, points)
    ahead = within & (s[:, 2] > 0)
    found = np.ones(len(points))
    found[ahead] = _compared(view, matrix, depth, points[ahead], normals[ahead], q[ahead], offset)
    return found


def uncertain(view, depth, points, normals, edges, touching=0.0):
    """Return where the texels of a depth view disagree on whether points are visible, (m,) bool.

    `edges` is the depth with all triangle edges drawn over it; `touching`, texels, spares corners.
    """
    matrix, side = view.texture_from_world(), depth.shape[0]
    points, normals = np.asarray(points, float), np.asarray(normals, float)
    q, s, within = _placed(matrix, points)
    rows = np.flatnonzero(within)
    s, slope = s[rows], _slope(matrix, q[rows], normals[rows])
    rise = np.abs(slope).sum(1) / side
    beside = touching * _steepest(matrix, q[rows], side)
    some, every = np.zeros(len(rows), bool), np.ones(len(rows), bool)
    middle = np.floor(s[:, :2] * side)
    for x in (-1, 0, 1):
        for y in (-1, 0, 1):
            at = np.clip(middle + np.array([x, y]), 0, side - 1)
            plane = s[:, 2] + (((at + 0.5) / side - s[:, :2]) * slope).sum(1) - 4e-7 - beside
            texel = tuple(at.astype(int).T[::-1])
            some |= (plane - rise / 128 > depth[texel]) | (plane - rise > edges[texel])
            every &= plane - rise / 128 > depth[texel]
    found = np.zeros(len(points), bool)
    found[rows] = some & ~every
    return found


def _placed(matrix, points):
    """Return points in texture space, before and after the division, and which lie inside."""
    q = points @ matrix[:, :3].T + matrix[:, 3]
    with np.errstate(divide='ignore', invalid='ignore'):
        s = q[:, :3] / q[:, 3:]
        return q, s, (q[:, 3] > 0) & (np.abs(s[:, :2] - 0.5).max(1) <= 0.5)


def _compared(view, matrix, depth, points, normals, q, offset):
    side = depth.shape[0]
    s = q[:, :3] / q[:, 3:]
    slope = _slope(matrix, q, normals)
    texel = texel_size(view, side) * (1.0 if view.parallel else q[:, 3:])
    moved = (points + normals * offset * texel) @ matrix[:, :3].T + matrix[:, 3]
    there = moved[:, :3] / moved[:, 3:]
    bias = 4e-7 + np.abs(slope).sum(1) / side / 128
    plane = there[:, 2] - ((there - s)[:, :2] * slope).sum(1) - bias
    place = s[:, :2] * side - 0.5
    base = np.floor(place)
    part = place - base
    total, steepest = np.zeros(len(points)), _steepest(matrix, q, side)
    for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
        at = np.clip(base + corner, 0, side - 1)
        share = np.where(corner, part, 1 - part).prod(1)
        here = plane + (((at + 0.5) / side - s[:, :2]) * slope).sum(1)
        nearest = depth[tuple(at.astype(int).T[::-1])]
        # The blocker's own plane must hide the point too: in a valley, it does not.
        out = 2 * np.array(corner) - 1
        rise = [nearest - depth[tuple(_next(at, out * k, side).T[::-1])] for k in np.eye(2)]
        rise = np.clip(np.transpose(rise), 0, steepest[:, None])
        away = 1 - np.where(corner, part, 1 - part)
        hidden = (here > nearest) & (plane > nearest + (rise * away).sum(1))
        total += np.where(hidden, 0.0, share)
    return np.round(total, 12)


def _next(at, step, side):
    return np.clip(at + step, 0, side - 1).astype(int)


def _steepest(matrix, q, side):
    """Return the steepest rise of a blocker away from a point, depth per texel, (m,)."""
    x, y, z = (_along(matrix, q, np.broadcast_to(axis, (len(q), 3))) for axis in np.eye(3))
    across, along = (np.stack([x[:, i], y[:, i], z[:, i]], 1) for i in (0, 2))
    return _STEEPEST * np.linalg.norm(along, axis=1) / (side * np.linalg.norm(across, axis=1))


def _slope(matrix, q, normals):
    """Return depth per texture coordinate on each point's plane, (m, 2)."""
    x, y, z = normals.T
    zero = np.zeros_like(x)
    helper = np.where(
        (np.abs(x) < 0.7)[:, None], np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1)
    )
    helper /= np.linalg.norm(helper, axis=1, keepdims=True)
    a, b = (_along(matrix, q, t) for t in (helper, np.cross(normals, helper)))
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    least = 1e-3 * ((a[:, :2] ** 2).sum(1) + (b[:, :2] ** 2).sum(1))
    det = np.where(np.abs(det) < least, np.where(det < 0, -least, least), det)
    up = a[:, 2] * b[:, 1] - b[:, 2] * a[:, 1]
    return np.stack([up, b[:, 2] * a[:, 0] - a[:, 2] * b[:, 0]], 1) / det[:, None]


def _along(matrix, q, ways):
    d = ways @ matrix[:, :3].T
    return (d[:, :3] - q[:, :3] / q[:, 3:] * d[:, 3:]) / q[:, 3:]
