"""Triangles of the full mesh with corners of their own, which have the values of cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.large.hierarchy import NO_CELL


@dataclass(frozen=True)
class Corners:
    """The vertices of some patches, where triangles of the full mesh share none."""

    #: Place of each vertex among those that the patches share.
    places: np.ndarray
    #: Triangles of these vertices, (n, 3) int32.
    triangles: np.ndarray
    #: Triangles of the full mesh that are drawn; their corners are the last vertices.
    full_triangles: np.ndarray

    @classmethod
    def of(cls, hierarchy, patches, triangles, vertex_count) -> Corners:
        """Return the corners of gathered triangles."""
        is_full_patch = hierarchy.patch_cells[patches, 0] == NO_CELL
        is_full = np.repeat(is_full_patch, hierarchy.triangle_counts[patches])
        is_shared = np.zeros(vertex_count, bool)
        is_shared[triangles[~is_full].ravel()] = True
        shared = np.flatnonzero(is_shared)
        numbers = np.cumsum(is_shared, dtype=np.int32) - 1
        full_count = int(is_full.sum())
        corners = np.arange(3 * full_count, dtype=np.int32).reshape(-1, 3) + len(shared)
        own = np.empty_like(triangles)
        own[is_full], own[~is_full] = corners, numbers[triangles[~is_full]]
        places = np.concatenate([shared, triangles[is_full].ravel()])
        full = patches[is_full_patch]
        ranges = [np.arange(*hierarchy.triangle_starts[p : p + 2]) for p in full]
        return cls(places, own, np.concatenate([np.zeros(0, int), *ranges]))

    def set_values(self, array, by_triangle):
        """Set the values of the triangles of the full mesh in an array of the vertices."""
        count = 3 * len(self.full_triangles)
        array[len(array) - count :] = np.repeat(by_triangle[self.full_triangles], 3, axis=0)

    def edge_flags(self, hierarchy, patches, vertex_count) -> np.ndarray:
        """Return whether an edge of a cell starts at each vertex, in some patches of the mesh."""
        triangles, flags = self.full_triangles, np.zeros(vertex_count, np.uint8)
        bits = hierarchy.edge_flags[triangles] if len(hierarchy.edge_flags) else np.uint8(7)
        owners = np.searchsorted(hierarchy.triangle_starts, triangles, side='right') - 1
        bits = np.where(np.isin(owners, patches), bits, np.uint8(0))
        own = bits[:, None] >> np.arange(3, dtype=np.uint8) & 1
        flags[vertex_count - 3 * len(triangles) :] = own.ravel()
        return flags
