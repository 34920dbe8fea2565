"""A depth buffer drawn before a frame, reduced to the farthest depth of squares of pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.gl import Quad, Target, nbytes_of
from pvibr.gl import enums as gl

#: Pixels along a side of the squares that keep their farthest depth.
TILE = 8
#: Fragment shader code of what is drawn for its depth alone. VTK discards alpha 0, which some
#: drivers also read from an unwritten output.
DEPTH_ONLY = {
    'VTK::Color::Impl': '\n',
    'VTK::Normal::Impl': '\n',
    'VTK::Light::Impl': 'gl_FragData[0] = vec4(1.0);\n',
}
_FARTHEST = f"""uniform sampler2D depth;
void main()
{{
  ivec2 first = ivec2(gl_FragCoord.xy) * {TILE}, last = textureSize(depth, 0) - 1;
  float d = 0.0;
  for (int y = 0; y < {TILE}; y++)
    for (int x = 0; x < {TILE}; x++)
      d = max(d, texelFetch(depth, min(first + ivec2(x, y), last), 0).r);
  gl_FragData[0] = vec4(d);
}}
"""


class _Gpu(NamedTuple):
    depths: Target
    farthest: Target
    quad: Quad


class DepthPrepass:
    """Greene et al., "Hierarchical Z-Buffer Visibility", SIGGRAPH 1993, with one level."""

    def __init__(self):
        self._gpu: _Gpu | None = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self._gpu is None else nbytes_of(self._gpu.depths, self._gpu.farthest)

    def farthest_depths(self, frame, actors, binder) -> np.ndarray:
        """Draw the depth of actors; return the farthest of each square of a frame's pixels."""
        gpu, state = self._of_size(frame.window, frame.size), frame.window.GetState()
        with gpu.depths.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            state.SetEnumState(gl.BLEND, False)
            state.SetEnumState(gl.DEPTH_TEST, True)
            for actor in actors:
                actor.RenderOpaqueGeometry(frame.renderer)
        binder.unbind()
        with gpu.farthest.drawing():
            gpu.quad.draw({}, {'depth': gpu.depths.depth})
        return gpu.farthest.colors[0].download()[..., 0]

    def _of_size(self, window, size) -> _Gpu:
        gpu = self._gpu
        if gpu is None or (gpu.depths.width, gpu.depths.height) != size:
            self.release()
            width, height = size
            tile_counts = -(-width // TILE), -(-height // TILE)
            self._gpu = gpu = _Gpu(
                Target(window, width, height, (), depth=True),
                Target(window, *tile_counts, ('r32f',), filter='nearest'),
                Quad(window, _FARTHEST, 'farthest depth'),
            )
        return gpu

    def release(self):
        """Free GPU memory; the context is current."""
        for resource in self._gpu or ():
            resource.release()
        self._gpu = None
