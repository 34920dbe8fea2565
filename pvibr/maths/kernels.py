"""Where to look around a texel, and how much each look counts."""

from __future__ import annotations

import operator

import numpy as np

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def vogel_disk(n):
    """Return points that fill the unit disk evenly: each stands for the same area.

    The spiral of Vogel, "A better way to construct the sunflower head", Mathematical Biosciences
    44, 1979: the golden angle from one point to the next. Turned by any angle it stays as even.

    Parameters
    ----------
    n : int
        How many; at least 1.

    Returns
    -------
    numpy.ndarray, shape (n, 2), float64
        Points from the middle out. The mean of their squared distances from it is 1/2, that of
        the disk.

    Raises
    ------
    ValueError
        If n is less than 1.

    Examples
    --------
    >>> from pvibr.maths.kernels import vogel_disk
    >>> float((vogel_disk(16) ** 2).sum(axis=1).mean())
    0.5
    """
    index = np.arange(_at_least('n', n, 1))
    radius = np.sqrt((index + 0.5) / n)
    angle = _GOLDEN_ANGLE * index
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def gaussian_weights(radius, sigma=None):
    """Return the weights of a blur along one axis.

    Parameters
    ----------
    radius : int
        Texels on each side of the middle; at least 0.
    sigma : float, optional
        Standard deviation in texels before the ends are cut off; positive. A third of the radius
        and a half unless given, so that little is lost.

    Returns
    -------
    numpy.ndarray, shape (2 * radius + 1,), float64
        Weights, symmetric, with the sum 1.

    Raises
    ------
    ValueError
        If the radius is negative or sigma is not positive.

    Examples
    --------
    >>> from pvibr.maths.kernels import gaussian_weights
    >>> gaussian_weights(1, sigma=1.0).round(3).tolist()
    [0.274, 0.452, 0.274]
    """
    radius = _at_least('radius', radius, 0)
    sigma = (radius + 0.5) / 3 if sigma is None else float(sigma)
    if not 0 < sigma < np.inf:
        msg = f'sigma is {sigma}; it must be positive and finite.'
        raise ValueError(msg)
    weights = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return weights / weights.sum()


def _at_least(name, value, least):
    value = operator.index(value)
    if value < least:
        msg = f'{name} is {value}; it must be at least {least}.'
        raise ValueError(msg)
    return value
