"""Occlusion culling of blocks of quadrics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.core.costs import Backoff
from pvibr.gl import Quad, Target, nbytes_of
from pvibr.gl import enums as gl
from pvibr.maths.occlusion import behind, likely_seen, on_screen
from pvibr.quadrics.cards import DRAW_MODES, HIDING, QUADS, Layer

_TILE = 8  # px, side of the squares of which the farthest depth is kept
_LEAST = 512  # blocks from which on a first drawing of some may pay
_LAYERS = 20.0  # in front of what is not expected to be seen: gaps in all of them are rare
_WORTH = 0.6  # share of blocks up to which a first drawing is cheap enough
_GAIN = 0.25  # share that must have been hidden for the next frame to try
_PAUSE = 32  # frames without a try after one in vain
_FARTHEST = f"""uniform sampler2D depth;
void main()
{{
  ivec2 first = ivec2(gl_FragCoord.xy) * {_TILE}, last = textureSize(depth, 0) - 1;
  float d = 0.0;
  for (int y = 0; y < {_TILE}; y++)
    for (int x = 0; x < {_TILE}; x++)
      d = max(d, texelFetch(depth, min(first + ivec2(x, y), last), 0).r);
  gl_FragData[0] = vec4(d);
}}
"""


class _Gpu(NamedTuple):
    target: Target
    coarse: Target
    quad: Quad


class Occlusion:
    """Finds blocks that are hidden by others.

    In the manner of Greene, Kass and Miller, "Hierarchical Z-Buffer Visibility", SIGGRAPH 1993.
    """

    def __init__(self):
        self.layers: list = []
        self._gpu: _Gpu | None = None
        self._pause = Backoff(_PAUSE, _PAUSE)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        held = () if self._gpu is None else (self._gpu.target, self._gpu.coarse)
        return nbytes_of(*self.layers, *held)

    def hidden(self, owner, frame, seen) -> np.ndarray:
        """Return a mask of the hidden blocks."""
        none = np.zeros(len(seen.modes), bool)
        # A pass may draw in pixels of its own, between those of the depths.
        if frame.casting or frame.renderer.GetPass() is not None or len(none) < _LEAST:
            return none
        if self._pause.waits():
            return none
        first = self._likely(frame, seen)
        if first.mean() > _WORTH:
            return none
        quads = seen.modes == DRAW_MODES.index(QUADS)
        parts = [seen.entries[first & ~quads], seen.entries[first & quads]]
        farthest = self._draw(owner, frame, parts)
        found = behind(frame, farthest, _TILE, seen.entries[:, :3], seen.around)
        if found.mean() < _GAIN:
            self._pause.failed()
        return found

    def _likely(self, frame, seen):
        low, high = on_screen(frame, seen.entries[:, :3], seen.around)
        middles = np.nan_to_num((low + high) / 2, posinf=-1.0, neginf=-1.0)
        return likely_seen(middles, seen.areas, _LAYERS)

    def _draw(self, owner, frame, parts):
        """Draw depths; return the farthest one in each square of pixels."""
        gpu = self._begin(owner, frame)
        state, renderer = frame.window.GetState(), frame.renderer
        with gpu.target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            state.SetEnumState(gl.BLEND, False)
            state.SetEnumState(gl.DEPTH_TEST, True)
            for layer, entries in zip(self.layers, parts, strict=True):
                for actor in layer.show(entries)[0]:
                    actor.RenderOpaqueGeometry(renderer)
        owner.binder.unbind()
        with gpu.coarse.drawing():
            gpu.quad.draw({}, {'depth': gpu.target.depth})
        return gpu.coarse.colors[0].download()[..., 0]

    def _begin(self, owner, frame) -> _Gpu:
        if not self.layers:
            self.layers = [Layer(owner, mode) for mode in HIDING]
        gpu, (width, height) = self._gpu, frame.size
        if gpu is None or (gpu.target.width, gpu.target.height) != frame.size:
            self._release_gpu()
            window, squares = frame.window, (-(-width // _TILE), -(-height // _TILE))
            self._gpu = gpu = _Gpu(
                Target(window, width, height, (), depth=True),
                Target(window, *squares, ('r32f',), filter='nearest'),
                Quad(window, _FARTHEST, 'farthest depth'),
            )
        return gpu

    def _release_gpu(self):
        for owner in self._gpu or ():
            owner.release()
        self._gpu = None

    def release(self, window):
        """Free GPU memory; the context is current."""
        self._release_gpu()
        for layer in self.layers:
            layer.release(window)
        self.layers, self._pause = [], Backoff(_PAUSE, _PAUSE)
