"""Many pictures in one texture, each in a square with its own mip levels.

Sides are powers of two and positions multiples of them, so no mip level mixes squares.
"""

from __future__ import annotations

import numpy as np

from pvibr.gl import Texture, release, texture_limit
from pvibr.gl import enums as gl
from pvibr.gl.mipmaps import Level
from pvibr.gl.target import blit

#: Texels along a side of the largest square.
_MAX_SIDE = 4096
#: Bytes per texel, mip levels included.
_TEXEL_BYTES = 4 * 4 / 3
#: Texels by which picture borders are repeated.
_BORDER = 64


def side_of(size) -> int:
    """Return the side of the square for a picture of (width, height)."""
    return 1 << int(np.ceil(np.log2(max(*size, 2))))


def halved(size, halving_count) -> tuple[int, int]:
    """Return the size of a picture after halvings, rounded as by JPEG decoders."""
    return -(-size[0] >> halving_count), -(-size[1] >> halving_count)


def least_halvings(sizes, texels, side=_MAX_SIDE) -> int:
    """Return the halvings after which all pictures fit into a number of texels."""
    for halving_count in range(16):
        square_sides = [side_of(halved(size, halving_count)) for size in sizes]
        if max(square_sides) <= side and sum(s * s for s in square_sides) <= texels:
            return halving_count
    return 16


class Squares:
    """A buddy allocator of squares: split on demand, merged when freed."""

    def __init__(self, side, column_count, row_count):
        self.side = side
        self._free = {side: {(side * i, side * j) for i, j in np.ndindex(column_count, row_count)}}

    def take(self, side):
        """Allocate a square; return its x and y, None if there is no space."""
        if side > self.side:
            return None
        free_places = self._free.setdefault(side, set())
        if free_places:
            corner_xy = min(free_places)
            free_places.remove(corner_xy)
            return corner_xy
        larger_square = self.take(2 * side)
        if larger_square is not None:
            x, y = larger_square
            free_places |= {(x + side, y), (x, y + side), (x + side, y + side)}
        return larger_square

    def give(self, side, place):
        """Free a square."""
        free_places = self._free.setdefault(side, set())
        corner = tuple(v & ~(2 * side - 1) for v in place)
        sibling_places = {(corner[0] + dx, corner[1] + dy) for dx in (0, side) for dy in (0, side)}
        sibling_places.remove(place)
        if side < self.side and sibling_places <= free_places:
            free_places -= sibling_places
            self.give(2 * side, corner)
        else:
            free_places.add(place)


class PictureSheet:
    """A texture of many pictures."""

    def __init__(self, window, sizes, memory):
        """Reserve up to `memory` bytes for pictures of (width, height)."""
        self.window = window
        max_texels, limit = max(int(memory / _TEXEL_BYTES), 1), texture_limit(window)
        side = min(_MAX_SIDE, limit, max(map(side_of, sizes)))
        while side > 64 and side * side > max_texels:
            side //= 2
        needed = -(-sum(side_of(size) ** 2 for size in sizes) // side**2)
        max_squares, max_count = max_texels // side**2, limit // side
        column_count = min(int(np.ceil(np.sqrt(min(needed, max_squares)))), max_count) or 1
        row_count = max(min(-(-needed // column_count), max_squares // column_count, max_count), 1)
        self.side, self.texels = side, row_count * column_count * side * side
        self.squares = Squares(side, column_count, row_count)
        self.texture = Texture(window, filter='linear')
        self.texture.object.SetGenerateMipmap(True)
        self.texture.object.SetMinificationFilter(self.texture.object.LinearMipmapLinear)
        self.texture.allocate(column_count * side, row_count * side)
        self.texture.nbytes = self.texture.nbytes * 4 // 3
        self._levels = [
            Level(window, self.texture.object, k, column_count * side >> k, row_count * side >> k)
            for k in range(side.bit_length())
        ]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.texture.nbytes

    def put(self, picture):
        """Copy a picture, row 0 at the bottom; return x, y and side, None without space."""
        height, width = picture.shape[:2]
        side = side_of((width, height))
        corner_xy = self.squares.take(side)
        if corner_xy is None:
            return None
        # Repeat the border, so that smaller levels mix in nothing else.
        border_padding = [(0, min(side - length, _BORDER)) for length in (height, width)]
        upload = Texture(self.window).upload(np.pad(picture, [*border_padding, (0, 0)], 'edge'))
        wide, high = upload.size
        source = Level(self.window, upload.object, 0, wide, high)
        x, y = corner_xy
        rects = (0, 0, wide, high), (x, y, x + wide, y + high)
        blit(self._state, source.object, self._levels[0].object, gl.COLOR_BUFFER_BIT, *rects)
        self._reduce(x, y, side)
        release(source, upload)
        return x, y, side

    @property
    def _state(self):
        return self.window.GetState()

    def _reduce(self, x, y, side):
        """Compute the smaller levels of a square."""
        for k in range(side.bit_length() - 1):
            larger, smaller = self._levels[k].object, self._levels[k + 1].object
            rect = [v >> k for v in (x, y, x + side, y + side)]
            half = [v >> 1 for v in rect]
            blit(self._state, larger, smaller, gl.COLOR_BUFFER_BIT, rect, half, gl.LINEAR)

    def free(self, place):
        """Free the square of a picture."""
        x, y, side = place
        self.squares.give(side, (x, y))

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._levels, self.texture)
        self._levels = []
