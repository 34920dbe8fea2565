"""Inverse kinematics and pose space deformation against their bars."""

from __future__ import annotations

import operator
from functools import partial

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.timing import timed
from benchmarks.figures.models import tube
from pvibr.animation.chain import Chain
from pvibr.animation.correctives import Correctives, PoseSpace
from pvibr.animation.figure import Figure
from pvibr.animation.ik_solvers import solve
from pvibr.animation.joint_limits import JointLimit
from pvibr.animation.pose import Pose
from pvibr.maths import quaternions

JOINTS = 30
METHODS = ('damped', 'ccd', 'fabrik')


def reaching(settings, results):
    """Yield the errors and times of random chains of thirty joints with all kinds of limits."""
    tip = JOINTS - 1
    for method in METHODS:
        errors, ms, excess = [], [], []
        for seed in range(settings.chains):
            chain, target = limited_chain(np.random.default_rng(seed))
            reach = partial(solve, chain, chain.limits.rest, [tip], [target], method=method)
            solution, least = min((timed(reach) for _ in range(3)), key=operator.itemgetter(1))
            errors.append(float(solution.errors[0] / chain.reach(tip)))
            ms.append(1e3 * least)
            excess.append(float(chain.limits.excess(solution.rotations).max()))
        found = {'error': errors, 'ms': ms, 'excess': excess}
        results.points.setdefault('reaching', {})[method] = found
        name = f'{method}, {JOINTS} joints with limits'
        barred = method == 'damped'  # the default one
        yield Row(f'{name}: worst error', max(errors), 'of its reach', 1e-3 if barred else None)
        yield Row(f'{name}: median time', np.median(ms), 'ms', 2 if barred else None)
        yield Row(f'{name}: longest time', max(ms), 'ms')
        yield Row(f'{name}: limits passed by', max(excess), 'rad', 1e-9)


def limited_chain(rng) -> tuple:
    """Return a chain of hinges and cones, bent at rest, and a point that it can reach."""
    offsets = np.zeros((JOINTS, 3))
    offsets[1:, 2] = 1 / (JOINTS - 1)
    limits = {joint: _limit(rng) for joint in range(JOINTS)}
    rest = quaternions.exp(rng.normal(size=(JOINTS, 3)) * 0.1)
    chain = Chain(np.arange(JOINTS) - 1, offsets, limits, rest)
    pose = chain.limits.clamped(quaternions.normalized(rng.normal(size=(JOINTS, 4))))
    return chain, chain.world(pose)[-1, :3, 3]


def _limit(rng):
    low, high = -rng.uniform(0, 1), rng.uniform(0.1, 1)
    if rng.random() < 0.5:
        return JointLimit.hinge(rng.normal(size=3), low, high)
    return JointLimit(rng.normal(size=3), rng.uniform(0.1, 1), (low, high))


def correcting(settings, results):
    """Yield the errors of a bending tube sculpted at some poses: at these, and far away."""
    plain = tube(40, 24, 3)
    rest = plain.skeleton.rest
    joint = 1

    def turned(degrees, axis=(1.0, 0, 0)):
        degrees = np.atleast_1d(degrees)
        rotation = np.tile(rest.rotation, (len(degrees), 1, 1))
        rotation[:, joint] = quaternions.from_axis_angle(axis, np.radians(degrees))
        return Pose(np.tile(rest.translation, (len(degrees), 1, 1)), rotation)

    keys = turned([30.0, 60.0, 90.0])
    rng = np.random.default_rng(2)
    shapes = np.stack([plain.posed(0, keys[i])[0] for i in range(3)])
    shapes += rng.normal(0, 0.05, shapes.shape)
    correctives = Correctives.from_sculpted(plain, [joint], keys, shapes)
    fixed = Figure(plain.meshes, plain.skeleton, correctives=correctives)
    away = max(np.abs(fixed.posed(0, keys[i])[0] - shapes[i]).max() for i in range(3))
    away /= np.ptp(shapes, axis=(0, 1)).max()
    space = PoseSpace([joint], keys, rest)
    weights = np.abs(space.weights(keys) - np.eye(3)).max()
    far = turned(np.linspace(90 + np.degrees(space.radius.max()) + 1, 180, 50))
    beyond = np.abs(space.weights(far)).max()
    yield Row('pose space: weights at key poses, error', weights, '', 1e-6)
    yield Row('pose space: shapes at key poses, error', away, 'of its size', 1e-6)
    yield Row('pose space: largest weight beyond the radii', beyond, '', 1e-6)
