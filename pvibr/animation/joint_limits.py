"""Joint limits: how far a joint may swing and twist from its rest rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pvibr.animation.batched_quaternions import cross, product
from pvibr.core.arguments import checked_direction
from pvibr.maths import quaternions

_ON_BOUND = 1e-9  # radians from a bound that count as on it
_NO_TWIST = 1e-6  # swings of half a turn, to this sine, leave the twist undefined
_CONJUGATE = np.array([[1.0], [-1.0], [-1.0], [-1.0]])


@dataclass(frozen=True)
class JointLimit:
    """How far one joint may turn from its rest rotation.

    Parameters
    ----------
    axis : sequence of float, length 3
        Twist axis in the joint's space at rest, of any length: for a bone its direction, for a
        hinge its pin.
    swing : float, default: pi
        Largest angle between the axis and its rest direction, in radians, 0 to pi.
    twist : tuple of float, default: (-pi, pi)
        Range of the twist about the axis in radians; a range of 2 pi is unlimited.

    Raises
    ------
    ValueError
        If the axis is zero, the swing is outside 0 to pi, or the twist range is empty or more
        than a full turn.

    Examples
    --------
    >>> from pvibr.animation import JointLimit
    >>> JointLimit.hinge([1, 0, 0], 0.0, 2.5)
    JointLimit(axis=(1.0, 0.0, 0.0), swing=0.0, twist=(0.0, 2.5))
    """

    axis: tuple
    swing: float = math.pi
    twist: tuple = (-math.pi, math.pi)

    def __post_init__(self):
        if not 0 <= self.swing <= math.pi:
            raise ValueError(f'swing must be from 0 to pi, in radians, got {self.swing}')
        lower_bound, upper_bound = map(float, self.twist)
        if not 0 <= upper_bound - lower_bound <= 2 * math.pi * (1 + 1e-12):
            raise ValueError(f'twist must be (low, high), at most 2 pi apart, got {self.twist}')
        object.__setattr__(self, 'axis', tuple(checked_direction('axis', self.axis).tolist()))
        object.__setattr__(self, 'swing', float(self.swing))
        object.__setattr__(self, 'twist', (lower_bound, upper_bound))

    @classmethod
    def hinge(cls, axis, low=-math.pi, high=math.pi):
        """Return the limit of a joint that turns about one axis only, without swing.

        Parameters
        ----------
        axis : sequence of float, length 3
            Axis in the joint's space at rest.
        low, high : float
            Range of the angle in radians.
        """
        return cls(axis, 0.0, (low, high))


class Limits:
    """The limits of some of n joints, enforced together."""

    def __init__(self, limits, rest):
        self.rest = quaternions.normalized(rest)
        joint_count = len(self.rest)
        free_limit = JointLimit((0.0, 0.0, 1.0))
        joint_limits = [limits.get(joint, free_limit) for joint in range(joint_count)]
        self.axis = np.array([limit.axis for limit in joint_limits]).reshape(joint_count, 3)
        self.swing = np.array([limit.swing for limit in joint_limits])
        low, high = np.array([limit.twist for limit in joint_limits]).reshape(joint_count, 2).T
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        #: Limited joints, which :meth:`cut` takes.
        self.limited_joints = np.array(sorted(limits), dtype=np.int64)
        self._axis = self.axis[self.limited_joints].T.copy()
        smallest = np.abs(self.axis).argmin(1)
        sideways = np.cross(self.axis, np.eye(3)[smallest])[self.limited_joints].T
        self._sideways = sideways / np.sqrt((sideways * sideways).sum(0))
        self._swing, self._middle, self._half = (
            values[self.limited_joints] for values in (self.swing, self.middle, self.half)
        )
        # A full turn or swing is unlimited.
        self._twist_end = np.where(self._half < np.pi - _ON_BOUND, self._half, np.inf)
        self._swing_end = np.where(self._swing < np.pi - _ON_BOUND, self._swing, np.inf)

    def clamped(self, rotations):
        """Return rotations clamped to the limits."""
        rotations = np.array(rotations, dtype=np.float64)
        rest_columns = self.rest[self.limited_joints].T
        from_rest = product(rest_columns * _CONJUGATE, rotations[self.limited_joints].T)
        rotations[self.limited_joints] = product(rest_columns, self.cut(from_rest).rotations).T
        return rotations

    def cut(self, from_rest):
        """Clamp the rotations of the limited joints, and locate them within their limits."""
        axis = self._axis
        w, xyz = from_rest[0], from_rest[1:]
        twist_part = (xyz * axis).sum(0)
        across = xyz - twist_part * axis
        length = np.sqrt(w * w + twist_part * twist_part)
        half_twist = np.where(length > _NO_TWIST, np.arctan2(twist_part, w), self._middle / 2)
        # Relative to the middle of its range the twist is clamped to the nearer end round the
        # circle, so that ranges beyond half a turn need no special case.
        twist_angle = 2 * half_twist - self._middle
        twist_angle -= 2 * np.pi * np.rint(twist_angle / (2 * np.pi))
        twist_angle = np.minimum(np.maximum(twist_angle, -self._half), self._half)
        # The swing remains after the twist: its axis is turned back by half the twist.
        across = np.cos(half_twist) * across - np.sin(half_twist) * cross(across, axis)
        sine = np.sqrt((across * across).sum(0))
        outward = np.where(sine > 1e-12, across / np.maximum(sine, 1e-12), self._sideways)
        swing_angle = 2 * np.arctan2(sine, length)
        swing_angle = np.minimum(swing_angle, self._swing)
        swing_twist = np.empty((2, *from_rest.shape))  # swing, twist
        swing_twist[0, 0] = np.cos(swing_angle / 2)
        swing_twist[0, 1:] = np.sin(swing_angle / 2) * outward
        half_twist = (twist_angle + self._middle) / 2
        swing_twist[1, 0] = np.cos(half_twist)
        swing_twist[1, 1:] = np.sin(half_twist) * axis
        at_bounds = np.array(
            [
                twist_angle <= _ON_BOUND - self._twist_end,
                twist_angle >= self._twist_end - _ON_BOUND,
                swing_angle >= self._swing_end - _ON_BOUND,
            ]
        )
        return Cut(product(swing_twist[0], swing_twist[1]), swing_twist[0], outward, at_bounds)

    def excess(self, rotations):
        """Return by how many radians rotations exceed their limits, shape (n,)."""
        from_rest = quaternions.multiply(quaternions.conjugate(self.rest), rotations)
        swing, twist = quaternions.swing_twist(from_rest, self.axis)
        twist_offset = (quaternions.log(twist) * self.axis).sum(-1) - self.middle
        twist_offset = np.abs(np.remainder(twist_offset + np.pi, 2 * np.pi) - np.pi)
        length = np.hypot(from_rest[:, 0], (from_rest[:, 1:] * self.axis).sum(-1))
        twist_offset = np.where(length > _NO_TWIST, twist_offset, 0.0)
        swing = np.linalg.norm(quaternions.log(swing), axis=-1)
        excess_angle = np.maximum(np.maximum(swing - self.swing, twist_offset - self.half), 0.0)
        return np.where(np.isin(np.arange(len(self.rest)), self.limited_joints), excess_angle, 0.0)


class Cut(NamedTuple):
    """Clamped rotations from rest, components first."""

    rotations: np.ndarray
    swing: np.ndarray
    outward: np.ndarray
    ends: np.ndarray
