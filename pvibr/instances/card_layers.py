"""The cards of one shader: what is opaque of them, their soft edges, and their depth."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pvibr.scene.shader_draws import PBR, ShaderDraws

_WHOLE = 0.98  # coverage from which a pixel is opaque
_ALL = 2.0  # more than any coverage
_BEHIND = 1e-6  # of w: a fringe behind its own core is rejected before it is shaded
# Share of what is covered below which two draws of it cost more than they mend: what is small and
# scattered has hardly an opaque pixel.
_MOST = 0.6
_SOME = 3  # rows of views, of which one is asked
#: Side of the square of patches of directions, each of which has errors of its own.
PATCH_SIDE = 4
PATCHES = PATCH_SIDE**2


@dataclass(frozen=True)
class Part:
    """What a draw shows of cards: coverages, and how."""

    least: float
    most: float
    #: Opacity, below 0 the coverage.
    alpha: float
    writes_depth: bool = True
    back: float = 0.0
    nearest_first: bool = False

    def uniforms(self) -> dict:
        """Return the uniforms of the part."""
        return {
            'ibr_part': (self.least, self.most, self.alpha),
            'ibr_back': self.back,
            'ibr_nearest_first': int(self.nearest_first),
        }


# Cores write depth and are opaque, so that they may come in any order, and before all fringes;
# these blend and write none, so that nothing behind them is missing that is drawn later.
CORE = Part(_WHOLE, _ALL, 1.0, nearest_first=True)
FRINGE = Part(1 / 255, _WHOLE, -1.0, writes_depth=False, back=_BEHIND)
#: Fringes of what has no core.
SOFT = Part(1 / 255, _ALL, -1.0, writes_depth=False)
#: Depth alone for effects that read it, of what is more than half covered; VTK discards alpha 0.
DEPTH = Part(0.5, _ALL, 1e-9)
#: For lights and picks.
SOLID = Part(0.5, _ALL, 1.0)


# By the address of the pictures' atlas while that lives: a look at all of it takes 20 ms.
_core_levels: dict[int, int] = {}


def core_level(atlas) -> int:
    """Return the coarsest level of an atlas of which most is opaque, -1 if none is."""
    key = id(atlas)
    if key not in _core_levels:
        _core_levels[key] = _core_level(atlas)
        weakref.finalize(atlas, _core_levels.pop, key, None)
    return _core_levels[key]


def _core_level(atlas) -> int:
    tile, covered = atlas.tile, atlas.geometry[..., 1]
    some = covered.reshape(-1, tile, covered.shape[1])[::_SOME].astype(np.float32)
    level = -1
    while (some >= 255 * _WHOLE).sum() > _MOST * (some > 0).sum() and some.shape[1] > 1:
        level, some = level + 1, _halved(some)
    return level


def _halved(tiles):
    rows, side, width = tiles.shape
    return tiles.reshape(rows, side // 2, 2, width // 2, 2).mean((2, 4))


class CardLayer:
    """The cards of one shader, drawn in parts from the same entries."""

    def __init__(self, cards, shader, prop, draws, most):
        self.cards, self.shader = cards, shader
        shiny = prop.GetSpecular() > 0 or prop.GetInterpolation() == PBR
        kind = shiny, cards.atlas.animated, cards.atlas.turntable is not None
        look = {'draws': draws, 'chunk': most, 'prop': prop, 'binder': cards.binder}

        def made(*, deep):
            return _Draws(self, feature=shader.feature(*kind, deep=deep), **look)

        cored = cards.core_size < shader.largest and not shader.splat
        self.core = made(deep=True) if cored else None
        # Where things pierce one another, a plane cuts wide fringes raggedly; those of small cards
        # are narrow, and the early depth test of a plane saves half of their time.
        self.fringe = made(deep=shader.steps > 0)
        self.depth = made(deep=True)
        self.ranges, self.level = np.zeros((2, PATCHES, 4))
        self.unit = cards.unit
        self.tint: tuple | None = None  # a colour for all that it draws

    def _all(self) -> list:
        return [draws for draws in (self.core, self.fringe, self.depth) if draws is not None]

    @property
    def nbytes(self) -> int:
        """Bytes of the entries on the GPU."""
        return self.fringe.nbytes

    @property
    def landed(self) -> bool:
        """Whether a program was drawn with."""
        return any(draws.landed for draws in self._all())

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self._all() if draws.failure), None)

    def _parts(self) -> dict:
        """Return which part each of the draws shows in the frame."""
        if self.cards.solid:
            return {self.depth: SOLID}
        parts = (
            {self.fringe: SOFT} if self.core is None else {self.core: CORE, self.fringe: FRINGE}
        )
        return {**parts, self.depth: DEPTH} if self.cards.deep else parts

    def bound(self, bounds):
        """Set the bounds that VTK knows the cards by."""
        for draws in self._all():
            draws.place_cards(bounds, self.shader.corners)

    def show(self, blocks, cuts, cored):
        """Draw blocks between cuts, from far to near; cores from one of them on."""
        self.fringe.upload(self.cards.window, blocks)
        ends = list(pairwise(np.asarray(cuts).tolist()))
        parts = self._parts()
        for draws in self._all():
            part = parts.get(draws)
            draws.entries, draws.part = self.fringe.entries, part or SOLID
            first = cored if part is CORE else 0
            some = [(max(a, first), b) for a, b in ends] if part else []
            draws.show_spans([(a * self.unit, b) if b > a else (0, 0) for a, b in some])

    def check(self):
        """Note shaders that the frame was not drawn with."""
        for draws in self._all():
            draws.check()

    def hide(self):
        """Draw nothing."""
        for draws in self._all():
            draws.hide()

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self._all():
            if draws is not self.fringe:
                draws.entries = None
            draws.release(window)

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


class _Draws(ShaderDraws):
    """The draws of a part."""

    def __init__(self, layer, **look):
        super().__init__(**look)
        self._layer = weakref.proxy(layer)
        self.part = SOLID

    def _inputs(self):
        textures, uniforms = self._layer.inputs()
        return textures, uniforms | self.part.uniforms()

    def _set_shader(self, program):
        super()._set_shader(program)
        # VTK itself sets it for the next actor.
        self._layer.cards.window.GetState().vtkglDepthMask(self.part.writes_depth)


def _columns(ranges):
    """Return a matrix for each row of patches, a column for each patch."""
    return ranges.reshape(PATCH_SIDE, -1, 4).swapaxes(1, 2)
