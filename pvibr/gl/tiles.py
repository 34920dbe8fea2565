"""Programs drawn only over tiles that need them."""

from __future__ import annotations

from typing import Any

from pvibr.gl.feature import sections
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import fitting_target
from pvibr.gl.texture import nbytes_of, release

SIDE = 16  # pixels along a side of a square
_MOST = 128  # tiles: what two triangles may become in core profile 3.2
_TEXTS = sections(shader_source(__file__))


class Tiles:
    """The tiles of a target over which programs are drawn, chosen by a texture."""

    def __init__(self, window):
        self.window = window
        self._quads: dict[str, Quad] = {}
        self._squares: Any = None
        self._tiles: Any = None
        self._extent = (0.0, 0.0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._squares, self._tiles)

    def find(self, found, size, reach):
        """Choose the tiles near to something."""
        counts = tuple(-(-n // SIDE) for n in size)
        side = next(n for n in range(1, max(counts) + 1) if _tiles(counts, n) <= _MOST)
        self._squares = fitting_target(self._squares, self.window, counts)
        self._tiles = fitting_target(
            self._tiles, self.window, tuple(-(-n // side) for n in counts)
        )
        self._extent = tuple(2.0 * side * SIDE / n for n in size)
        step = -(-size[0] // found.size[0])
        self._draw('squares', self._squares, {'step': step, 'reach': reach}, found=found)
        self._draw('tiles', self._tiles, {'side': side}, squares=self._squares.colors[0])

    def _draw(self, name, target, uniforms, **textures):
        if name not in self._quads:
            text = f'#define SIDE {SIDE}\n{_TEXTS[name]}'
            self._quads[name] = Quad(self.window, text, f'tiles.glsl, {name}')
        target.draw(self._quads[name], uniforms, textures)

    def program(self, fragment, name) -> Quad:
        """Return a program to be drawn over tiles."""
        return Quad(self.window, fragment, name, geometry=_TEXTS['geometry'])

    def draw(self, quad, uniforms, textures, blend=None):
        """Draw a program over the tiles that `find` chose."""
        tiles = {'tiles': self._tiles.colors[0]}
        quad.draw({'extent': self._extent, **uniforms}, {**textures, **tiles}, blend)

    @property
    def squares(self):
        """Texture: 1 for each square of `SIDE` pixels that is near to something, else 0."""
        return self._squares.colors[0]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._squares, self._tiles, *self._quads.values())
        self._squares = self._tiles = None
        self._quads = {}


def _tiles(counts, side):
    return -(-counts[0] // side) * -(-counts[1] // side)
