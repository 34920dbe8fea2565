"""The size of a mesh's own triangles: they are drawn where they can be seen one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.large.hierarchy import NO_CELL, Hierarchy

#: Length of a triangle's edges, relative to the error, above which its own value or edges show.
VISIBLE_EDGE = 3.0
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


def with_visible_cells(hierarchy) -> Hierarchy:
    """Return a hierarchy whose errors are as large as the mesh's triangles, which show alone."""
    lengths, errors = edge_lengths(hierarchy), hierarchy.errors.astype(float)
    made_by, replaced_by = hierarchy.patch_cells.T
    # A cell is made before those that replace it: their numbers are larger.
    for patch in np.argsort(made_by, kind='stable').tolist():
        maker, owner = made_by[patch], replaced_by[patch]
        if owner != NO_CELL:
            own = lengths[patch] / VISIBLE_EDGE if maker == NO_CELL else errors[maker]
            errors[owner] = max(errors[owner], own)
    return replace(hierarchy, errors=errors)
