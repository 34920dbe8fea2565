"""Inverse kinematics by damped Gauss-Newton steps with bounds: all joints and effectors at once.

Each joint has three directions: twist, swing outward and swing sideways. Directions that would
cross a limit are left out of a step, so that other joints compensate; overshoot is clamped. Steps
as in Buss (2004), "Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and
damped least squares methods"; damping is adapted as by Levenberg and Marquardt.
"""

from __future__ import annotations

import math
import operator
from typing import NamedTuple

import numpy as np

from pvibr.animation.batched_quaternions import CROSS, cross, product

_DAMPING = 0.1, 1e-5  # of the mean square of the Jacobian: per missing share of reach, minimum
_LARGEST_STEP = 0.6  # radians of any joint: linearisation fails beyond
_ROUNDS = 3  # of leaving out directions that would cross a limit, per step
_GAIN = 0.05  # share of the squared error that an accepted step must remove
_STUCK = 1.0  # damping beyond which the solver counts as stuck
_KICKS = 3  # out of poses where no small step helps, such as a straight chain that must fold


def solve(chain, rotations, effectors, targets, weights, tolerances, iterations):
    """Return rotations that bring effectors to targets."""
    task = _Task(chain, effectors, targets, weights)
    current = best_pose = task.pose(product(task.from_rest, rotations.T))
    caution, kick_count, iteration = 1.0, 0, 0
    while iteration < iterations and (best_pose.distances > tolerances).any():
        iteration += 1
        # Far from the target the damping keeps steps short; near it, they are Newton steps.
        damping = caution * (_DAMPING[0] * math.sqrt(current.error) / task.size + _DAMPING[1])
        trial_pose = task.stepped(current, task.step(current, damping))
        if trial_pose.error < current.error * (1 - _GAIN):
            current, caution = trial_pose, max(caution / 8, 1.0)
            best_pose = min(best_pose, current, key=_error)
        elif damping < _STUCK:
            caution *= 16
        elif kick_count < _KICKS:
            kick_count += 1
            current, caution = task.kicked(best_pose, kick_count), 1.0
        else:
            break
    return product(task.rest, best_pose.delta).T, iteration


class _Pose(NamedTuple):
    """A pose of the chain, its residual, and its free directions."""

    delta: np.ndarray  # (4, n) rotations from rest, clamped to the limits
    basis: np.ndarray  # (n, 3, 3) columns: twist, swing outward, swing sideways, at rest
    ends: np.ndarray  # (3, n) bool: twist at its lower end, at its upper end, swing at its bound
    world: np.ndarray  # (n + 1, 4, 4)
    residual: np.ndarray  # (k, 3) effectors to targets, times the square roots of the weights
    distances: np.ndarray  # (k,)
    error: float


_error = operator.attrgetter('error')


class _Task:
    """What stays the same from step to step."""

    def __init__(self, chain, effectors, targets, weights):
        joint_limits = chain.limits
        joint_count = len(chain)
        self.chain, self.effectors, self.targets = chain, effectors, targets
        weights = np.sqrt(weights)  # the sum of weights times squares is minimised
        self.weights = weights[:, None]
        effector_reach = [chain.reach(effector) for effector in effectors]
        self.size = max(float(np.linalg.norm(weights * effector_reach)), 1e-300)
        self.rest = joint_limits.rest.T.copy()
        self.from_rest = self.rest * [[1], [-1], [-1], [-1]]
        self.rest_is_turned = self.rest[1:].any()
        self.rest_matrices = chain.rest_matrices
        # Which joints move which effector, times the square root of its weight.
        self.influence = np.zeros((len(effectors), joint_count, 1))
        for row, (effector, weight) in enumerate(zip(effectors, weights, strict=True)):
            self.influence[row, chain.path(effector)[:-1]] = weight
        self.limits, self.limited_joints = joint_limits, joint_limits.limited_joints
        self.axis = joint_limits.axis[self.limited_joints].T.copy()
        self.straight = np.tile(np.eye(3), (joint_count, 1, 1))
        self.free = np.zeros((3, joint_count), dtype=bool)
        self.can_turn = np.ones((joint_count, 3))
        self.can_turn[self.limited_joints[joint_limits.swing[self.limited_joints] == 0], 1:] = (
            0.0  # hinges only twist
        )

    def pose(self, delta):
        """Return rotations clamped to the limits, with their residual."""
        joint_basis, at_bounds = self.straight.copy(), self.free.copy()
        if len(self.limited_joints):
            limited = self.limits.cut(delta.take(self.limited_joints, 1))
            delta[:, self.limited_joints] = limited.rotations
            at_bounds[:, self.limited_joints] = limited.ends
            # The twist's direction lies halfway between the axis and the swung axis.
            twisting = limited.swing[0] * self.axis + cross(limited.swing[1:], self.axis)
            directions = twisting, limited.outward, cross(twisting, limited.outward)
            joint_basis[self.limited_joints] = np.array(directions).transpose(2, 1, 0)
        world = self.chain.scanned(product(self.rest, delta) if self.rest_is_turned else delta)
        target_offsets = self.targets - world[self.effectors + 1, :3, 3]
        residual = target_offsets * self.weights
        distances = np.sqrt((target_offsets * target_offsets).sum(1))
        error = float((residual**2).sum())
        return _Pose(delta, joint_basis, at_bounds, world, residual, distances, error)

    def step(self, pose, damping):
        """Return small rotations (n, 3) along each joint's three directions."""
        k, n = self.influence.shape[:2]
        joint_origins = pose.world[1:, :3, 3]
        offsets = (joint_origins[self.effectors, None] - joint_origins) * self.influence
        parents = pose.world.take(self.chain.above, 0)[:, :3, :3]
        if self.rest_is_turned:
            parents = parents @ self.rest_matrices
        turns = (offsets @ CROSS).reshape(k, n, 3, 3) @ (parents @ pose.basis)
        # Rows: effectors' coordinates; columns: joints' directions.
        jacobian = turns.transpose(0, 2, 1, 3).reshape(3 * k, 3 * n)
        residual = pose.residual.reshape(-1)
        if not pose.ends.any():
            return self._least_squares(
                jacobian * self.can_turn.reshape(-1), residual, damping
            ).reshape(n, 3)
        is_open = self.can_turn
        step = residual @ jacobian  # the gradient tells which bounds are active
        for _ in range(_ROUNDS):
            is_open = is_open * ~self._blocked(step.reshape(n, 3), pose.ends)
            step = self._least_squares(jacobian * is_open.reshape(-1), residual, damping)
            if not self._blocked(step.reshape(n, 3), pose.ends).any():
                break
        return step.reshape(n, 3)

    def _least_squares(self, jacobian, residual, damping):
        normal_matrix = jacobian @ jacobian.T
        size = len(normal_matrix)
        normal_matrix.reshape(-1)[:: size + 1] += damping * normal_matrix.trace() / size + 1e-300
        return np.linalg.solve(normal_matrix, residual) @ jacobian

    def _blocked(self, step, at_bounds):
        """Return which directions of a step cross a limit."""
        at_low, at_high, at_swing = at_bounds
        is_blocked = np.zeros(step.shape, dtype=bool)
        is_blocked[:, 0] = np.where(step[:, 0] < 0, at_low, at_high & (step[:, 0] > 0))
        is_blocked[:, 1] = at_swing & (step[:, 1] > 0)
        return is_blocked

    def stepped(self, pose, step, turn_limit=_LARGEST_STEP):
        """Return the pose after a step, clamped to the limits."""
        step = (pose.basis @ step[:, :, None])[:, :, 0].T
        largest_turn = np.sqrt((step * step).sum(0).max(initial=0.0))
        turn = np.empty((4, step.shape[1]))
        turn[0] = 1.0
        turn[1:] = step * (0.5 * min(1.0, turn_limit / max(largest_turn, 1e-300)))
        delta = product(turn, pose.delta)
        return self.pose(delta / np.sqrt((delta * delta).sum(0)))

    def kicked(self, pose, kick_count):
        """Return the pose with all active joints turned at random, reproducibly."""
        random_turns = np.random.default_rng(kick_count).uniform(-1, 1, self.can_turn.shape)
        random_turns = random_turns * self.can_turn * self.influence.any(0)
        return self.stepped(pose, random_turns, turn_limit=0.4 * kick_count)
