"""Arrays of the patches of a cut; a cut copies those of patches that the last one had."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from pvibr.large.hierarchy import NO_CELL

#: Largest coordinate that single precision holds well enough, relative to the mesh's extent.
_NEAR = 4.0
_NOTHING = np.zeros((0, 3), np.int32)


@dataclass(frozen=True, eq=False)
class PatchArrays:
    """What patches are drawn with, one after the other."""

    #: Arrays of the vertices by name.
    columns: dict[str, Any]
    #: Triangles as places among the vertices, (n, 3) int32.
    triangles: Any
    #: Where the vertices and the triangles of each patch start, and where the last ones end.
    vertex_starts: list[int]
    triangle_starts: list[int]
    #: Place of each patch, by its number.
    places: dict[int, int]

    @classmethod
    def looked_up(cls, hierarchy, look, patches: Sequence[int] = ()) -> PatchArrays:
        """Return those of patches of a hierarchy."""
        rows = [_rows(hierarchy, look, patch) for patch in patches]
        vertex_starts = [0, *accumulate(len(own) for own, _ in rows)]
        triangle_starts = [0, *accumulate(len(triangles) for _, triangles in rows)]
        columns = _columns(
            hierarchy, look, np.concatenate([_NOTHING[:, 0], *(r[0] for r in rows)])
        )
        by_triangle = None if look.values is None else look.values.by_triangle
        triangles = np.concatenate([_NOTHING, *(r[1] for r in rows)])
        for k, patch in enumerate(patches):
            triangles[triangle_starts[k] : triangle_starts[k + 1]] += vertex_starts[k]
            if by_triangle is not None and _is_full(hierarchy, patch):
                values = by_triangle[slice(*hierarchy.triangle_starts[patch : patch + 2])]
                own = slice(vertex_starts[k], vertex_starts[k + 1])
                columns['scalars'][own] = np.repeat(values, 3, axis=0)
        places = {patch: k for k, patch in enumerate(patches)}
        return cls(columns, triangles, vertex_starts, triangle_starts, places)

    def moved_to(self, hierarchy, look, patches: Sequence[int]) -> PatchArrays:
        """Return those of other patches of the same hierarchy and look."""
        new = self.looked_up(hierarchy, look, [p for p in patches if p not in self.places])
        sources = [
            (self, self.places[p]) if p in self.places else (new, new.places[p]) for p in patches
        ]
        vertices = [slice(*of.vertex_starts[k : k + 2]) for of, k in sources]
        rows = [slice(*of.triangle_starts[k : k + 2]) for of, k in sources]
        starts = [0, *accumulate(own.stop - own.start for own in vertices)]
        triangle_starts = [0, *accumulate(own.stop - own.start for own in rows)]
        columns = {}
        for name, empty in new.columns.items():
            parts = [of.columns[name][own] for (of, _), own in zip(sources, vertices, strict=True)]
            columns[name] = np.concatenate([empty[:0], *parts])
        parts = [of.triangles[own] for (of, _), own in zip(sources, rows, strict=True)]
        triangles = np.concatenate([_NOTHING, *parts])
        for (first, last), own, start in zip(
            pairwise(triangle_starts), vertices, starts, strict=False
        ):
            triangles[first:last] += start - own.start
        places = {patch: k for k, patch in enumerate(patches)}
        return PatchArrays(columns, triangles, starts, triangle_starts, places)

    def edge_flags(self, hierarchy, patches) -> np.ndarray:
        """Return whether an edge of a cell starts at each vertex, in some patches of the mesh."""
        flags = np.zeros(self.vertex_starts[-1], np.uint8)
        for patch in patches.tolist():
            rows = slice(*hierarchy.triangle_starts[patch : patch + 2])
            bits = hierarchy.edge_flags[rows] if len(hierarchy.edge_flags) else np.uint8(7)
            place = self.places[patch]
            own = flags[self.vertex_starts[place] : self.vertex_starts[place + 1]].reshape(-1, 3)
            own[:] = np.reshape(bits, (-1, 1)) >> np.arange(3, dtype=np.uint8) & 1
        return flags


def _is_full(hierarchy, patch) -> bool:
    return hierarchy.patch_cells[patch, 0] == NO_CELL


def _rows(hierarchy, look, patch) -> tuple[np.ndarray, np.ndarray]:
    """Return rows of the vertices of a patch in its hierarchy, and its triangles among them.

    Where a look has corners, triangles of the full mesh share none.
    """
    first, last = hierarchy.vertex_starts[patch : patch + 2].tolist()
    triangles = hierarchy.triangles[slice(*hierarchy.triangle_starts[patch : patch + 2])]
    if look.has_corners and _is_full(hierarchy, patch):
        rows = triangles.ravel().astype(np.int64) + first
        return rows, np.arange(len(rows), dtype=np.int32).reshape(-1, 3)
    return np.arange(first, last), triangles.astype(np.int32)


def _columns(hierarchy, look, rows) -> dict[str, np.ndarray]:
    """Return the arrays of vertices."""
    vertices = hierarchy.vertices.take(rows)
    low, high = hierarchy.bounds
    is_near = max(abs(low).max(), abs(high).max()) <= _NEAR * (high - low).max()
    points = hierarchy.points.take(vertices, axis=0) + hierarchy.origin
    columns = {'points': points.astype(np.float32) if is_near else points}
    if look.has_normals:
        columns['normals'] = hierarchy.normals.take(vertices, axis=0)
    if look.has_texture:
        columns['coordinates'] = hierarchy.texture_coordinates.take(rows, axis=0)
    if look.values is not None:
        columns['scalars'] = look.values.by_vertex.take(vertices, axis=0)
    return columns
