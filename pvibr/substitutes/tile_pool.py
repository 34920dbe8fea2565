"""Square power-of-two tiles in one render target."""

from __future__ import annotations

from pvibr.gl import Target, texture_limit

# Colour and coverage, normal and material; depth beside them.
FORMATS = ('rgba8', 'rgba8')
TEXEL_BYTES = 12


class Tiles:
    """A buddy allocator of squares in a larger one."""

    def __init__(self, side, smallest_side=8):
        self.side, self.smallest_side = side, smallest_side
        self._free: dict[int, set] = {side: {(0, 0)}}

    def fits(self, size) -> int:
        """Return the side of the tile that holds an image."""
        return max(self.smallest_side, 1 << (int(size) - 1).bit_length())

    def take(self, side) -> tuple[int, int] | None:
        """Take a free tile; return its corner, None if there is none."""
        free_side = side
        while not self._free.get(free_side):
            free_side *= 2
            if free_side > self.side:
                return None
        x, y = min(self._free[free_side])
        self._free[free_side].remove((x, y))
        while free_side > side:
            free_side //= 2
            other_quarters = {
                (x + free_side, y),
                (x, y + free_side),
                (x + free_side, y + free_side),
            }
            self._free.setdefault(free_side, set()).update(other_quarters)
        return x, y

    def give(self, corner, side):
        """Free a tile and merge it with its free buddies."""
        while side < self.side:
            x, y = (c // (2 * side) * 2 * side for c in corner)
            buddies = {(x + i * side, y + j * side) for i in (0, 1) for j in (0, 1)} - {corner}
            free = self._free.setdefault(side, set())
            if not buddies <= free:
                break
            free -= buddies
            corner, side = (x, y), 2 * side
        self._free.setdefault(side, set()).add(corner)


class TilePool:
    """Tiles on the GPU, limited by memory."""

    def __init__(self, window, area, memory):
        affordable_side = int(min((memory / TEXEL_BYTES) ** 0.5, texture_limit(window)))
        self.largest = max(8, 1 << (affordable_side.bit_length() - 1))  # a power of two
        side = 256
        while side < self.largest and side * side < 2 * area:
            side *= 2
        self.side = min(side, self.largest)
        self.tiles = Tiles(self.side)
        self.target = Target(window, self.side, self.side, FORMATS, depth=True)

    @property
    def textures(self) -> dict:
        """Textures by sampler name."""
        colors = dict(zip(('ibr_albedo', 'ibr_shape'), self.target.colors, strict=True))
        return colors | {'ibr_depth': self.target.depth}
