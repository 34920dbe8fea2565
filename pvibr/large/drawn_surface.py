"""A hierarchy as it is drawn: with the values, textures and edges of a colouring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, cached_property

import numpy as np

from pvibr.core.arguments import checked_whole
from pvibr.large.cut import ModelView, cut_of, patches_in_view, patches_within, pixels_of
from pvibr.large.cut_mesh import CutLook
from pvibr.large.detail import Detail
from pvibr.large.hierarchy import NO_CELL, Hierarchy
from pvibr.large.original_cells import (
    edge_lengths,
    patches_with_edges,
    with_visible_cells,
)
from pvibr.large.tolerance import Tolerance
from pvibr.maths.kd_boxes import divided, inside

_FLAT = 0  # VTK_FLAT


class DrawnSurface:
    """What draws a hierarchy by a colouring and a material."""

    def __init__(self, built: Hierarchy, coloring, prop, part=None):
        self._built, self.coloring, self._prop = built, coloring, prop
        self._is_own = None if part is None else _patches_of(built, *part)
        self._detail = Detail()

    @cached_property
    def _values(self):
        return self.coloring.values_of(self._built)

    @cached_property
    def _edge_lengths(self) -> np.ndarray:
        return edge_lengths(self._built)

    @cached_property
    def _with_visible_cells(self) -> Hierarchy:
        return with_visible_cells(self._built, self._edge_lengths)

    @property
    def hierarchy(self) -> Hierarchy:
        """The hierarchy, in which cells of the mesh that show are not simplified."""
        if self.coloring.is_of_cells or self._prop.GetEdgeVisibility():
            return self._with_visible_cells
        return self._built

    def chosen(self, thing, factor=1.0) -> Hierarchy:
        """Return the hierarchy with the errors by which patches are chosen."""
        if thing.detail == 'none' or factor == math.inf or thing.is_draft:
            return self.hierarchy
        value_range, is_lit = thing.GetMapper().GetScalarRange(), bool(self._prop.GetLighting())
        values = self._values
        return self._detail.of(self.hierarchy, values, value_range, factor, is_lit=is_lit)

    def cut(self, thing, view, tolerance) -> tuple[np.ndarray, np.ndarray]:
        """Return the patches of a cut, and those of them that are in view, front to back."""
        cut = cut_of(self.chosen(thing, tolerance.detail_factor), view, tolerance.error)
        if self._is_own is None:
            return cut
        whole, in_view = (patches[self._is_own[patches]] for patches in cut)
        return whole, in_view

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

    def look(self, patches) -> CutLook:
        """Return the look of patches."""
        edges = None
        if self._prop.GetEdgeVisibility():
            edges = patches[self._built.patch_cells[patches, 0] == NO_CELL]
        has_normals = self._prop.GetInterpolation() != _FLAT
        return CutLook(self._values, has_normals, self.coloring.has_texture, edges)

    def look_of_export(self, patches, view: ModelView, max_error) -> CutLook:
        """Return the look of patches, with the edges of those that a view shows in full."""
        look = replace(self.look(patches), has_normals=True)
        if look.edges is None:
            return look
        lengths = self._edge_lengths
        return replace(
            look, edges=patches_with_edges(self._built, lengths, patches, view, max_error)
        )

    def show(self, cut, patches):
        """Let a cut mesh be of some patches."""
        cut.show(self.hierarchy, patches, self.look(patches))


def _patches_of(hierarchy, index, count) -> np.ndarray:
    """Return which patches of all levels are in a part of space, of parts with as many patches."""
    centers = hierarchy.patch_boxes.mean(1)
    boxes = [box for _, box in divided(centers[hierarchy.full_patches], count)]
    if index >= len(boxes):
        return np.zeros(len(centers), bool)
    return inside(centers, boxes[index])


def checked_part(part) -> tuple[int, int] | None:
    """Return the index of a part and the count of parts, checked, or None for the whole."""
    if part is None:
        return None
    if not isinstance(part, (tuple, list)) or len(part) != 2:
        raise ValueError(f'part must be an index and a count, as (0, 4), got {part!r:.80}')
    count = checked_whole('part[1]', part[1], 1, 100_000)
    return checked_whole('part[0]', part[0], 0, count - 1), count
