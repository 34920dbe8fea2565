"""Vectors of length one."""

from __future__ import annotations

import numpy as np


def unit_vectors(vectors):
    """Return vectors scaled to length one; zero vectors stay zero.

    Parameters
    ----------
    vectors : array_like, shape (..., d)
        Vectors of any length; float32 is squared in float64, where it stays in range.

    Returns
    -------
    numpy.ndarray, shape (..., d), float64
        Unit or zero vectors.

    Examples
    --------
    >>> from pvibr.maths.vectors import unit_vectors
    >>> unit_vectors([[3.0, 4.0], [0.0, 0.0]]).tolist()
    [[0.6, 0.8], [0.0, 0.0]]
    """
    vectors = np.asarray(vectors, dtype=np.float64)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
