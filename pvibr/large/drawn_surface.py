"""A hierarchy as it is drawn: with the values, textures and edges of a colouring."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, cached_property

import numpy as np

from pvibr.large.cut import ModelView, patches_in_view, patches_within, pixels_of
from pvibr.large.cut_mesh import CutLook
from pvibr.large.detail import Detail
from pvibr.large.hierarchy import Hierarchy
from pvibr.large.original_cells import (
    VISIBLE_CELL,
    VISIBLE_LINE,
    edge_lengths,
    patches_with_edges,
    with_visible_cells,
)
from pvibr.large.tolerance import Tolerance

_FLAT = 0  # VTK_FLAT
_NOTHING = np.zeros(0, int)


class DrawnSurface:
    """What draws a hierarchy by a colouring and a material."""

    def __init__(self, built: Hierarchy, coloring, prop):
        self._built, self.coloring, self._prop = built, coloring, prop
        self._detail = Detail()

    @cached_property
    def _values(self):
        return self.coloring.values_of(self._built)

    @cached_property
    def _edge_lengths(self) -> np.ndarray:
        return edge_lengths(self._built)

    @cached_property
    def _with_visible_cells(self) -> Hierarchy:
        return with_visible_cells(self._built, self._edge_lengths, VISIBLE_CELL)

    @cached_property
    def _with_visible_lines(self) -> Hierarchy:
        return with_visible_cells(self._built, self._edge_lengths, VISIBLE_LINE)

    @property
    def hierarchy(self) -> Hierarchy:
        """The hierarchy, in which cells of the mesh that show are not simplified."""
        if self.coloring.is_of_cells:
            return self._with_visible_cells
        return self._with_visible_lines if self._prop.GetEdgeVisibility() else self._built

    def chosen(self, thing, factor=1.0) -> Hierarchy:
        """Return the hierarchy with the errors by which patches are chosen."""
        if thing.detail == 'none' or factor == math.inf:
            return self.hierarchy
        value_range, is_lit = thing.GetMapper().GetScalarRange(), bool(self._prop.GetLighting())
        values = self._values
        return self._detail.of(self.hierarchy, values, value_range, factor, is_lit=is_lit)

    def triangles_by_tolerance(self, thing, view_of) -> Callable[[Tolerance], int]:
        """Return how many triangles each tolerance draws in the view that is got when asked."""

        @cache
        def scales_and_counts():
            hierarchy, view = self.hierarchy, view_of()
            counts = np.zeros_like(hierarchy.triangle_counts)
            in_view = patches_in_view(hierarchy, np.arange(len(counts)), view)
            counts[in_view] = hierarchy.triangle_counts[in_view]
            return pixels_of(1.0, hierarchy.boxes, view), counts

        def count(tolerance):
            scales, counts = scales_and_counts()
            chosen = self.chosen(thing, tolerance.detail_factor)
            patches = patches_within(chosen, chosen.errors * scales, tolerance.error)
            return int(counts[patches].sum())

        return count

    def look(self, patches, view: ModelView | None = None, max_error=0.0) -> CutLook:
        """Return the look of patches, with edges as a view shows them."""
        edges = None
        if self._prop.GetEdgeVisibility():
            edges = _NOTHING
            if view is not None:
                lengths = self._edge_lengths
                edges = patches_with_edges(self._built, lengths, patches, view, max_error)
        has_normals = self._prop.GetInterpolation() != _FLAT
        return CutLook(self._values, has_normals, self.coloring.has_texture, edges)

    def show(self, cut, patches, view=None, max_error=0.0):
        """Let a cut mesh be of some patches."""
        cut.show(self.hierarchy, patches, self.look(patches, view, max_error))
