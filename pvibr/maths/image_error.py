"""Errors of a picture against a reference: colour, coverage, silhouette."""

from __future__ import annotations

import numpy as np
import scipy  # whose modules load when they are first used


def box_reduce(image, factor):
    """Return the means of an image over squares of `factor` pixels, a divisor of both sides."""
    image = np.asarray(image)
    h, w = image.shape[0] // factor, image.shape[1] // factor
    pixel_blocks = image.reshape(h, factor, w, factor, *image.shape[2:])
    return pixel_blocks.mean((1, 3), dtype=np.float64)


def outline(coverage):
    """Return the pixels of coverage 1/2 or more beside one of less, or at the border, (h, w)."""
    inside = np.asarray(coverage) >= 0.5
    deep = np.zeros_like(inside)
    deep[1:-1, 1:-1] = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    return inside & ~deep


def crossed(coverage):
    """Return the pixels that a silhouette passes through: partly covered ones and the outline."""
    coverage = np.asarray(coverage)
    return ((coverage > 0.05) & (coverage < 0.95)) | outline(coverage)


def displacements(coverage, reference):
    """Return the distances in pixels between the silhouettes of two pictures, both ways, (n,).

    From each outline pixel to the nearest pixel that the other silhouette crosses.
    """
    pairs = (coverage, reference), (reference, coverage)
    return np.concatenate([outline_distances(*pair)[1] for pair in pairs])


def outline_distances(coverage, reference):
    """Return a picture's outline pixels (n, 2) and their distances (n,) to another silhouette."""
    is_outline, is_target = outline(coverage), crossed(reference)
    off_target = is_outline & ~is_target
    pixel_distances = np.zeros(int(is_outline.sum()))
    if not is_target.any():
        pixel_distances[:] = np.hypot(*is_outline.shape)
    elif off_target.any():
        # For few pixels a tree is much cheaper than a distance transform.
        tree = scipy.spatial.cKDTree(
            np.argwhere(is_target), compact_nodes=False, balanced_tree=False
        )
        pixel_distances[off_target[is_outline]] = tree.query(np.argwhere(off_target))[0]
    return np.argwhere(is_outline), pixel_distances


def silhouette_iou(coverage, reference) -> float:
    """Return the overlap of two silhouettes: covered in both over covered in either."""
    intersection = np.minimum(coverage, reference).sum()
    union = np.maximum(coverage, reference).sum()
    return float(intersection / union) if union > 0 else 1.0


def psnr(image, reference) -> float:
    """Return the peak signal-to-noise ratio of images with values from 0 to 1, in decibels."""
    mse = float(np.mean((np.asarray(image, float) - reference) ** 2))
    return float('inf') if mse == 0 else -10 * float(np.log10(mse))
