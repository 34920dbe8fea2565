"""The cards of one shader."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np

from pvibr.things.shader_draws import is_shiny
from pvibr.things.soft_draws import CORE, SOLID, SoftDraws

#: View directions are divided into a square of patches; errors are measured in each.
PATCH_SIDE = 4
PATCHES = PATCH_SIDE**2


class CardLayer(SoftDraws):
    """The cards of one shader: cores, fringes and depth, from the same entries."""

    def __init__(self, cards, shader, prop, draws, chunk):
        self.cards, self.shader = cards, shader
        self.core_size = shader.core_size(cards.atlas)
        kind = is_shiny(prop), cards.atlas.animated, cards.atlas.turntable is not None
        super().__init__(
            shader.feature(*kind, deep=True),
            # Planes that pierce one another cut wide fringes raggedly; fringes of small cards are
            # narrow, and the early depth test of a plane halves their time.
            shader.feature(*kind, deep=shader.steps > 0),
            cored=self.core_size < shader.largest,
            draws=draws,
            chunk=chunk,
            prop=prop,
            binder=cards.binder,
        )
        self.ranges, self.side_ranges = np.zeros((2, PATCHES, 4))
        self.unit = cards.unit
        self.tint: tuple | None = None  # one colour for all its cards
        self.is_empty = False  # whether it draws nothing since it was shown last
        self._inputs: tuple[dict, dict] = {}, {}  # textures, uniforms but for those of the view
        self._shared_uniforms: dict | None = None  # those of the cards that the inputs contain

    @property
    def window(self):
        """The window of the cards."""
        return self.cards.window

    @property
    def nbytes(self) -> int:
        """Bytes of the entries on the GPU."""
        return self.fringe.nbytes

    def show(self, blocks, cuts, *, ranges, unit, cored):
        """Draw blocks between cuts, from far to near; from index `cored` on with cores."""
        if not len(blocks):
            self.clear()
            return
        self.is_empty = False
        if unit != self.unit or ranges[0] is not self.ranges or ranges[1] is not self.side_ranges:
            self.unit, (self.ranges, self.side_ranges) = unit, ranges
            self.refresh()
        self.fringe.upload(self.cards.window, blocks)
        layer_parts = self.parts(solid=self.cards.solid, deep=self.cards.deep)
        for draws in self.every:
            draws.entries, draws.part, spans = self.fringe.entries, SOLID, []
            if draws in layer_parts:
                draws.part = layer_parts[draws]
                first = cored if draws.part is CORE else 0
                starts = [(a if a > first else first, b) for a, b in pairwise(cuts)]
                spans = [(a * unit, b) if b > a else (0, 0) for a, b in starts]
            if spans or draws.span_count:
                draws.show_spans(spans)

    def clear(self):
        """Draw nothing."""
        self.is_empty = True
        self.ranges, self.side_ranges = np.zeros((2, PATCHES, 4))
        for draws in self.every:
            draws.show_spans(())

    def refresh(self):
        """Make the inputs again, after a change of anything but uniforms of the cards."""
        self._shared_uniforms = None

    def inputs(self) -> tuple[dict, dict, dict]:
        """Return the textures and the uniforms of all parts, those of the view apart."""
        if self._shared_uniforms is not self.cards.uniforms:
            self._shared_uniforms = self.cards.uniforms
            self._inputs = self._current_inputs()
        textures, uniforms = self._inputs
        return textures, self.cards.view_uniforms, uniforms

    def _current_inputs(self) -> tuple[dict, dict]:
        cards, textures = self.cards, self.cards.textures
        uniforms = cards.uniforms | range_uniforms((self.ranges, self.side_ranges))
        uniforms |= {
            'ibr_unit': self.unit,
            'ibr_tint': (*self.tint, 1.0) if self.tint else (0.0, 0.0, 0.0, 0.0),
        }
        if self.tint:
            uniforms['ibr_multiply'] = 0
        if self.shader.sides:
            turntable, textures = cards.atlas.turntable, {**textures, **cards.turntable_textures}
            uniforms |= {
                'ibr_views': turntable.turns.columns,
                'ibr_tile': turntable.tile,
                'ibr_turn_views': 1 if self.shader.sides == 1 else turntable.turns.views,
            }
        return textures, uniforms


def range_uniforms(ranges) -> dict:
    """Return the uniforms of the ranges of sizes from above and from the side."""
    above, side = ranges
    return {'ibr_ranges': _columns(above.tobytes()), 'ibr_turn_ranges': _columns(side.tobytes())}


@lru_cache
def _columns(range_bytes):
    """Return one matrix per row of patches, with a column per patch; one object of equal ones."""
    return np.frombuffer(range_bytes).reshape(PATCH_SIDE, -1, 4).swapaxes(1, 2)
