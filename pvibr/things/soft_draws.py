"""Soft-edged cards drawn in parts: opaque cores, blended fringes, and their depth."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from functools import cached_property

from pvibr.things.draw_order import Stage
from pvibr.things.shader_draws import ShaderDraws

#: Coverage at which a pixel counts as opaque.
WHOLE = 0.98
_ALL = 2.0  # more than any coverage
_BEHIND = 1e-6  # of w: the depth test rejects a fringe behind its own core before shading


@dataclass(frozen=True)
class Part:
    """What a draw shows of cards: a range of coverage, and how."""

    least: float
    most: float
    #: Opacity; negative for the coverage.
    alpha: float
    writes_depth: bool = True
    back: float = 0.0
    nearest_first: bool = False

    @cached_property
    def uniforms(self) -> dict:
        """The uniforms of the part."""
        return {
            'ibr_part': (self.least, self.most, self.alpha),
            'ibr_back': self.back,
            'ibr_nearest_first': int(self.nearest_first),
        }


# Opaque cores write depth, so any order works, before all fringes. Fringes blend and write no
# depth, so they do not hide what is drawn later behind them.
CORE = Part(WHOLE, _ALL, 1.0, nearest_first=True)
FRINGE = Part(1 / 255, WHOLE, -1.0, writes_depth=False, back=_BEHIND)
#: Fringes of cards without a core.
SOFT = Part(1 / 255, _ALL, -1.0, writes_depth=False)
#: Depth only, where more than half covered, for effects that read it; VTK discards alpha 0.
DEPTH = Part(0.5, _ALL, 1e-9)
#: Hard edges, also for lights and picking.
SOLID = Part(0.5, _ALL, 1.0)


class PartDraws(ShaderDraws):
    """The draws of one part; textures and uniforms come from the owning soft draws."""

    def __init__(self, owner, **look):
        super().__init__(**look)
        self._owner = weakref.proxy(owner)
        self.part = SOLID

    def _inputs(self):
        return self._owner.inputs()

    def _set_shader(self, program):
        self.own_uniforms = self.part.uniforms
        super()._set_shader(program)
        # VTK sets it again for the next actor.
        self._owner.window.GetState().vtkglDepthMask(self.part.writes_depth)


class SoftDraws:
    """Draws of the same cards: cores, fringes, and depth where an effect reads it.

    A subclass has a `window` and ``inputs()``, the textures and uniforms of all parts.
    """

    def __init__(self, feature, fringe=None, *, cored=True, **look):
        self.core = PartDraws(self, feature=feature, **look) if cored else None
        self.fringe = PartDraws(self, feature=fringe or feature, **look)
        self.depth = PartDraws(self, feature=feature, **look)

    @cached_property
    def every(self) -> list:
        """The draws of all parts."""
        return [draws for draws in (self.core, self.fringe, self.depth) if draws is not None]

    @property
    def actors(self) -> list:
        """The actors of all parts."""
        return [actor for draws in self.every for actor in draws.actors]

    @property
    def landed(self) -> bool:
        """Whether any program has drawn."""
        return any(draws.landed for draws in self.every)

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self.every if draws.failure), None)

    def order(self, row) -> list:
        """Return (key, actor) pairs; fringes of higher rows are drawn later."""
        keyed_actors = []
        for draws, stage, turn in (
            (self.core, Stage.CORE, -1),
            (self.fringe, Stage.FRINGE, 1),
            (self.depth, Stage.DEPTH, 1),
        ):
            actors = [] if draws is None else draws.actors
            keyed_actors += [((stage, turn * row, turn * k), a) for k, a in enumerate(actors)]
        return keyed_actors

    def parts(self, *, solid, deep) -> dict:
        """Return the part that each draw shows: hard edges, or soft ones, with depth if `deep`."""
        if solid:
            return {self.core or self.depth: SOLID}
        parts = {self.fringe: SOFT}
        if self.core is not None:
            parts = {self.core: CORE, self.fringe: FRINGE}
        return {**parts, self.depth: DEPTH} if deep else parts

    def bound(self, bounds, corners=4):
        """Set the bounds by which VTK culls the cards."""
        for draws in self.every:
            draws.place_cards(bounds, corners)

    def check(self):
        """Record failures of shaders in the last frame."""
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
