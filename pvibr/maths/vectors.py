"""Vectors of length one, and products of many with a small matrix."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import place_of

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]  # axes after and before each
_LEAST = 1e-280  # squared length; shorter vectors, or longer than the inverse, are rescaled first


def unit_vectors(vectors):
    """Return vectors (..., d) of length one in float64; zero vectors stay zero."""
    vectors = np.asarray(vectors, dtype=np.float64)
    squares = np.einsum('...i,...i->...', vectors, vectors)[..., None]
    out_of_range = ~((squares > _LEAST) & (squares < 1 / _LEAST))  # or zero, or NaN
    if out_of_range.any():
        largest = np.abs(vectors).max(-1, keepdims=True, initial=0.0)
        vectors = vectors / np.where(out_of_range & (largest > 0), largest, 1.0)
        squares = np.einsum('...i,...i->...', vectors, vectors)[..., None]
    return np.divide(vectors, np.sqrt(squares), out=np.zeros_like(vectors), where=squares > 0)


def cross(a, b):
    """Return the cross products of vectors (..., 3), as ``numpy.cross`` does.

    That makes 80 calls, which take five times as long for few vectors.
    """
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


def products(matrix, vectors):
    """Return the products (n, m) of a small matrix (m, d) and each of many vectors (n, d).

    Without BLAS, whose waiting threads took ten times the processor time.
    """
    return np.einsum('md,nd->nm', matrix, vectors)


def as_units(name, vectors) -> np.ndarray:
    """Return unit vectors (..., d); an error names the first vector without a direction."""
    try:
        numbers = np.asarray(vectors, float)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} must be numbers, got {vectors!r}') from error
    # In two steps, so that squares of very long or short ones stay in range.
    largest = np.abs(numbers).max(-1, keepdims=True)
    has_direction = (largest > 0) & np.isfinite(largest)
    if not has_direction.all():
        bad_index = tuple(np.argwhere(~has_direction[..., 0])[0])
        where = f'{name}[{place_of(bad_index)}]' if bad_index else name
        raise ValueError(f'{where} must be finite and not zero, got {numbers[bad_index].tolist()}')
    scaled = numbers / largest
    return scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
