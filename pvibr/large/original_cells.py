"""The size of a mesh's own triangles: they are drawn where they can be seen one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.large.cut import pixels_of
from pvibr.large.hierarchy import NO_CELL, Hierarchy

#: Length of a triangle's edges, relative to the error, above which its own value and edges show.
VISIBLE = 3.0
#: Triangles of a patch, about, whose edges are measured.
_MEASURED = 200


def edge_lengths(hierarchy) -> np.ndarray:
    """Return the mean length of the triangles' edges of each patch, 0 for simplified ones."""
    lengths = np.zeros(len(hierarchy.patch_cells))
    for patch in hierarchy.full_patches.tolist():
        first, last = hierarchy.triangle_starts[patch : patch + 2]
        triangles = hierarchy.triangles[first : last : max((last - first) // _MEASURED, 1)]
        vertices = hierarchy.vertices[slice(*hierarchy.vertex_starts[patch : patch + 2])]
        corners = hierarchy.points[vertices[triangles]]
        sides = corners - np.roll(corners, 1, axis=1)
        lengths[patch] = np.sqrt(np.einsum('ijk,ijk->ij', sides, sides)).mean()
    return lengths


def with_visible_cells(hierarchy, lengths) -> Hierarchy:
    """Return a hierarchy whose errors are as large as the mesh's triangles, which show alone."""
    errors = hierarchy.errors.astype(float)
    made_by, replaced_by = hierarchy.patch_cells.T
    # A cell is made before those that replace it: their numbers are larger.
    for patch in np.argsort(made_by, kind='stable').tolist():
        maker, owner = made_by[patch], replaced_by[patch]
        if owner != NO_CELL:
            own = lengths[patch] / VISIBLE if maker == NO_CELL else errors[maker]
            errors[owner] = max(errors[owner], own)
    return replace(hierarchy, errors=errors)


def edge_flags(faces, polygons) -> np.ndarray:
    """Return the edges of triangles that are edges of their polygons, bits 1, 2 and 4, (m,) uint8.

    Triangles of one polygon follow each other.
    """
    starts, ends = faces, np.roll(faces, -1, axis=1)
    is_inner = np.zeros(faces.shape, bool)
    pairs, distance = np.arange(len(faces)), 0
    while True:
        distance += 1
        pairs = pairs[pairs + distance < len(faces)]
        pairs = pairs[polygons[pairs] == polygons[pairs + distance]]
        if not len(pairs):
            return (~is_inner @ np.array([1, 2, 4], np.uint8)).astype(np.uint8)
        others = pairs + distance
        for k in range(3):
            for j in range(3):
                is_same = (starts[pairs, k] == ends[others, j]) & (
                    ends[pairs, k] == starts[others, j]
                )
                is_inner[pairs[is_same], k] = is_inner[others[is_same], j] = True


def patches_with_edges(hierarchy, lengths, patches, view, max_error) -> np.ndarray:
    """Return those of some patches of the full mesh whose triangles' edges show."""
    pixels = pixels_of(lengths[patches], hierarchy.patch_boxes[patches], view)
    return patches[pixels > VISIBLE * max_error]
