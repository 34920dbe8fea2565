"""Culling, and the choice of what draws each instance, in one pass over groups of many meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE, PATCHES
from pvibr.instances.card_spans import NOWHERE
from pvibr.instances.cards import FADE
from pvibr.maths import octahedral
from pvibr.maths.blocks import Blocks
from pvibr.meshes.turntable import SIDE_ELEVATION

#: Patch of directions that are unsure or of no consequence: limits end with the least of all.
UNKNOWN = PATCHES
_UNSURE = 1e-4  # error of the sine of an angle, or of a position in a patch, on the GPU
_NO_BLOCKS = np.zeros((0, 4), np.float32)


@dataclass(frozen=True)
class SeenBlocks:
    """Blocks in view, those of each group together and far ones first."""

    #: Origin in eye space and number in the group, shape (n, 4).
    table: np.ndarray
    #: Depths, negative, and on-screen diameters of the largest instances, in pixels.
    depths: np.ndarray
    sizes: np.ndarray
    #: Origins in eye space, float64, shape (n, 3).
    centers: np.ndarray
    #: Radii of bounding spheres, of all blocks, and which of them these are.
    all_radii: np.ndarray
    numbers: np.ndarray


class CardBlocks:
    """The blocks of a group that one card shader draws."""

    # What only some frames ask for is taken from all that is seen when they do.

    def __init__(self, seen, rows, spans, core_size, unit, limits):
        self._seen, self._rows = seen, rows
        #: The sizes that the shader draws, and those near a turntable's horizon.
        self.spans = spans
        #: On-screen diameter up to which cards have no core.
        self.core_size = core_size
        #: Instances in a block.
        self.unit = unit
        #: What chooses single instances of the blocks.
        self.limits = limits

    def __len__(self):
        return self._rows.size

    def where(self, mask) -> CardBlocks:
        """Return some of the blocks, by a mask or their rows."""
        options = self.spans, self.core_size, self.unit, self.limits
        return CardBlocks(self._seen, self._rows[mask], *options)

    @property
    def table(self) -> np.ndarray:
        """Origin in eye space and number in the group, shape (n, 4)."""
        return self._seen.table.take(self._rows, 0)

    @property
    def depths(self) -> np.ndarray:
        """Depths, negative, far ones first."""
        return self._seen.depths[self._rows]

    @property
    def sizes(self) -> np.ndarray:
        """On-screen diameter of the largest instance of each, in pixels."""
        return self._seen.sizes[self._rows]

    @property
    def centers(self) -> np.ndarray:
        """Centres of the bounding spheres in eye space, shape (n, 3)."""
        return self._seen.centers[self._rows]

    @property
    def radii(self) -> np.ndarray:
        """Radii of the bounding spheres."""
        return self._seen.all_radii[self._seen.numbers[self._rows]]

    @property
    def ranges(self) -> tuple:
        """The spans as the shader reads them."""
        above, side = self.spans
        return above.ranges, side.ranges

    @property
    def cored(self) -> int:
        """The first block that may have a core."""
        (may_have_core,) = (self.sizes > 0.99 * self.core_size).nonzero()  # the shader decides
        return int(may_have_core[0]) if may_have_core.size else len(self)

    def fits(self, sizes, patches) -> np.ndarray:
        """Return which sizes may be drawn, a little generously: the shader decides."""
        above, side = (span.fits(patches, 0.99 * sizes, 1.01 * sizes) for span in self.spans)
        return above | side


class Choice:
    """What draws a group in a frame."""

    def __init__(self, visible):
        #: The blocks in view.
        self.visible = visible
        #: Those that may have instances too large for cards: origin in eye space, number.
        self.meshes = _NO_BLOCKS
        #: Those that each card shader draws, by its name.
        self.cards: dict[str, CardBlocks] = {}


class GroupBlocks:
    """The blocks of several groups, one group after the other."""

    def __init__(self, groups=()):
        self.groups = tuple(groups)
        self._versions = self._current_versions()
        self._table = _LimitsTable(())
        if groups:
            all_blocks = [group.placement.blocks for group in groups]
            self._starts = np.cumsum([0, *(len(blocks.reach) for blocks in all_blocks)])
            self._blocks = Blocks.joined(all_blocks)
            self._radii = self._blocks.bounding_radii

    def _current_versions(self) -> list[int]:
        return [group.placement.version for group in self.groups]

    def of(self, groups) -> GroupBlocks:
        """Return the blocks of groups as they are now."""
        is_current = self.groups == tuple(groups) and self._versions == self._current_versions()
        return self if is_current else GroupBlocks(groups)

    def choose(self, frame, limits) -> list[Choice]:
        """Return what draws each of the groups, by the limits of each."""
        if self._table.limits != limits:
            self._table = _LimitsTable(limits)
        table = self._table
        visible, origins, smallest, largest, depths = self._blocks.seen(frame)
        owners, ends, own_numbers = None, [0, len(visible)], visible
        if self._blocks.owners is not None:
            owners = self._blocks.owners[visible]
            ends = owners.searchsorted(np.arange(len(self.groups) + 1)).tolist()
            own_numbers = visible - self._starts[owners]
        entries = np.empty((len(visible), 4), np.float32)
        entries[:, :3], entries[:, 3] = origins, own_numbers
        seen = SeenBlocks(entries, depths, largest, origins, self._radii, visible)
        first_rows = table.first_rows(owners)
        rows = first_rows + self._patches(frame, table, seen, first_rows, own_numbers, ends)
        choices = [Choice(own_numbers[a:b]) for a, b in pairwise(ends)]
        (near,) = (largest >= table.mesh_from[rows]).nonzero()
        for choice, (a, b) in zip(choices, pairwise(_ends(near, ends)), strict=True):
            if b > a:
                choice.meshes = entries[near[a:b]]
        if len(visible):
            elevations = self._elevations(frame, table, seen, own_numbers, ends)
            self._choose_cards(choices, table, seen, rows, smallest, ends, elevations)
        return choices

    def _choose_cards(self, choices, table, seen, rows, smallest, ends, elevations):
        extremes = np.minimum.reduce(smallest), np.maximum.reduce(seen.sizes)
        for name, shader_limits in table.drawn_between(*extremes):
            in_span = shader_limits.fit(rows, smallest, seen.sizes, elevations)
            for k, (a, b) in enumerate(pairwise(_ends(in_span, ends)) if in_span.size else ()):
                layers = self.groups[k].cards.layers
                if b > a and name in layers:
                    limits = table.limits[k]
                    options = limits.spans[name], layers[name].core_size, self.groups[k].unit
                    choices[k].cards[name] = CardBlocks(seen, in_span[a:b], *options, limits)

    def _patches(self, frame, table, seen, first_rows, own_numbers, ends):
        """Return the patch of each block's view direction, UNKNOWN where it does not matter."""
        if not table.varies or self.groups[0].unit > 1:
            return UNKNOWN
        least, most = table.varying_sizes(first_rows)
        (undecided,) = ((seen.sizes >= least) & (seen.sizes < most)).nonzero()
        patches = np.full(len(seen.sizes), UNKNOWN)
        if undecided.size:
            spans = pairwise(_ends(undecided, ends))
            rows = [(g, undecided[a:b]) for g, (a, b) in zip(self.groups, spans, strict=True)]
            for half in {g.atlas.half for g, of_group in rows if of_group.size}:
                pairs = [(g, k) for g, k in rows if k.size and g.atlas.half == half]
                matrices = [g.placement.axes(own_numbers[k]) for g, k in pairs]
                chosen = np.concatenate([k for _, k in pairs])
                are_points = all(m is None for m in matrices)
                axes = None if are_points else _joined_axes(matrices, [k.size for _, k in pairs])
                patches[chosen] = view_patches(frame, seen.centers[chosen].T, axes, half)
        return patches

    def _elevations(self, frame, table, seen, own_numbers, ends):
        """Return sines of the eye's elevation over turntables' horizons, NaN where unknown."""
        if not table.has_sides or self.groups[0].unit > 1:
            return None
        elevations = np.full(len(seen.sizes), np.nan)
        for group, span in zip(self.groups, pairwise(ends), strict=True):
            if group.atlas.turntable is not None:
                part = slice(*span)
                elevations[part] = group.elevations(frame, own_numbers[part], seen.centers[part])
        return elevations


def _ends(rows, ends) -> list[int]:
    """Return where among some ascending rows those of each group begin, and the last end."""
    return [0, len(rows)] if len(ends) == 2 else rows.searchsorted(ends).tolist()


def _joined_axes(matrices, counts) -> np.ndarray:
    """Return axes of groups as columns, (9, n), the identity where there are none."""
    identity = np.eye(3, dtype=np.float32).reshape(9, 1)
    pairs = zip(matrices, counts, strict=True)
    return np.concatenate([np.tile(identity, k) if m is None else m for m, k in pairs], 1)


def view_patches(frame, centers, axes, half) -> np.ndarray:
    """Return the patch of the view direction of instances, UNKNOWN where unsure.

    From eye-space centres (3, n), and their poses' axes (9, n) or None without any.
    """
    view = frame.view
    toward = np.array([[0.0], [0.0], [1.0]]) if view.parallel else -centers
    toward = view.view_from_world[:3, :3].T @ toward
    directions = toward.T if axes is None else _in_model(axes, toward)
    lengths = np.sqrt(np.add.reduce(np.square(directions.T)))
    directions = directions / np.maximum(lengths, 1e-30)[:, None]
    cells, cell_margin = octahedral.cells(directions, PATCH_SIDE, half)
    return np.where(cell_margin > _UNSURE, cells, UNKNOWN)


def _in_model(axes, toward) -> np.ndarray:
    """Return directions, (3, n) or (3, 1), in the model axes of poses, of any length, (n, 3)."""
    (a, b, c), (d, e, f), (g, h, i) = axes[:3], axes[3:6], axes[6:]
    x, y, z = toward
    # The adjugate: the inverse but for the factor of the determinant.
    cofactors = (e * i - f * h, f * g - d * i, d * h - e * g)
    directions = np.stack(
        [
            cofactors[0] * x + (c * h - b * i) * y + (b * f - c * e) * z,
            cofactors[1] * x + (a * i - c * g) * y + (c * d - a * f) * z,
            cofactors[2] * x + (b * g - a * h) * y + (a * e - b * d) * z,
        ],
        1,
    )
    is_mirrored = a * cofactors[0] + b * cofactors[1] + c * cofactors[2] < 0
    return np.where(is_mirrored[:, None], -directions, directions)


class _LimitsTable:
    """Limits of several groups: a row for each patch of those that differ."""

    def __init__(self, limits):
        #: Those of each group.
        self.limits = limits
        if not limits:
            return
        row_of = {x: k for k, x in enumerate(dict.fromkeys(limits))}
        self._different = [*row_of]
        self._first_rows = np.array([row_of[x] for x in limits]) * (PATCHES + 1)
        self.mesh_from = np.concatenate([x.mesh_from_at for x in self._different])
        least, most = np.array([x.varying for x in self._different]).T
        self._varying = np.repeat([least, most * FADE], PATCHES + 1, 1)
        #: Whether levels depend on the direction of view at any size.
        self.varies = bool((least <= most).any())

    def first_rows(self, owners):
        """Return the first row of the groups of blocks, a single number if all have the same."""
        return 0 if len(self._different) == 1 else self._first_rows[owners]

    def varying_sizes(self, rows):
        """Return the sizes from and to which the level depends on the direction of view."""
        return self._varying[0][rows], self._varying[1][rows]

    @cached_property
    def _shaders(self) -> list[tuple[str, _ShaderLimits]]:
        names = dict.fromkeys(name for x in self._different for name, *_ in x.drawn_cards)
        return [
            (n, _ShaderLimits([x.spans.get(n, (NOWHERE,) * 2) for x in self._different]))
            for n in names
        ]

    @cached_property
    def has_sides(self) -> bool:
        """Whether any limits differ near the horizon of a turntable."""
        return any(limits.differ for _, limits in self._shaders)

    def drawn_between(self, smallest, largest) -> list[tuple[str, _ShaderLimits]]:
        """Return name and limits of each shader that draws at some size of a range."""
        return [(n, x) for n, x in self._shaders if largest >= x.least and smallest < x.most]


class _ShaderLimits:
    """The sizes at which a card shader draws, of several groups."""

    def __init__(self, spans):
        above, side = zip(*spans, strict=True)
        self._above, self._side = _Sizes(above), _Sizes(side)
        #: Whether those near a turntable's horizon are others.
        self.differ: Any = any(a is not s for a, s in spans)
        self.least = min(self._above.low.min(), self._side.low.min())
        self.most = max(self._above.high.max(), self._side.high.max())

    def fit(self, rows, smallest, largest, elevations) -> np.ndarray:
        """Return the blocks that may have instances of these sizes, from above or the side."""
        fits = self._above.fit(rows, smallest, largest)
        if self.differ:
            fits_side = self._side.fit(rows, smallest, largest)
            if elevations is not None:  # close to the limit, the shader decides
                fits &= ~(elevations <= SIDE_ELEVATION - _UNSURE)
                fits_side &= ~(elevations >= SIDE_ELEVATION + _UNSURE)
            fits |= fits_side
        return fits.nonzero()[0]


class _Sizes:
    """From and to which sizes spans draw, by row of a table of limits."""

    def __init__(self, spans):
        self.low = np.concatenate([span.low for span in spans])
        self.high = FADE * np.concatenate([span.high for span in spans])

    def fit(self, rows, smallest, largest) -> np.ndarray:
        """Return which blocks may have instances of these sizes."""
        return (largest >= self.low[rows]) & (smallest < self.high[rows])
