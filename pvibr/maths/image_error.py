"""Errors of a picture against a reference: colour, coverage, silhouette."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


def box_reduce(image, factor):
    """Average an image over squares of pixels.

    Parameters
    ----------
    image : numpy.ndarray, shape (h, w) or (h, w, c)
        h and w are multiples of `factor`.
    factor : int
        Side of the squares.

    Returns
    -------
    numpy.ndarray, shape (h / factor, w / factor[, c]), float64
        The means.

    Examples
    --------
    >>> from pvibr.maths.image_error import box_reduce
    >>> box_reduce(np.arange(4.0).reshape(2, 2), 2).tolist()
    [[1.5]]
    """
    image = np.asarray(image)
    h, w = image.shape[0] // factor, image.shape[1] // factor
    blocks = image.reshape(h, factor, w, factor, *image.shape[2:])
    return blocks.mean((1, 3), dtype=np.float64)


def outline(coverage):
    """Return the pixels of a silhouette: covered by half or more, beside one that is not.

    Parameters
    ----------
    coverage : numpy.ndarray, shape (h, w)
        0 to 1.

    Returns
    -------
    numpy.ndarray, shape (h, w), bool
        Pixels at the image's border count as beside the outside.
    """
    inside = np.asarray(coverage) >= 0.5
    deep = np.zeros_like(inside)
    deep[1:-1, 1:-1] = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    return inside & ~deep


def crossed(coverage):
    """Return the pixels that a silhouette passes through.

    Parameters
    ----------
    coverage : numpy.ndarray, shape (h, w)
        0 to 1, of many samples a pixel.

    Returns
    -------
    numpy.ndarray, shape (h, w), bool
        Pixels that are partly covered, and those of :func:`outline`.
    """
    coverage = np.asarray(coverage)
    return ((coverage > 0.05) & (coverage < 0.95)) | outline(coverage)


def displacements(coverage, reference):
    """Return the distances between the silhouettes of two pictures, both ways.

    The distance of each outline pixel of one picture to the nearest pixel that the other's
    silhouette passes through: an exact hard edge has distance 0.

    Parameters
    ----------
    coverage, reference : numpy.ndarray, shape (h, w)
        Coverage, 0 to 1.

    Returns
    -------
    numpy.ndarray, shape (n,)
        Pixels; empty where neither has an outline, the image's diagonal where only one has.

    Examples
    --------
    >>> from pvibr.maths.image_error import displacements
    >>> a = np.zeros((9, 9))
    >>> a[2:7, 2:7] = 1
    >>> float(displacements(a, np.roll(a, 2, 0)).max())
    2.0
    """
    pairs = ((coverage, reference), (reference, coverage))
    return np.concatenate([outline_distances(*pair)[1] for pair in pairs])


def outline_distances(drawn, other):
    """Return the distances of a picture's silhouette from that of another, and its pixels.

    Parameters
    ----------
    drawn, other : numpy.ndarray, shape (h, w)
        Coverage, 0 to 1.

    Returns
    -------
    tuple of 2 numpy.ndarray, shape (n, 2) and (n,)
        Rows and columns of the outline of `drawn`, and the distances to the silhouette of `other`.
    """
    edge, target = outline(drawn), crossed(other)
    off = edge & ~target
    away = np.zeros(int(edge.sum()))
    if not target.any():
        away[:] = np.hypot(*edge.shape)
    elif off.any():
        # Few pixels are asked for: much cheaper than the distance of each pixel of the picture.
        tree = cKDTree(np.argwhere(target), compact_nodes=False, balanced_tree=False)
        away[off[edge]] = tree.query(np.argwhere(off))[0]
    return np.argwhere(edge), away


def silhouette_iou(coverage, reference) -> float:
    """Return the overlap of two silhouettes: covered in both over covered in either.

    Parameters
    ----------
    coverage, reference : numpy.ndarray, shape (h, w)
        Coverage, 0 to 1.

    Returns
    -------
    float
        1 for the same; partly covered pixels count by their part.
    """
    low, high = np.minimum(coverage, reference).sum(), np.maximum(coverage, reference).sum()
    return float(low / high) if high > 0 else 1.0


def psnr(image, reference) -> float:
    """Return the peak signal-to-noise ratio of images with values from 0 to 1, in decibels.

    Parameters
    ----------
    image, reference : numpy.ndarray
        Same shape.

    Returns
    -------
    float
        Infinity for equal images.
    """
    mse = float(np.mean((np.asarray(image, float) - reference) ** 2))
    return float('inf') if mse == 0 else -10 * float(np.log10(mse))
