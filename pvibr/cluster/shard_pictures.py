"""Pictures of shards: colour and depth of what is covered, compressed and composited."""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np

#: Level of zlib: higher ones take longer than the bytes that they save.
_LEVEL = 1
#: Display gamma by which VTK averages samples.
_GAMMA = 2.2


class ShardPicture(NamedTuple):
    """Colour and depth within the rectangle that a shard covers; row 0 is the lowest."""

    #: Size of the whole picture, and lower left corner of the rectangle, in pixels.
    size: tuple[int, int]
    origin: tuple[int, int]
    #: Colour times coverage, and coverage, shape (h, w, 4), uint8.
    color: np.ndarray
    #: Distance along the view, shape (h, w), float32; infinite where there is no surface.
    depth: np.ndarray
    #: Whether soft edges are means of samples, which VTK averages as light.
    is_sampled: bool = False

    @classmethod
    def of(cls, color, depth, is_sampled=False) -> ShardPicture:
        """Return what is covered of a whole picture."""
        height, width = depth.shape
        rows, columns = (np.flatnonzero((color[..., 3] > 0).any(k)) for k in (1, 0))
        if not len(rows):
            return cls((width, height), (0, 0), color[:0, :0], depth[:0, :0], is_sampled)
        low, high = (columns[0], rows[0]), (columns[-1] + 1, rows[-1] + 1)
        part = np.s_[low[1] : high[1], low[0] : high[0]]
        color, depth = color[part], depth[part]
        origin, depth = (int(low[0]), int(low[1])), reaching(color, depth)
        return cls((width, height), origin, color, depth, is_sampled)

    @property
    def rect(self) -> tuple[int, int, int, int]:
        """Left, lower, right and upper edge of the rectangle."""
        (x, y), (height, width) = self.origin, self.depth.shape
        return x, y, x + width, y + height

    def packed(self) -> bytes:
        """Return it compressed; the bytes of depths are sorted by significance before."""
        numbers = [*self.size, *self.origin, self.is_sampled, *self.depth.shape]
        shape = np.array(numbers, '<i4').tobytes()
        planes = np.ascontiguousarray(self.depth, '<f4').view(np.uint8).reshape(-1, 4).T
        texels = np.ascontiguousarray(self.color.reshape(-1, 4).T)
        return shape + zlib.compress(texels.tobytes() + planes.tobytes(), _LEVEL)

    @classmethod
    def unpacked(cls, data) -> ShardPicture:
        """Return the picture that was packed."""
        *places, is_sampled, height, width = np.frombuffer(data, '<i4', 7).tolist()
        planes = np.frombuffer(zlib.decompress(data[28:]), np.uint8).reshape(2, 4, -1)
        color = planes[0].T.reshape(height, width, 4)
        depth = np.ascontiguousarray(planes[1].T).view('<f4').reshape(height, width)
        size, origin = (places[0], places[1]), (places[2], places[3])
        return cls(size, origin, color, depth, bool(is_sampled))

    def blendable(self, background) -> np.ndarray:
        """Return colours whose edges, blended with a background, are as VTK averages samples."""
        color, edges = self.color.copy(), self.edges()
        light, behind = _light(color[edges]), np.asarray(background, float)
        left = 1 - light[:, 3:]
        goal = (light[:, :3] + left * behind**_GAMMA) ** (1 / _GAMMA)
        on_black, on_white = (
            (light[:, :3] + left * value) ** (1 / _GAMMA) for value in (0.0, 1.0)
        )
        # Exact on the background, and nearly so on what is black or white; colours within 0 to 1.
        least = np.maximum(
            1 - goal / np.maximum(behind, 1e-6), (goal - behind) / (1 + 1e-6 - behind)
        )
        coverage = np.maximum(1 - (on_white - on_black).mean(1), least.max(1)).clip(0, 1)[:, None]
        own = goal - (1 - coverage) * behind
        color[edges] = np.rint(255 * np.clip(np.hstack([own, coverage]), 0, 1))
        return color

    def edges(self) -> np.ndarray:
        """Return which pixels are means of samples of a surface and of what is behind it."""
        alpha = self.color[..., 3]
        return (alpha > 0) & (alpha < 255) & np.isfinite(self.depth) & self.is_sampled

    def within(self, rect) -> ShardPicture:
        """Return the same picture in a larger rectangle."""
        low_x, low_y, high_x, high_y = rect
        color = np.zeros((high_y - low_y, high_x - low_x, 4), np.uint8)
        depth = np.full(color.shape[:2], np.inf, np.float32)
        x0, y0, x1, y1 = self.rect
        part = np.s_[y0 - low_y : y1 - low_y, x0 - low_x : x1 - low_x]
        color[part], depth[part] = self.color, self.depth
        return self._replace(origin=(low_x, low_y), color=color, depth=depth)


def reaching(color, depth) -> np.ndarray:
    """Return depths that soft edges have from the surface beside them."""
    padded = np.pad(depth, 1, constant_values=np.inf)
    height, width = depth.shape
    beside = [padded[j : j + height, i : i + width] for j in range(3) for i in range(3)]
    is_soft = (color[..., 3] > 0) & np.isinf(depth)
    return np.where(is_soft, np.min(beside, 0), depth)


def composited(pictures) -> ShardPicture:
    """Composite pictures, those of nearer shards first, pair by pair.

    Surfaces are ordered by their depth, what has none by the order of the shards: premultiplied
    colours as in Porter and Duff, "Compositing Digital Images", SIGGRAPH 1984.
    """
    pictures = list(pictures)
    while len(pictures) > 1:
        pairs = zip(pictures[::2], pictures[1::2], strict=False)
        odd = pictures[-1:] if len(pictures) % 2 else []
        pictures = [*(_over(*pair) for pair in pairs), *odd]
    return pictures[0]


def _over(front, back) -> ShardPicture:
    if not back.depth.size or not front.depth.size:
        return front if front.depth.size else back
    rects = np.array([front.rect, back.rect])
    rect = (*rects[:, :2].min(0).tolist(), *rects[:, 2:].max(0).tolist())
    front, back = front.within(rect), back.within(rect)
    is_swapped = (back.depth < front.depth) & (back.color[..., 3] > 0) & np.isfinite(front.depth)
    upper = np.where(is_swapped[..., None], back.color, front.color)
    lower = np.where(is_swapped[..., None], front.color, back.color)
    left = 255 - upper[..., 3:].astype(np.uint16)
    color = upper + ((lower * left + 127) // 255).astype(np.uint8)
    edges = np.where(is_swapped, back.edges(), front.edges())
    above, below = _light(upper[edges]), _light(lower[edges])
    color[edges] = _display(above + (1 - above[:, 3:]) * below)
    return front._replace(color=color, depth=np.minimum(front.depth, back.depth))


def _light(color) -> np.ndarray:
    """Return linear light times coverage, and coverage, of display colours times coverage."""
    alpha = color[:, 3:] / 255
    straight = np.minimum(color[:, :3] / 255 / np.maximum(alpha, 1 / 255), 1)
    return np.hstack([alpha * straight**_GAMMA, alpha])


def _display(light) -> np.ndarray:
    alpha = light[:, 3:]
    straight = (light[:, :3] / np.maximum(alpha, 1e-9)) ** (1 / _GAMMA)
    return np.rint(255 * np.clip(np.hstack([alpha * straight, alpha]), 0, 1)).astype(np.uint8)


def merged(packed) -> bytes:
    """Composite packed pictures, those of nearer shards first."""
    return composited(map(ShardPicture.unpacked, packed)).packed()
