"""Inverse kinematics joint by joint: cyclic coordinate descent and FABRIK."""

from __future__ import annotations

import math

_NONE = (1.0, 0.0, 0.0, 0.0)


class Sweeps:
    """A chain in plain floats, and its targets."""

    def __init__(self, chain, rotations, effectors, targets, weights):
        self.parents = chain.parents.tolist()
        self.offsets = _tuples(chain.offsets)
        self.lengths = chain.lengths.tolist()
        self.limits = _plain_limits(chain.limits)
        self.goals = list(zip(effectors, _tuples(targets), weights, strict=True))
        joint_count = len(self.parents)
        # The goals beyond each joint, and the total weight of the goals it serves.
        self.beyond: list = [[] for _ in range(joint_count)]
        self.load = [0.0] * joint_count
        for goal in self.goals:
            for joint in chain.path(goal[0]):
                self.load[joint] += goal[2]
                if joint != goal[0]:
                    self.beyond[joint].append(goal)
        self.children: list = [[] for _ in range(joint_count)]
        for joint, parent in enumerate(self.parents):
            if parent >= 0 and self.load[joint] > 0:
                self.children[parent].append(joint)
        self.rotations = _tuples(rotations)
        self.world = [_NONE] * joint_count
        self.origins = [(0.0, 0.0, 0.0)] * joint_count
        self._place()

    def errors(self):
        """Return the distance of each effector from its target."""
        return [math.dist(self.origins[effector], goal) for effector, goal, _ in self.goals]

    def ccd(self):
        """Turn each joint, the last first, so that the effectors beyond it come nearest.

        Wang and Chen (1991), "A combined optimization method for solving the inverse kinematics
        problems of mechanical manipulators"; several effectors count by their weights.
        """
        for joint in range(len(self.parents) - 1, -1, -1):
            origin = self.origins[joint]
            vector_pairs = [
                (_minus(self.origins[effector], origin), _minus(goal, origin), weight)
                for effector, goal, weight in self.beyond[joint]
            ]
            if vector_pairs:
                rotation_before = self.world[joint]
                self._turn(joint, vector_pairs)
                joint_turn = _product(self.world[joint], _conjugate(rotation_before))
                # Joints nearer the root need only the effectors before all are placed again.
                for effector, _, _ in self.beyond[joint]:
                    turned = _rotated(joint_turn, _minus(self.origins[effector], origin))
                    self.origins[effector] = _plus(origin, turned)
        self._place()

    def fabrik(self):
        """Place the joints from the targets back to the root, then turn each to its place.

        Aristidou and Lasenby (2011), "FABRIK: a fast, iterative solver for the inverse kinematics
        problem"; where branches meet, the joint takes the weighted mean.
        """
        joint_goals = self._backward_pass()
        for joint, parent in enumerate(self.parents):
            self._set(joint, parent)
            origin = self.origins[joint]
            vector_pairs = [
                (
                    _rotated(self.world[joint], self.offsets[child]),
                    _minus(joint_goals[child], origin),
                    self.load[child],
                )
                for child in self.children[joint]
            ]
            if vector_pairs:
                self._turn(joint, vector_pairs)

    def _backward_pass(self):
        """Return where each joint must be for the effectors to be at their targets."""
        sums = [(0.0, 0.0, 0.0)] * len(self.parents)
        for effector, goal, weight in self.goals:
            sums[effector] = _plus(sums[effector], goal, weight)
        goal_weights = [0.0] * len(self.parents)
        for effector, _, weight in self.goals:
            goal_weights[effector] += weight
        goals = list(self.origins)
        for joint in range(len(self.parents) - 1, -1, -1):
            parent = self.parents[joint]
            if goal_weights[joint] > 0:
                goals[joint] = _scaled(sums[joint], 1 / goal_weights[joint])
                if parent >= 0:
                    way = _minus(self.origins[parent], goals[joint])
                    distance = math.hypot(*way)
                    ratio = self.lengths[joint] / distance if distance > 0 else 0.0
                    joint_load = self.load[joint]
                    sums[parent] = _plus(sums[parent], _plus(goals[joint], way, ratio), joint_load)
                    goal_weights[parent] += joint_load
        return goals

    def _turn(self, joint, vector_pairs):
        """Turn a joint so that vectors (from, to, weight) align best, within its limit."""
        parent = self.parents[joint]
        joint_limit = self.limits[joint]
        parent_rotation = _NONE if parent < 0 else self.world[parent]
        hinge_axis = None
        if joint_limit is not None and joint_limit[2] == 0:  # a hinge
            hinge_axis = _rotated(_product(parent_rotation, joint_limit[0]), joint_limit[1])
        turned_rotation = _product(_best(vector_pairs, hinge_axis), self.world[joint])
        rotation = _product(_conjugate(parent_rotation), turned_rotation)
        self.rotations[joint] = _clamped(rotation, joint_limit)
        self.world[joint] = _product(parent_rotation, self.rotations[joint])

    def _set(self, joint, parent):
        """Place a joint by its parent."""
        if parent < 0:
            self.origins[joint], self.world[joint] = self.offsets[joint], self.rotations[joint]
        else:
            parent_rotation = self.world[parent]
            turned_offset = _rotated(parent_rotation, self.offsets[joint])
            self.origins[joint] = _plus(self.origins[parent], turned_offset)
            self.world[joint] = _product(parent_rotation, self.rotations[joint])

    def _place(self):
        for joint, parent in enumerate(self.parents):
            self._set(joint, parent)


def _best(vector_pairs, hinge_axis):
    """Return the rotation that aligns vectors best; about a pin, if there is one."""
    quaternion_sum, length_sum = (0.0, 0.0, 0.0, 0.0), 0.0
    for u, v, weight in vector_pairs:
        if hinge_axis is not None:
            u, v = _across(u, hinge_axis), _across(v, hinge_axis)
        weighted_length = weight * math.hypot(*u) * math.hypot(*v)
        weighted_axis = _scaled(_cross(u, v), weight)
        quaternion_sum = (
            quaternion_sum[0] + weighted_length + weight * _dot(u, v),
            *_plus(quaternion_sum[1:], weighted_axis),
        )
        length_sum += weighted_length
    if math.hypot(*quaternion_sum) > 1e-12 * length_sum:
        return _unit(quaternion_sum)
    # No turn, or half a turn: about the pin, or any perpendicular axis.
    return (0.0, *(hinge_axis or _any_across(u))) if length_sum > 0 else _NONE


def _plain_limits(limits):
    """Return (rest, axis, swing, middle, half) of each joint, or None if it is free."""
    columns = limits.rest, limits.axis, limits.swing, limits.middle, limits.half
    joint_limits = [None] * len(limits.rest)
    for joint in limits.limited_joints.tolist():
        joint_limits[joint] = tuple(column[joint].tolist() for column in columns)
    return joint_limits


def _clamped(rotation, limit):
    """Clamp a rotation as :meth:`pvibr.animation.joint_limits.Limits.clamped` does."""
    if limit is None:
        return _unit(rotation)
    rest, axis, swing, middle, half = limit
    w, *xyz = _product(_conjugate(rest), rotation)
    along = _dot(xyz, axis)
    half_twist = math.atan2(along, w)
    across = _across(xyz, axis)
    # The swing remains after the twist: its axis is turned back by half the twist.
    across = _plus(
        _scaled(across, math.cos(half_twist)), _cross(across, axis), -math.sin(half_twist)
    )
    sine = math.hypot(*across)
    swing_angle = min(2 * math.atan2(sine, math.hypot(w, along)), swing)
    twist = min(max(math.remainder(2 * half_twist - middle, 2 * math.pi), -half), half) + middle
    sine_ratio = math.sin(swing_angle / 2) / sine if sine > 0 else 0.0
    swung = math.cos(swing_angle / 2), *_scaled(across, sine_ratio)
    twisted = math.cos(twist / 2), *_scaled(axis, math.sin(twist / 2))
    return _unit(_product(rest, _product(swung, twisted)))


def _product(a, b):
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _conjugate(q):
    return q[0], -q[1], -q[2], -q[3]


def _rotated(q, v):
    w, x, y, z = q
    a, b, c = v
    i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i


def _unit(q):
    size = math.hypot(*q)
    return tuple(value / size for value in q)


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _plus(a, b, factor=1.0):
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _scaled(a, factor):
    return a[0] * factor, a[1] * factor, a[2] * factor


def _across(v, axis):
    """Return the part of a vector perpendicular to a unit axis."""
    return _plus(v, axis, -_dot(v, axis))


def _any_across(v):
    """Return a unit vector perpendicular to another."""
    smallest_axis = min(range(3), key=lambda i: abs(v[i]))
    across = _cross(v, [float(i == smallest_axis) for i in range(3)])
    return _scaled(across, 1 / math.hypot(*across))


def _tuples(array):
    return [tuple(row) for row in array.tolist()]
