"""Blurred moments of depth maps, which can be filtered linearly."""

from __future__ import annotations

from pvibr.gl import Quad, Target, release, shader_source

#: Which moments a method keeps.
KINDS = {'vsm': 1, 'evsm': 2, 'msm': 3}
#: Of exponential moments: the square of its exponential is just a float of 32 bits.
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
    """The moments of the depth of a depth view, in half its resolution."""

    def __init__(self, view, kind):
        self.view, self.window = view, view.drawer.window
        width, height = (n // 2 for n in view.texture.size)
        self.target, self._half = (
            Target(self.window, width, height, ('rgba32f',)) for _ in range(2)
        )
        text = shader_source(__file__)
        head = f'#define KIND {KINDS[kind]}\n#define WARP {WARP:.1f}\n'
        self._passes = [
            Quad(self.window, f'{head}#define FIRST {first}\n{_UNIFORMS}{text}', 'moments.glsl')
            for first in (1, 0)
        ]

    @property
    def texture(self):
        """The moments, filtered linearly."""
        return self.target.colors[0]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes + self._half.nbytes

    def update(self, k, sigma):
        """Blur the depth of a view."""
        side = self.view.resolution // 2
        x, y = self.view.corner(k)
        view = self.view.views[k]
        uniforms = {
            'parallel': int(view.parallel),
            'near': float(view.near),
            'far': float(view.far),
            'sigma': max(sigma / 2, 1e-3),
            'reach': min(int(1.5 * sigma + 0.5), 48),
            'side': float(side),
            'corner': (x / 2, y / 2),
        }
        steps = (
            (self._passes[0], self._half, self.view.texture),
            (self._passes[1], self.target, self._half.colors[0]),
        )
        state = self.window.GetState()
        for quad, target, source in steps:
            with target.drawing():
                state.vtkglViewport(x // 2, y // 2, side, side)
                quad.draw(uniforms, {'source': source})

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self.target, self._half, *self._passes)
