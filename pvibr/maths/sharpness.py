"""Sharpness: how much of a reference's detail a picture has where it has least."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter

_LUMINANCE = np.array([0.299, 0.587, 0.114])
_WINDOW = 25  # px along a side, in which gradients are averaged
#: The share of windows, those with the least gradient in the reference, that has no say.
FLAT_SHARE = 0.3
_PERCENTILE = 5
_ROUNDING = 1e-9  # of running sums; what 8 bits show is hundreds of times as steep


def sharpness(image, reference):
    """Return the sharpness of an sRGB picture beside a reference where it is lowest; 1 is equal.

    Noise and aliasing raise it: read it beside :func:`~pvibr.maths.flip.flip`.
    """
    expected = local_gradients(reference)
    if not (expected > _ROUNDING).any():
        raise ValueError('reference must have gradients, got one colour.')
    return lowest_ratio(local_gradients(image), expected)


def local_gradients(images) -> np.ndarray:
    """Return gradients of luminance per pixel, averaged over 25 px windows, (..., h, w)."""
    luminance = np.asarray(images, float) @ _LUMINANCE
    steepness = np.hypot(*np.gradient(luminance, axis=(-2, -1)))
    return uniform_filter(steepness, (1,) * (steepness.ndim - 2) + (_WINDOW, _WINDOW))


def lowest_ratio(gradients, expected) -> float:
    """Return the 5th percentile of local gradients over the expected ones, 1 if there are none."""
    steep = expected > _ROUNDING
    if not steep.any():
        return 1.0
    detailed = expected > np.quantile(expected[steep], FLAT_SHARE)
    return float(np.percentile(gradients[detailed] / expected[detailed], _PERCENTILE))
