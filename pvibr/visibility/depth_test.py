"""Whether a depth view sees points: the float64 twin of ``receiver.glsl``."""

from __future__ import annotations

import numpy as np

#: Largest slope, in texels per texel, of a blocker that may touch the receiver.
_STEEPEST = 4.0


def texel_size(view, resolution) -> float:
    """Return the width of a texel of a view, world units; in perspective at a distance of 1."""
    focal_scale = np.linalg.norm(view.clip_from_view[:2, :2], axis=1).min()
    return float(2 / focal_scale / resolution)


def seen(view, depth, points, normals, offset=0.25):
    """Return the visibility of points in a depth view, (m,), 0 to 1; 1 outside the view.

    Depth (n, n) from 0 near to 1 far, bottom row first; normals face the eye; `offset` in texels.
    """
    matrix, points = view.texture_from_world(), np.asarray(points, float)
    normals = np.asarray(normals, float)
    clip, uvz, is_inside = _placed(matrix, points)
    is_tested = is_inside & (uvz[:, 2] > 0)
    visibility = np.ones(len(points))
    visibility[is_tested] = _compared(
        view, matrix, depth, points[is_tested], normals[is_tested], clip[is_tested], offset
    )
    return visibility


def uncertain(view, depth, points, normals, edges, touching=0.0):
    """Return where the texels of a depth view disagree on whether points are visible, (m,) bool.

    `edges` is the depth with all triangle edges drawn over it; `touching`, texels, spares corners.
    """
    matrix, side = view.texture_from_world(), depth.shape[0]
    points, normals = np.asarray(points, float), np.asarray(normals, float)
    clip, uvz, is_inside = _placed(matrix, points)
    tested = np.flatnonzero(is_inside)
    uvz = uvz[tested]
    slope = _slope(matrix, clip[tested], normals[tested])
    rise = np.abs(slope).sum(1) / side
    touch = touching * _steepest(matrix, clip[tested], side)
    any_hidden, all_hidden = np.zeros(len(tested), bool), np.ones(len(tested), bool)
    center_texel = np.floor(uvz[:, :2] * side)
    for x in (-1, 0, 1):
        for y in (-1, 0, 1):
            xy = np.clip(center_texel + np.array([x, y]), 0, side - 1)
            plane = uvz[:, 2] + (((xy + 0.5) / side - uvz[:, :2]) * slope).sum(1) - 4e-7 - touch
            texel = tuple(xy.astype(int).T[::-1])
            any_hidden |= (plane - rise / 128 > depth[texel]) | (plane - rise > edges[texel])
            all_hidden &= plane - rise / 128 > depth[texel]
    disagreement = np.zeros(len(points), bool)
    disagreement[tested] = any_hidden & ~all_hidden
    return disagreement


def _placed(matrix, points):
    """Return points in texture space, before and after the division, and which lie inside."""
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    with np.errstate(divide='ignore', invalid='ignore'):
        uvz = clip[:, :3] / clip[:, 3:]
        return clip, uvz, (clip[:, 3] > 0) & (np.abs(uvz[:, :2] - 0.5).max(1) <= 0.5)


def _compared(view, matrix, depth, points, normals, clip, offset):
    side = depth.shape[0]
    uvz = clip[:, :3] / clip[:, 3:]
    slope = _slope(matrix, clip, normals)
    width = texel_size(view, side) * (1.0 if view.parallel else clip[:, 3:])
    shifted = (points + normals * offset * width) @ matrix[:, :3].T + matrix[:, 3]
    shifted_uvz = shifted[:, :3] / shifted[:, 3:]
    bias = 4e-7 + np.abs(slope).sum(1) / side / 128
    plane = shifted_uvz[:, 2] - ((shifted_uvz - uvz)[:, :2] * slope).sum(1) - bias
    texel_position = uvz[:, :2] * side - 0.5
    base_texel = np.floor(texel_position)
    texel_fraction = texel_position - base_texel
    visible_share = np.zeros(len(points))
    max_rise = _steepest(matrix, clip, side)
    for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
        xy = np.clip(base_texel + corner, 0, side - 1)
        texel_weight = np.where(corner, texel_fraction, 1 - texel_fraction).prod(1)
        receiver = plane + (((xy + 0.5) / side - uvz[:, :2]) * slope).sum(1)
        blocker = depth[tuple(xy.astype(int).T[::-1])]
        # The blocker's own plane must hide the point too: in a valley it does not.
        outward = 2 * np.array(corner) - 1
        beside = (np.clip(xy + outward * k, 0, side - 1).astype(int) for k in np.eye(2))
        rise = [blocker - depth[tuple(texel.T[::-1])] for texel in beside]
        rise = np.clip(np.transpose(rise), 0, max_rise[:, None])
        corner_away = 1 - np.where(corner, texel_fraction, 1 - texel_fraction)
        is_hidden = (receiver > blocker) & (plane > blocker + (rise * corner_away).sum(1))
        visible_share += np.where(is_hidden, 0.0, texel_weight)
    return np.round(visible_share, 12)


def _steepest(matrix, clip, side):
    """Return the steepest rise of a blocker away from a point, depth per texel, (m,)."""
    x, y, z = (_along(matrix, clip, np.broadcast_to(axis, (len(clip), 3))) for axis in np.eye(3))
    across, along = (np.stack([x[:, i], y[:, i], z[:, i]], 1) for i in (0, 2))
    return _STEEPEST * np.linalg.norm(along, axis=1) / (side * np.linalg.norm(across, axis=1))


def _slope(matrix, clip, normals):
    """Return depth per texture coordinate on each point's plane, (m, 2)."""
    x, y, z = normals.T
    zero = np.zeros_like(x)
    tangent = np.where(
        (np.abs(x) < 0.7)[:, None], np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1)
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    a, b = (_along(matrix, clip, direction) for direction in (tangent, np.cross(normals, tangent)))
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    least_det = 1e-3 * ((a[:, :2] ** 2).sum(1) + (b[:, :2] ** 2).sum(1))
    det = np.where(np.abs(det) < least_det, np.where(det < 0, -least_det, least_det), det)
    du = a[:, 2] * b[:, 1] - b[:, 2] * a[:, 1]
    return np.stack([du, b[:, 2] * a[:, 0] - a[:, 2] * b[:, 0]], 1) / det[:, None]


def _along(matrix, clip, directions):
    step = directions @ matrix[:, :3].T
    return (step[:, :3] - clip[:, :3] / clip[:, 3:] * step[:, 3:]) / clip[:, 3:]
