"""Sharpness: how much of a reference's detail a picture has where it has least."""

from __future__ import annotations

import numpy as np
import scipy  # whose modules load when they are first used

#: Weights of red, green and blue.
LUMINANCE = np.array([0.299, 0.587, 0.114])
_WINDOW = 25  # px along a side, in which gradients are averaged
#: The share of windows, those of least gradient in the reference, that is ignored.
FLAT_SHARE = 0.3
_PERCENTILE = 5
_ROUNDING = 1e-9  # of running sums; one step of 8 bits is hundreds of times as steep


def sharpness(image, reference):
    """Return the sharpness of an sRGB picture beside a reference where it is lowest; 1 is equal.

    Noise and aliasing raise it: read it beside :func:`~pvibr.maths.flip.flip`.
    """
    expected_gradients = local_gradients(reference)
    if not (expected_gradients > _ROUNDING).any():
        raise ValueError('reference must have gradients, got one colour')
    return lowest_ratio(local_gradients(image), expected_gradients)


def local_gradients(images) -> np.ndarray:
    """Return gradients of luminance per pixel, averaged over 25 px windows, (..., h, w)."""
    return gradients_of(np.asarray(images, float) @ LUMINANCE)


def gradients_of(luminance) -> np.ndarray:
    """Return the gradients of a luminance per pixel, averaged over 25 px windows, (..., h, w)."""
    down, across = np.gradient(luminance, axis=(-2, -1))
    down *= down
    across *= across
    down += across
    steepness = np.sqrt(down, out=down)
    return scipy.ndimage.uniform_filter(
        steepness, (1,) * (steepness.ndim - 2) + (_WINDOW, _WINDOW)
    )


def lowest_ratio(gradients, expected) -> float:
    """Return the 5th percentile of local gradients over the expected ones, 1 if there are none."""
    return Details(expected).lowest_ratio(gradients)


class Details:
    """The pixels of a picture that have details, from its local gradients."""

    def __init__(self, gradients):
        gradients = np.ravel(gradients)
        is_steep = gradients > _ROUNDING
        least = np.quantile(gradients[is_steep], FLAT_SHARE) if is_steep.any() else np.inf
        self._pixels = np.flatnonzero(gradients > least)
        self._gradients = gradients[self._pixels]

    def lowest_ratio(self, gradients) -> float:
        """Return the 5th percentile of local gradients over these, 1 if there are none."""
        if not len(self._pixels):
            return 1.0
        ratios = np.ravel(gradients)[self._pixels] / self._gradients
        # As numpy.percentile(), which takes several times as long.
        rank, fraction = divmod(_PERCENTILE / 100 * (len(ratios) - 1), 1)
        ranks = [int(rank), min(int(rank) + 1, len(ratios) - 1)]
        low, high = np.partition(ratios, ranks)[ranks].tolist()
        return low + fraction * (high - low)
