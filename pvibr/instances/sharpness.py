"""Sharpness: how much of a reference's detail a picture has where it has least."""

from __future__ import annotations

import numpy as np
import scipy  # whose modules load when they are first used

_LUMINANCE = np.array([0.299, 0.587, 0.114])
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
    luminance = np.asarray(images, float) @ _LUMINANCE
    steepness = np.hypot(*np.gradient(luminance, axis=(-2, -1)))
    return scipy.ndimage.uniform_filter(
        steepness, (1,) * (steepness.ndim - 2) + (_WINDOW, _WINDOW)
    )


def lowest_ratio(gradients, expected) -> float:
    """Return the 5th percentile of local gradients over the expected ones, 1 if there are none."""
    is_steep = expected > _ROUNDING
    if not is_steep.any():
        return 1.0
    is_detailed = expected > np.quantile(expected[is_steep], FLAT_SHARE)
    return float(np.percentile(gradients[is_detailed] / expected[is_detailed], _PERCENTILE))
