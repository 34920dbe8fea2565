"""Picking of a large mesh: a ray against the triangles of the full mesh, whatever is drawn."""

from __future__ import annotations

import numpy as np


def nearest_triangle(hierarchy, start, direction, first, last):
    """Return the triangle of the full mesh that a ray meets first, and the distance, or None.

    Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997. The ray is about
    the hierarchy's origin; `first` and `last` limit distances in units of `direction`.
    """
    patches = hierarchy.full_patches
    enter, leave = _box_distances(hierarchy.patch_boxes[patches], start, direction)
    is_met = (np.maximum(enter, first) <= np.minimum(leave, last)).nonzero()[0]
    nearest = None
    for k in is_met[np.argsort(enter[is_met])]:
        if nearest is not None and enter[k] > nearest[1]:
            break
        patch = patches[k]
        found = _meet(hierarchy, patch, start, direction, first, last)
        if found is not None and (nearest is None or found[1] < nearest[1]):
            nearest = found
    return nearest


def _box_distances(boxes, start, direction) -> tuple[np.ndarray, np.ndarray]:
    """Return where a ray enters and leaves boxes."""
    slow = np.where(np.abs(direction) < 1e-300, 1e-300, direction)
    ends = np.sort((boxes - start) / slow, axis=1)
    return ends[:, 0].max(1), ends[:, 1].min(1)


def _meet(hierarchy, patch, start, direction, first, last):
    a, b = hierarchy.triangle_starts[patch : patch + 2]
    vertices = hierarchy.vertices[slice(*hierarchy.vertex_starts[patch : patch + 2])]
    corners = hierarchy.points[vertices].astype(float)[hierarchy.triangles[a:b]]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, sides[1])
    with np.errstate(divide='ignore', invalid='ignore'):
        scale = 1 / np.einsum('ij,ij->i', sides[0], across)
        to_start = start - corners[:, 0]
        u = np.einsum('ij,ij->i', to_start, across) * scale
        turned = np.cross(to_start, sides[0])
        v = turned @ direction * scale
        distances = np.einsum('ij,ij->i', sides[1], turned) * scale
        is_hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distances >= first) & (distances <= last)
    if not is_hit.any():
        return None
    best = np.where(is_hit, distances, np.inf).argmin()
    return int(hierarchy.mesh_cells[a + best]), float(distances[best])
