"""Changes of space as 4x4 matrices: numpy only, float64, column vectors (``a_from_b @ b``)."""

from __future__ import annotations

import numpy as np

from pvibr.maths.quaternions import to_matrices
from pvibr.maths.vectors import unit_vectors


def trs(translations, quaternions=None, scales=None):
    """Return matrices that scale, then rotate, then translate.

    Parameters
    ----------
    translations : array_like, shape (n, 3)
        World units.
    quaternions : array_like, shape (n, 4) or (4,), optional
        Rotations (w, x, y, z).
    scales : array_like, shape (n, 3), (n,) or scalar, optional
        Factors per axis, or one for all axes.

    Returns
    -------
    numpy.ndarray, shape (n, 4, 4), float64
        ``world_from_model`` per row.

    Examples
    --------
    >>> from pvibr.maths.transforms import trs
    >>> (trs([[1.0, 2.0, 3.0]], scales=2.0)[0] @ [1, 1, 1, 1]).tolist()
    [3.0, 4.0, 5.0, 1.0]
    """
    translations = np.atleast_2d(np.asarray(translations, dtype=np.float64))
    matrices = np.zeros((len(translations), 4, 4))
    matrices[:, :3, :3] = np.eye(3) if quaternions is None else to_matrices(quaternions)
    if scales is not None:
        scales = np.asarray(scales, dtype=np.float64)
        per_axis = scales if scales.ndim == 2 else scales.reshape(-1, 1)
        matrices[:, :3, :3] *= per_axis[:, None, :]
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1
    return matrices


def inverses(matrices):
    """Return the inverses of affine matrices; of flat ones those within their planes.

    Parameters
    ----------
    matrices : array_like, shape (..., 4, 4)
        Affine matrices, which may scale an axis to nothing.

    Returns
    -------
    numpy.ndarray, shape (..., 4, 4), float64
        Inverses; the pseudoinverse of the linear part where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.transforms import inverses
    >>> inverses(np.diag([2.0, 4.0, 0.0, 1.0])).diagonal().tolist()
    [0.5, 0.25, 0.0, 1.0]
    """
    matrices = np.asarray(matrices, dtype=np.float64)
    if np.linalg.det(matrices[..., :3, :3]).all():
        return np.linalg.inv(matrices)
    linear = np.linalg.pinv(matrices[..., :3, :3], rcond=1e-15)
    out = np.zeros_like(matrices)
    out[..., :3, :3] = linear
    out[..., :3, 3] = -np.einsum('...ij,...j->...i', linear, matrices[..., :3, 3])
    out[..., 3, 3] = 1.0
    return out


def transform_points(matrix, points):
    """Return points transformed by a matrix.

    Parameters
    ----------
    matrix : array_like, shape (4, 4)
        Affine ``b_from_a``.
    points : array_like, shape (n, 3)
        Points in space a.

    Returns
    -------
    numpy.ndarray, shape (n, 3), float64
        Points in space b.

    Examples
    --------
    >>> from pvibr.maths.transforms import transform_points
    >>> transform_points(np.diag([2.0, 2.0, 2.0, 1.0]), [[1.0, 2.0, 3.0]]).tolist()
    [[2.0, 4.0, 6.0]]
    """
    matrix = np.asarray(matrix, dtype=np.float64)
    return np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def transform_normals(matrix, normals):
    """Return unit normals of a surface whose points are moved by a matrix.

    Parameters
    ----------
    matrix : array_like, shape (4, 4)
        Affine ``b_from_a`` with an inverse.
    normals : array_like, shape (n, 3)
        Normals in space a; a zero normal stays zero.

    Returns
    -------
    numpy.ndarray, shape (n, 3), float64
        Normals in space b. A mirroring matrix keeps outward normals outward.

    Examples
    --------
    >>> from pvibr.maths.transforms import transform_normals
    >>> transform_normals(np.diag([1.0, 1.0, -5.0, 1.0]), [[0.0, 0.0, 1.0]]).tolist()
    [[0.0, 0.0, -1.0]]
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    # Normals are covectors: n . v must keep its value, so a row times the inverse.
    return unit_vectors(np.asarray(normals, dtype=np.float64) @ np.linalg.inv(linear)) + 0.0


def signs_of(matrices):
    """Return the signs of the determinants of affine matrices: negative ones mirror.

    Parameters
    ----------
    matrices : numpy.ndarray, shape (..., 4, 4) or (..., 3, 4), float
        The matrices, or their upper rows.

    Returns
    -------
    numpy.ndarray, shape (...), float
        -1, 0 or 1 for each.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.transforms import signs_of
    >>> signs_of(np.diag([2.0, -3.0, 1.0, 1.0]))
    np.float64(-1.0)
    """
    if matrices.ndim == 2:  # plain numbers: each of many figures is asked in each frame
        (a, b, c), (d, e, f), (g, h, i) = matrices[:3, :3].tolist()
    else:
        (a, b, c), (d, e, f), (g, h, i) = (
            [matrices[..., row, column] for column in range(3)] for row in range(3)
        )
    return np.sign(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
