"""Pyramids of the nearest depth in depth maps, which bound the search for blockers."""

from __future__ import annotations

import math

from pvibr.gl import Quad, Target, release, shader_source
from pvibr.gl import enums as gl
from pvibr.gl.target import blit

#: Map texels along a side of a first-level texel.
STEP = 4
_UNIFORMS = """uniform sampler2D source;
uniform vec2 corner;
uniform float side;
uniform float size;
"""


class Nearest:
    """The nearest depth around any texel of a depth view."""

    def __init__(self, view):
        self.view, self.window = view, view.drawer.window
        self.side = side = first_side(view.resolution)
        pyramid_size = view.columns * (side + side // 2), view.rows * side
        self.target = Target(self.window, *pyramid_size, ('r32f',), filter='nearest')
        # Levels are drawn here first: a pass must not read its own target.
        self._level_target = Target(self.window, side, side, ('r32f',), filter='nearest')
        self._passes = [Quad(self.window, text, 'nearest.glsl') for text in texts()]

    @property
    def texture(self):
        """All levels of all views."""
        return self.target.colors[0]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes + self._level_target.nbytes

    def update(self, view_number):
        """Update the pyramid of a view."""
        side, state = self.side, self.window.GetState()
        left = view_number % self.view.columns * (side + side // 2)
        bottom = view_number // self.view.columns * side
        source, quad = self.view.texture, self._passes[0]
        corner, source_side = self.view.corner(view_number), self.view.resolution
        for level in range(int(math.log2(side)) + 1):
            n = side >> level
            x, y = (left, bottom) if level == 0 else (left + side, bottom + side - 2 * n)
            with self._level_target.drawing():
                state.vtkglViewport(0, 0, n, n)
                uniforms = {'corner': tuple(map(float, corner)), 'side': float(source_side)}
                quad.draw(uniforms | {'size': float(n)}, {'source': source})
            objects, rects = (self._level_target.object, self.target.object), (0, 0, n, n)
            blit(state, *objects, gl.COLOR_BUFFER_BIT, rects, (x, y, x + n, y + n))
            source, quad, corner, source_side = self.texture, self._passes[1], (x, y), n

    def release(self):
        """Free GPU memory; the context must be current."""
        release(self.target, self._level_target, *self._passes)


def texts() -> list[str]:
    """Return the programs of the first level and of the others."""
    text = _UNIFORMS + shader_source(__file__)
    return [f'#define STEP {step}\n{text}' for step in (STEP, 2)]


def first_side(resolution) -> int:
    """Return the side of the first level in texels, a power of two."""
    return 1 << max(math.ceil(math.log2(resolution / STEP)), 1)
