"""Joints, their order, and poses as matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation import Pose, Skeleton
from tests.animation.conftest import refused

SEEDS = st.integers(0, 2**32 - 1)


def random_tree(rng, n):
    """Return a skeleton whose parents do not come first, and a pose of it."""
    parents = np.array([rng.integers(-1, i) if i else -1 for i in range(n)])
    place = rng.permutation(n)
    shuffled = np.empty(n, int)
    shuffled[place] = np.where(parents < 0, -1, place[parents])
    scale = rng.uniform(0.5, 2.0, (n, 3)) * rng.choice([-1, 1], (n, 3))
    pose = Pose(rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), scale)
    return Skeleton(shuffled, pose), pose


@given(SEEDS)
def test_a_joint_stands_on_its_parent_in_any_order(seed):
    skeleton, pose = random_tree(np.random.default_rng(seed), 9)
    world, local = skeleton.world(pose), pose.matrices()
    for joint, parent in enumerate(skeleton.parents):
        above = np.eye(4) if parent < 0 else world[parent]
        assert np.allclose(world[joint], above @ local[joint])
    assert np.allclose(skeleton.local(world), local, atol=1e-7)
    seen = list(skeleton.order)
    assert sorted(seen) == list(range(9))
    assert all(p < 0 or seen.index(p) < seen.index(j) for j, p in enumerate(skeleton.parents))
    assert all(skeleton.parents[c] == j for j in range(9) for c in skeleton.children[j])


@given(SEEDS)
def test_matrices_are_taken_apart_and_put_together(seed):
    _, pose = random_tree(np.random.default_rng(seed), 9)
    again = Pose.from_matrices(pose.matrices())
    assert np.allclose(again.matrices(), pose.matrices())
    assert np.allclose(np.abs(again.scale), np.abs(pose.scale))


def test_many_poses_at_once():
    rng = np.random.default_rng(0)
    skeleton, _ = random_tree(rng, 5)
    poses = Pose(rng.normal(size=(2, 3, 5, 3)), rng.normal(size=(2, 3, 5, 4)))
    world = skeleton.world(poses)
    assert world.shape == (2, 3, 5, 4, 4)
    assert np.allclose(world[1, 2], skeleton.world(poses[1][2]))


@pytest.mark.parametrize(
    ('parents', 'words'),
    [
        ([1, 2, 0], 'parents must not form a cycle, got a -> b -> c -> a'),
        ([-1, 1, 1], 'parents must not form a cycle, got b -> b'),
        ([-1, 2, 1], 'parents must not form a cycle, got c -> b -> c'),
        ([-1, 3, 0], r"parents\[1\] \('b'\) must be from -1 to 2, got 3"),
        ([-2, 0, 0], r"parents\[0\] \('a'\) must .* got -2"),
    ],
)
def test_parents_that_are_no_tree_are_named(parents, words):
    refused(words, Skeleton, parents, np.tile(np.eye(4), (3, 1, 1)), 'abc')


def test_a_long_chain_is_no_cycle():
    skeleton = Skeleton(np.arange(500) - 1, Pose(np.ones((500, 3))))
    assert np.allclose(skeleton.world(skeleton.rest)[-1, :3, 3], 500)


def test_rest_must_fit():
    with pytest.raises(ValueError, match=r'rest must hold 1 joints, as parents, got shape \(2,\)'):
        Skeleton([-1], Pose(np.zeros((2, 3))))
    refused(r'rest\[0\] must not be singular', Skeleton, [-1], [np.diag([1.0, 1, 0, 1])])
    refused(r'names must hold 1 names.* got 2', Skeleton, [-1], [np.eye(4)], ['a', 'b'])


def test_parents_must_be_whole_numbers():
    for parents in ([-1.0, 0.5], [[-1, 0]]):
        refused('parents must be whole numbers', Skeleton, parents, Pose(np.zeros((2, 3))))


def test_joints_scaled_to_nothing():
    skeleton = Skeleton([-1, 0], Pose([[1, 2, 3], [4, 5, 6]], scale=[[2, 0, 2], [1, 1, 1]]))
    world = skeleton.world(skeleton.rest)
    assert world[1, :3, 3].tolist() == [9, 2, 15]
    np.testing.assert_allclose(skeleton.local(world)[1, :3, 3], [4, 0, 6])
    np.testing.assert_allclose(skeleton.world(skeleton.local(world)), world, atol=1e-12)


def test_unknown_joints_name_those_that_exist():
    skeleton = Skeleton([-1, 0], Pose(np.zeros((2, 3))), ['hip', 'knee'])
    assert [skeleton.index('knee'), skeleton.index(0)] == [1, 0]
    for name in ('toe', 2, -1):
        refused(rf'must be in the skeleton \(hip, knee.*, got {name!r}', skeleton.index, name)


@pytest.mark.parametrize(
    ('matrix', 'words'),
    [
        (np.diag([1.0, 1, 1, 2]), r'last row of matrices\[0\] must be'),
        (np.full((4, 4), np.nan), r'\[0, 0, 0\] must .*got nan'),
        (np.eye(3), 'must have shape'),
        ([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], 'sheared'),
    ],
)
def test_matrices_that_are_no_pose_are_named(matrix, words):
    refused(words, Pose.from_matrices, [matrix])


def test_poses_refuse_what_does_not_fit():
    refused(r'translation must have shape \(..., n, 3\)', Pose, [0.0, 0.0, 0.0])
    refused('quaternion', Pose, np.zeros((2, 3)), [[1, 0, 0, 0], [0, 0, 0, 0]])
    refused(r'rotation must .* got \(3, 4\)', Pose, np.zeros((2, 3)), np.ones((3, 4)))
    refused(r'scale\[0\] must .*got nan', Pose, np.zeros((2, 3)), scale=[np.nan, 1, 1])
    with pytest.raises(IndexError, match='single pose'):
        Pose(np.zeros((2, 3)))[0]
    with pytest.raises(ValueError, match='pose must have 2 joints, got 1'):
        Skeleton([-1, 0], Pose(np.zeros((2, 3)))).world(Pose(np.zeros((1, 3))))
