"""Inverse kinematics: joint rotations that bring end effectors to their targets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.animation import ik_damped
from pvibr.animation.chain import Chain
from pvibr.animation.ik_sweeps import Sweeps
from pvibr.maths import quaternions

#: Ways to solve, see :func:`solve`.
METHODS = ('damped', 'ccd', 'fabrik', 'two_bone')
_LITTLE = 0.9  # share of the squared error that a useful sweep may leave
_PATIENCE = 3  # useless sweeps in a row before giving up


class Solution(NamedTuple):
    """Result of a solver: rotations (n, 4), distances to the targets (k,), iterations."""

    rotations: np.ndarray
    errors: np.ndarray
    iterations: int


class _Task(NamedTuple):
    chain: Chain
    effectors: np.ndarray  # (k,) int
    targets: np.ndarray  # (k, 3) within reach
    weights: np.ndarray  # (k,)
    tolerances: np.ndarray  # (k,) in the figure's unit

    def errors(self, rotations):
        effector_points = self.chain.world(rotations)[self.effectors, :3, 3]
        return np.linalg.norm(effector_points - self.targets, axis=1)


def solve(
    chain,
    rotations,
    effectors,
    targets,
    weights=None,
    *,
    method='damped',
    poles=None,
    tolerance=1e-3,
    iterations=100,
):
    """Return rotations within the joints' limits that bring effectors to their targets."""
    ik_task = _task(chain, effectors, targets, weights, tolerance)
    rotations = chain.limits.clamped(quaternions.normalized(rotations))
    solved, iteration_count = _run(ik_task, rotations, method, iterations)
    for effector, pole in (poles or {}).items():
        turned = chain.limits.clamped(_swivelled(ik_task, solved, effector, pole, method))
        if (ik_task.errors(turned) > ik_task.tolerances).any():
            turned, extra_iterations = _run(ik_task, turned, method, iterations)
            iteration_count += extra_iterations
        accepted = np.maximum(ik_task.errors(solved), ik_task.tolerances)
        if (ik_task.errors(turned) <= accepted).all():
            solved = turned
    effector_points = chain.world(solved)[ik_task.effectors, :3, 3]
    errors = np.linalg.norm(effector_points - np.reshape(targets, (-1, 3)), axis=1)
    return Solution(solved, errors, iteration_count)


def _task(chain, effectors, targets, weights, tolerance):
    effectors = np.asarray(effectors, dtype=np.int64)
    targets = np.asarray(targets, dtype=np.float64)
    weights = np.ones(len(effectors)) if weights is None else np.asarray(weights, dtype=float)
    if weights.shape != effectors.shape or not ((weights > 0) & np.isfinite(weights)).all():
        raise ValueError(
            f'weights must be {len(effectors)} positive numbers, got {weights.tolist()}'
        )
    # A target out of reach is moved to the nearest point that the stretched chain can reach.
    roots = chain.offsets[[chain.path(effector)[0] for effector in effectors]]
    chain_reach = np.array([chain.reach(effector) for effector in effectors])
    offsets = targets - roots
    target_distance = np.linalg.norm(offsets, axis=1)
    share = np.minimum(1.0, chain_reach / np.maximum(target_distance, 1e-300))
    reachable = np.where((share < 1)[:, None], roots + offsets * share[:, None], targets)
    return _Task(chain, effectors, reachable, weights, tolerance * chain_reach)


def _run(task, rotations, method, iterations):
    """Return rotations and the number of steps; what sweeps leave is solved by damped steps."""
    sweep_count = 0
    if method == 'two_bone':
        for effector, target in zip(task.effectors, task.targets, strict=True):
            rotations = _two_bone(task.chain, rotations, effector, target)
            rotations = task.chain.limits.clamped(rotations)
        return rotations, 1
    if method != 'damped':
        rotations, sweep_count = _swept(task, rotations, method, iterations)
    rotations, damped_steps = ik_damped.solve(
        *(task.chain, rotations, task.effectors, task.targets, task.weights),
        *(task.tolerances, iterations),
    )
    return rotations, sweep_count + damped_steps


def _swept(task, rotations, method, iterations):
    """Sweep until all targets are reached or the gain is small; return the best rotations."""
    goals = task.effectors.tolist(), task.targets, task.weights.tolist()
    sweeps = Sweeps(task.chain, rotations, *goals)
    best_rotations, least_error, idle_sweeps = sweeps.rotations, np.inf, 0
    for sweep_index in range(iterations + 1):
        errors = np.array(sweeps.errors())
        error = float((task.weights * errors**2).sum())
        idle_sweeps = 0 if error < _LITTLE * least_error else idle_sweeps + 1
        if error < least_error:
            best_rotations, least_error = list(sweeps.rotations), error
        is_done = (errors <= task.tolerances).all() or sweep_index == iterations
        if is_done or idle_sweeps > _PATIENCE:
            break
        getattr(sweeps, method)()
    return np.array(best_rotations), sweep_index


def _two_bone(chain, rotations, effector, target):
    """Bend the middle joint to the right distance, then turn its parent to the target."""
    path = chain.path(effector)
    if len(path) < 3:
        raise ValueError(
            f'effector {effector} must have 2 joints above it for two_bone, got {len(path) - 1}'
        )
    root, middle, _ = path[-3:]
    world = chain.world(rotations)
    a, b, c = world[path[-3:], :3, 3]
    upper, lower = a - b, c - b
    u, v = np.linalg.norm(upper), np.linalg.norm(lower)
    rotations = rotations.copy()
    if u > 0 and v > 0:
        distance = np.clip(np.linalg.norm(target - a), abs(u - v), u + v)
        bend_angle = np.arccos(np.clip((u * u + v * v - distance**2) / (2 * u * v), -1, 1))
        bend_axis = np.cross(upper, lower)
        current_angle = np.arctan2(np.linalg.norm(bend_axis), upper @ lower)
        if np.linalg.norm(bend_axis) <= 1e-9 * u * v:
            bend_axis = _opening_axis(chain, world, middle, upper)
        bend_turn = quaternions.from_axis_angle(bend_axis, bend_angle - current_angle)
        rotations[middle] = _turned(chain, world, rotations, middle, bend_turn)
        c = b + quaternions.rotate(bend_turn, lower)
    if np.linalg.norm(c - a) > 0 and np.linalg.norm(target - a) > 0:
        aim_turn = quaternions.between(c - a, target - a)
        rotations[root] = _turned(chain, world, rotations, root, aim_turn)
    return rotations


def _opening_axis(chain, world, joint, bone):
    """Return the axis about which a straight limb opens: its hinge's, or any across."""
    limits = chain.limits
    if limits.swing[joint] == 0:
        parent_joint = chain.parents[joint]
        hinge_axis = quaternions.rotate(limits.rest[joint], limits.axis[joint])
        sign = -1.0 if limits.middle[joint] >= 0 else 1.0
        return sign * (world[parent_joint, :3, :3] @ hinge_axis)
    return np.cross(bone, np.eye(3)[np.abs(bone).argmin()])


def _turned(chain, world, rotations, joint, turn):
    """Return a joint's rotation after a turn in the figure's space."""
    parent_joint = chain.parents[joint]
    if parent_joint >= 0:
        above = quaternions.from_matrices(world[parent_joint, :3, :3])
        turn = quaternions.multiply(
            quaternions.conjugate(above), quaternions.multiply(turn, above)
        )
    return quaternions.normalized(quaternions.multiply(turn, rotations[joint]))


def _swivelled(task, rotations, effector, pole, method):
    """Turn a limb about the line from root to effector until its knee points at the pole."""
    chain = task.chain
    shared_joints = {j for e in task.effectors if e != effector for j in chain.path(e)}
    limb = [joint for joint in chain.path(effector) if joint not in shared_joints]
    limb = limb[-3:] if method == 'two_bone' else limb
    if len(limb) < 3:
        return rotations
    world = chain.world(rotations)
    offsets = world[limb, :3, 3] - world[limb[0], :3, 3]
    line = offsets[-1]
    limb_length = np.linalg.norm(line)
    if limb_length == 0:
        return rotations
    line = line / limb_length
    across = offsets - (offsets @ line)[:, None] * line
    knee = across[np.linalg.norm(across, axis=1).argmax()]
    to_pole = np.asarray(pole, dtype=np.float64) - world[limb[0], :3, 3]
    to_pole = to_pole - (to_pole @ line) * line
    if min(np.linalg.norm(knee), np.linalg.norm(to_pole)) <= 1e-9 * chain.reach(effector):
        return rotations
    swivel_angle = np.arctan2(line @ np.cross(knee, to_pole), knee @ to_pole)
    swivel_turn = quaternions.from_axis_angle(line, swivel_angle)
    rotations = rotations.copy()
    rotations[limb[0]] = _turned(chain, world, rotations, limb[0], swivel_turn)
    return rotations
