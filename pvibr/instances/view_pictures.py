"""Pictures of all views of a mesh side by side, and their errors against a reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE, PATCHES
from pvibr.instances.sharpness import LUMINANCE, Details, gradients_of
from pvibr.maths.flip import Flip
from pvibr.maths.image_error import Silhouette

CELL = 9 / 8  # side of a view's cell in diameters: the sizes fit the reference's pixels
SAMPLES = 2  # reference samples along a side of a pixel, at a layout's largest size
SLACK = 0.5  # px: outline distances are resolved to whole pixels
_BLURRED_FROM = 32  # px from which blur is visible
#: px of `max_error` per px of coverage lost or gained along outlines: thin things have two sides,
#: and directions between the few views of a patch are several times worse.
_COVERAGE_WEIGHT = 8.0
_ROUNDED = 1.5 / 255  # what rounding to eight bits can make of an invisible difference
_FLOOR = 1e-4  # invisible FLIP


@dataclass(frozen=True)
class Layout:
    """Views in a square, and the on-screen diameters of the bounding sphere, px."""

    side: int  # views along a side of the square
    sizes: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of views."""
        return self.side**2


class SizedReference:
    """The reference at one size."""

    def __init__(self, samples, picture, layout, size):
        self.size, self.layout, self.picture = size, layout, picture
        self._silhouette = Silhouette(picture[..., 3])
        *colors, self._coverage = self._tiles(picture)
        self.covered = np.maximum(self._coverage.sum((1, 2)), 1.0)
        # On its mean colour, as in a field of its like: on white, outlines would dominate.
        total = self.covered.sum()
        self.background = [np.float32(c.sum((1, 2)).sum() / total) for c in colors]
        images = self._on_background(picture)
        self.flip = Flip(images)
        outlines = self._tiles(self._silhouette.crossed[..., None].astype(np.float32))[0]
        self.outlines = np.maximum(outlines.sum((1, 2)), 1.0)
        self._details = [Details(g) for g in self._gradients(images)]
        mesh = one_sample(samples, layout.sizes[-1], size)
        self.mesh_flip = self._flip(self._on_background(mesh))
        self.mesh_displacement = self._displacement(mesh)
        coverage = self._tiles(mesh)[3]
        self.mesh_coverage_error = self._coverage_error(coverage)
        self.mesh_coverage_shift = self._coverage_shift(coverage)

    def errors(self, picture, displacement):
        """Return displacement, FLIP, that of the mesh and blur in each patch."""
        images = self._on_background(picture)
        by_view = self._flip(images), self.mesh_flip, self._blur(images)
        return np.stack(np.broadcast_arrays(displacement, *map(patches, by_view)), 1)

    def card_errors(self, picture):
        """Return the same of cards, whose soft outlines may be no worse than the mesh's."""
        # What is no worse than the mesh, as thin things are, does not count.
        displacement = self._displacement(picture)
        displacement = np.where(displacement > self.mesh_displacement, displacement, 0.0)
        coverage = self._tiles(picture)[3]
        shift = self._coverage_shift(coverage)
        shift = by_patch(np.where(shift > self.mesh_coverage_shift, shift, 0.0)).max(1)
        errors = self.errors(picture, np.maximum(displacement, _COVERAGE_WEIGHT * shift + SLACK))
        # Relative to each view: what is seen edge-on covers little, and fades.
        coverage_ratio = self._coverage_error(coverage) / self.mesh_coverage_error
        errors[:, 1] = np.maximum(errors[:, 1], patches(self.mesh_flip * coverage_ratio))
        return errors

    def _displacement(self, picture):
        return displacement_of(Silhouette(picture[..., 3]), self._silhouette, self.layout.side)

    def _coverage_shift(self, coverage):
        """Return the coverage gained or lost in each view, px along outlines."""
        return np.abs(coverage.sum((1, 2)) - self._coverage.sum((1, 2))) / self.outlines

    def _coverage_error(self, coverage):
        """Return the absolute error of coverage in each view, per covered pixel."""
        difference = np.abs(coverage - self._coverage)
        return np.maximum(difference.sum((1, 2)) / self.covered, _FLOOR)

    def _blur(self, images):
        """Return the share of gradients lost in each view, where most are lost."""
        if self.size < _BLURRED_FROM:
            return np.zeros(self.layout.count)
        pairs = zip(self._details, self._gradients(images), strict=True)
        return np.array([max(1 - details.lowest_ratio(g), 0.0) for details, g in pairs])

    def _gradients(self, images):
        if self.size < _BLURRED_FROM:
            return []
        weights = LUMINANCE.astype(np.float32).tolist()
        channels = np.moveaxis(images, -1, 0)
        return gradients_of(sum(w * c for w, c in zip(weights, channels, strict=True)))

    def _flip(self, images):
        """Return the FLIP of each view per covered pixel, at least `_FLOOR`."""
        maps = self.flip.maps(images)
        return np.maximum(maps.sum((1, 2)) / self.covered, _FLOOR)

    def _on_background(self, picture):
        """Return the views on the background, (views, cell, cell, 3)."""
        *colors, coverage = self._tiles(picture)
        uncovered = 1 - coverage
        for color, behind in zip(colors, self.background, strict=True):
            color += uncovered * behind
            np.clip(color, 0, 1, out=color)
        return np.stack(colors).transpose(1, 2, 3, 0)

    def _tiles(self, picture):
        """Return copies of each channel by view, (views, cell, cell)."""
        side = self.layout.side
        cell = len(picture) // side
        sheets = np.moveaxis(picture, -1, 0).reshape(-1, side, cell, side, cell)
        return [s.swapaxes(1, 2).copy().reshape(side**2, cell, cell) for s in sheets]


def patches(values):
    """Return the mean over the views of each patch."""
    return by_patch(values).mean(1)


def by_patch(values):
    """Return values by view as values by patch, (PATCHES, views)."""
    views = round(len(values) ** 0.5) // PATCH_SIDE
    cells = values.reshape(PATCH_SIDE, views, PATCH_SIDE, views).swapaxes(1, 2)
    return cells.reshape(PATCHES, views * views)


def pixels_of(samples, layout) -> dict:
    """Return the pixels of each size of a layout from the samples of its largest."""
    pixels = {layout.sizes[-1]: reduced(samples)}
    for size in layout.sizes[-2::-1]:
        larger = np.moveaxis(pixels[2 * size], -1, 0)
        sums = larger[:, ::2] + larger[:, 1::2]
        halved = sums[..., ::2] + sums[..., 1::2]
        halved *= np.float32(0.25)
        pixels[size] = np.moveaxis(halved, 0, -1)
    return dict(sorted(pixels.items()))


def reduced(picture):
    """Return pixels of the largest size, averaging samples with half weight on borders."""
    borders = picture[::SAMPLES].astype(np.uint16)
    sums = borders + np.roll(borders, -1, 0)
    for k in range(1, SAMPLES):
        sums += picture[k::SAMPLES]
        sums += picture[k::SAMPLES]
    height, width, n_channels = sums.shape
    # Each channel by itself: arithmetic along four channels is several times as slow.
    pixels = np.empty((n_channels, height, width // SAMPLES), np.float32)
    for channel, values in zip(pixels, np.moveaxis(sums, -1, 0), strict=True):
        borders = np.ascontiguousarray(values[:, ::SAMPLES])
        total = borders + np.roll(borders, -1, 1)
        for k in range(1, SAMPLES):
            total += 2 * values[:, k::SAMPLES]
        np.divide(total, np.float32(255 * (2 * SAMPLES) ** 2), out=channel)
    return np.moveaxis(pixels, 0, -1)


def one_sample(samples, largest, size):
    """Return one sample per pixel, at its centre."""
    step = largest * SAMPLES // size
    return fractions(samples[step // 2 :: step, step // 2 :: step])


def fractions(picture):
    """Return a picture of eight bits as values from 0 to 1, each channel by itself in memory."""
    channels = np.ascontiguousarray(np.moveaxis(picture, -1, 0))
    return np.moveaxis(channels / np.float32(255), 0, -1)


def without_rounding(picture, truth):
    """Return a picture without differences within rounding."""
    # FLIP weighs one step of 255 all over a smooth surface like all its outlines.
    channels, true_channels = (np.moveaxis(p, -1, 0) for p in (picture, truth))
    is_off = np.zeros(channels.shape[1:], bool)
    for pair in zip(channels, true_channels, strict=True):
        is_off |= np.abs(np.subtract(*pair)) > _ROUNDED
    return np.moveaxis(np.where(is_off, channels, true_channels), 0, -1)


def displacement_of(silhouette, truth, side):
    """Return a bound of most outline displacements in each patch, px."""
    # The 99th percentile over all views of a patch, and the 95th in each of them.
    both_ways = silhouette.distances_to(truth), truth.distances_to(silhouette)
    pixel_ids, distances = (np.concatenate(sides) for sides in zip(*both_ways, strict=True))
    view_ids, view_count = pixel_ids // (len(truth.coverage) // side) @ [side, 1], side**2
    patch_ids = np.empty(view_count, int)
    patch_ids[by_patch(np.arange(view_count))] = np.arange(PATCHES)[:, None]
    all_views = quantiles(distances, patch_ids[view_ids], PATCHES, 0.99)
    each_view = quantiles(distances, view_ids, view_count, 0.95)
    return np.maximum(all_views, by_patch(each_view).max(1))


def quantiles(values, groups, count, share):
    """Return the quantile of a share of the values of each group, 0 for empty ones."""
    counts = np.bincount(groups, minlength=count)
    # Ranks in the values of all groups, sorted within each.
    ranks = np.cumsum(counts) - 1 - (1 - share) * (counts - 1)
    ordered = np.append(values[np.lexsort((values, groups))], 0.0)
    return np.where(counts, np.interp(ranks, np.arange(len(ordered)), ordered), 0.0)
