"""A mesh as patches of all levels, of which some draw it within an error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

#: Index of the cell that made the patches of the full mesh, or that replaces the coarsest.
NO_CELL = -1
#: Rows, and patches, that are checked at once.
_PIECE_ROWS, _PIECE_PATCHES = 1 << 22, 1 << 12
#: Kind of the numbers of each array, and the shape of its rows.
_LAYOUT: dict[str, tuple[str, tuple[int, ...]]] = {
    'origin': ('f', ()),
    'points': ('f', (3,)),
    'normals': ('f', (3,)),
    'parents': ('i', ()),
    'level_starts': ('i', ()),
    'areas': ('f', ()),
    'vertex_of_point': ('i', ()),
    'mesh_cells': ('i', ()),
    'edge_flags': ('u', ()),
    'errors': ('f', ()),
    'boxes': ('f', (2, 3)),
    'probes': ('i', (5,)),
    'probe_weights': ('f', (3,)),
    'patch_cells': ('i', (2,)),
    'patch_boxes': ('f', (2, 3)),
    'vertex_starts': ('i', ()),
    'triangle_starts': ('i', ()),
    'vertices': ('i', ()),
    'triangles': ('u', (3,)),
    'texture_coordinates': ('f', (2,)),
}


@dataclass(frozen=True)
class Hierarchy:
    """Patches of triangles, each made by one cell and replaced by another."""

    # A cell replaces all of its patches at once by others with about half the triangles. Patches
    # that share an edge have the same vertices there, by number.

    #: Where vertex positions are relative to, model space, (3,) float64.
    origin: np.ndarray
    #: Positions of the vertices about the origin, (v, 3) float32; first those of the full mesh.
    points: np.ndarray
    #: Unit normals of the vertices, (v, 3) float32.
    normals: np.ndarray
    #: Vertex that each was merged into, -1 for none; always a later one.
    parents: np.ndarray
    #: Vertices of each level start here, (levels + 1,).
    level_starts: np.ndarray
    #: Area around each vertex of the full mesh, its weight in averages.
    areas: np.ndarray
    #: Vertex of each point of the mesh; equal points have the same.
    vertex_of_point: np.ndarray
    #: Cell of the mesh that each triangle of the full mesh is of, in the order of patches.
    mesh_cells: np.ndarray
    #: Edges of each of these triangles that are edges of its cell, bits 1, 2 and 4; all if empty.
    edge_flags: np.ndarray
    #: Distance that the full mesh keeps from what replaced each cell, (c,).
    errors: np.ndarray
    #: Bounds (low, high) about the origin of each cell and all that it replaces, (c, 2, 3).
    boxes: np.ndarray
    #: Where some vertices of the full mesh are on what replaced each cell: the cell, the vertex,
    #: the corners of the nearest triangle, (n, 5), and the weights of these, (n, 3).
    probes: np.ndarray
    probe_weights: np.ndarray
    #: Cells that made each patch and that replace it, (p, 2), `NO_CELL` for none.
    patch_cells: np.ndarray
    #: Bounds of each patch, (p, 2, 3).
    patch_boxes: np.ndarray
    #: Where the vertices and the triangles of each patch start, (p + 1,).
    vertex_starts: np.ndarray
    triangle_starts: np.ndarray
    #: Vertices of the patches.
    vertices: np.ndarray
    #: Triangles of the patches, as places among the vertices of their patch, (t, 3) uint16.
    triangles: np.ndarray
    #: Texture coordinates of the patches' vertices, of which seams have several, or none at all.
    texture_coordinates: np.ndarray

    @property
    def nbytes(self) -> int:
        """Size of all arrays."""
        return sum(array.nbytes for array in self.to_arrays().values())

    @cached_property
    def triangle_counts(self) -> np.ndarray:
        """Triangles of each patch."""
        return np.diff(self.triangle_starts)

    @cached_property
    def full_patches(self) -> np.ndarray:
        """Patches of the full mesh."""
        return np.flatnonzero(self.patch_cells[:, 0] == NO_CELL)

    @property
    def n_triangles(self) -> int:
        """Triangles of the full mesh."""
        return len(self.mesh_cells)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest coordinates of the full mesh, model space."""
        boxes = self.patch_boxes[self.full_patches]
        return self.origin + boxes[:, 0].min(0), self.origin + boxes[:, 1].max(0)

    @cached_property
    def full_triangles(self) -> np.ndarray:
        """Vertices of the triangles of the full mesh, in the order of patches, (t, 3)."""
        patches = self.full_patches
        places = self.triangles[: self.n_triangles].astype(np.int64)
        places += np.repeat(self.vertex_starts[patches], self.triangle_counts[patches])[:, None]
        return self.vertices[places]

    @cached_property
    def triangle_areas(self) -> np.ndarray:
        """Areas of these triangles; a small one of those without."""
        a, b, c = (self.points[corner] for corner in self.full_triangles.T)
        b, c = b - a, c - a
        squares = [
            (b[:, i] * c[:, j] - b[:, j] * c[:, i]) ** 2 for i, j in ((0, 1), (1, 2), (2, 0))
        ]
        areas = np.sqrt(sum(squares))
        return np.maximum(areas, 1e-12 * max(areas.max(), 1e-30))

    def averaged(self, values) -> np.ndarray:
        """Return means by area of the points' values at all vertices, NaN where none is finite."""
        values = np.asarray(values).reshape(len(self.vertex_of_point), -1)
        return self.means(self.vertex_of_point, values, self.areas[self.vertex_of_point])

    def means(self, vertices, values, weights) -> np.ndarray:
        """Return means of weighted values at vertices of the full mesh, (n,) or (n, 3), at all."""
        return np.stack([self._column_means(vertices, v, weights) for v in values.T], 1)

    def _column_means(self, vertices, values, weights) -> np.ndarray:
        is_known, count = np.isfinite(values), len(self.areas)
        weights = np.where(is_known, weights, 0.0).astype(np.float64)
        sums = _summed(vertices, np.where(is_known, values, 0) * weights, count)
        totals = np.zeros(len(self.points), np.float32)
        means = np.zeros(len(self.points), np.float32)
        own_totals = _summed(vertices, weights, count)
        totals[:count] = own_totals / (own_totals.max(initial=0.0) or 1.0)
        with np.errstate(invalid='ignore', divide='ignore'):
            means[:count] = sums / own_totals
            for first, last, children in self.merges():
                places, own_weights = self.parents[children] - first, totals[children]
                products = np.where(own_weights > 0, means[children] * own_weights, 0)
                totals[first:last] = np.bincount(places, own_weights, last - first)
                means[first:last] = np.bincount(places, products, last - first)
                means[first:last] /= totals[first:last]
        means[totals == 0] = np.nan
        return self.with_neighbours(means, totals == 0)

    def with_neighbours(self, values, is_unknown) -> np.ndarray:
        """Return values of vertices; those that none was merged into have that of the nearest."""
        if not is_unknown[len(self.areas) :].any():
            return values
        for at in np.flatnonzero(self._is_lonely[self.vertices]).tolist():
            patch = np.searchsorted(self.vertex_starts, at, side='right') - 1
            own = self.vertices[slice(*self.vertex_starts[patch : patch + 2])]
            own = own[~self._is_lonely[own]]
            if len(own):
                gaps = self.points[own] - self.points[self.vertices[at]]
                values[self.vertices[at]] = values[own[np.einsum('ij,ij->i', gaps, gaps).argmin()]]
        return values

    @cached_property
    def _is_lonely(self) -> np.ndarray:
        """Whether no vertex of the full mesh was merged into each one."""
        # Of cells that meet at a vertex alone each may merge it, and one of them has it.
        is_lonely = np.ones(len(self.points), bool)
        is_lonely[: len(self.areas)] = False
        for _, _, children in self.merges():
            is_lonely[self.parents[children[~is_lonely[children]]]] = False
        return is_lonely

    def merges(self):
        """Yield the vertices of each level, first and last, and those merged into them."""
        for first, last in zip(self.level_starts[1:-1], self.level_starts[2:], strict=True):
            parents = self.parents[:first]
            children = np.flatnonzero((parents >= first) & (parents < last))
            if len(children):
                yield int(first), int(last), children

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return all arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Hierarchy:
        """Return the hierarchy of arrays that `to_arrays` returned, checked."""
        hierarchy = cls.of_checked(arrays)
        hierarchy.check()
        return hierarchy

    @classmethod
    def of_checked(cls, arrays: Mapping[str, np.ndarray]) -> Hierarchy:
        """Return the hierarchy of arrays that were checked before."""
        return cls(**{field.name: arrays[field.name] for field in fields(cls)})

    def check(self):
        """Raise a ValueError where arrays do not belong together, which names one that is off."""
        for name, array in self.to_arrays().items():
            if (array.dtype.kind, array.shape[1:]) != _LAYOUT[name]:
                raise ValueError(f'its arrays do not belong together: {name!r} is of another kind')
        for name, is_right in self._rules():
            if not is_right:
                raise ValueError(f'its arrays do not belong together: {name!r} does not fit')

    def _rules(self) -> Iterator[tuple[str, bool]]:
        """Yield the names of arrays, and whether they fit those before."""
        patch_count, vertex_count = len(self.patch_cells), len(self.points)
        starts = self.level_starts
        yield 'origin', len(self.origin) == 3
        yield 'boxes', len(self.boxes) == len(self.errors)
        yield 'probes', _is_below(self.probes[:, 0], len(self.errors))
        yield 'probes', _is_below(self.probes[:, 1], len(self.areas))
        yield 'probes', _is_below(self.probes[:, 2:], vertex_count)
        yield 'probe_weights', len(self.probe_weights) == len(self.probes)
        yield 'patch_cells', _is_below(self.patch_cells, len(self.errors), NO_CELL)
        yield 'patch_boxes', len(self.patch_boxes) == patch_count
        yield 'level_starts', starts[:2].tolist() == [0, len(self.areas)]
        yield 'level_starts', starts[-1] == vertex_count and bool((np.diff(starts) >= 0).all())
        yield 'normals', len(self.normals) == vertex_count
        yield 'parents', len(self.parents) == vertex_count
        yield 'parents', _is_below(self.parents, vertex_count, -1)
        yield 'vertex_of_point', _is_below(self.vertex_of_point, len(self.areas))
        yield 'vertex_starts', _are_starts(self.vertex_starts, patch_count, len(self.vertices))
        yield 'vertices', _is_below(self.vertices, vertex_count)
        yield 'texture_coordinates', len(self.texture_coordinates) in (0, len(self.vertices))
        yield (
            'triangle_starts',
            _are_starts(self.triangle_starts, patch_count, len(self.triangles)),
        )
        yield 'triangles', self._are_corners_whole()
        yield 'edge_flags', len(self.edge_flags) in (0, len(self.mesh_cells))
        yield 'mesh_cells', len(self.mesh_cells) == self.triangle_counts[self.full_patches].sum()

    def _are_corners_whole(self) -> bool:
        """Return True if triangles are of the vertices of their patches."""
        counts, starts = np.diff(self.vertex_starts), self.triangle_starts
        for first in range(0, len(counts), _PIECE_PATCHES):
            last = min(first + _PIECE_PATCHES, len(counts))
            corners = self.triangles[starts[first] : starts[last]]
            highest = np.maximum(np.maximum(corners[:, 0], corners[:, 1]), corners[:, 2])
            if (highest >= np.repeat(counts[first:last], self.triangle_counts[first:last])).any():
                return False
        return True


def _summed(places, values, count) -> Any:
    """Return sums by place, or by each of several places."""
    if places.ndim == 2:
        return sum(_summed(own, values, count) for own in places.T)
    return np.bincount(places, values, count)


def _are_starts(starts, count, end) -> bool:
    """Return True if starts divide a range into a number of parts, none of them empty."""
    return (
        len(starts) == count + 1
        and starts[0] == 0
        and starts[-1] == end
        and (np.diff(starts) > 0).all()
    )


def _is_below(indices, count, least=0) -> bool:
    pieces = (indices[k : k + _PIECE_ROWS] for k in range(0, len(indices), _PIECE_ROWS))
    return all(bool(piece.min() >= least and piece.max() < count) for piece in pieces)
