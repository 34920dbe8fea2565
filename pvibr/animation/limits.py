"""Joint limits: how far a joint may swing and twist from its rest rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pvibr.animation.batched_quaternions import cross, product
from pvibr.maths import quaternions
from pvibr.maths.arguments import checked_direction

_AT = 1e-9  # radians from a bound that count as on it
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
            raise ValueError(f'swing is {self.swing}; it must be from 0 to pi, in radians.')
        low, high = map(float, self.twist)
        if not 0 <= high - low <= 2 * math.pi * (1 + 1e-12):
            raise ValueError(f'twist is {self.twist}; it must be (low, high), at most 2 pi apart.')
        object.__setattr__(self, 'axis', tuple(checked_direction('axis', self.axis).tolist()))
        object.__setattr__(self, 'swing', float(self.swing))
        object.__setattr__(self, 'twist', (low, high))

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
        n = len(self.rest)
        for joint in limits:
            if not 0 <= joint < n:
                raise ValueError(f'limits has joint {joint}; there are joints 0 to {n - 1}.')
        free = JointLimit((0.0, 0.0, 1.0))
        all_ = [limits.get(joint, free) for joint in range(n)]
        self.axis = np.array([limit.axis for limit in all_]).reshape(n, 3)
        self.swing = np.array([limit.swing for limit in all_])
        low, high = np.array([limit.twist for limit in all_]).reshape(n, 2).T
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        #: Limited joints, which :meth:`cut` takes.
        self.at = np.array(sorted(limits), dtype=np.int64)
        self._axis = self.axis[self.at].T.copy()
        sideways = np.cross(self.axis, np.eye(3)[np.abs(self.axis).argmin(1)])[self.at].T
        self._sideways = sideways / np.sqrt((sideways * sideways).sum(0))
        self._swing, self._middle, self._half = (
            values[self.at] for values in (self.swing, self.middle, self.half)
        )
        # A full turn or swing is unlimited.
        self._twist_end = np.where(self._half < np.pi - _AT, self._half, np.inf)
        self._swing_end = np.where(self._swing < np.pi - _AT, self._swing, np.inf)

    def clamped(self, rotations):
        """Return rotations clamped to the limits."""
        rotations = np.array(rotations, dtype=np.float64)
        rest = self.rest[self.at].T
        away = product(rest * _CONJUGATE, rotations[self.at].T)
        rotations[self.at] = product(rest, self.cut(away).rotations).T
        return rotations

    def cut(self, away):
        """Clamp the rotations of the limited joints, and locate them within their limits."""
        axis = self._axis
        w, xyz = away[0], away[1:]
        along = (xyz * axis).sum(0)
        across = xyz - along * axis
        half_twist = np.arctan2(along, w)
        # Relative to the middle of its range the twist is clamped to the nearer end round the
        # circle, so that ranges beyond half a turn need no special case.
        twist = 2 * half_twist - self._middle
        twist -= 2 * np.pi * np.rint(twist / (2 * np.pi))
        twist = np.minimum(np.maximum(twist, -self._half), self._half)
        # The swing remains after the twist: its axis is turned back by half the twist.
        across = np.cos(half_twist) * across - np.sin(half_twist) * cross(across, axis)
        sine = np.sqrt((across * across).sum(0))
        outward = np.where(sine > 1e-12, across / np.maximum(sine, 1e-12), self._sideways)
        angle = 2 * np.arctan2(sine, np.sqrt(w * w + along * along))
        angle = np.minimum(angle, self._swing)
        turns = np.empty((2, *away.shape))  # swing, twist
        turns[0, 0] = np.cos(angle / 2)
        turns[0, 1:] = np.sin(angle / 2) * outward
        half_twist = (twist + self._middle) / 2
        turns[1, 0] = np.cos(half_twist)
        turns[1, 1:] = np.sin(half_twist) * axis
        ends = np.array(
            [
                twist <= _AT - self._twist_end,
                twist >= self._twist_end - _AT,
                angle >= self._swing_end - _AT,
            ]
        )
        return Cut(product(turns[0], turns[1]), turns[0], outward, ends)

    def excess(self, rotations):
        """Return by how many radians rotations exceed their limits, shape (n,)."""
        away = quaternions.multiply(quaternions.conjugate(self.rest), rotations)
        swing, twist = quaternions.swing_twist(away, self.axis)
        off = (quaternions.log(twist) * self.axis).sum(-1) - self.middle
        off = np.abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi)
        swing = np.linalg.norm(quaternions.log(swing), axis=-1)
        beyond = np.maximum(np.maximum(swing - self.swing, off - self.half), 0.0)
        return np.where(np.isin(np.arange(len(self.rest)), self.at), beyond, 0.0)


class Cut(NamedTuple):
    """Clamped rotations from rest, components first."""

    rotations: np.ndarray
    swing: np.ndarray
    outward: np.ndarray
    ends: np.ndarray
