"""Soft-edged cards drawn in parts: what is opaque of them, their edges, and their depth."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

from pvibr.things.draw_order import Stage
from pvibr.things.shader_draws import ShaderDraws

#: Coverage from which a pixel is opaque.
WHOLE = 0.98
_ALL = 2.0  # more than any coverage
_BEHIND = 1e-6  # of w: a fringe behind its own core is rejected before it is shaded


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
CORE = Part(WHOLE, _ALL, 1.0, nearest_first=True)
FRINGE = Part(1 / 255, WHOLE, -1.0, writes_depth=False, back=_BEHIND)
#: Fringes of what has no core.
SOFT = Part(1 / 255, _ALL, -1.0, writes_depth=False)
#: Depth alone for effects that read it, of what is more than half covered; VTK discards alpha 0.
DEPTH = Part(0.5, _ALL, 1e-9)
#: Hard edges, also for lights and picks.
SOLID = Part(0.5, _ALL, 1.0)


class PartDraws(ShaderDraws):
    """The draws of a part; the soft draws that own them have the textures and uniforms."""

    def __init__(self, owner, **look):
        super().__init__(**look)
        self._owner = weakref.proxy(owner)
        self.part = SOLID

    def _inputs(self):
        textures, uniforms = self._owner.inputs()
        return textures, uniforms | self.part.uniforms()

    def _set_shader(self, program):
        super()._set_shader(program)
        # VTK itself sets it for the next actor.
        self._owner.window.GetState().vtkglDepthMask(self.part.writes_depth)


class SoftDraws:
    """Draws of the same cards: cores, fringes, and depth where it is read.

    A subclass has the window, and ``inputs()``: textures and uniforms of all parts.
    """

    def __init__(self, feature, fringe=None, *, cored=True, **look):
        self.core = PartDraws(self, feature=feature, **look) if cored else None
        self.fringe = PartDraws(self, feature=fringe or feature, **look)
        self.depth = PartDraws(self, feature=feature, **look)

    @property
    def every(self) -> list:
        """The draws of all parts."""
        return [draws for draws in (self.core, self.fringe, self.depth) if draws is not None]

    @property
    def actors(self) -> list:
        """The actors of all parts."""
        return [actor for draws in self.every for actor in draws.actors]

    @property
    def landed(self) -> bool:
        """Whether a program was drawn with."""
        return any(draws.landed for draws in self.every)

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self.every if draws.failure), None)

    def order(self, row) -> list:
        """Return pairs of a key and an actor: fringes of higher rows are drawn later."""
        found = []
        for draws, stage, turn in (
            (self.core, Stage.CORE, -1),
            (self.fringe, Stage.FRINGE, 1),
            (self.depth, Stage.DEPTH, 1),
        ):
            actors = [] if draws is None else draws.actors
            found += [((stage, turn * row, turn * k), a) for k, a in enumerate(actors)]
        return found

    def parts(self, *, solid, deep) -> dict:
        """Return the part that each draw shows: hard edges, or soft ones whose depth is read."""
        if solid:
            return {self.core or self.depth: SOLID}
        parts = {self.fringe: SOFT}
        if self.core is not None:
            parts = {self.core: CORE, self.fringe: FRINGE}
        return {**parts, self.depth: DEPTH} if deep else parts

    def bound(self, bounds, corners=4):
        """Set the bounds that VTK knows the cards by."""
        for draws in self.every:
            draws.place_cards(bounds, corners)

    def check(self):
        """Note shaders that the frame was not drawn with."""
        for draws in self.every:
            draws.check()

    def hide(self):
        """Draw nothing."""
        for draws in self.every:
            draws.hide()

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self.every:
            if draws is not self.fringe:
                draws.entries = None
            draws.release(window)
