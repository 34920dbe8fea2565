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
    expected = local_gradients(reference)
    if not (expected > _ROUNDING).any():
        raise ValueError('reference must have gradients, got one colour.')
    return lowest_ratio(local_gradients(image), expected)


def local_gradients(images) -> np.ndarray:
    """Return gradients of luminance, averaged in a window of 25 px around each pixel.

    Parameters
    ----------
    images : array_like, shape (..., h, w, 3)
        Display-ready sRGB, 0 to 1.

    Returns
    -------
    numpy.ndarray, shape (..., h, w)
        Change of luminance per pixel.
    """
    luminance = np.asarray(images, float) @ _LUMINANCE
    steepness = np.hypot(*np.gradient(luminance, axis=(-2, -1)))
    return uniform_filter(steepness, (1,) * (steepness.ndim - 2) + (_WINDOW, _WINDOW))


def lowest_ratio(gradients, expected) -> float:
    """Return the 5th percentile of local gradients over the expected ones.

    Parameters
    ----------
    gradients, expected : numpy.ndarray, shape (h, w)
        Of an image and of its reference, as :func:`local_gradients` returns them.

    Returns
    -------
    float
        1 if none is expected anywhere.
    """
    steep = expected > _ROUNDING
    if not steep.any():
        return 1.0
    detailed = expected > np.quantile(expected[steep], FLAT_SHARE)
    return float(np.percentile(gradients[detailed] / expected[detailed], _PERCENTILE))
