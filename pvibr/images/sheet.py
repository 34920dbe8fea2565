"""Texture atlases whose mip levels preserve alpha coverage."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.gl import MipTexture, texture_limit
from pvibr.images.projected import as_rgba, is_live
from pvibr.maths.arguments import naming

#: Texels along a side that a sheet may have: what drivers of the last ten years take.
LARGEST = 16_384
_WASTE = 4.0  # texels of padding and images together, over those of images
_STEEPEST = 8.0  # alpha of a smaller level is raised by this factor at most


class Sheet:
    """Images side by side in one texture.

    The share is kept as Castano does ("Computing Alpha Mipmaps", 2010): alpha is scaled per level
    such that as much passes the test; here image by image, by the quantile of its filtered alpha.
    """

    def __init__(self, images, cutout=None):
        self.sizes = np.array([(i.shape[1], i.shape[0]) for i in images])
        step = _step(self.sizes)
        cells = -(-self.sizes // step) * step
        corners, (width, height) = shelves(cells, LARGEST)
        self.rects = np.concatenate([corners, corners + self.sizes], 1).astype(np.float32)
        reduced = [_Reduced(image[::-1]) for image in images]
        self.levels: list[np.ndarray] = []
        for k in range(int(step).bit_length()):
            full = np.zeros((height >> k, width >> k, 4), np.float32)
            for one, (x, y), (w, h) in zip(reduced, corners >> k, cells >> k, strict=True):
                full[y : y + h, x : x + w] = one.padded(h, w)
                one.halve()
            level = full if cutout is None or not k else self._kept(full, k, 255 * cutout)
            self.levels.append(np.rint(level).astype(np.uint8))

    def _kept(self, full, k, cut):
        """Return a level with the alpha coverage of the largest."""
        out = full.copy()
        for rect in self.rects.astype(int):
            here, there = _window(rect, 0), _window(rect, k)
            share = (self.levels[0][here][..., 3] >= cut).mean()
            alpha = full[there][..., 3]
            if not 0 < share < 1:
                continue
            between = _between(alpha)
            passing = int(np.rint(share * between.size))
            least = np.sort(between, axis=None)[-max(passing, 1)]
            # Where none should pass, all stay just below the cut.
            factor = cut / max(least, 1e-3) * (1.001 if passing else 0.98)
            scale = np.clip(factor, 1 / _STEEPEST, _STEEPEST)
            out[there] *= np.minimum(scale, 255 / np.maximum(alpha, 1e-3))[..., None]
        return out

    @property
    def nbytes(self) -> int:
        """Bytes of all levels."""
        return sum(level.nbytes for level in self.levels)

    def upload(self, window) -> tuple[MipTexture, int]:
        """Upload the levels."""
        limit = texture_limit(window)
        fits = [k for k, level in enumerate(self.levels) if max(level.shape[:2]) <= limit]
        if not fits:
            height, width = self.levels[-1].shape[:2]
            raise ValueError(
                f'images need {width} x {height} texels at least; the driver takes {limit}'
            )
        first = fits[0]
        texture = MipTexture(window).upload(self.levels[first])
        for k, level in enumerate(self.levels[first + 1 :], 1):
            texture.put_level(k, level)
        return texture, first


def _step(sizes) -> int:
    """Return the power of two that cells are multiples of: 2**k keeps k smaller levels apart."""
    step = 1 << (int(sizes.max()).bit_length() - 1)
    area = sizes.prod(1).sum()
    while step > 1 and (-(-sizes // step) * step).prod(1).sum() > _WASTE * area:
        step //= 2
    return step


def shelves(sizes, limit):
    """Pack boxes in shelves, the tallest first."""
    wanted = int(np.ceil(np.sqrt(sizes.prod(1).sum())))
    width = min(max(wanted, int(sizes[:, 0].max())), limit)
    corners = np.zeros((len(sizes), 2), int)
    x = y = shelf = right = 0
    for i in np.lexsort((-sizes[:, 0], -sizes[:, 1])):
        w, h = sizes[i]
        if x and x + w > width:
            x, y, shelf = 0, y + shelf, 0
        corners[i] = x, y
        x, shelf = x + w, max(shelf, h)
        right = max(right, x)
    size = int(right), int(y + shelf)
    if max(size) > limit:
        raise ValueError(
            f'images need a texture of {size[0]} x {size[1]} texels together; one may have '
            f'{limit} x {limit}: give fewer or smaller ones, or several sets'
        )
    return corners, size


def _between(a):
    """Return linearly filtered values between texels, twice as many per side."""
    for axis in (0, 1):
        wide = np.concatenate([np.take(a, [0], axis), a, np.take(a, [-1], axis)], axis)
        count = a.shape[axis]
        before, after = (np.take(wide, np.arange(count) + k, axis) for k in (0, 2))
        pair = np.stack([0.25 * before + 0.75 * a, 0.25 * after + 0.75 * a], axis + 1)
        a = pair.reshape([2 * n if k == axis else n for k, n in enumerate(a.shape)])
    return a


def _window(rect, k):
    """Return the slices of an image in a level."""
    left, bottom, right, top = rect
    rows = slice(bottom >> k, max(-(-top >> k), (bottom >> k) + 1))
    return rows, slice(left >> k, max(-(-right >> k), (left >> k) + 1))


class _Reduced:
    """An image times its alpha at smaller and smaller levels, without what pads it."""

    def __init__(self, image):
        self.pixels = image.astype(np.float32)
        self.pixels[..., :3] *= self.pixels[..., 3:] / 255
        self._shares = [np.ones(n, np.float32) for n in image.shape[:2]]  # of texels that it fills

    def halve(self):
        """Go on to the next level."""
        for axis in (0, 1):
            share = _paired(self._shares[axis])
            weight = share.reshape([*share.shape, 1, 1] if axis == 0 else [1, *share.shape, 1])
            pairs = _paired(self.pixels, axis) * weight
            self._shares[axis] = total = share.sum(1)
            shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
            self.pixels = pairs.sum(axis + 1) / total.reshape(shape)

    def padded(self, height, width):
        """Return the level, its border repeated."""
        missing = (height - self.pixels.shape[0], width - self.pixels.shape[1], 0)
        return np.pad(self.pixels, [(0, n) for n in missing], mode='edge')


def _paired(a, axis=0):
    """Return an array with an axis split into pairs, padded with a zero."""
    count = a.shape[axis]
    a = np.pad(a, [(0, count % 2 if k == axis else 0) for k in range(a.ndim)])
    return a.reshape(*a.shape[:axis], -1, 2, *a.shape[axis + 1 :])


def as_images(image, frames=None) -> list:
    """Return one image or several as arrays."""
    images = (
        image if isinstance(image, list | tuple) or getattr(image, 'ndim', 0) == 4 else [image]
    )
    if any(is_live(i) for i in images):
        raise ValueError('image is a list with a live texture; give that alone')
    if not len(images):
        raise ValueError('image is an empty list; it must have at least one')
    found = [_numbered(i, one, len(images)) for i, one in enumerate(images)]
    return found if frames is None else [f for i in found for f in _cut_up(i, frames)]


def _numbered(i, image, count):
    try:
        return as_rgba(image)
    except ValueError as error:
        if count == 1 or isinstance(image, str | Path):
            raise
        raise ValueError(f'image[{i}]: {error}') from error


def _cut_up(image, frames):
    height, width = image.shape[:2]
    with naming('frames', frames):
        good = np.shape(frames) == (2,) and all(isinstance(f, int | np.integer) for f in frames)
    if not good or min(frames) < 1 or width % frames[0] or height % frames[1]:
        raise ValueError(
            f'frames = {frames!r}: it must be columns and rows that divide the image of '
            f'{width} x {height} pixels'
        )
    columns, rows = frames
    w, h = width // columns, height // rows
    cells = image.reshape(rows, h, columns, w, 4).swapaxes(1, 2)
    return [np.ascontiguousarray(c) for c in cells.reshape(-1, h, w, 4)]
