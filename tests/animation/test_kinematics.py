"""Inverse kinematics: limits and bones hold, and what can be reached is reached."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr.animation.chain import Chain
from pvibr.animation.ik_solvers import METHODS, solve
from pvibr.animation.joint_limits import JointLimit
from pvibr.maths import quaternions as quat
from tests.animation.conftest import refused

FEW = settings(deadline=None, max_examples=40)
SWEEPS = pytest.mark.parametrize('method', ['damped', 'ccd', 'fabrik'])
ALL = pytest.mark.parametrize('method', METHODS)
SEEDS = st.integers(0, 10_000)


def rope(n, limits=None, rest=None):
    offsets = np.zeros((n, 3))
    offsets[1:, 2] = 1 / (n - 1)
    return Chain(np.arange(n) - 1, offsets, limits, rest)


def a_limit(rng):
    low, high = -rng.uniform(0, 1), rng.uniform(0.1, 1)
    if rng.random() < 0.5:
        return JointLimit.hinge(rng.normal(size=3), low, high)
    return JointLimit(rng.normal(size=3), rng.uniform(0.1, 1), (low, high))


def a_tree(rng, n):
    """Random joints, some limited, some bones of no length."""
    parents = [
        max(-1, i - 1 - int(rng.integers(0, 2)) * int(rng.integers(0, 4))) for i in range(n)
    ]
    parents[0] = -1
    offsets = rng.normal(size=(n, 3)) * (rng.random((n, 1)) > 0.1)
    limits = {i: a_limit(rng) for i in range(n) if rng.random() < 0.6}
    rest = quat.normalized(rng.normal(size=(n, 4)))
    return Chain(parents, offsets, limits, rest)


def a_pose(rng, chain):
    return chain.limits.clamped(quat.normalized(rng.normal(size=(len(chain), 4))))


def at(chain, rotations, joints=slice(None)):
    return chain.world(rotations)[joints, :3, 3]


def holds(chain, solution):
    rotations = solution.rotations
    assert np.isfinite(rotations).all()
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1, atol=1e-9)
    assert chain.limits.excess(rotations).max() < 1e-9
    origins = at(chain, rotations)
    children = np.flatnonzero(chain.parents >= 0)
    bones = np.linalg.norm(origins[children] - origins[chain.parents[children]], axis=1)
    np.testing.assert_allclose(bones, chain.lengths[children], atol=1e-9)
    roots = chain.parents < 0
    np.testing.assert_allclose(origins[roots], chain.offsets[roots], atol=1e-12)


@SWEEPS
@FEW
@given(SEEDS, st.integers(1, 12), st.floats(0, 3))
def test_limits_and_bones_hold(method, seed, n, far):
    rng = np.random.default_rng(seed)
    chain = a_tree(rng, n)
    effectors = rng.choice(n, size=min(n, 1 + seed % 3), replace=False)
    targets = rng.normal(size=(len(effectors), 3)) * far
    solution = solve(
        *(chain, a_pose(rng, chain), effectors, targets),
        method=method,
        poles={effectors[0]: rng.normal(size=3)},
        iterations=20,
    )
    holds(chain, solution)
    away = at(chain, solution.rotations, effectors) - targets
    np.testing.assert_allclose(solution.errors, np.linalg.norm(away, axis=1), atol=1e-12)


@SWEEPS
@FEW
@given(SEEDS, st.integers(0, 3))
def test_it_gets_no_worse(method, seed, iterations):
    rng = np.random.default_rng(seed)
    chain = a_tree(rng, 10)
    start = a_pose(rng, chain)
    target = at(chain, a_pose(rng, chain), [9])
    before = np.linalg.norm(at(chain, start, [9]) - target)
    after = solve(chain, start, [9], target, method=method, iterations=iterations).errors[0]
    assert after <= max(before + 1e-9, 1e-3 * chain.reach(9))


@ALL
@FEW
@given(SEEDS)
def test_two_bones_keep_limits_and_length(method, seed):
    rng = np.random.default_rng(seed)
    limits = {i: a_limit(rng) for i in range(3) if rng.random() < 0.6}
    chain = Chain([-1, 0, 1], rng.normal(size=(3, 3)), limits)
    target = rng.normal(size=(1, 3))
    holds(chain, solve(chain, a_pose(rng, chain), [2], target, method=method, iterations=10))


@ALL
@pytest.mark.parametrize('seed', range(8))
def test_two_bones_without_limits_reach_what_can_be_reached(method, seed):
    rng = np.random.default_rng(seed)
    chain = Chain([-1, 0, 1], rng.normal(size=(3, 3)))
    target = at(chain, a_pose(rng, chain), [2])
    start = a_pose(rng, chain)
    solution = solve(chain, start, [2], target, method=method)
    holds(chain, solution)
    bar = 1e-9 if method == 'two_bone' else 1e-3
    assert solution.errors[0] <= bar * chain.reach(2)


@SWEEPS
@pytest.mark.parametrize('seed', range(5))
def test_thirty_joints_without_limits_converge(method, seed):
    rng = np.random.default_rng(seed)
    chain = rope(30)
    target = at(chain, a_pose(rng, chain), [29])
    assert solve(chain, chain.limits.rest, [29], target, method=method).errors[0] <= 1e-3


@pytest.mark.parametrize('seed', range(20))
def test_thirty_joints_with_limits_converge_in_few_steps(seed):
    rng = np.random.default_rng(seed)
    limits = {i: a_limit(rng) for i in range(30)}
    chain = rope(30, limits, quat.exp(rng.normal(size=(30, 3)) * 0.1))
    target = at(chain, a_pose(rng, chain), [29])
    solution = solve(chain, chain.limits.rest, [29], target)
    holds(chain, solution)
    assert solution.errors[0] <= 1e-3
    assert solution.iterations <= 25


@SWEEPS
@pytest.mark.parametrize('seed', range(5))
def test_a_tree_reaches_with_all_its_hands(method, seed):
    rng = np.random.default_rng(seed)
    parents = [-1, 0, 1, 2, 3, 4, 2, 6, 7, 2, 9, 10]
    chain = Chain(parents, rng.normal(size=(12, 3)))
    hands = [5, 8, 11]
    targets = at(chain, a_pose(rng, chain), hands)
    solution = solve(chain, chain.limits.rest, hands, targets, method=method)
    reach = [chain.reach(hand) for hand in hands]
    assert (solution.errors <= np.multiply(reach, 1e-3)).all()


@SWEEPS
def test_weights_say_which_target_wins(method):
    chain = rope(8)
    targets = [[1.0, 0, 0], [-1.0, 0, 0]]
    errors = [
        solve(chain, chain.limits.rest, [7, 7], targets, weights, method=method).errors
        for weights in ([9.0, 1.0], [1.0, 9.0])
    ]
    assert errors[0][0] < 0.7 < errors[0][1]
    assert errors[1][1] < 0.7 < errors[1][0]


@ALL
def test_out_of_reach_stretches_toward_the_target(method):
    chain = Chain([-1, 0, 1], [[1, 1, 1], [0, 0, 1], [0, 0, 1]])
    direction = quat.rotate(quat.exp([0.3, -1.0, 0.2]), [0, 0, 1])
    start = quat.exp([[0.2, 0, 0], [1, 0.3, 0], [0, 0, 0]])
    solution = solve(chain, start, [2], [[1, 1, 1] + 50 * direction], method=method)
    hand = at(chain, solution.rotations, 2)
    np.testing.assert_allclose(hand, [1, 1, 1] + 2 * direction, atol=3e-3)
    assert np.isclose(solution.errors[0], 48, atol=3e-3)


@ALL
@pytest.mark.parametrize('share', [0.0, 0.4, -0.6])
def test_a_straight_limb_folds_along_its_own_line(method, share):
    chain = Chain([-1, 0, 1], [[0, 0, 0], [0, 0, 1], [0, 0, 1]])
    solution = solve(chain, np.eye(4)[[0, 0, 0]], [2], [[0, 0, 2 * share]], method=method)
    assert solution.errors[0] <= 2e-3


@ALL
def test_bones_without_length(method):
    chain = Chain([-1, 0, 1], np.zeros((3, 3)))
    solution = solve(chain, np.eye(4)[[0, 0, 0]], [2], [[0, 3, 4]], method=method)
    assert solution.errors.tolist() == [5.0]
    chain = Chain([-1, 0, 1], [[0, 0, 0], [0, 0, 0], [0, 2, 0]])
    solution = solve(chain, np.eye(4)[[0, 0, 0]], [2], [[0, 0, 9]], method=method)
    np.testing.assert_allclose(solution.errors, 7, atol=3e-3)


@ALL
@pytest.mark.parametrize('pole', [[5, 0, 0], [-1, -1, 0], [0, 0.1, 7]])
def test_the_knee_shows_the_pole(method, pole):
    chain = Chain([-1, 0, 1], [[0, 0, 0], [0, 0, 1], [0, 0, 1]])
    start = quat.exp([[0.1, 0, 0], [0.5, 0.1, 0], [0, 0, 0]])
    target = [0.3, 0.2, 1.2]
    found = solve(chain, start, [2], [target], method=method, poles={2: pole})
    _, knee, foot = at(chain, found.rotations)
    line = foot / np.linalg.norm(foot)
    across = [v - (v @ line) * line for v in (knee, np.array(pole, dtype=float))]
    cosine = across[0] @ across[1] / np.prod(np.linalg.norm(across, axis=1))
    assert cosine > 1 - 1e-9
    assert found.errors[0] <= 2e-3


def test_an_elbow_bends_the_way_its_hinge_allows():
    for low, high in ((0.0, 2.5), (-2.5, 0.0)):
        limits = {1: JointLimit.hinge([1, 0, 0], low, high)}
        chain = Chain([-1, 0, 1], [[0, 0, 0], [0, 0, 1], [0, 0, 1]], limits)
        for method in METHODS:
            found = solve(chain, chain.limits.rest, [2], [[0.1, 0.2, 1.0]], method=method)
            assert found.errors[0] <= 2e-3, method
            angle = quat.log(found.rotations[1])
            assert low <= angle[0] <= high
            np.testing.assert_allclose(angle[1:], 0, atol=1e-9)


@pytest.mark.parametrize('scale', [1e-6, 1.0, 1e6])
@SWEEPS
def test_size_does_not_matter(method, scale):
    chain = rope(6)
    big = Chain(chain.parents, chain.offsets * scale)
    found = solve(big, chain.limits.rest, [5], [[0.3 * scale, 0.2 * scale, 0]], method=method)
    expected = solve(chain, chain.limits.rest, [5], [[0.3, 0.2, 0]], method=method)
    assert found.iterations == expected.iterations
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=1e-6)


@pytest.mark.parametrize('method', ['damped', 'fabrik'])
def test_poses_follow_a_target_without_jumps(method):
    limits = dict.fromkeys(range(12), JointLimit([0, 0, 1], 0.6, (-0.3, 0.3)))
    chain = rope(12, limits)
    pose, turns = chain.limits.rest, []
    for t in np.linspace(0, 2 * math.pi, 60):
        target = [0.5 * math.cos(t), 0.5 * math.sin(t), 0.5 + 0.2 * math.cos(3 * t)]
        before = pose
        pose = solve(chain, pose, [11], [target], method=method).rotations
        away = quat.multiply(quat.conjugate(before), pose)
        turns.append(np.linalg.norm(quat.log(away), axis=1).max())
    assert max(turns[5:]) < 0.25  # after it came from rest


def test_the_knee_of_two_bones_at_the_end_of_a_longer_chain():
    chain = rope(6)
    start = quat.exp(np.random.default_rng(0).normal(size=(6, 3)) * 0.3)
    before = at(chain, start)
    target, pole = before[3] + [0.1, 0.2, 0.1], np.array([1.0, 0, 0])
    found = solve(chain, start, [5], [target], method='two_bone', poles={5: pole})
    after = at(chain, found.rotations)
    np.testing.assert_allclose(after[:4], before[:4], atol=1e-12)
    line = (target - after[3]) / np.linalg.norm(target - after[3])
    knee, to = (v - (v @ line) * line for v in (after[4] - after[3], pole - after[3]))
    assert knee @ to > (1 - 1e-9) * np.linalg.norm(knee) * np.linalg.norm(to)


def test_what_is_reached_is_not_touched():
    chain = rope(5)
    start = quat.exp(np.full((5, 3), 0.1))
    found = solve(chain, start, [4], at(chain, start, [4]))
    assert found.iterations == 0
    np.testing.assert_allclose(found.rotations, start, atol=1e-12)


def test_bad_input_is_named():
    rope_pose = rope(3), np.eye(4)[[0, 0, 0]]
    refused('1 positive numbers', solve, *rope_pose, [2], [[0, 0, 1]], [0.0])
    with pytest.raises(ValueError, match='effector 1 must have 2 joints above it'):
        solve(*rope_pose, [1], [[0, 0, 1]], method='two_bone')
