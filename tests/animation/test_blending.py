"""Blending of poses: means, hemispheres, additive poses, masks."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pvibr.animation.blending import crossfade, difference, joint_mask, mix, with_additive
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton
from pvibr.maths import quaternions
from tests.animation.conftest import refused

seeds = st.integers(0, 2**32 - 1)
parts = st.floats(0, 1)


def some(seed, shape=(), n=3, turn=np.pi):
    """Return poses whose rotations are at most a turn from none."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(*shape, n, 3))
    axis *= turn * rng.uniform(size=(*shape, n, 1)) / np.linalg.norm(axis, axis=-1, keepdims=True)
    return Pose(
        rng.normal(size=(*shape, n, 3)),
        quaternions.exp(axis),
        rng.uniform(0.2, 2, (*shape, n, 3)),
        rng.normal(size=(*shape, 2)),
    )


def angle(a, b):
    """Return the angles between rotations in degrees."""
    turn = quaternions.multiply(quaternions.conjugate(a), b)
    return np.degrees(np.linalg.norm(quaternions.log(turn), axis=-1))


def same(a, b, atol=1e-9):
    for name in ('translation', 'scale', 'weights'):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=atol)
    assert (angle(a.rotation, b.rotation) < 1e-5).all()


@given(seeds, st.integers(1, 5))
def test_a_mix_of_one_pose_is_that_pose(seed, k):
    poses = [some(seed + i) for i in range(k)]
    for i, pose in enumerate(poses):
        same(mix(poses, np.eye(k)[i] * 7), pose)
    same(mix([poses[0]] * k, np.arange(1, k + 1)), poses[0])


@given(seeds, parts)
def test_signs_of_quaternions_do_not_matter(seed, part):
    a, b = some(seed), some(seed + 1)
    assume((np.abs((a.rotation * b.rotation).sum(-1)) > 1e-3).all())
    turned = b.replaced(rotation=-b.rotation)
    same(crossfade(a, b, part), crossfade(a, turned, part))
    same(crossfade(a, b, part), mix([b, a], [part, 1 - part]))


@given(seeds, parts)
def test_near_rotations_are_mixed_as_slerp_does(seed, part):
    a, b = some(seed, turn=np.pi / 4), some(seed + 1, turn=np.pi / 4)
    exact = quaternions.slerp(a.rotation, b.rotation, part)
    assert angle(crossfade(a, b, part).rotation, exact).max() < 1.0
    assert (
        angle(crossfade(a, b, 0.5).rotation, quaternions.slerp(a.rotation, b.rotation, 0.5)).max()
        < 1e-5
    )


@given(seeds, st.permutations(range(4)), st.lists(st.floats(0.01, 1), min_size=4, max_size=4))
def test_the_order_of_near_poses_does_not_matter(seed, order, weights):
    poses = [some(seed + i, turn=np.pi / 2) for i in range(4)]
    same(mix(poses, weights), mix([poses[i] for i in order], [weights[i] for i in order]))


@given(seeds, parts, parts)
def test_fades_within_fades_add_up(seed, first, second):
    a, b, c = (some(seed + i, turn=np.pi / 4) for i in range(3))
    shares = [(1 - first) * (1 - second), first * (1 - second), second]
    nested = crossfade(crossfade(a, b, first), c, second)
    flat = mix([a, b, c], shares)
    np.testing.assert_allclose(nested.translation, flat.translation, atol=1e-12)
    # A sum that was normalized on the way weighs a little more: far below what is seen.
    assert angle(nested.rotation, flat.rotation).max() < 5


@given(seeds, st.floats(-3, 3))
def test_a_difference_leads_back(seed, weight):
    pose, reference, base = some(seed), some(seed + 1), some(seed + 2)
    extra = difference(pose, reference)
    same(with_additive(reference, extra), pose)
    same(with_additive(base, extra, 0.0), base)
    again = with_additive(with_additive(base, extra, weight), extra, -weight)
    np.testing.assert_allclose(again.translation, base.translation, atol=1e-9)
    np.testing.assert_allclose(again.weights, base.weights, atol=1e-9)
    assert angle(again.rotation, base.rotation).max() < 1e-5


def test_an_additive_pose_is_scaled_by_its_angle():
    rest = Pose(np.zeros((1, 3)))
    up = Pose(np.zeros((1, 3)), quaternions.from_axis_angle([[0, 0, 1]], np.radians(20)))
    three = with_additive(rest, difference(up, rest), 3.0)
    assert angle(three.rotation, rest.rotation)[0] == pytest.approx(60)


@given(seeds, parts)
def test_masked_joints_stay(seed, part):
    a, b = some(seed), some(seed + 1)
    faded = crossfade(a, b, part, [0.0, 1.0, 0.5])
    np.testing.assert_allclose(faded.translation[0], a.translation[0], atol=1e-12)
    whole, half = crossfade(a, b, part), crossfade(a, b, part / 2)
    np.testing.assert_allclose(faded.matrices()[1], whole.matrices()[1], atol=1e-12)
    np.testing.assert_allclose(faded.matrices()[2], half.matrices()[2], atol=1e-12)
    np.testing.assert_array_equal(faded.weights, a.weights)
    on_top = with_additive(a, b, part, [0.0, 1.0, 0.5])
    np.testing.assert_allclose(on_top.matrices()[0], a.matrices()[0], atol=1e-12)


def test_many_poses_and_weights_at_once():
    a, b, c = some(1, (4, 5)), some(2), some(3, (5,))
    weights = np.random.default_rng(0).uniform(size=(4, 5, 3))
    whole = mix([a, b, c], weights)
    assert whole.shape == (4, 5)
    one = Pose(a.translation[2, 3], a.rotation[2, 3], a.scale[2, 3], a.weights[2, 3])
    same(whole[2][3], mix([one, b, c[3]], weights[2, 3]))
    assert crossfade(b, c, np.zeros((4, 1))).shape == (4, 5)
    assert with_additive(b, difference(c, b), np.ones((4, 1)), [1, 0, 1]).shape == (4, 5)


def test_the_time_is_that_of_the_heaviest():
    a, b = (some(i).replaced(time=float(i)) for i in (1, 2))
    assert mix([a, b], [0.6, 0.4]).time == 1
    assert crossfade(a, b, [0.4, 0.6]).time.tolist() == [1, 2]


def test_masks_grow_down_the_tree():
    #  0 - 1 - 2 - 3
    #    \ 4 - 5
    tree = Skeleton([-1, 0, 1, 2, 0, 4], Pose(np.zeros((6, 3))), list('abcdef'))
    assert joint_mask(tree, ['b']).tolist() == [0, 1, 1, 1, 0, 0]
    np.testing.assert_allclose(joint_mask(tree, ['b'], 2), [0, 1 / 3, 2 / 3, 1, 0, 0])
    np.testing.assert_allclose(joint_mask(tree, [0], 1), [0.5, 1, 1, 1, 1, 1])
    assert joint_mask(tree, ['d', 'e']).tolist() == [0, 0, 0, 1, 1, 1]
    assert joint_mask(tree, []).sum() == 0


def test_bad_input_is_named():
    a, b = some(1), some(2)
    refused(r'weights must have shape \(..., 2\), got \(3,\)', mix, [a, b], [1, 1, 1])
    for weights in ([-1, 2], [0, 0], [np.nan, 1]):
        refused('weights must be finite, not negative', mix, [a, b], weights)
    refused(r'weight must be from 0 to 1, got 1\.5', crossfade, a, b, 1.5)
    refused('mask must be from 0 to 1, got nan', crossfade, a, b, 0.5, [np.nan, 1, 1])
    refused(r'mask must have shape \(3,\), got \(2,\)', with_additive, a, b, 1.0, [1, 1])
    tree = Skeleton([-1], Pose(np.zeros((1, 3))), ['hip'])
    refused(r"joint must be in the skeleton \(hip.*, got 'nose'", joint_mask, tree, ['nose'])
    refused('feather must be 0 or more, got -1', joint_mask, tree, ['hip'], -1)
