"""Changes of space as 4x4 matrices on column vectors (``a_from_b @ b``)."""

from __future__ import annotations

import numpy as np

from pvibr.maths.quaternions import to_matrices
from pvibr.maths.vectors import unit_vectors

#: Names of the columns of poses in tables.
AXES = ('x', 'y', 'z')
QUATERNION = ('qw', 'qx', 'qy', 'qz')
AXIS_SCALES = ('sx', 'sy', 'sz')


def trs(translations, quaternions=None, scales=None):
    """Return matrices (n, 4, 4) that scale, by axis or as a whole, then rotate, then translate."""
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


def turns_and_scales(linear):
    """Return rotations (n, 3, 3) and scales (n, 3) of matrices; a mirror is a negative z."""
    # The nearest rotations of what is sheared. Axes scaled to nothing get directions at right
    # angles to the others.
    scales = np.linalg.norm(linear, axis=1)
    left, _, right = np.linalg.svd(linear / np.where(scales > 0, scales, 1.0)[:, None])
    rotations, mirror_signs = left @ right, np.ones_like(scales)
    mirror_signs[np.linalg.det(rotations) < 0, 2] = -1.0
    return rotations * mirror_signs[:, None], scales * mirror_signs


def inverses(matrices):
    """Return the inverses of affine matrices (..., 4, 4); pseudoinverses where one is singular."""
    matrices = np.asarray(matrices, dtype=np.float64)
    if np.linalg.det(matrices[..., :3, :3]).all():
        return np.linalg.inv(matrices)
    linear = np.linalg.pinv(matrices[..., :3, :3], rcond=1e-15)
    inverse_matrices = np.zeros_like(matrices)
    inverse_matrices[..., :3, :3] = linear
    inverse_matrices[..., :3, 3] = -np.einsum('...ij,...j->...i', linear, matrices[..., :3, 3])
    inverse_matrices[..., 3, 3] = 1.0
    return inverse_matrices


def transform_points(matrix, points):
    """Return points (n, 3) transformed by an affine matrix (4, 4)."""
    matrix = np.asarray(matrix, dtype=np.float64)
    return np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def transform_normals(matrix, normals):
    """Return unit normals of a surface moved by a matrix; mirrors keep outward ones outward."""
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    # Normals are covectors: n . v must keep its value, so a row times the inverse.
    return unit_vectors(np.asarray(normals, dtype=np.float64) @ np.linalg.inv(linear)) + 0.0


def signs_of(matrices):
    """Return the signs of the determinants of affine matrices, (..., 3 or 4, 4): -1 mirrors."""
    if matrices.ndim == 2:  # plain numbers: called for each of many figures in each frame
        (a, b, c), (d, e, f), (g, h, i) = matrices[:3, :3].tolist()
    else:
        (a, b, c), (d, e, f), (g, h, i) = (
            [matrices[..., row, column] for column in range(3)] for row in range(3)
        )
    return np.sign(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
