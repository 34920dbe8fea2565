"""Linear blend and dual quaternion skinning.

Both give one affine matrix per vertex, which moves the vertex and, by its cofactors, the normal.
Dual quaternions: Kavan, Collins, Zara and O'Sullivan, "Geometric Skinning with Approximate Dual
Quaternion Blending", ACM Transactions on Graphics 27(4), 2008: blending in section 3 (the
antipodal sign in 3.3), scale in two phases in section 4.2. Here each joint stretches about its
own position at rest, so that the result does not depend on the origin.
"""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import checked_number
from pvibr.maths import quaternions
from pvibr.maths.vectors import unit_vectors

MAX_INFLUENCES = 8
_HALF_TURN = 1e-6  # cosine between quaternions, as in posing.glsl


def normalized_weights(weights):
    """Return skin weights (v, k) that sum to one per vertex."""
    weights = np.asarray(weights, dtype=np.float64)
    if weights.ndim != 2 or not 1 <= weights.shape[1] <= MAX_INFLUENCES:
        raise ValueError(
            f'weights must have shape (v, 1 to {MAX_INFLUENCES}), got {weights.shape}'
        )
    _refuse(weights, ~np.isfinite(weights).all(1), 'finite')
    _refuse(weights, (weights < 0).any(1), '0 or more')
    # In two steps, so that the sum of very large or small weights stays in range.
    largest = weights.max(1, keepdims=True)
    _refuse(weights, largest[:, 0] == 0, 'above 0 for a joint of each vertex')
    weights = weights / largest
    return weights / weights.sum(1, keepdims=True)


def linear_blend(matrices, joints, weights):
    """Return one matrix per vertex, (v, 3, 4): the weighted mean of its joints' matrices."""
    affine_rows = np.asarray(matrices, dtype=np.float64)[:, :3, :]
    return _weighted(affine_rows, joints, weights)


def dual_blend(matrices, joints, weights, centers=None, bulge=1.0):
    """Return one matrix per vertex, (v, 3, 4): its joints' motions blended as dual quaternions.

    Joints scale about `centers`; `bulge` goes from the linear blend, 0, to the dual one, 1.
    """
    real, dual, stretch = dual_parts(matrices, centers)
    joints = np.asarray(joints)
    weights = np.asarray(weights, dtype=np.float64)
    heaviest = joints[np.arange(len(joints)), weights.argmax(1)]
    # q and -q are one rotation: take that on the side of the heaviest joint's, the short way.
    # Half a turn has two; rounding, which differs in 32 bits, must not decide.
    alignment = np.einsum('vkq,vq->vk', real[joints], real[heaviest])
    signed = np.where(alignment < -_HALF_TURN, -weights, weights)
    blended = rigid(_weighted(real, joints, signed), _weighted(dual, joints, signed))
    rigid_blend = _after(blended, _weighted(stretch, joints, weights))
    if bulge == 1.0:
        return rigid_blend
    checked_number('bulge', bulge, 0, 1)
    linear = linear_blend(matrices, joints, weights)
    return linear + bulge * (rigid_blend - linear)


def dual_parts(matrices, centers=None):
    """Decompose joints into unit dual quaternions (..., m, 4) and the stretch before them.

    The stretch is the affine matrix of scale, shear and mirror about `centers`, (..., m, 3, 4).
    """
    matrices = np.asarray(matrices, dtype=np.float64)
    centers = np.zeros(3) if centers is None else np.asarray(centers, dtype=np.float64)
    rotation, linear = _polar(matrices[..., :3, :3])
    real = quaternions.from_matrices(rotation)
    stretch_shift = centers - _times(linear, centers)
    posed_centers = _times(matrices[..., :3, :3], centers) + matrices[..., :3, 3]
    translation = posed_centers - _times(rotation, centers)
    half_translation = np.concatenate([np.zeros_like(translation[..., :1]), 0.5 * translation], -1)
    stretch = np.concatenate([linear, stretch_shift[..., None]], -1)
    return real, quaternions.multiply(half_translation, real), stretch


def rigid(real, dual):
    """Return the matrices (..., 3, 4) of dual quaternions of any length but zero."""
    real = np.asarray(real, dtype=np.float64)
    length_squared = (real**2).sum(-1, keepdims=True)
    shift = 2 * quaternions.multiply(dual, quaternions.conjugate(real))[..., 1:] / length_squared
    return np.concatenate([quaternions.to_matrices(real), shift[..., None]], -1)


def moved_points(matrices, points):
    """Return points (v, 3), each transformed by its own matrix (v, 3, 4)."""
    matrices = np.asarray(matrices, dtype=np.float64)
    return _times(matrices[..., :3], np.asarray(points, float)) + matrices[..., 3]


def moved_normals(matrices, normals):
    """Return unit normals, each transformed by its own matrix; outward ones stay outward."""
    a, b, c = np.moveaxis(np.asarray(matrices, dtype=np.float64)[..., :3], -1, 0)
    # The cofactors are the inverse transpose times the determinant, and exist without one.
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], -1)
    mirror_sign = np.where((cofactors[..., 0] * a).sum(-1) < 0, -1.0, 1.0)
    turned_normals = _times(cofactors, np.asarray(normals, float)) * mirror_sign[..., None]
    return unit_vectors(turned_normals) + 0.0


def _weighted(values, joints, weights):
    """Return the sum over the joints of each vertex, one column of joints at a time."""
    joints = np.asarray(joints)
    weights = np.asarray(weights, dtype=np.float64)
    weighted_sum = np.zeros((len(joints), *values.shape[1:]))
    for joint, weight in zip(joints.T, weights.T, strict=True):
        weighted_sum += values[joint] * weight.reshape(-1, *[1] * (values.ndim - 1))
    return weighted_sum


def _after(second, first):
    """Return the affine matrices of ``first`` and then ``second``."""
    combined = second[..., :3] @ first
    combined[..., 3] += second[..., 3]
    return combined


def _polar(linear):
    """Return the polar decomposition: rotation, and stretch with any reflection."""
    u, s, vt = np.linalg.svd(linear)
    mirror_sign = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    u[..., 2] *= mirror_sign[..., None]
    s[..., 2] *= mirror_sign
    return u @ vt, np.swapaxes(vt, -1, -2) @ (s[..., None] * vt)


def _times(matrices, vectors):
    return np.einsum('...ij,...j->...i', matrices, vectors)


def _refuse(weights, is_bad, allowed):
    bad_rows = np.flatnonzero(is_bad)
    if len(bad_rows):
        first_row = weights[bad_rows[0]].tolist()
        more = f' and {len(bad_rows) - 1} more' if len(bad_rows) > 1 else ''
        raise ValueError(f'weights must be {allowed}, got {first_row} in row {bad_rows[0]}{more}')
