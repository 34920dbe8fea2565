"""Blurred moments of depth maps, which can be filtered linearly."""

from __future__ import annotations

from pvibr.gl import Quad, Target, release, shader_source

#: KIND of moments.glsl by method.
KINDS = {'vsm': 1, 'evsm': 2, 'msm': 3}
#: Warp of exponential moments: the square of its exponential just fits a 32-bit float.
WARP = 40.0
_UNIFORMS = """uniform sampler2D source;
uniform int parallel;
uniform int reach;
uniform float near;
uniform float far;
uniform float sigma;
uniform float side;
uniform vec2 corner;
"""


class Moments:
    """Moments of a depth view's depth, at half its resolution."""

    def __init__(self, view, method):
        self.view, self.window = view, view.drawer.window
        width, height = (n // 2 for n in view.texture.size)
        self.target, self._half_blurred = (
            Target(self.window, width, height, ('rgba32f',)) for _ in range(2)
        )
        body = _UNIFORMS + shader_source(__file__)
        defines = f'#define KIND {KINDS[method]}\n#define WARP {WARP:.1f}\n'
        self._passes = [
            Quad(self.window, f'{defines}#define FIRST {first}\n{body}', 'moments.glsl')
            for first in (1, 0)
        ]

    @property
    def texture(self):
        """The moments, filtered linearly."""
        return self.target.colors[0]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes + self._half_blurred.nbytes

    def update(self, view_number, sigma):
        """Blur the depth of a view."""
        tile_side = self.view.resolution // 2
        x, y = self.view.corner(view_number)
        view = self.view.views[view_number]
        uniforms = {
            'parallel': int(view.parallel),
            'near': float(view.near),
            'far': float(view.far),
            'sigma': max(sigma / 2, 1e-3),
            'reach': min(int(1.5 * sigma + 0.5), 48),
            'side': float(tile_side),
            'corner': (x / 2, y / 2),
        }
        blur_steps = (
            (self._passes[0], self._half_blurred, self.view.texture),
            (self._passes[1], self.target, self._half_blurred.colors[0]),
        )
        state = self.window.GetState()
        for quad, target, source in blur_steps:
            with target.drawing():
                state.vtkglViewport(x // 2, y // 2, tile_side, tile_side)
                quad.draw(uniforms, {'source': source})

    def release(self):
        """Free GPU memory; the context must be current."""
        release(self.target, self._half_blurred, *self._passes)
