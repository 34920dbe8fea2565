"""Quaternions of a few dozen joints in columns, (4, n): the same as maths, at small n faster.

Products of quaternions and vectors are linear in each factor and a rotation matrix is quadratic:
each is one product of a constant matrix with all products of two components, where the formula
written out is some thirty calls of numpy.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths import quaternions

_E = np.eye(4)
_PRODUCT = np.moveaxis(quaternions.multiply(_E[:, None], _E), -1, 0).reshape(4, 16)
# Entry (c, b) of the rotation matrix is what q e_b q* has along c.
_MATRIX = np.einsum(
    'ibjc->cbij',
    quaternions.multiply(
        quaternions.multiply(_E[:, None], _E[1:])[:, :, None], quaternions.conjugate(_E)
    )[..., 1:],
).reshape(9, 16)

#: Cross products: CROSS @ (all products of two components); (a @ CROSS) is v -> v x a.
CROSS = np.array([[np.cross(a, b) for b in np.eye(3)] for a in np.eye(3)]).reshape(3, 9)


def product(a, b):
    """Return products of quaternions: the rotation b, and then a.

    Parameters
    ----------
    a, b : numpy.ndarray, shape (4, n), float64
        Quaternions (w, x, y, z) in columns.

    Returns
    -------
    numpy.ndarray, shape (4, n), float64
        As :func:`pvibr.maths.quaternions.multiply`.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation.columns import product
    >>> product(np.eye(4)[:, [1]], np.eye(4)[:, [2]]).T.tolist()
    [[0.0, 0.0, 0.0, 1.0]]
    """
    return _PRODUCT @ (a[:, None] * b).reshape(16, -1)


def matrices(columns):
    """Return rotation matrices.

    Parameters
    ----------
    columns : numpy.ndarray, shape (4, n), float64
        Unit quaternions (w, x, y, z) in columns.

    Returns
    -------
    numpy.ndarray, shape (n, 3, 3), float64
        As :func:`pvibr.maths.quaternions.to_matrices`.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation.columns import matrices
    >>> matrices(np.eye(4)[:, [3]])[0].diagonal().tolist()
    [-1.0, -1.0, 1.0]
    """
    return (_MATRIX @ (columns[:, None] * columns).reshape(16, -1)).T.reshape(-1, 3, 3)


def cross(a, b):
    """Return cross products.

    Parameters
    ----------
    a, b : numpy.ndarray, shape (3, n), float64
        Vectors in columns.

    Returns
    -------
    numpy.ndarray, shape (3, n), float64
        The vectors a x b.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation.columns import cross
    >>> cross(np.eye(3)[:, [0]], np.eye(3)[:, [1]]).T.tolist()
    [[0.0, 0.0, 1.0]]
    """
    return CROSS @ (a[:, None] * b).reshape(9, -1)
