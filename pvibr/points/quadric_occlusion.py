"""Occlusion culling of blocks of quadrics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.core.costs import Backoff
from pvibr.gl import Quad, Target, nbytes_of
from pvibr.gl import enums as gl
from pvibr.gl.driver import driver_of
from pvibr.points.occlusion_culling import behind, likely_seen, on_screen
from pvibr.points.quadric_cards import DRAW_MODES, HIDING, QUADS, Layer

_TILE = 8  # px along a side of the squares that keep their farthest depth
_LEAST = 512  # blocks from which a depth prepass may pay
_LAYERS = 20.0  # expected layers of items in front of a block that is presumed hidden
_WORTH = 0.6  # greatest share of blocks in the prepass
_GAIN = 0.25  # least share of hidden blocks for the next frame to try
_PAUSE = 32  # frames without a try after a failure
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
    """Finds hidden blocks: Greene et al., "Hierarchical Z-Buffer Visibility", SIGGRAPH 1993."""

    def __init__(self):
        self.layers: list = []
        self._gpu: _Gpu | None = None
        self._pause = Backoff(_PAUSE, _PAUSE)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        targets = () if self._gpu is None else (self._gpu.target, self._gpu.coarse)
        return nbytes_of(*self.layers, *targets)

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
        is_hidden = behind(frame, farthest_depths, _TILE, blocks.entries[:, :3], blocks.radii)
        if is_hidden.mean() < _GAIN:
            self._pause.failed()
        return is_hidden

    def _likely(self, frame, blocks):
        low, high = on_screen(frame, blocks.entries[:, :3], blocks.radii)
        screen_middles = np.nan_to_num((low + high) / 2, posinf=-1.0, neginf=-1.0)
        return likely_seen(screen_middles, blocks.areas, _LAYERS)

    def _draw(self, owner, frame, entries_by_layer):
        """Draw the depth prepass; return the farthest depth in each square of pixels."""
        gpu = self._begin(owner, frame)
        state, renderer = frame.window.GetState(), frame.renderer
        with gpu.target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            state.SetEnumState(gl.BLEND, False)
            state.SetEnumState(gl.DEPTH_TEST, True)
            for layer, entries in zip(self.layers, entries_by_layer, strict=True):
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
            window, tile_counts = frame.window, (-(-width // _TILE), -(-height // _TILE))
            self._gpu = gpu = _Gpu(
                Target(window, width, height, (), depth=True),
                Target(window, *tile_counts, ('r32f',), filter='nearest'),
                Quad(window, _FARTHEST, 'farthest depth'),
            )
        return gpu

    def _release_gpu(self):
        for resource in self._gpu or ():
            resource.release()
        self._gpu = None

    def release(self, window):
        """Free GPU memory; the context is current."""
        self._release_gpu()
        for layer in self.layers:
            layer.release(window)
        self.layers, self._pause = [], Backoff(_PAUSE, _PAUSE)
