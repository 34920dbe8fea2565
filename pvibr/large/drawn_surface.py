"""A hierarchy as it is drawn: with the values, textures and edges of a colouring."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from pvibr.large.cut import ModelView, triangles_in_view
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

_FLAT = 0  # VTK_FLAT
_NOTHING = np.zeros(0, int)


class DrawnSurface:
    """What draws a hierarchy by a colouring and a material."""

    def __init__(self, built: Hierarchy, coloring, prop):
        self._built, self.coloring, self._prop = built, coloring, prop
        self._detail = Detail()
        #: Hierarchy, view and error of which triangles were counted last, and their number.
        self._counted: tuple = (None, None, 0.0, 0)

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

    def triangles(self, thing, view, tolerance) -> int:
        """Return how many triangles are drawn within a tolerance."""
        chosen, error = self.chosen(thing, tolerance.detail_factor), tolerance.error
        hierarchy, last_view, last_error, _ = self._counted
        if hierarchy is not chosen or last_view is not view or last_error != error:
            self._counted = chosen, view, error, triangles_in_view(chosen, view, error)
        return self._counted[-1]

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
