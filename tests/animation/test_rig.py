"""Rigs: steps in order, on the poses of a skeleton in any place and size."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr import Figure
from pvibr.animation import (
    Aim,
    ClampToLimits,
    Clip,
    ClipSource,
    CopyTransform,
    InverseKinematics,
    JointLimit,
    Pose,
    Rig,
    Skeleton,
    Track,
)
from pvibr.maths import quaternions as quat
from tests.animation.conftest import refused

NAMES = ['hand', 'hip', 'chest', 'shoulder', 'elbow', 'head', 'other shoulder', 'other hand']
PARENTS = [4, -1, 1, 2, 3, 2, 2, 6]  # the hand comes before its elbow
FEW = settings(deadline=None, max_examples=40)
SEEDS = st.integers(0, 10_000)


def body(rng):
    """A skeleton whose bones and rest are any, and whose joints scale all axes alike."""
    n = len(NAMES)
    scale = np.repeat(rng.uniform(0.5, 2, (n, 1)), 3, axis=1)
    rest = Pose(rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), scale)
    return Skeleton(PARENTS, rest, NAMES)


def a_pose(rng, skeleton):
    n = len(skeleton)
    return skeleton.rest.replaced(
        rotation=quat.multiply(skeleton.rest.rotation, quat.exp(rng.normal(size=(n, 3)) * 0.4))
    )


def origin(skeleton, pose, name):
    return skeleton.world(pose)[skeleton.index(name), :3, 3]


def axis_of(skeleton, pose, name, axis):
    linear = skeleton.world(pose)[skeleton.index(name), :3, :3]
    return linear @ axis / np.linalg.norm(linear @ axis)


@FEW
@given(SEEDS, st.sampled_from(['damped', 'ccd', 'fabrik', 'two_bone']))
def test_a_hand_reaches_and_only_its_limb_turns(seed, method):
    rng = np.random.default_rng(seed)
    skeleton = body(rng)
    rig = Rig(skeleton, [InverseKinematics('hand', root='shoulder', method=method)])
    goal = a_pose(rng, skeleton)
    start = a_pose(rng, skeleton)
    keep = [skeleton.index(name) for name in ('hip', 'chest')]
    rotation = goal.rotation.copy()
    rotation[keep] = start.rotation[keep]
    target = origin(skeleton, goal.replaced(rotation=rotation), 'hand')
    pose = rig.solve(start, {'hand': target})
    arm = [skeleton.index(name) for name in ('shoulder', 'elbow')]
    others = np.setdiff1d(range(len(skeleton)), arm)
    np.testing.assert_allclose(pose.rotation[others], start.rotation[others], atol=1e-12)
    np.testing.assert_array_equal(pose.translation, start.translation)
    bones = skeleton.world(start)[[3, 4, 0], :3, 3]
    reach = np.linalg.norm(np.diff(bones, axis=0), axis=1).sum()
    assert np.linalg.norm(origin(skeleton, pose, 'hand') - target) <= 2e-3 * reach


@FEW
@given(SEEDS, st.sampled_from(['damped', 'ccd', 'fabrik']))
def test_limits_of_a_rig_hold_with_several_effectors(seed, method):
    rng = np.random.default_rng(seed)
    skeleton = body(rng)
    limits = {
        'elbow': JointLimit.hinge(rng.normal(size=3), 0.0, 2.0),
        'chest': JointLimit(rng.normal(size=3), 0.3, (-0.2, 0.2)),
        3: JointLimit(rng.normal(size=3), 1.0, (-1, 1)),
    }
    rig = Rig(skeleton, [InverseKinematics(['hand', 'other hand'], method=method)], limits)
    targets = {'hand': rng.normal(size=3) * 2, 'other hand': rng.normal(size=3) * 2}
    pose = rig.solve(a_pose(rng, skeleton), targets)
    assert rig.limits.excess(pose.rotation).max() < 1e-9


def test_a_pole_is_a_point_of_the_figure():
    rng = np.random.default_rng(1)
    skeleton = body(rng)
    pose = a_pose(rng, skeleton)
    pole = np.array([3.0, -2.0, 5.0])
    for given_, targets in ((pole, {}), ('behind', {'behind': pole})):
        step = InverseKinematics('hand', method='two_bone', poles={'hand': given_})
        shoulder, elbow, hand = (origin(skeleton, pose, n) for n in ('shoulder', 'elbow', 'hand'))
        target = shoulder + 0.9 * (hand - shoulder)
        found = Rig(skeleton, [step]).solve(pose, {'hand': target} | targets)
        elbow = origin(skeleton, found, 'elbow') - shoulder
        line = (target - shoulder) / np.linalg.norm(target - shoulder)
        a, b = (v - (v @ line) * line for v in (elbow, pole - shoulder))
        assert a @ b >= (1 - 1e-9) * np.linalg.norm(a) * np.linalg.norm(b)


def test_both_arms_by_two_bones_are_each_for_themselves():
    bones = [[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [0, -1, 0], [0, 0, 1], [0, 0, 1]]
    names = ['hip', 'a', 'b', 'c', 'd', 'e', 'f']
    skeleton = Skeleton([-1, 0, 1, 2, 0, 4, 5], Pose(bones), names)
    rig = Rig(skeleton, [InverseKinematics(['c', 'f'], method='two_bone')])
    targets = {'c': np.array([0.5, 1.2, 0.9]), 'f': np.array([-0.5, -1.2, 0.9])}
    pose = rig.solve(skeleton.rest, targets)
    for name, target in targets.items():
        np.testing.assert_allclose(origin(skeleton, pose, name), target, atol=1e-9)
    only = rig.solve(skeleton.rest, {'c': targets['c']})
    np.testing.assert_allclose(only.rotation[4:], skeleton.rest.rotation[4:], atol=1e-12)


@FEW
@given(SEEDS)
def test_aim_shows_the_point_and_rolls_up(seed):
    rng = np.random.default_rng(seed)
    skeleton = body(rng)
    scale = skeleton.rest.scale.copy()
    scale[5] = [1, 2, 3]  # what aims may scale its axes each for itself
    pose = a_pose(rng, skeleton).replaced(scale=scale)
    point, up, axis, up_axis = rng.normal(size=(4, 3)) * [[9], [1], [1], [1]]
    rig = Rig(skeleton, [Aim('head', 'ball', axis, up=up, up_axis=up_axis)])
    found = rig.solve(pose, {'ball': point})
    way = point - origin(skeleton, found, 'head')
    way /= np.linalg.norm(way)
    np.testing.assert_allclose(axis_of(skeleton, found, 'head', axis), way, atol=1e-9)
    shown = axis_of(skeleton, found, 'head', up_axis)
    a, b = (v - (v @ way) * way for v in (shown, up))
    assert a @ b >= (1 - 1e-9) * np.linalg.norm(a) * np.linalg.norm(b)
    plain = Rig(skeleton, [Aim('head', point, axis)]).solve(pose)
    np.testing.assert_allclose(axis_of(skeleton, plain, 'head', axis), way, atol=1e-9)
    assert rig.solve(pose) is pose


def test_aim_in_part_and_inside_of_a_limit():
    eye = Skeleton([-1], Pose([[0, 0, 0]]), ['eye'])
    for step, limits, expected in (
        (Aim('eye', [5, 0, 0]), None, math.pi / 2),
        (Aim('eye', [5, 0, 0], weight=0.5), None, math.pi / 4),
        (Aim('eye', [5, 0, 0]), {'eye': JointLimit([0, 0, 1], 0.3)}, 0.3),
        (Aim('eye', [0, 0, 0]), None, 0.0),
    ):
        turned = quat.log(Rig(eye, [step], limits).solve(eye.rest).rotation[0])
        np.testing.assert_allclose(turned, [0, expected, 0], atol=1e-12)


@FEW
@given(SEEDS)
def test_copy_makes_both_lie_alike(seed):
    rng = np.random.default_rng(seed)
    skeleton = body(rng)
    pose = a_pose(rng, skeleton)
    found = Rig(skeleton, [CopyTransform('head', 'hand', position=True)]).solve(pose)
    head, hand = skeleton.world(found)[[5, 0]]
    np.testing.assert_allclose(head[:3, 3], hand[:3, 3], atol=1e-9)
    ratio = head[:3, :3] @ np.linalg.inv(hand[:3, :3])
    np.testing.assert_allclose(ratio, ratio[0, 0] * np.eye(3), atol=1e-9)


def test_copy_of_what_left_its_rest():
    rng = np.random.default_rng(0)
    skeleton = body(rng)
    turn = quat.exp([0.3, 0.2, -0.5])
    rotation = skeleton.rest.rotation.copy()
    rotation[3] = quat.multiply(rotation[3], turn)
    translation = skeleton.rest.translation.copy()
    translation[3] += [1, 2, 3]
    pose = skeleton.rest.replaced(rotation=rotation, translation=translation)
    step = CopyTransform('other shoulder', 'shoulder', space='local', position=True)
    found = Rig(skeleton, [step]).solve(pose)
    expected = quat.multiply(skeleton.rest.rotation[6], turn)
    np.testing.assert_allclose(found.rotation[6], expected, atol=1e-12)
    moved = found.translation[6] - skeleton.rest.translation[6]
    np.testing.assert_allclose(moved, [1, 2, 3], atol=1e-12)


def test_steps_are_done_in_order():
    rng = np.random.default_rng(3)
    skeleton = body(rng)
    pose = a_pose(rng, skeleton)
    target = {'hand': origin(skeleton, a_pose(rng, skeleton), 'hand')}
    aim, reach = Aim('head', [9, 9, 9]), InverseKinematics('hand')

    def shown(steps):
        found = Rig(skeleton, steps).solve(pose, target)
        way = np.array([9.0, 9, 9]) - origin(skeleton, found, 'head')
        return axis_of(skeleton, found, 'head', [0, 0, 1]) @ way / np.linalg.norm(way)

    assert shown([reach, aim]) > 1 - 1e-9
    assert shown([aim, reach]) < 1 - 1e-6


def test_limits_of_a_clip_are_kept_where_asked():
    skeleton = body(np.random.default_rng(0))
    limits = {'elbow': JointLimit([0, 0, 1], 0.1, (0.0, 0.0)), 'head': JointLimit([0, 0, 1], 0.2)}
    rig = Rig(skeleton, [ClampToLimits()], limits)
    pose = a_pose(np.random.default_rng(5), skeleton)
    assert rig.limits.excess(pose.rotation).max() > 0.1
    assert rig.limits.excess(rig.solve(pose).rotation).max() < 1e-9


def test_poses_of_a_source_are_rigged_at_any_times():
    arm = Skeleton([-1, 0, 1], Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]]), ['a', 'b', 'hand'])
    times = [0.0, 0.5, 1.0]
    bent = Track(0, 'rotation', times, quat.exp([[0, 0, t] for t in times]), 'linear')
    played = ClipSource(Figure([], arm, [Clip('bend', [bent])]), 'bend', loop=False)
    rig = Rig(
        arm, [InverseKinematics('hand', root='b'), CopyTransform('hand', 'a', position=True)]
    )

    def targets(time):
        return {'hand': [1.0, 1 + time, 0.0]}

    many = rig.on(played, targets).sample([[0.0, 0.25], [0.5, 1.0]])
    assert many.shape == (2, 2)
    for place, time in (((0, 1), 0.25), ((1, 1), 1.0)):
        one = rig.solve(played.sample(time), targets(time))
        np.testing.assert_allclose(many.rotation[place], one.rotation, atol=1e-12)
        np.testing.assert_allclose(many.translation[place], one.translation, atol=1e-12)
    still = rig.on(arm.rest, targets(0.0)).sample(7.0)
    np.testing.assert_allclose(still.rotation, rig.solve(arm.rest, targets(0.0)).rotation)
    refused('must be a Pose or have sample', rig.on, 'Walk', kind=TypeError)


def test_bones_may_change_their_length():
    arm = Skeleton([-1, 0, 1], Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]]), ['a', 'b', 'hand'])
    rig = Rig(arm, [InverseKinematics('hand')])
    for length in (1.0, 2.0, 1.0):
        pose = arm.rest.replaced(translation=[[7, 0, 0], [length, 0, 0], [1, 0, 0]])
        found = rig.solve(pose, {'hand': [7, 9, 0]})
        assert abs(origin(arm, found, 'hand') - [7, 1 + length, 0]).max() < 0.01


@pytest.mark.parametrize(
    ('make', 'message'),
    [
        (
            lambda s: Rig(s, [InverseKinematics('foot')]),
            r"joint must be in the skeleton \(hand.*, got 'foot'",
        ),
        (lambda s: Rig(s, [], {'foot': JointLimit([0, 0, 1])}), "got 'foot'"),
        (lambda s: Rig(s, [InverseKinematics('hand', root='head')]), "must be below 'head'"),
        (
            lambda s: Rig(s, [InverseKinematics('chest', method='two_bone')]),
            'must have 2 joints above it',
        ),
        (lambda s: InverseKinematics('hand', method='magic'), r"method must .*got 'magic'"),
        (
            lambda s: InverseKinematics('hand', weights=[1, 2]),
            'weights must have 1 values.* got 2',
        ),
        (
            lambda s: InverseKinematics('hand', poles={'head': [0, 0, 0]}),
            "poles must name effectors .* got 'head'",
        ),
        (lambda s: Aim('head', [0, 0]), r'at must have shape'),
        (lambda s: Aim('head', [0, 0, 1], axis=[0, 0, 0]), 'axis must'),
        (
            lambda s: Aim('head', [0, 0, 1], [0, 1, 0], up=[0, 1, 0]),
            'must not be parallel to axis',
        ),
        (lambda s: Aim('head', [0, 0, 1], weight=1.5), r'weight must .*got 1.5'),
        (
            lambda s: CopyTransform('head', 'hand', rotation=False),
            'rotation or position must be True',
        ),
        (lambda s: CopyTransform('head', 'hand', space='moon'), "space must be .* got 'moon'"),
        (
            lambda s: Rig(s, [InverseKinematics('hand')]).solve(s.rest, {'fist': [0, 0, 0]}),
            r"targets must be in use by steps \(hand\), got 'fist'",
        ),
        (
            lambda s: Rig(s, [InverseKinematics('hand')]).solve(s.rest, {'hand': [0, 0]}),
            r"targets\['hand'\]",
        ),
        (lambda s: Rig(s, []).solve(s.rest, [0, 0]), 'must map names to points'),
        (lambda s: Rig(s, []).solve(Pose(np.zeros((2, 8, 3)))), 'must be one pose'),
    ],
)
def test_bad_input_is_named(make, message):
    refused(message, make, body(np.random.default_rng(0)))


def test_uneven_scales_of_joints_that_turn_are_named():
    bones = Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]], scale=[[1, 1, 1], [1, 2, 1], [1, 2, 3]])
    arm = Skeleton([-1, 0, 1], bones, ['shoulder', 'elbow', 'hand'])
    refused(
        r"scale of joint 'elbow' must be .* got \[1.0, 2.0, 1.0\]",
        Rig(arm, [InverseKinematics('hand')]).solve,
        arm.rest,
        {'hand': [1, 1, 0]},
    )
