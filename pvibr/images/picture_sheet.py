"""Many pictures in one texture, each in a square with mip levels of its own.

The side of a square is a power of two and its place a multiple of it: no level mixes it with
another, down to a texel.
"""

from __future__ import annotations

import numpy as np

from pvibr.gl import Texture, release, texture_limit
from pvibr.gl import enums as gl
from pvibr.gl.mipmaps import Level
from pvibr.gl.target import blit

#: Texels along a side of the largest square.
_SIDE = 4096
#: Bytes of a texel with its mip levels.
_TEXEL = 4 * 4 / 3
#: Texels by which the border of a picture is repeated.
_BORDER = 64


def side_of(size) -> int:
    """Return the side of the square that a picture of (width, height) needs."""
    return 1 << int(np.ceil(np.log2(max(*size, 2))))


def halved(size, times) -> tuple[int, int]:
    """Return the size of a picture that was halved, as JPEG decoders do it."""
    return -(-size[0] >> times), -(-size[1] >> times)


def least_halvings(sizes, texels, side=_SIDE) -> int:
    """Return how often pictures are halved so that all fit in a number of texels."""
    for times in range(16):
        sides = [side_of(halved(size, times)) for size in sizes]
        if max(sides) <= side and sum(s * s for s in sides) <= texels:
            return times
    return 16


class Squares:
    """Squares of free texels: halved to give, joined when they come back."""

    def __init__(self, side, columns, rows):
        self.side = side
        self._free = {side: {(side * i, side * j) for i in range(columns) for j in range(rows)}}

    def take(self, side):
        """Return x and y of a square, None if there is none."""
        if side > self.side:
            return None
        free = self._free.setdefault(side, set())
        if free:
            place = min(free)
            free.remove(place)
            return place
        larger = self.take(2 * side)
        if larger is not None:
            x, y = larger
            free |= {(x + side, y), (x, y + side), (x + side, y + side)}
        return larger

    def give(self, side, place):
        """Give a square back."""
        free = self._free.setdefault(side, set())
        corner = tuple(v & ~(2 * side - 1) for v in place)
        others = {(corner[0] + dx, corner[1] + dy) for dx in (0, side) for dy in (0, side)}
        others.remove(place)
        if side < self.side and others <= free:
            free -= others
            self.give(2 * side, corner)
        else:
            free.add(place)


class PictureSheet:
    """A texture of many pictures."""

    def __init__(self, window, sizes, memory):
        """Reserve up to `memory` bytes for pictures of (width, height)."""
        self.window = window
        texels, limit = max(int(memory / _TEXEL), 1), texture_limit(window)
        side = min(_SIDE, limit, max(map(side_of, sizes)))
        while side > 64 and side * side > texels:
            side //= 2
        wanted = -(-sum(side_of(size) ** 2 for size in sizes) // side**2)
        columns = min(int(np.ceil(np.sqrt(min(wanted, texels // side**2)))), limit // side) or 1
        rows = max(min(-(-wanted // columns), texels // side**2 // columns, limit // side), 1)
        self.side, self.texels = side, rows * columns * side * side
        self.squares = Squares(side, columns, rows)
        self.texture = Texture(window, filter='linear')
        self.texture.object.SetGenerateMipmap(True)
        self.texture.object.SetMinificationFilter(self.texture.object.LinearMipmapLinear)
        self.texture.allocate(columns * side, rows * side)
        self.texture.nbytes = self.texture.nbytes * 4 // 3
        self._levels = [
            Level(window, self.texture.object, k, columns * side >> k, rows * side >> k)
            for k in range(side.bit_length())
        ]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.texture.nbytes

    def put(self, picture):
        """Copy a picture, row 0 at the bottom; return x, y and side, None if there is no place."""
        height, width = picture.shape[:2]
        side = side_of((width, height))
        place = self.squares.take(side)
        if place is None:
            return None
        # Its border is repeated, so that smaller levels mix it with nothing else.
        more = [(0, min(side - length, _BORDER)) for length in (height, width)]
        part = Texture(self.window).upload(np.pad(picture, [*more, (0, 0)], 'edge'))
        wide, high = part.size
        source = Level(self.window, part.object, 0, wide, high)
        x, y = place
        rects = (0, 0, wide, high), (x, y, x + wide, y + high)
        blit(self._state, source.object, self._levels[0].object, gl.COLOR_BUFFER_BIT, *rects)
        self._reduce(x, y, side)
        release(source, part)
        return x, y, side

    @property
    def _state(self):
        return self.window.GetState()

    def _reduce(self, x, y, side):
        """Make the smaller levels of a square."""
        for k in range(side.bit_length() - 1):
            large, small = self._levels[k].object, self._levels[k + 1].object
            rect = [v >> k for v in (x, y, x + side, y + side)]
            half = [v >> 1 for v in rect]
            blit(self._state, large, small, gl.COLOR_BUFFER_BIT, rect, half, gl.LINEAR)

    def free(self, place):
        """Let other pictures take the square of one."""
        x, y, side = place
        self.squares.give(side, (x, y))

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._levels, self.texture)
        self._levels = []
