"""Rotations as unit quaternions (w, x, y, z) in float64, with any leading axes.

``multiply(a, b)`` turns by b first and then by a, as matrices on column vectors do. A quaternion
and its negative are the same rotation.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.vectors import as_units

_TINY = 1e-100


def normalized(quaternions):
    """Return quaternions of length one; zero ones are an error."""
    return _units('quaternions', quaternions, 4)


def multiply(a, b):
    """Return the Hamilton products of quaternions: rotation b, then a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, dtype=np.float64), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def conjugate(quaternions):
    """Return the inverses of unit quaternions."""
    return np.asarray(quaternions, dtype=np.float64) * [1, -1, -1, -1]


def rotate(quaternions, vectors):
    """Return vectors rotated by unit quaternions."""
    q = np.asarray(quaternions, dtype=np.float64)
    v = np.asarray(vectors, dtype=np.float64)
    twice = 2 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice + np.cross(q[..., 1:], twice)


def to_matrices(quaternions):
    """Return the rotation matrices, (..., 3, 3), of quaternions of any length but zero."""
    return unit_matrices(normalized(quaternions))


def unit_matrices(quaternions):
    """Return the rotation matrices, (..., 3, 3), of unit quaternions, which are not checked."""
    # Element by element: a product of long and narrow matrices would wake BLAS's threads.
    parts = np.ascontiguousarray(np.moveaxis(quaternions, -1, 0))
    (wx, xx, xy, xz), (wy, _, yy, yz), (wz, _, _, zz) = 2 * parts[1:, None] * parts
    first = 1 - yy - zz, xy - wz, xz + wy
    second = xy + wz, 1 - xx - zz, yz - wx
    third = xz - wy, yz + wx, 1 - xx - yy
    return np.stack([*first, *second, *third], -1).reshape(*quaternions.shape[:-1], 3, 3)


def from_matrices(matrices):
    """Return the unit quaternions, w not negative, of rotation matrices (..., 3, 3)."""
    m = np.asarray(matrices, dtype=np.float64)
    if m.shape[-2:] != (3, 3):
        raise ValueError(f'matrices must have shape (..., 3, 3), got {m.shape}')
    x, y, z = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    s01, s02, s12 = (m[..., j, i] + m[..., i, j] for i, j in ((0, 1), (0, 2), (1, 2)))
    d01, d02, d12 = (m[..., j, i] - m[..., i, j] for i, j in ((0, 1), (0, 2), (1, 2)))
    # Rows of 4 q q^T: each is a multiple of q; the one with the largest diagonal is most exact.
    outer_products = np.stack(
        [
            *(1 + x + y + z, d12, -d02, d01),
            *(d12, 1 + x - y - z, s01, s02),
            *(-d02, s01, 1 - x + y - z, s12),
            *(d01, s02, s12, 1 - x - y + z),
        ],
        axis=-1,
    ).reshape(*m.shape[:-2], 4, 4)
    largest_row = np.diagonal(outer_products, axis1=-2, axis2=-1).argmax(-1)
    q = np.take_along_axis(outer_products, largest_row[..., None, None], axis=-2)[..., 0, :]
    return _positive(_units('matrices', q, 4))


def from_axis_angle(axes, angles):
    """Return the quaternions of rotations about axes of any length, by angles in radians."""
    half = np.asarray(angles, dtype=np.float64)[..., None] / 2
    xyz = np.sin(half) * _units('axes', axes, 3)
    return np.concatenate([np.broadcast_to(np.cos(half), (*xyz.shape[:-1], 1)), xyz], axis=-1)


def between(u, v):
    """Return the shortest rotations from directions u to directions v; a half turn if opposite."""
    u, v = np.broadcast_arrays(_units('u', u, 3), _units('v', v, 3))
    # (1 + u . v, u x v); the sum's length keeps its digits for opposite directions.
    w = np.square(u + v).sum(-1, keepdims=True) / 2
    q = np.concatenate([w, np.cross(u, v)], axis=-1)
    is_opposite = np.abs(q).max(-1, keepdims=True) < 1e-8
    least_axis = np.eye(3)[np.abs(u).argmin(-1)]
    half_turns = np.concatenate([np.zeros_like(w), np.cross(u, least_axis)], axis=-1)
    return normalized(np.where(is_opposite, half_turns, q))


def slerp(a, b, t):
    """Interpolate rotations along the shortest arc, from a at t = 0 to b at 1, or beyond."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    t = np.asarray(t, dtype=np.float64)[..., None]
    b = np.where((a * b).sum(-1, keepdims=True) < 0, -b, b)
    # The half angle from both diagonals loses no digit for close ones. It is at most a quarter
    # turn: only zero is special, and a tiny angle stands in for it.
    half_angle = np.maximum(2 * np.arctan2(_length(a - b), _length(a + b)), _TINY)
    return (a * np.sin((1 - t) * half_angle) + b * np.sin(t * half_angle)) / np.sin(half_angle)


def swing_twist(quaternions, axis):
    """Split rotations into a swing of an axis and a twist about it; the twist comes first.

    The twist is the identity where the swing is a half turn.
    """
    q = np.asarray(quaternions, dtype=np.float64)
    axis = _units('axis', axis, 3)
    axis_component = (q[..., 1:] * axis).sum(-1, keepdims=True)
    w = np.broadcast_to(q[..., :1], axis_component.shape)
    twist = np.concatenate([w, axis_component * axis], axis=-1)
    length = _length(twist)
    twist = np.where(length > 1e-12, twist / np.maximum(length, 1e-12), [1.0, 0, 0, 0])
    return multiply(q, conjugate(twist)), twist


def log(quaternions):
    """Return the rotation vectors (axis times angle up to pi) of unit quaternions."""
    q = _positive(np.asarray(quaternions, dtype=np.float64))
    sine = _length(q[..., 1:])
    half_angle = np.arctan2(sine, q[..., :1])
    # sin(half) / half is the safe side of the quotient: it is 1 without a rotation.
    return 2 * q[..., 1:] / np.sinc(half_angle / np.pi)


def exp(vectors):
    """Return the unit quaternions of rotation vectors; undoes :func:`log`."""
    v = np.asarray(vectors, dtype=np.float64) / 2
    half = _length(v)
    return np.concatenate([np.cos(half), v * np.sinc(half / np.pi)], axis=-1)


def _length(vectors):
    return np.sqrt(np.einsum('...i,...i->...', vectors, vectors))[..., None]


def _positive(quaternions):
    """Return quaternions with non-negative w."""
    return np.where(quaternions[..., :1] < 0, -quaternions, quaternions) + 0.0


def _units(name, vectors, size):
    """Return unit vectors of `size` components."""
    v = np.asarray(vectors, dtype=np.float64)
    if v.shape[-1:] != (size,):
        raise ValueError(f'{name} must have shape (..., {size}), got {v.shape}')
    return as_units(name, v)
