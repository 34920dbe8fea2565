"""Sharpness, how much of the detail of a reference a picture has where it has least."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter

_LUMINANCE = np.array([0.299, 0.587, 0.114])
_WINDOW = 25  # px along a side, in which gradients are averaged
#: The share of windows, those with the least gradient in the reference, that has no say.
FLAT_SHARE = 0.3
_PERCENTILE = 5
_NOTHING = 1e-6  # sums of rounding errors where a picture has one colour
_ROUNDING = 1e-9  # of running sums; what 8 bits show is hundreds of times as steep


def sharpness(image, reference):
    """Return the local gradient of luminance over that of a reference, where it is lowest.

    Both are (h, w, 3), 0 to 1, the reference with many samples per pixel. The 5th percentile over
    windows of 25 px, where the reference has gradients: 1 is as sharp as the reference. Noise and
    aliasing raise it, so it counts only beside FLIP of the same pictures.
    """
    actual, expected = local_gradients(image), local_gradients(reference)
    if not expected.any():
        msg = 'reference must have gradients, got one colour.'
        raise ValueError(msg)
    return lowest_ratio(actual, expected)


def local_gradients(pictures) -> np.ndarray:
    """Return gradients of luminance, averaged around each pixel: (..., h, w, 3) to (..., h, w)."""
    luminance = np.asarray(pictures) @ _LUMINANCE.astype(np.result_type(pictures))
    steepness = np.hypot(*np.gradient(luminance, axis=(-2, -1)))
    return uniform_filter(steepness, (1,) * (steepness.ndim - 2) + (_WINDOW, _WINDOW))


def lowest_ratio(actual, expected) -> float:
    """Return a low percentile of local gradients over the expected; 1 where none is expected."""
    if not (expected > _NOTHING).any():
        return 1.0
    detailed = expected > np.quantile(expected[expected > _NOTHING], FLAT_SHARE)
    return float(np.percentile(actual[detailed] / expected[detailed], _PERCENTILE))
