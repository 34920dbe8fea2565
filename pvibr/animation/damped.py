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
    now = best = task.pose(product(task.from_rest, rotations.T))
    caution, kicks, done = 1.0, 0, 0
    while done < iterations and (best.distances > tolerances).any():
        done += 1
        # Far from the target the damping keeps steps short; near it, they are Newton steps.
        damping = caution * (_DAMPING[0] * math.sqrt(now.error) / task.size + _DAMPING[1])
        trial = task.moved(now, task.step(now, damping))
        if trial.error < now.error * (1 - _GAIN):
            now, caution = trial, max(caution / 8, 1.0)
            best = min(best, now, key=_error)
        elif damping < _STUCK:
            caution *= 16
        elif kicks < _KICKS:
            kicks += 1
            now, caution = task.kicked(best, kicks), 1.0
        else:
            break
    return product(task.rest, best.delta).T, done


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
        limits = chain.limits
        n = len(chain)
        self.chain, self.effectors, self.targets = chain, effectors, targets
        weights = np.sqrt(weights)  # the sum of weights times squares is minimised
        self.weights = weights[:, None]
        reach = [chain.reach(effector) for effector in effectors]
        self.size = max(float(np.linalg.norm(weights * reach)), 1e-300)
        self.rest = limits.rest.T.copy()
        self.from_rest = self.rest * [[1], [-1], [-1], [-1]]
        self.turned = self.rest[1:].any()
        self.rest_matrices = chain.rest_matrices
        # Which joints move which effector, times the square root of its weight.
        self.share = np.zeros((len(effectors), n, 1))
        for row, (effector, weight) in enumerate(zip(effectors, weights, strict=True)):
            self.share[row, chain.path(effector)[:-1]] = weight
        self.limits, self.at = limits, limits.at
        self.axis = limits.axis[self.at].T.copy()
        self.straight = np.tile(np.eye(3), (n, 1, 1))
        self.free = np.zeros((3, n), dtype=bool)
        self.open = np.ones((n, 3))
        self.open[self.at[limits.swing[self.at] == 0], 1:] = 0.0  # hinges only twist

    def pose(self, delta):
        """Return rotations clamped to the limits, with their residual."""
        basis, ends = self.straight.copy(), self.free.copy()
        if len(self.at):
            cut = self.limits.cut(delta.take(self.at, 1))
            delta[:, self.at], ends[:, self.at] = cut.rotations, cut.ends
            # The twist's direction lies halfway between the axis and the swung axis.
            twisting = cut.swing[0] * self.axis + cross(cut.swing[1:], self.axis)
            directions = twisting, cut.outward, cross(twisting, cut.outward)
            basis[self.at] = np.array(directions).transpose(2, 1, 0)
        world = self.chain.scanned(product(self.rest, delta) if self.turned else delta)
        away = self.targets - world[self.effectors + 1, :3, 3]
        residual = away * self.weights
        distances = np.sqrt((away * away).sum(1))
        return _Pose(delta, basis, ends, world, residual, distances, float((residual**2).sum()))

    def step(self, pose, damping):
        """Return small rotations (n, 3) along each joint's three directions."""
        k, n = self.share.shape[:2]
        at = pose.world[1:, :3, 3]
        away = (at[self.effectors, None] - at) * self.share
        parents = pose.world.take(self.chain.above, 0)[:, :3, :3]
        if self.turned:
            parents = parents @ self.rest_matrices
        turns = (away @ CROSS).reshape(k, n, 3, 3) @ (parents @ pose.basis)
        # Rows: effectors' coordinates; columns: joints' directions.
        whole = turns.transpose(0, 2, 1, 3).reshape(3 * k, 3 * n)
        residual = pose.residual.reshape(-1)
        if not pose.ends.any():
            return self._least(whole * self.open.reshape(-1), residual, damping).reshape(n, 3)
        open_ = self.open
        step = residual @ whole  # the gradient tells which bounds are active
        for _ in range(_ROUNDS):
            open_ = open_ * ~self._shut(step.reshape(n, 3), pose.ends)
            step = self._least(whole * open_.reshape(-1), residual, damping)
            if not self._shut(step.reshape(n, 3), pose.ends).any():
                break
        return step.reshape(n, 3)

    def _least(self, jacobian, residual, damping):
        square = jacobian @ jacobian.T
        size = len(square)
        square.reshape(-1)[:: size + 1] += damping * square.trace() / size + 1e-300
        return np.linalg.solve(square, residual) @ jacobian

    def _shut(self, step, ends):
        """Return which directions of a step cross a limit."""
        low, high, swung = ends
        shut = np.zeros(step.shape, dtype=bool)
        shut[:, 0] = np.where(step[:, 0] < 0, low, high & (step[:, 0] > 0))
        shut[:, 1] = swung & (step[:, 1] > 0)
        return shut

    def moved(self, pose, step, largest=_LARGEST_STEP):
        """Return the pose after a step, clamped to the limits."""
        step = (pose.basis @ step[:, :, None])[:, :, 0].T
        size = np.sqrt((step * step).sum(0).max(initial=0.0))
        turn = np.empty((4, step.shape[1]))
        turn[0] = 1.0
        turn[1:] = step * (0.5 * min(1.0, largest / max(size, 1e-300)))
        delta = product(turn, pose.delta)
        return self.pose(delta / np.sqrt((delta * delta).sum(0)))

    def kicked(self, pose, times):
        """Return the pose with all active joints turned at random, reproducibly."""
        turns = np.random.default_rng(times).uniform(-1, 1, self.open.shape)
        turns = turns * self.open * self.share.any(0)
        return self.moved(pose, turns, largest=0.4 * times)
