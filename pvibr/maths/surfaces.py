"""Closedness of triangle meshes."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

_THIN = 1e-6  # thickness, of the whole size, below which a piece's sides are not told apart
_LINES = 128  # along each edge of the bounds, from which a surface is looked at
_FEW = 1e-3  # share of lines that may meet what is wound the other way first: folds of scans
_MOST = 1 << 21  # pairs of lines and triangles that are tried for one axis


def winding(points, faces) -> int:
    """Return 1 if closed triangles run counter-clockwise seen from outside, -1 if from inside.

    0 if they are not closed, or if components or more than 0.1 % of the visible surface disagree.
    """
    faces = np.asarray(faces)
    if not len(faces):
        return 0
    points, same = np.unique(np.asarray(points), axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    count = len(points)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if not np.array_equal(np.sort(begin * count + end), np.sort(end * count + begin)):
        return 0
    local = (points - points.mean(0)).astype(float)
    local /= np.ptp(local, axis=0).max() or 1.0
    side = _side_by_volume(local, faces)
    return side if side and _is_seen_from(side, local[faces]) else 0


def _side_by_volume(points, faces) -> int:
    """Return the sign of the volumes of all connected components, 0 if they differ."""
    count = len(points)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    graph = coo_array((np.ones(len(begin), np.int8), (begin, end)), shape=(count, count))
    _, pieces = connected_components(graph, directed=False)
    a, b, c = points[faces.T]
    piece = pieces[faces[:, 0]]
    volumes = np.bincount(piece, (a * np.cross(b, c)).sum(1) / 6)
    areas = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    if (volumes > _THIN * areas)[piece].all():
        return 1
    return -1 if (volumes < -_THIN * areas)[piece].all() else 0


def _is_seen_from(side, corners) -> bool:
    """Return whether nearly all that is met first along the axes is met from one side."""
    for axis in range(3):
        line, depth, toward = _crossings(np.roll(corners, 2 - axis, axis=2))
        for sign in (1, -1):
            behind = toward * sign * side < 0
            away = -sign * depth + _THIN * behind  # of two in one place, that which is seen
            order = np.lexsort((away, line))
            first = np.diff(line[order], prepend=-1) > 0
            if behind[order[first]].sum() > _FEW * first.sum():
                return False
    return True


def _crossings(corners):
    """Return where lines along z meet triangles: numbers of lines, depths, signs of normals."""
    flat = corners[..., :2].reshape(-1, 2)
    low, high = (np.array([pick(flat[:, k]) for k in (0, 1)]) for pick in (np.min, np.max))
    flat = ((flat - low) / (high - low + 1e-300)).reshape(-1, 3, 2)
    lines = _LINES
    while True:
        # A part of a step off the middle: symmetric meshes have edges there.
        at = flat * lines - 0.4637
        a, b, c = at.swapaxes(0, 1)  # numpy takes long to reduce an axis of three
        low = np.ceil(np.minimum(np.minimum(a, b), c)).astype(int)
        high = np.floor(np.maximum(np.maximum(a, b), c)).astype(int)
        sizes = np.maximum(high - low + 1, 0)
        counts = sizes[:, 0] * sizes[:, 1]
        if counts.sum() <= _MOST:
            break
        lines //= 2
    face = np.repeat(np.arange(len(at)), counts)
    place = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(place, np.maximum(sizes[face, 0], 1))
    x, y = low[face, 0] + column, low[face, 1] + row
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(at[face], 0, -1)
    shares = np.stack(
        [
            (bx - x) * (cy - y) - (cx - x) * (by - y),
            (cx - x) * (ay - y) - (ax - x) * (cy - y),
            (ax - x) * (by - y) - (bx - x) * (ay - y),
        ]
    )
    area = shares.sum(0)
    met = np.flatnonzero((shares * np.sign(area) >= 0).all(0) & (area != 0))
    depth = (shares[:, met] * corners[face[met], :, 2].T).sum(0) / area[met]
    return (y * lines + x)[met], depth, np.sign(area[met])
