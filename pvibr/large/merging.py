"""Equal points of a mesh, merged."""

from __future__ import annotations

import numpy as np

#: Odd factors by which the bits of coordinates are mixed.
_HASH = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


def merged_points(points) -> tuple[np.ndarray, np.ndarray]:
    """Return points without copies, and the place of each among them.

    Points that look the same in single precision are the same.
    """
    drawn = np.ascontiguousarray(points, np.float32) + np.float32(0.0)  # no negative zeros
    first, places = merged_rows(drawn.view(np.uint32))
    return points[first], places


def merged_rows(rows) -> tuple[np.ndarray, np.ndarray]:
    """Return the first of equal rows, (n, 3) uint32, and the place of each row among these."""
    hashes = rows.astype(np.uint64) @ _HASH
    order = np.argsort(hashes, kind='stable')
    is_first = np.r_[True, hashes[order][1:] != hashes[order][:-1]]
    if is_first.all():
        return np.arange(len(rows)), np.arange(len(rows), dtype=np.int32)
    first, groups = order[is_first], np.empty(len(rows), np.int64)
    groups[order] = np.cumsum(is_first) - 1
    if not np.array_equal(rows, rows[first[groups]]):  # hashes met
        _, first, groups = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    # In the order of the mesh, which keeps neighbours together.
    ranks = np.empty(len(first), np.int32)
    ranks[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return np.sort(first), ranks[groups.ravel()]
