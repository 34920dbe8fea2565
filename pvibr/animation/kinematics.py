"""Inverse kinematics: joint rotations that bring end effectors to their targets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.animation import damped
from pvibr.animation.chain import Chain
from pvibr.animation.sweeps import Sweeps
from pvibr.maths import quaternions
from pvibr.maths.arguments import check_one_of

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
        at = self.chain.world(rotations)[self.effectors, :3, 3]
        return np.linalg.norm(at - self.targets, axis=1)


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
    check_one_of('method', method, METHODS)
    task = _task(chain, effectors, targets, weights, tolerance)
    rotations = _start(chain, rotations)
    found, done = _run(task, rotations, method, iterations)
    for effector, pole in (poles or {}).items():
        turned = chain.limits.clamped(_swivelled(task, found, effector, pole, method))
        if (task.errors(turned) > task.tolerances).any():
            turned, more = _run(task, turned, method, iterations)
            done += more
        if (task.errors(turned) <= np.maximum(task.errors(found), task.tolerances)).all():
            found = turned
    at = chain.world(found)[task.effectors, :3, 3]
    errors = np.linalg.norm(at - np.reshape(targets, (-1, 3)), axis=1)
    return Solution(found, errors, done)


def _start(chain, rotations):
    rotations = quaternions.normalized(rotations)
    if rotations.shape != (len(chain), 4):
        raise ValueError(
            f'rotations are of shape {rotations.shape}; the chain has {len(chain)} joints.'
        )
    return chain.limits.clamped(rotations)


def _task(chain, effectors, targets, weights, tolerance):
    effectors = np.atleast_1d(np.asarray(effectors, dtype=np.int64))
    for effector in effectors:
        if not 0 <= effector < len(chain):
            raise ValueError(f'effectors has {effector}; there are joints 0 to {len(chain) - 1}.')
    targets = np.atleast_2d(np.asarray(targets, dtype=np.float64))
    if targets.shape != (len(effectors), 3) or not np.isfinite(targets).all():
        raise ValueError(
            f'targets must be finite and of shape {(len(effectors), 3)}: {targets.tolist()}.'
        )
    weights = np.ones(len(effectors)) if weights is None else np.asarray(weights, dtype=float)
    if weights.shape != effectors.shape or not ((weights > 0) & np.isfinite(weights)).all():
        raise ValueError(f'weights must be {len(effectors)} positive numbers: {weights.tolist()}.')
    # A target out of reach is moved to the nearest point that the stretched chain can reach.
    roots = chain.offsets[[chain.path(effector)[0] for effector in effectors]]
    reach = np.array([chain.reach(effector) for effector in effectors])
    away = targets - roots
    distance = np.linalg.norm(away, axis=1)
    share = np.minimum(1.0, reach / np.maximum(distance, 1e-300))
    within = np.where((share < 1)[:, None], roots + away * share[:, None], targets)
    return _Task(chain, effectors, within, weights, tolerance * reach)


def _run(task, rotations, method, iterations):
    """Return rotations and the number of steps; what sweeps leave is solved by damped steps."""
    done = 0
    if method == 'two_bone':
        for effector, target in zip(task.effectors, task.targets, strict=True):
            rotations = _two_bone(task.chain, rotations, effector, target)
            rotations = task.chain.limits.clamped(rotations)
        return rotations, 1
    if method != 'damped':
        rotations, done = _swept(task, rotations, method, iterations)
    rotations, steps = damped.solve(
        *(task.chain, rotations, task.effectors, task.targets, task.weights),
        *(task.tolerances, iterations),
    )
    return rotations, done + steps


def _swept(task, rotations, method, iterations):
    """Sweep until all targets are reached or the gain is small; return the best rotations."""
    sweeps = Sweeps(
        *(task.chain, rotations, task.effectors.tolist(), task.targets, task.weights.tolist())
    )
    best, least, waited = sweeps.rotations, np.inf, 0
    for done in range(iterations + 1):
        errors = np.array(sweeps.errors())
        error = float((task.weights * errors**2).sum())
        waited = 0 if error < _LITTLE * least else waited + 1
        if error < least:
            best, least = list(sweeps.rotations), error
        if (errors <= task.tolerances).all() or waited > _PATIENCE or done == iterations:
            break
        getattr(sweeps, method)()
    return np.array(best), done


def _two_bone(chain, rotations, effector, target):
    """Bend the middle joint to the right distance, then turn its parent to the target."""
    path = chain.path(effector)
    if len(path) < 3:
        raise ValueError(
            f'effector {effector} has {len(path) - 1} joints above it; two bones need 2.'
        )
    root, middle, _ = path[-3:]
    world = chain.world(rotations)
    a, b, c = world[path[-3:], :3, 3]
    upper, lower = a - b, c - b
    u, v = np.linalg.norm(upper), np.linalg.norm(lower)
    rotations = rotations.copy()
    if u > 0 and v > 0:
        distance = np.clip(np.linalg.norm(target - a), abs(u - v), u + v)
        wanted = np.arccos(np.clip((u * u + v * v - distance**2) / (2 * u * v), -1, 1))
        axis = np.cross(upper, lower)
        now = np.arctan2(np.linalg.norm(axis), upper @ lower)
        if np.linalg.norm(axis) <= 1e-9 * u * v:
            axis = _pin(chain, world, middle, upper)
        bend = quaternions.from_axis_angle(axis, wanted - now)
        rotations[middle] = _turned(chain, world, rotations, middle, bend)
        c = b + quaternions.rotate(bend, lower)
    if np.linalg.norm(c - a) > 0 and np.linalg.norm(target - a) > 0:
        turn = quaternions.between(c - a, target - a)
        rotations[root] = _turned(chain, world, rotations, root, turn)
    return rotations


def _pin(chain, world, joint, bone):
    """Return the axis about which a straight limb opens: its hinge's, or any across."""
    limits = chain.limits
    if limits.swing[joint] == 0:
        parent = chain.parents[joint]
        pin = quaternions.rotate(limits.rest[joint], limits.axis[joint])
        sign = -1.0 if limits.middle[joint] >= 0 else 1.0
        return sign * (world[parent, :3, :3] @ pin)
    return np.cross(bone, np.eye(3)[np.abs(bone).argmin()])


def _turned(chain, world, rotations, joint, turn):
    """Return a joint's rotation after a turn in the figure's space."""
    parent = chain.parents[joint]
    if parent >= 0:
        above = quaternions.from_matrices(world[parent, :3, :3])
        turn = quaternions.multiply(
            quaternions.conjugate(above), quaternions.multiply(turn, above)
        )
    return quaternions.normalized(quaternions.multiply(turn, rotations[joint]))


def _swivelled(task, rotations, effector, pole, method):
    """Turn a limb about the line from root to effector until its knee points at the pole."""
    chain = task.chain
    if effector not in task.effectors:
        raise ValueError(
            f'poles has {effector}; it must be one of the effectors {task.effectors.tolist()}.'
        )
    others = {j for e in task.effectors if e != effector for j in chain.path(e)}
    path = [joint for joint in chain.path(effector) if joint not in others]
    path = path[-3:] if method == 'two_bone' else path
    if len(path) < 3:
        return rotations
    world = chain.world(rotations)
    at = world[path, :3, 3] - world[path[0], :3, 3]
    line = at[-1]
    length = np.linalg.norm(line)
    if length == 0:
        return rotations
    line = line / length
    across = at - (at @ line)[:, None] * line
    knee = across[np.linalg.norm(across, axis=1).argmax()]
    to = np.asarray(pole, dtype=np.float64) - world[path[0], :3, 3]
    to = to - (to @ line) * line
    if min(np.linalg.norm(knee), np.linalg.norm(to)) <= 1e-9 * chain.reach(effector):
        return rotations
    angle = np.arctan2(line @ np.cross(knee, to), knee @ to)
    turn = quaternions.from_axis_angle(line, angle)
    rotations = rotations.copy()
    rotations[path[0]] = _turned(chain, world, rotations, path[0], turn)
    return rotations
