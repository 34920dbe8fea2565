"""The cards of one shader."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.scene.shader_draws import PBR
from pvibr.scene.soft_draws import CORE, SOLID, SoftDraws

#: Side of the square of patches of directions, each of which has errors of its own.
PATCH_SIDE = 4
PATCHES = PATCH_SIDE**2


def at_patches(values, patches) -> np.ndarray:
    """Return values by patch at some patches, the least of all where one is unknown, -1."""
    return np.append(values, values.min(-1, keepdims=True), -1)[..., patches]


class CardLayer(SoftDraws):
    """The cards of one shader, drawn in parts from the same entries."""

    def __init__(self, cards, shader, prop, draws, most):
        self.cards, self.shader = cards, shader
        self.core_size = shader.core_size(cards.atlas)
        shiny = prop.GetSpecular() > 0 or prop.GetInterpolation() == PBR
        kind = shiny, cards.atlas.animated, cards.atlas.turntable is not None
        super().__init__(
            shader.feature(*kind, deep=True),
            # Where things pierce one another, a plane cuts wide fringes raggedly; those of small
            # cards are narrow, and the early depth test of a plane saves half of their time.
            shader.feature(*kind, deep=shader.steps > 0),
            cored=self.core_size < shader.largest,
            draws=draws,
            chunk=most,
            prop=prop,
            binder=cards.binder,
        )
        self.ranges, self.level = np.zeros((2, PATCHES, 4))
        self.unit = cards.unit
        self.tint: tuple | None = None  # a colour for all that it draws

    @property
    def window(self):
        """The window that the cards are in."""
        return self.cards.window

    @property
    def nbytes(self) -> int:
        """Bytes of the entries on the GPU."""
        return self.fringe.nbytes

    def show(self, blocks, cuts, cored):
        """Draw blocks between cuts, from far to near; cores from one of them on."""
        self.fringe.upload(self.cards.window, blocks)
        ends = list(pairwise(np.asarray(cuts).tolist()))
        parts = self.parts(solid=self.cards.solid, deep=self.cards.deep)
        for draws in self.every:
            part = parts.get(draws)
            draws.entries, draws.part = self.fringe.entries, part or SOLID
            first = cored if part is CORE else 0
            some = [(max(a, first), b) for a, b in ends] if part else []
            draws.show_spans([(a * self.unit, b) if b > a else (0, 0) for a, b in some])

    def inputs(self) -> tuple[dict, dict]:
        """Return the textures and the uniforms of all parts."""
        cards, textures = self.cards, self.cards.textures
        uniforms = cards.uniforms | {
            'ibr_ranges': _columns(self.ranges),
            'ibr_turn_ranges': _columns(self.level),
            'ibr_unit': self.unit,
            'ibr_tint': (*self.tint, 1.0) if self.tint else (0.0, 0.0, 0.0, 0.0),
        }
        if self.tint:
            uniforms['ibr_multiply'] = 0
        if self.shader.sides:
            turns, textures = cards.atlas.turntable, {**textures, **cards.turned}
            uniforms |= {
                'ibr_views': turns.turns.columns,
                'ibr_tile': turns.tile,
                'ibr_turn_views': 1 if self.shader.sides == 1 else turns.turns.views,
            }
        return textures, uniforms


def _columns(ranges):
    """Return a matrix for each row of patches, a column for each patch."""
    return ranges.reshape(PATCH_SIDE, -1, 4).swapaxes(1, 2)
