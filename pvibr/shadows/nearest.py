"""Pyramids of the nearest depth of depth maps, which bound what may hide a light."""

from __future__ import annotations

import math

from pvibr.gl import Quad, Target, release, shader_source
from pvibr.gl import enums as gl
from pvibr.gl.target import blit

#: Texels of the map along a side of the first level's.
STEP = 4
_UNIFORMS = """uniform sampler2D source;
uniform vec2 corner;
uniform float side;
uniform float size;
"""


class Nearest:
    """The least depth of a depth view around any texel."""

    def __init__(self, view):
        self.view, self.window = view, view.drawer.window
        self.side = side = first_side(view.resolution)
        size = view.columns * (side + side // 2), view.rows * side
        self.target = Target(self.window, *size, ('r32f',), filter='nearest')
        # No pass reads the texture that it draws into.
        self._level = Target(self.window, side, side, ('r32f',), filter='nearest')
        text = _UNIFORMS + shader_source(__file__)
        self._passes = [
            Quad(self.window, f'#define STEP {step}\n{text}', 'nearest.glsl') for step in (STEP, 2)
        ]

    @property
    def texture(self):
        """All levels of all views."""
        return self.target.colors[0]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes + self._level.nbytes

    def update(self, k):
        """Take the depth of a view."""
        side, state = self.side, self.window.GetState()
        x = k % self.view.columns * (side + side // 2)
        y = k // self.view.columns * side
        source, quad = self.view.texture, self._passes[0]
        corner, size = self.view.corner(k), self.view.resolution
        for level in range(int(math.log2(side)) + 1):
            n = side >> level
            place = (x, y) if level == 0 else (x + side, y + side - 2 * n)
            with self._level.drawing():
                state.vtkglViewport(0, 0, n, n)
                uniforms = {'corner': tuple(map(float, corner)), 'side': float(size)}
                quad.draw(uniforms | {'size': float(n)}, {'source': source})
            rects = (0, 0, n, n), (*place, place[0] + n, place[1] + n)
            objects = self._level.object, self.target.object
            blit(state, *objects, gl.COLOR_BUFFER_BIT, *rects)
            source, quad, corner, size = self.texture, self._passes[1], place, n

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self.target, self._level, *self._passes)


def first_side(resolution) -> int:
    """Return the texels along a side of the first level, a power of two."""
    return 1 << max(math.ceil(math.log2(resolution / STEP)), 1)
