"""What the cells of a hierarchy lose of a mesh's shading, beside the places of its surface."""

from __future__ import annotations

import operator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.large.hierarchy import NO_CELL, Hierarchy

#: Spread of the unit normals that a vertex stands for, and of its values relative to their range,
#: from which what it leaves out is seen as soon as it is large enough.
_NORMAL_SPREAD, _VALUE_SPREAD = 0.12, 0.15
#: Distance of such vertices, relative to the error that is allowed: pixels at an error of 1.
_SPACING = 1.6
#: Corners of triangles that count the area around a vertex, times 2 for the parallelogram.
_AREA_PARTS = 6
#: Vertices that are looked at at once.
_PIECE = 1 << 22


class Detail:
    """What the cells of a hierarchy lose of its shading, kept while neither has changed."""

    # Vertices, and no textures: by 16 samples of the mesh in each triangle of a cut at 1 pixel,
    # FLIP was still 1.8 (terrain) to 3.7 (a scan) times that of the mesh, as outlines are off.

    def __init__(self):
        self._shown: tuple = (None, None)
        self._look: tuple = ()
        self._errors: Any = None
        self._last: tuple = (0.0, None)  # factor, and the hierarchy for it

    def of(self, hierarchy, values, value_range, factor=1.0, *, is_lit) -> Hierarchy:
        """Return a hierarchy whose errors also tell what it loses of normals and values."""
        shown, look = (hierarchy, values), (value_range, is_lit)
        if look != self._look or not all(map(operator.is_, shown, self._shown)):
            self._shown, self._look = shown, look
            lengths = lost_lengths(hierarchy, values, value_range, is_lit=is_lit)
            self._errors, self._last = lengths / _SPACING, (0.0, None)
        if self._last[0] != factor:
            errors = np.maximum(hierarchy.errors, self._errors / factor)
            self._last = factor, replace(hierarchy, errors=errors)
        return self._last[1]


def lost_lengths(hierarchy, values, value_range, *, is_lit) -> np.ndarray:
    """Return the lengths across which each cell leaves out what can be seen, never decreasing."""
    # That of a vertex is the size of what was merged into it, less where this is nearly even.
    areas = vertex_areas(hierarchy)
    shares = np.zeros(len(areas), np.float32)
    if is_lit:
        shares += spread_of(hierarchy, areas, hierarchy.normals) / _NORMAL_SPREAD**2
    if values is not None:
        by_vertex = values.by_vertex
        # What is beyond the range has its first or last colour.
        low, high = (0, 255) if by_vertex.ndim == 2 else value_range
        scale = max(high - low, 1e-30) * _VALUE_SPREAD  # in single precision
        by_vertex = np.clip(by_vertex, low, high).reshape(len(areas), -1)
        shares += spread_of(hierarchy, areas, by_vertex, scale)
    squares = areas * np.minimum(shares, 1) / _AREA_PARTS
    return np.sqrt(_largest_below(hierarchy, _means_of_cells(hierarchy, squares)))


def vertex_areas(hierarchy) -> np.ndarray:
    """Return the area of the full mesh, times a factor, that each vertex stands for."""
    areas = np.zeros(len(hierarchy.points), np.float32)
    areas[: len(hierarchy.areas)] = hierarchy.areas
    for children, parents in _merges(hierarchy):
        _add(areas, parents, areas[children])
    return areas


def spread_of(hierarchy, areas, values, scale=1.0) -> np.ndarray:
    """Return the variance of what was merged into each vertex, by area, from values (v, k)."""
    sums, kind = np.zeros(len(areas), np.float32), np.result_type(values, np.float32)
    for children, parents in _merges(hierarchy):
        ends = values[children].astype(kind), values[parents].astype(kind)
        differences = ((ends[0] - ends[1]) / scale).astype(np.float32)
        is_unknown = np.isnan(differences)
        if is_unknown.any():  # what is known ends there
            is_end = np.isnan(ends[0]) != np.isnan(ends[1])
            differences = np.where(is_unknown, is_end, differences)
        squares = np.einsum('ij,ij->i', differences, differences)
        _add(sums, parents, areas[children] * squares + sums[children])
    return np.divide(sums, areas, out=np.zeros_like(sums), where=areas > 0)


def _merges(hierarchy):
    """Yield vertices and what each was merged into, those of a vertex before its own merge."""
    starts = hierarchy.level_starts.tolist()
    for level_start, level_end in pairwise(starts):
        for first in range(level_start, level_end, _PIECE):
            parents = np.asarray(hierarchy.parents[first : min(first + _PIECE, level_end)])
            is_merged = parents >= 0
            if is_merged.any():
                yield first + np.flatnonzero(is_merged), parents[is_merged]


def _add(sums, places, values):
    """Add values to sums, which may have several at a place."""
    low, high = places.min(), places.max()
    sums[low : high + 1] += np.bincount(places - low, values, high - low + 1)


def _means_of_cells(hierarchy, values) -> np.ndarray:
    """Return the mean of the values of the vertices of what replaced each cell."""
    count = len(hierarchy.errors)
    is_made = hierarchy.patch_cells[:, 0] != NO_CELL
    first = hierarchy.vertex_starts[:-1][is_made]
    if not len(first):
        return np.zeros(count)
    start = int(first[0])  # those of the full mesh come first
    sums = np.add.reduceat(values[hierarchy.vertices[start:]], first - start)
    makers = hierarchy.patch_cells[is_made, 0]
    vertex_counts = np.diff(hierarchy.vertex_starts)[is_made]
    return np.bincount(makers, sums, count) / np.maximum(
        np.bincount(makers, vertex_counts, count), 1
    )


def _largest_below(hierarchy, values) -> np.ndarray:
    """Return the largest of the values of each cell and of those that it replaced."""
    values = values.copy()
    made_by, replaced_by = hierarchy.patch_cells.T
    for patch in np.argsort(made_by, kind='stable').tolist():
        maker, owner = made_by[patch], replaced_by[patch]
        if maker != NO_CELL and owner != NO_CELL:
            values[owner] = max(values[owner], values[maker])
    return values
