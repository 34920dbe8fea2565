"""Occlusion culling of blocks of quadrics."""

from __future__ import annotations

import numpy as np

from pvibr.core.costs import Backoff
from pvibr.gl import nbytes_of
from pvibr.gl.driver import driver_of
from pvibr.points.quadric_cards import DRAW_MODES, HIDING, QUADS, Layer
from pvibr.things.depth_prepass import TILE, DepthPrepass
from pvibr.things.occlusion_culling import behind, likely_seen, on_screen

_LEAST = 512  # blocks from which a depth prepass may pay
_LAYERS = 20.0  # expected layers of items in front of a block that is presumed hidden
_WORTH = 0.6  # greatest share of blocks in the prepass
_GAIN = 0.25  # least share of hidden blocks for the next frame to try
_PAUSE = 32  # frames without a try after a failure


class Occlusion:
    """Finds hidden blocks of quadrics."""

    def __init__(self):
        self.layers: list = []
        self._prepass = DepthPrepass()
        self._pause = Backoff(_PAUSE, _PAUSE)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self.layers, self._prepass)

    def hidden(self, owner, frame, blocks) -> np.ndarray:
        """Return a mask of the hidden blocks."""
        none_hidden = np.zeros(len(blocks.modes), bool)
        # A render pass may draw at another resolution.
        if frame.casting or frame.renderer.GetPass() is not None or len(none_hidden) < _LEAST:
            return none_hidden
        if not driver_of(frame.window).is_software:
            return none_hidden  # a GPU draws all in less time than it takes to answer
        if self._pause.waits():
            return none_hidden
        likely_visible = self._likely(frame, blocks)
        if likely_visible.mean() > _WORTH:
            return none_hidden
        is_quad = blocks.modes == DRAW_MODES.index(QUADS)
        in_layers = likely_visible & ~is_quad, likely_visible & is_quad
        farthest_depths = self._draw(owner, frame, [blocks.entries[k] for k in in_layers])
        is_hidden = behind(frame, farthest_depths, TILE, blocks.entries[:, :3], blocks.radii)
        if is_hidden.mean() < _GAIN:
            self._pause.failed()
        return is_hidden

    def _likely(self, frame, blocks):
        low, high = on_screen(frame, blocks.entries[:, :3], blocks.radii)
        screen_middles = np.nan_to_num((low + high) / 2, posinf=-1.0, neginf=-1.0)
        return likely_seen(screen_middles, blocks.areas, _LAYERS)

    def _draw(self, owner, frame, entries_by_layer):
        """Draw the depth prepass; return the farthest depth in each square of pixels."""
        if not self.layers:
            self.layers = [Layer(owner, mode) for mode in HIDING]
        pairs = zip(self.layers, entries_by_layer, strict=True)
        actors = [actor for layer, entries in pairs for actor in layer.show(entries)[0]]
        return self._prepass.farthest_depths(frame, actors, owner.binder)

    def release(self, window):
        """Free GPU memory; the context is current."""
        self._prepass.release()
        for layer in self.layers:
            layer.release(window)
        self.layers, self._pause = [], Backoff(_PAUSE, _PAUSE)
