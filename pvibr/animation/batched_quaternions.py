"""Quaternions of few joints, components first (4, n): as in maths, faster at small n."""

from __future__ import annotations

import numpy as np

from pvibr.maths import quaternions

_E = np.eye(4)
_PRODUCT = np.moveaxis(quaternions.multiply(_E[:, None], _E), -1, 0).reshape(4, 16)
# Entry (c, b) of the rotation matrix is component c of q e_b q*.
_MATRIX = np.einsum(
    'ibjc->cbij',
    quaternions.multiply(
        quaternions.multiply(_E[:, None], _E[1:])[:, :, None], quaternions.conjugate(_E)
    )[..., 1:],
).reshape(9, 16)

#: Cross products: CROSS @ (all products of two components); (a @ CROSS) is v -> v x a.
CROSS = np.array([[np.cross(a, b) for b in np.eye(3)] for a in np.eye(3)]).reshape(3, 9)


def product(a, b):
    """Return products of quaternions: rotation b, then a."""
    return _PRODUCT @ (a[:, None] * b).reshape(16, -1)


def matrices(rotations):
    """Return rotation matrices."""
    return (_MATRIX @ (rotations[:, None] * rotations).reshape(16, -1)).T.reshape(-1, 3, 3)


def cross(a, b):
    """Return cross products."""
    return CROSS @ (a[:, None] * b).reshape(9, -1)
