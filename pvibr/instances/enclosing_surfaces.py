"""Closedness of triangle meshes."""

from __future__ import annotations

import numpy as np
import scipy  # whose modules load when they are first used

_THIN = 1e-6  # relative thickness below which the two sides of a piece are indistinguishable
_LINES = 128  # lines of sight along each edge of the bounds
_FEW = 1e-3  # share of lines that may meet a back side first: folds of scans
_MOST = 1 << 21  # pairs of lines and triangles tested per axis


def winding(points, faces) -> int:
    """Return 1 if closed triangles run counter-clockwise seen from outside, -1 if from inside.

    0 if they are not closed, or if components or more than 0.1 % of the visible surface disagree.
    """
    faces = np.asarray(faces)
    if not len(faces):
        return 0
    points, point_index = np.unique(np.asarray(points), axis=0, return_inverse=True)
    faces = point_index.reshape(-1)[faces]
    count = len(points)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if not np.array_equal(np.sort(begin * count + end), np.sort(end * count + begin)):
        return 0
    unit_points = (points - points.mean(0)).astype(float)
    unit_points /= np.ptp(unit_points, axis=0).max() or 1.0
    side = _side_by_volume(unit_points, faces)
    return side if side and _is_seen_from(side, unit_points[faces]) else 0


def _side_by_volume(points, faces) -> int:
    """Return the sign of the volumes of all connected components, 0 if they differ."""
    count = len(points)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    graph = scipy.sparse.coo_array(
        (np.ones(len(begin), np.int8), (begin, end)), shape=(count, count)
    )
    _, pieces = scipy.sparse.csgraph.connected_components(graph, directed=False)
    a, b, c = points[faces.T]
    face_piece = pieces[faces[:, 0]]
    volumes = np.bincount(face_piece, (a * np.cross(b, c)).sum(1) / 6)
    areas = np.bincount(face_piece, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    if (volumes > _THIN * areas)[face_piece].all():
        return 1
    return -1 if (volumes < -_THIN * areas)[face_piece].all() else 0


def _is_seen_from(side, corners) -> bool:
    """Return whether nearly all that is met first along the axes is met from one side."""
    for axis in range(3):
        line, depth, toward = _crossings(np.roll(corners, 2 - axis, axis=2))
        for sign in (1, -1):
            is_back = toward * sign * side < 0
            distance = (
                -sign * depth + _THIN * is_back
            )  # of two coincident faces, take that which faces the viewer
            sorted_order = np.lexsort((distance, line))
            is_first = np.diff(line[sorted_order], prepend=-1) > 0
            if is_back[sorted_order[is_first]].sum() > _FEW * is_first.sum():
                return False
    return True


def _crossings(corners):
    """Return where lines along z meet triangles: numbers of lines, depths, signs of normals."""
    flat_corners = corners[..., :2].reshape(-1, 2)
    low, high = (np.array([pick(flat_corners[:, k]) for k in (0, 1)]) for pick in (np.min, np.max))
    flat_corners = ((flat_corners - low) / (high - low + 1e-300)).reshape(-1, 3, 2)
    line_count = _LINES
    while True:
        # Off the middle of a step, where symmetric meshes have edges.
        grid_corners = flat_corners * line_count - 0.4637
        a, b, c = grid_corners.swapaxes(0, 1)  # numpy reduces short axes slowly
        low = np.ceil(np.minimum(np.minimum(a, b), c)).astype(int)
        high = np.floor(np.maximum(np.maximum(a, b), c)).astype(int)
        line_spans = np.maximum(high - low + 1, 0)
        counts = line_spans[:, 0] * line_spans[:, 1]
        if counts.sum() <= _MOST:
            break
        line_count //= 2
    face = np.repeat(np.arange(len(grid_corners)), counts)
    index = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(index, np.maximum(line_spans[face, 0], 1))
    x, y = low[face, 0] + column, low[face, 1] + row
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(grid_corners[face], 0, -1)
    shares = np.stack(
        [
            (bx - x) * (cy - y) - (cx - x) * (by - y),
            (cx - x) * (ay - y) - (ax - x) * (cy - y),
            (ax - x) * (by - y) - (bx - x) * (ay - y),
        ]
    )
    double_areas = shares.sum(0)
    is_met = np.flatnonzero((shares * np.sign(double_areas) >= 0).all(0) & (double_areas != 0))
    depth = (shares[:, is_met] * corners[face[is_met], :, 2].T).sum(0) / double_areas[is_met]
    return (y * line_count + x)[is_met], depth, np.sign(double_areas[is_met])
