"""Largest errors of images, and the texels that these need."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Texels per pixel of an image, along a side, at which it is rendered again.
FINEST = 4.0
#: Largest side of an image in texels.
LARGEST = 1024
#: Layers of images of translucent surfaces, in two rows: the first and the last fronts and backs.
LAYERS = 4
# Texels per allowed error of a new image, so that it still serves from nearer.
_RESERVE = 1.15
# Texels per pixel of a new image if memory allows, for smooth outlines in multisampled windows.
_SMOOTH = 2.0
# Largest displacement and texel of images with lines, pixels: depth corrects most of the first.
_LINE_ERROR, _LINE_TEXEL = 1.0, 0.5
# Least texels across a line of one pixel: thinner ones would have gaps.
_LINE_TEXELS = 1.5
# Least width that lines count as, pixels, so that thin ones do not become visibly bolder.
_BOLD = 4.0
# Area of a square tile per area of what is seen in it, and per area of a smaller square.
_TILE_SHARE, _SQUARE_SHARE = 1.6, 2.0


class Limits(NamedTuple):
    """The largest errors of n images and the widths of their lines in pixels, and their layers."""

    displaced: np.ndarray  # (n,)
    texel: np.ndarray
    stroke_px: np.ndarray  # 0 if there are none
    is_clear: np.ndarray  # of which a tile holds several layers

    def rows(self, index) -> Limits:
        """Return a selection."""
        return Limits(*(field[index] for field in self))

    def excess(self, displaced, texel_px) -> np.ndarray:
        """Return errors in units of the largest ones, (n,)."""
        return np.maximum(displaced / self.displaced, texel_px / self.texel)

    def widened(self, growth) -> np.ndarray:
        """Return the displacement that the widening of lines by a share counts as, (n,)."""
        return growth * np.where(self.stroke_px > 0, np.maximum(self.stroke_px, _BOLD), 0.0)

    @property
    def rows_of_layers(self) -> np.ndarray:
        """Rows and columns of layers in the tile of each image."""
        return np.where(self.is_clear, 2, 1)

    @property
    def least_texels(self) -> np.ndarray:
        """Texels per pixel of new images."""
        return _RESERVE / self.texel


def limits_of(max_error, eyes, nodes) -> Limits:
    """Return the limits of images of nodes."""
    stroke_px = nodes.stroke_px
    has_lines, quality = stroke_px > 0, eyes.frame.quality
    line_texel = min(max_error, _LINE_TEXEL, 1 / (_LINE_TEXELS * eyes.supersampling))
    displaced = np.where(has_lines, min(max_error, _LINE_ERROR), max_error) / quality
    # While quality is lowered, lines are coarser, but no blots.
    texel = np.where(has_lines, min(line_texel / quality, 1.0), max_error / quality)
    return Limits(displaced, texel, stroke_px, nodes.is_clear)


class Plan(NamedTuple):
    """Sizes of new images in texels."""

    size: np.ndarray  # (n, 2), margins included, of a layer
    margin: np.ndarray  # (n,), on each side
    rows: np.ndarray  # (n,), rows and columns of layers

    @property
    def sides(self) -> np.ndarray:
        """The larger side of each image, all layers included."""
        return self.rows * self.size.max(1)

    @property
    def tile_area(self) -> int:
        """Texels of all tiles."""
        return int((4.0 ** np.ceil(np.log2(self.sides.clip(8, LARGEST)))).sum())


def plan(side_px, limits, room) -> Plan:
    """Return the sizes of images of sides in pixels (n, 2), of at most `room` texels a pixel.

    Limits are met all the same; where they leave a choice, tiles are filled.
    """
    largest_px = np.maximum(side_px.max(1), 1e-300)
    smooth_size = largest_px * min(_SMOOTH, room) / np.maximum(limits.texel, 1.0) + 2
    rows = limits.rows_of_layers
    tile_size = np.minimum(2.0 ** np.rint(np.log2(rows * smooth_size)), LARGEST) / rows
    texels_per_px = np.maximum(limits.least_texels, (tile_size - 2.5) / largest_px)
    inner_size = np.ceil(np.minimum(side_px * texels_per_px[:, None], 1e6)).astype(int)
    margin = 1 + np.ceil(limits.stroke_px / 2 * texels_per_px).astype(int)
    return Plan(inner_size + 2 * margin[:, None], margin, rows)


def room(texels, card_area, limits) -> float:
    """Return how many texels per pixel fit, for cards of areas in pixels, all layers included."""
    is_fixed = limits.least_texels > _SMOOTH
    tile_area = _TILE_SHARE * card_area
    fixed_texels = _SQUARE_SHARE * tile_area * limits.least_texels**2
    spare_texels = max(texels - fixed_texels[is_fixed].sum(), 0.0)
    return float((spare_texels / max(tile_area[~is_fixed].sum(), 1.0)) ** 0.5)
