"""What the cells of a hierarchy lose of a mesh's shading, beside the places of its surface."""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import Any

import numpy as np

from pvibr.large.hierarchy import NO_CELL, Hierarchy

#: Difference of the unit normals of the full mesh and of a cell, and of their values relative to
#: their range, from which what is left out is seen as soon as it is large enough.
_NORMAL_DIFFERENCE, _VALUE_DIFFERENCE = 0.12, 0.15
#: Size of triangles that have such, relative to the error that is allowed: pixels at 1.
_SPACING = 1.6


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
    # That of a triangle is its size, less where its corners give nearly what the full mesh has.
    shares = np.zeros(len(hierarchy.probes), np.float32)
    if is_lit:
        shares += squared_differences(hierarchy, hierarchy.normals) / _NORMAL_DIFFERENCE**2
    if values is not None:
        by_vertex = values.by_vertex
        # What is beyond the range has its first or last colour.
        low, high = (0, 255) if by_vertex.ndim == 2 else value_range
        scale = max(high - low, 1e-30) * _VALUE_DIFFERENCE  # in single precision
        by_vertex = np.clip(by_vertex, low, high).reshape(len(by_vertex), -1)
        shares += squared_differences(hierarchy, by_vertex, scale)
    squares = triangle_areas(hierarchy) * np.minimum(shares, 1)
    return np.sqrt(_largest_below(hierarchy, _means_of_cells(hierarchy, squares)))


def squared_differences(hierarchy, values, scale=1.0) -> np.ndarray:
    """Return squared differences of values (v, k) at probes from those of the corners there."""
    own, *corners = (values.take(places, axis=0) for places in hierarchy.probes.T[1:])
    own = own.astype(np.result_type(values, np.float32))
    differences = np.zeros(own.shape, np.float32)
    for corner, weights in zip(corners, hierarchy.probe_weights.T, strict=True):
        differences += (weights[:, None] * (corner - own) / scale).astype(np.float32)
    is_unknown = np.isnan(differences)
    if is_unknown.any():  # what is known ends there
        is_end = np.isnan(own) != np.any([np.isnan(corner) for corner in corners], axis=0)
        differences = np.where(is_unknown, is_end, differences)
    return np.einsum('ij,ij->i', differences, differences)


def triangle_areas(hierarchy) -> np.ndarray:
    """Return the areas of the parallelograms of the triangles that probes are on."""
    a, b, c = (hierarchy.points.take(corner, axis=0) for corner in hierarchy.probes[:, 2:].T)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _means_of_cells(hierarchy, values) -> np.ndarray:
    """Return the means by area of values at probes of each cell."""
    cells, weights = hierarchy.probes[:, 0], hierarchy.areas[hierarchy.probes[:, 1]]
    count = len(hierarchy.errors)
    sums = np.bincount(cells, weights * values, count)
    return sums / np.maximum(np.bincount(cells, weights, count), 1e-300)


def _largest_below(hierarchy, values) -> np.ndarray:
    """Return the largest of the values of each cell and of those that it replaced."""
    values = values.copy()
    made_by, replaced_by = hierarchy.patch_cells.T
    for patch in np.argsort(made_by, kind='stable').tolist():
        maker, owner = made_by[patch], replaced_by[patch]
        if maker != NO_CELL and owner != NO_CELL:
            values[owner] = max(values[owner], values[maker])
    return values
