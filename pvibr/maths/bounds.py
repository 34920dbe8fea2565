"""Boxes around points."""

from __future__ import annotations

import numpy as np


def bounds_of(sets):
    """Return the corners of the smallest box around sets of points; 0 if there are none.

    Parameters
    ----------
    sets : sequence of array_like, shape (n, 3)
        Points.

    Returns
    -------
    numpy.ndarray, shape (2, 3)
        The lower and the upper corner.

    Examples
    --------
    >>> from pvibr.maths.bounds import bounds_of
    >>> bounds_of([[[0, 0, 0], [1, 2, 3]], [[5, 1, 1]]]).tolist()
    [[0.0, 0.0, 0.0], [5.0, 2.0, 3.0]]
    """
    points = np.concatenate([np.zeros((0, 3)), *sets])
    return np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 3))
