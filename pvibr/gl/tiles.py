"""Programs drawn only over the tiles that need them."""

from __future__ import annotations

from typing import Any

from pvibr.gl.feature import sections
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import fitting_target
from pvibr.gl.texture import nbytes_of, release

SIDE = 16  # side of a square in pixels
_MAX_TILES = 128  # geometry shader output guaranteed by core profile 3.2
_TEXTS = sections(shader_source(__file__))


class Tiles:
    """The tiles of a target over which programs are drawn, chosen by a texture."""

    def __init__(self, window):
        self.window = window
        self._quads: dict[str, Quad] = {}
        self._squares: Any = None
        self._tile_target: Any = None
        self._extent = (0.0, 0.0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._squares, self._tile_target)

    def find(self, light_mask, size, reach):
        """Choose the tiles within `reach` pixels of non-zero texels."""
        square_counts = tuple(-(-n // SIDE) for n in size)
        sides = range(1, max(square_counts) + 1)
        columns, rows = square_counts
        tile_side = next(n for n in sides if -(-columns // n) * -(-rows // n) <= _MAX_TILES)
        self._squares = fitting_target(self._squares, self.window, square_counts)
        tile_counts = tuple(-(-n // tile_side) for n in square_counts)
        self._tile_target = fitting_target(self._tile_target, self.window, tile_counts)
        self._extent = tuple(2.0 * tile_side * SIDE / n for n in size)
        uniforms = {'step': -(-size[0] // light_mask.size[0]), 'reach': reach}
        self._draw('squares', self._squares, uniforms, found=light_mask)
        self._draw('tiles', self._tile_target, {'side': tile_side}, squares=self.squares)

    def _draw(self, name, target, uniforms, **textures):
        if name not in self._quads:
            text = f'#define SIDE {SIDE}\n{_TEXTS[name]}'
            self._quads[name] = Quad(self.window, text, f'tiles.glsl, {name}')
        target.draw(self._quads[name], uniforms, textures)

    def program(self, fragment, name) -> Quad:
        """Return a program to draw over tiles."""
        return Quad(self.window, fragment, name, geometry=_TEXTS['geometry'])

    def draw(self, quad, uniforms, textures, blend=None):
        """Draw a program over the tiles chosen by `find`."""
        tile_texture = {'tiles': self._tile_target.colors[0]}
        quad.draw({'extent': self._extent, **uniforms}, {**textures, **tile_texture}, blend)

    @property
    def squares(self):
        """Texture with 1 for each square of `SIDE` pixels near non-zero texels, else 0."""
        return self._squares.colors[0]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._squares, self._tile_target, *self._quads.values())
        self._squares = self._tile_target = None
        self._quads = {}
