"""Texture atlases whose mip levels preserve alpha coverage."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.arguments import naming
from pvibr.core.errors import warn
from pvibr.gl import MipTexture, texture_limit
from pvibr.maths.filled_texels import dilated
from pvibr.textures.projected import as_rgba, is_live

#: Largest side of a sheet in texels, as drivers of the last ten years support.
LARGEST = 16_384
_MAX_WASTE = 4.0  # texels with padding over texels of images, at most
_MAX_FACTOR = 8.0  # by which alpha of smaller levels is scaled, at most


class Sheet:
    """Images side by side in one texture.

    Castano, "Computing Alpha Mipmaps", 2010: alpha of each level is scaled to preserve coverage;
    here per image, by a quantile of its filtered alpha. Colours are straight: means weighted by
    alpha, dilated into transparent texels.
    """

    def __init__(self, images, cutout=None):
        self.sizes = np.array([(i.shape[1], i.shape[0]) for i in images])
        cell_step = _step(self.sizes)
        cell_sizes = -(-self.sizes // cell_step) * cell_step
        corners, (width, height) = shelves(cell_sizes, LARGEST)
        self.rects = np.concatenate([corners, corners + self.sizes], 1).astype(np.float32)
        reduced = [_Reduced(image[::-1]) for image in images]
        self.levels: list[np.ndarray] = []
        for k in range(int(cell_step).bit_length()):
            level = np.zeros((height >> k, width >> k, 4), np.float32)
            cells = zip(reduced, corners >> k, cell_sizes >> k, strict=True)
            for image, (x, y), (w, h) in cells:
                level[y : y + h, x : x + w] = image.padded(h, w)
                image.halve()
            if cutout is not None and k:
                level = self._with_coverage(level, k, 255 * cutout)
            self.levels.append(np.rint(level).astype(np.uint8))

    def _with_coverage(self, level_pixels, level_index, cutoff):
        """Return a level with the alpha coverage of the largest."""
        scaled = level_pixels.copy()
        for rect in self.rects.astype(int):
            full_window, level_window = _window(rect, 0), _window(rect, level_index)
            passing_share = (self.levels[0][full_window][..., 3] >= cutoff).mean()
            alpha = level_pixels[level_window][..., 3]
            if not 0 < passing_share < 1:
                continue
            filtered_alpha = _filtered(alpha)
            passing_count = int(np.rint(passing_share * filtered_alpha.size))
            threshold_alpha = np.sort(filtered_alpha, axis=None)[-max(passing_count, 1)]
            # If none should pass, all stay just below the cutoff.
            factor = cutoff / max(threshold_alpha, 1e-3) * (1.001 if passing_count else 0.98)
            scale = np.clip(factor, 1 / _MAX_FACTOR, _MAX_FACTOR)
            scaled[level_window][..., 3] = np.minimum(scale * alpha, 255)
        return scaled

    @property
    def nbytes(self) -> int:
        """Bytes of all levels."""
        return sum(level.nbytes for level in self.levels)

    def upload(self, window) -> tuple[MipTexture, int]:
        """Upload the levels that the driver supports; return the texture and its first level."""
        limit, levels = texture_limit(window), list(self.levels)
        while max(levels[-1].shape[:2]) > limit:
            levels.append(_halved(levels[-1]))
        first_level = [max(level.shape[:2]) <= limit for level in levels].index(True)
        if first_level >= len(self.levels):
            (height, width), (high, wide) = levels[0].shape[:2], levels[first_level].shape[:2]
            warn(
                f'images are blurred: textures of the driver have at most {limit} x {limit} '
                f'texels, {width} x {height} are reduced to {wide} x {high}'
            )
        texture = MipTexture(window).upload(levels[first_level])
        for k, level in enumerate(levels[first_level + 1 :], 1):
            texture.put_level(k, level)
        return texture, first_level


def _halved(level) -> np.ndarray:
    """Return an image of half the size, which mixes neighbours."""
    level = np.pad(level, [*((0, n % 2) for n in level.shape[:2]), (0, 0)], 'edge')
    height, width = level.shape[:2]
    return np.rint(level.reshape(height // 2, 2, width // 2, 2, -1).mean((1, 3))).astype(np.uint8)


def _step(sizes) -> int:
    """Return the power of two that aligns cells: 2**k separates images in k smaller levels."""
    cell_step = 1 << (int(sizes.max()).bit_length() - 1)
    area = sizes.prod(1).sum()
    while cell_step > 1 and (-(-sizes // cell_step) * cell_step).prod(1).sum() > _MAX_WASTE * area:
        cell_step //= 2
    return cell_step


def shelves(sizes, limit):
    """Pack boxes on shelves, tallest first; return their corners (n, 2) and the total size."""
    square_width = int(np.ceil(np.sqrt(sizes.prod(1).sum())))
    width = min(max(square_width, int(sizes[:, 0].max())), limit)
    corners = np.zeros((len(sizes), 2), int)
    x = y = shelf_height = right = 0
    for i in np.lexsort((-sizes[:, 0], -sizes[:, 1])):
        w, h = sizes[i]
        if x and x + w > width:
            x, y, shelf_height = 0, y + shelf_height, 0
        corners[i] = x, y
        x, shelf_height = x + w, max(shelf_height, h)
        right = max(right, x)
    size = int(right), int(y + shelf_height)
    if max(size) > limit:
        raise ValueError(
            f'images must fit into {limit} x {limit} texels together, got {size[0]} x {size[1]}: '
            f'use fewer or smaller ones, or several sets'
        )
    return corners, size


def _filtered(values):
    """Return values linearly interpolated between texels, twice as many per side."""
    for axis in (0, 1):
        first, last = np.take(values, [0], axis), np.take(values, [-1], axis)
        padded = np.concatenate([first, values, last], axis)
        count = values.shape[axis]
        previous, after = (np.take(padded, np.arange(count) + k, axis) for k in (0, 2))
        pairs = np.stack([0.25 * previous + 0.75 * values, 0.25 * after + 0.75 * values], axis + 1)
        values = pairs.reshape([2 * n if k == axis else n for k, n in enumerate(values.shape)])
    return values


def _window(rect, k):
    """Return the slices of an image in a level."""
    left_edge, bottom, right, top = rect
    row_slice = slice(bottom >> k, max(-(-top >> k), (bottom >> k) + 1))
    return row_slice, slice(left_edge >> k, max(-(-right >> k), (left_edge >> k) + 1))


class _Reduced:
    """Successively halved levels of an image with premultiplied alpha, without its padding."""

    def __init__(self, image):
        self.pixels = image.astype(np.float32)
        self.pixels[..., :3] *= self.pixels[..., 3:] / 255
        # Share of each row and column of texels that the image fills.
        self._fill_shares = [np.ones(n, np.float32) for n in image.shape[:2]]

    def halve(self):
        """Reduce to the next level."""
        for axis in (0, 1):
            share = _paired(self._fill_shares[axis])
            weight = share.reshape([*share.shape, 1, 1] if axis == 0 else [1, *share.shape, 1])
            pairs = _paired(self.pixels, axis) * weight
            self._fill_shares[axis] = total_share = share.sum(1)
            shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
            self.pixels = pairs.sum(axis + 1) / total_share.reshape(shape)

    def padded(self, height, width):
        """Return the level with straight colours and its border repeated."""
        padding = (height - self.pixels.shape[0], width - self.pixels.shape[1], 0)
        pixels = self.pixels.copy()
        if pixels[..., 3].min() < 255:
            pixels[..., :3] = dilated(pixels / 255)[..., :3]
        return np.pad(pixels, [(0, n) for n in padding], mode='edge')


def _paired(values, axis=0):
    """Return an array with an axis split into pairs, padded with a zero."""
    count = values.shape[axis]
    values = np.pad(values, [(0, count % 2 if k == axis else 0) for k in range(values.ndim)])
    return values.reshape(*values.shape[:axis], -1, 2, *values.shape[axis + 1 :])


def as_images(image, frames=None) -> list:
    """Return one image or several as arrays."""
    images = (
        image if isinstance(image, list | tuple) or getattr(image, 'ndim', 0) == 4 else [image]
    )
    if any(is_live(i) for i in images):
        raise ValueError('image must be a live texture alone, got a list with one')
    if not len(images):
        raise ValueError('image must have at least one image, got an empty list')
    arrays = [_indexed_rgba(i, image_item, len(images)) for i, image_item in enumerate(images)]
    return arrays if frames is None else [f for i in arrays for f in _cut_up(i, frames)]


def _indexed_rgba(i, image, count):
    try:
        return as_rgba(image)
    except ValueError as error:
        if count == 1 or isinstance(image, str | Path):
            raise
        raise ValueError(f'image[{i}]: {error}') from error


def _cut_up(image, frames):
    height, width = image.shape[:2]
    with naming('frames', frames):
        is_pair = np.shape(frames) == (2,) and all(isinstance(f, int | np.integer) for f in frames)
    if not is_pair or min(frames) < 1 or width % frames[0] or height % frames[1]:
        raise ValueError(
            f'frames must be columns and rows that divide the {width} x {height} pixels of image, '
            f'got {frames!r}'
        )
    column_count, row_count = frames
    w, h = width // column_count, height // row_count
    cells = image.reshape(row_count, h, column_count, w, 4).swapaxes(1, 2)
    return [np.ascontiguousarray(c) for c in cells.reshape(-1, h, w, 4)]
