"""Vectors of length one, and products of many with a small matrix."""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import place_of

_LEAST = 1e-280  # square; those of what is shorter, or longer than the inverse, are inexact


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
    squares = np.einsum('...i,...i->...', vectors, vectors)[..., None]
    out = ~((squares > _LEAST) & (squares < 1 / _LEAST))  # or zero, or NaN
    if out.any():
        largest = np.abs(vectors).max(-1, keepdims=True, initial=0.0)
        vectors = vectors / np.where(out & (largest > 0), largest, 1.0)
        squares = np.einsum('...i,...i->...', vectors, vectors)[..., None]
    return np.divide(vectors, np.sqrt(squares), out=np.zeros_like(vectors), where=squares > 0)


def products(matrix, vectors):
    """Return the products of a small matrix and each of many vectors.

    Unlike ``vectors @ matrix.T`` it leaves out BLAS, whose threads wait for each other: called
    from several threads it took ten times the processor time.

    Parameters
    ----------
    matrix : numpy.ndarray, shape (m, d)
        Any matrix.
    vectors : numpy.ndarray, shape (n, d)
        Any vectors.

    Returns
    -------
    numpy.ndarray, shape (n, m)
        The products.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.vectors import products
    >>> products(np.array([[0.0, 2.0]]), np.array([[1.0, 3.0], [4.0, 5.0]])).tolist()
    [[6.0], [10.0]]
    """
    return np.einsum('md,nd->nm', matrix, vectors)


def as_units(name, vectors) -> np.ndarray:
    """Return unit vectors; an error names the first vector without a direction.

    Parameters
    ----------
    name : str
        Name of the argument in errors.
    vectors : array_like, shape (..., d)
        Vectors of any length but 0.

    Returns
    -------
    numpy.ndarray, shape (..., d), float64
        Unit vectors.

    Raises
    ------
    TypeError
        If these are not numbers.
    ValueError
        If a vector is zero or not finite.

    Examples
    --------
    >>> from pvibr.maths.vectors import as_units
    >>> as_units('axis', [0, 0, 1e-200]).tolist()
    [0.0, 0.0, 1.0]
    """
    try:
        given = np.asarray(vectors, float)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} must be numbers, not {vectors!r}') from error
    # Two steps, so that the squares of very long or short ones stay in range.
    largest = np.abs(given).max(-1, keepdims=True)
    good = (largest > 0) & np.isfinite(largest)
    if not good.all():
        place = tuple(np.argwhere(~good[..., 0])[0])
        where = f'{name}[{place_of(place)}]' if place else name
        raise ValueError(f'{where} is {given[place].tolist()}; it must be finite and not zero.')
    scaled = given / largest
    return scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
