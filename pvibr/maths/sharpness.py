"""Sharpness, how much of the detail of a reference a picture has where it has least."""

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
    """Return how sharp a picture is beside a reference, where it is least sharp.

    The mean gradient of luminance in windows of 25 px, over that of the reference: its 5th
    percentile where the reference has gradients. Noise and aliasing raise it, so it counts only
    beside :func:`~pvibr.maths.flip.flip` of the same pictures.

    Parameters
    ----------
    image, reference : array_like, shape (h, w, 3)
        Display-ready sRGB, 0 to 1; the reference with many samples per pixel.

    Returns
    -------
    float
        1 is as sharp as the reference.

    Examples
    --------
    >>> from pvibr.maths.sharpness import sharpness
    >>> stripes = np.zeros((32, 32, 3))
    >>> stripes[:, ::4] = 1.0
    >>> round(sharpness(stripes / 2, stripes), 6)
    0.5
    """
    actual, expected = (uniform_filter(_gradient(a), _WINDOW) for a in (image, reference))
    steep = expected > _ROUNDING
    if not steep.any():
        msg = 'reference must have gradients, got one colour.'
        raise ValueError(msg)
    detailed = expected > np.quantile(expected[steep], FLAT_SHARE)
    return float(np.percentile(actual[detailed] / expected[detailed], _PERCENTILE))


def _gradient(picture):
    """Return how steep luminance is at each pixel, (h, w)."""
    return np.hypot(*np.gradient(np.asarray(picture, float) @ _LUMINANCE))
