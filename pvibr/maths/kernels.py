"""Sample patterns around a texel."""

from __future__ import annotations

import operator

import numpy as np

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def vogel_disk(n):
    """Return points that fill the unit disk evenly: a spiral of golden angles.

    Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 44, 1979.

    Parameters
    ----------
    n : int
        Number of points; at least 1.

    Returns
    -------
    numpy.ndarray, shape (n, 2), float64
        Points from the middle out; their mean squared radius is 1/2, that of the disk.

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
    if operator.index(n) < 1:
        raise ValueError(f'n is {n}; it must be at least 1.')
    index = np.arange(n)
    radius = np.sqrt((index + 0.5) / n)
    angle = _GOLDEN_ANGLE * index
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
