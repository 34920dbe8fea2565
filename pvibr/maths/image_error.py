"""Errors of a picture against a reference: colour, coverage, silhouette."""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
import scipy  # whose modules load when they are first used

_NEAR = 4  # pixels within which targets are looked for one by one


def box_reduce(image, factor):
    """Return the means of an image over squares of `factor` pixels, a divisor of both sides."""
    image = np.asarray(image)
    h, w = image.shape[0] // factor, image.shape[1] // factor
    pixel_blocks = image.reshape(h, factor, w, factor, *image.shape[2:])
    return pixel_blocks.mean((1, 3), dtype=np.float64)


class Silhouette:
    """The silhouette of a picture, from its coverage (h, w), 0 to 1."""

    def __init__(self, coverage):
        self.coverage = np.asarray(coverage)

    @cached_property
    def outline(self) -> np.ndarray:
        """Pixels of coverage 1/2 or more beside one of less, or at the border, (h, w)."""
        inside = self.coverage >= 0.5
        deep = np.zeros_like(inside)
        center = deep[1:-1, 1:-1]
        np.logical_and(inside[:-2, 1:-1], inside[2:, 1:-1], out=center)
        center &= inside[1:-1, :-2]
        center &= inside[1:-1, 2:]
        return inside & ~deep

    @cached_property
    def crossed(self) -> np.ndarray:
        """Pixels that the silhouette passes through: partly covered ones and the outline."""
        return ((self.coverage > 0.05) & (self.coverage < 0.95)) | self.outline

    def distances_to(self, other) -> tuple[np.ndarray, np.ndarray]:
        """Return the outline's pixels (n, 2) and their distances (n,) to another silhouette."""
        width = max(self.outline.shape[1], 1)
        outline_ids = np.flatnonzero(self.outline)
        pixels = np.stack(np.divmod(outline_ids, width), 1)
        distances = np.zeros(len(pixels))
        if other.crossed.any():
            (off_target,) = np.nonzero(~other.crossed.ravel()[outline_ids])
            distances[off_target] = _distances(pixels[off_target], other.crossed)
        else:
            distances[:] = np.hypot(*self.outline.shape)
        return pixels, distances


def _distances(pixels, is_target):
    """Return the distances of pixels (n, 2) to the nearest target."""
    # Most are near one: looked for in growing circles, far fewer are left for a tree.
    width = is_target.shape[1] + 2 * _NEAR
    is_near = np.pad(is_target, _NEAR).ravel()
    places = (pixels + _NEAR) @ [width, 1]
    distances, left = np.zeros(len(pixels)), np.arange(len(pixels))
    for distance, steps in _circles():
        is_met = is_near[places[left, None] + steps @ [width, 1]].any(1)
        distances[left[is_met]] = distance
        left = left[~is_met]
    if len(left):
        tree = scipy.spatial.cKDTree(
            np.argwhere(is_target), compact_nodes=False, balanced_tree=False
        )
        distances[left] = tree.query(pixels[left])[0]
    return distances


@cache
def _circles():
    """Return the distances from a pixel up to `_NEAR`, and the steps to the pixels there."""
    steps = np.argwhere(np.ones((2 * _NEAR + 1,) * 2)) - _NEAR
    squares = (steps**2).sum(1)
    return [(d**0.5, steps[squares == d]) for d in np.unique(squares) if 0 < d <= _NEAR**2]


def outline(coverage):
    """Return the pixels of coverage 1/2 or more beside one of less, or at the border, (h, w)."""
    return Silhouette(coverage).outline


def crossed(coverage):
    """Return the pixels that a silhouette passes through: partly covered ones and the outline."""
    return Silhouette(coverage).crossed


def displacements(coverage, reference):
    """Return the distances in pixels between the silhouettes of two pictures, both ways, (n,).

    From each outline pixel to the nearest pixel that the other silhouette crosses.
    """
    pair = Silhouette(coverage), Silhouette(reference)
    return np.concatenate([a.distances_to(b)[1] for a, b in (pair, pair[::-1])])


def outline_distances(coverage, reference):
    """Return a picture's outline pixels (n, 2) and their distances (n,) to another silhouette."""
    return Silhouette(coverage).distances_to(Silhouette(reference))


def silhouette_iou(coverage, reference) -> float:
    """Return the overlap of two silhouettes: covered in both over covered in either."""
    intersection = np.minimum(coverage, reference).sum()
    union = np.maximum(coverage, reference).sum()
    return float(intersection / union) if union > 0 else 1.0


def psnr(image, reference) -> float:
    """Return the peak signal-to-noise ratio of images with values from 0 to 1, in decibels."""
    mse = float(np.mean((np.asarray(image, float) - reference) ** 2))
    return float('inf') if mse == 0 else -10 * float(np.log10(mse))
