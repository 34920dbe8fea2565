"""Figures far away, very small, very large, and of joints that are hardly joints."""

import numpy as np
import pytest

from benchmarks.figures.errors import gpu_errors, shown
from benchmarks.figures.models import tube
from pvibr import Figure
from pvibr.animation import Clip, Morphs, Pose, Skin, Track
from pvibr.animation.blending import crossfade, mix
from pvibr.animation.skinning import dual_blend, linear_blend
from pvibr.maths import quaternions
from tests.animation.conftest import refused

HOW = pytest.mark.parametrize('how', ['linear', 'dual'])
OFFSETS = pytest.mark.parametrize('offset', [0.0, 1e3, 1e6, 1e9])
SCALES = pytest.mark.parametrize('scale', [1e-9, 1e9])
SMALL = 16, 12, 5


def scaled(figure, scale):
    """The same figure in another unit."""
    body, rest = figure.meshes[0], figure.skeleton.rest
    return Figure.from_arrays(
        scale * body.points,
        body.mesh.regular_faces,
        body.skin.joints,
        body.skin.weights,
        figure.skeleton.parents,
        rest.replaced(translation=scale * rest.translation),
        normals=body.normals,
        clips=figure.clips,
    )


def on_the_gpu(figure, pose, how):
    with shown(figure, skinning=how) as actor:
        actor.pose = pose
        actor.pipeline.window.Render()
        return gpu_errors(actor)


@HOW
@OFFSETS
def test_a_pose_is_the_same_wherever_the_figure_is(offset, how):
    near, far = tube(*SMALL), tube(*SMALL, offset=offset)
    for time in (0.0, 0.3, 1.0):
        here, there = (f.posed(0, f.sample(time), how) for f in (near, far))
        digits = 32 * np.spacing(max(offset, 1.0))
        np.testing.assert_allclose(there[0] - offset, here[0], atol=digits)
        np.testing.assert_allclose(there[1], here[1], atol=1e-9)


@HOW
@pytest.mark.parametrize(
    ('offset', 'scale'), [(0.0, 1.0), (1e3, 1.0), (1e6, 1.0), (1e9, 1.0), (0.0, 1e-9), (0.0, 1e9)]
)
def test_the_gpu_agrees_wherever_and_in_whatever_unit_the_figure_is(offset, scale, how):
    figure = tube(*SMALL, offset=offset)
    figure = figure if scale == 1 else scaled(figure, scale)
    position, degrees = on_the_gpu(figure, figure.sample(0.7), how)
    assert position < 1e-5
    assert degrees < 0.1


@HOW
@SCALES
def test_units_do_not_matter(scale, how):
    plain = tube(*SMALL)
    other = scaled(plain, scale)
    pose = plain.sample(0.7)
    points, normals = other.posed(0, other.sample(0.7), how)
    expected, directions = plain.posed(0, pose, how)
    np.testing.assert_allclose(points / scale, expected, atol=1e-12)
    np.testing.assert_allclose(normals, directions, atol=1e-12)
    low, high = np.reshape(other.bounds(other.sample(0.7), how) / scale, (3, 2)).T
    assert (low <= expected.min(0) + 1e-12).all()
    assert (high >= expected.max(0) - 1e-12).all()


@HOW
def test_weights_of_zero_pull_at_nothing(how):
    figure = tube(*SMALL)
    skin, n = figure.meshes[0].skin, len(figure.meshes[0].points)
    pose = figure.sample(0.7)
    expected = figure.posed(0, pose, how)
    figure.meshes[0].skin = Skin(
        skin.nodes,
        skin.inverse_bind,
        np.concatenate([np.full((n, 2), 4), skin.joints], 1),
        np.concatenate([np.zeros((n, 1)), np.full((n, 1), 5e-324), skin.weights], 1),
    )
    for found, wanted in zip(figure.posed(0, pose, how), expected, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert on_the_gpu(figure, pose, how)[0] < 1e-5


def test_vertices_without_weight_are_named():
    weights = np.ones((5, 2))
    weights[[1, 3]] = 0
    refused(r'row 1 and 1 more', Skin, [0, 1], [np.eye(4)] * 2, np.zeros((5, 2), int), weights)


@HOW
def test_a_quaternion_and_its_opposite_are_one_rotation(how):
    figure = tube(*SMALL)
    pose = figure.sample(0.7)
    signs = np.array([1, -1, 1, -1, -1])[:, None]
    flipped = pose.replaced(rotation=signs * pose.rotation)
    expected = figure.posed(0, pose, how)
    for found, wanted in zip(figure.posed(0, flipped, how), expected, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert on_the_gpu(figure, flipped, how)[0] < 1e-5
    for between in (crossfade(pose, flipped, 0.5), mix([pose, flipped], [0.3, 0.7])):
        np.testing.assert_allclose(figure.posed(0, between, how)[0], expected[0], atol=1e-9)


def test_keys_of_opposite_signs_go_the_short_way():
    turns = quaternions.from_axis_angle([[1.0, 0, 0]] * 3, [0.0, 0.2, 0.4])
    rest = Pose([[0.0, 0, 0]])
    times = np.linspace(0, 2, 9)
    straight, flipped = (
        Clip('turn', [Track(0, 'rotation', [0, 1, 2], keys)]).sample(times, rest, loop=False)
        for keys in (turns, turns * [[1], [-1], [1]])
    )
    np.testing.assert_allclose(
        quaternions.to_matrices(flipped.rotation),
        quaternions.to_matrices(straight.rotation),
        atol=1e-12,
    )


def test_halfway_between_opposite_rotations_is_finite():
    half_turn = quaternions.from_axis_angle([0, 0, 1.0], np.pi)
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[1, :3, :3] = quaternions.to_matrices(half_turn)
    joints, weights = np.array([[0, 1]]), np.array([[0.5, 0.5]])
    for blend in (linear_blend, dual_blend):
        assert np.isfinite(blend(matrices, joints, weights)).all()
    left, right = (
        quaternions.slerp([1.0, 0, 0, 0], half_turn * sign, np.linspace(0, 1, 5))
        for sign in (1, -1)
    )
    for way in (left, right):
        np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1, atol=1e-12)


@HOW
@pytest.mark.parametrize(
    'stretch', [[0, 0, 0], [1, 1, 0], [1e-12, 1, 1], [-1, 1, 1], [1e9, 1e-9, 1]]
)
def test_joints_that_collapse_or_mirror_leave_numbers(stretch, how):
    figure = tube(*SMALL)
    pose = figure.sample(0.7)
    scale = pose.scale.copy()
    scale[2] = stretch
    pose = pose.replaced(scale=scale)
    points, normals = figure.posed(0, pose, how)
    assert np.isfinite(points).all()
    assert np.isfinite(normals).all()
    assert np.isfinite(figure.bounds(pose, how)).all()
    moved = np.abs(points).max()
    with shown(figure, skinning=how) as actor:
        actor.pose = pose
        actor.pipeline.window.Render()
        body = actor._posed[0]
        posed = actor._posing.gpu.download(0)[0][: len(points)]
        found = posed + np.asarray(body.actor.user_matrix)[:3, 3]
    assert np.abs(found - points).max() <= 1e-5 * max(moved, 1.0)


@HOW
def test_bones_without_length(how):
    rest = Pose(np.zeros((4, 3)))
    figure = tube(16, 12, 4)
    body = figure.meshes[0]
    bunch = Figure.from_arrays(
        body.points,
        body.mesh.regular_faces,
        body.skin.joints,
        body.skin.weights,
        [-1, 0, 1, 2],
        rest,
    )
    turn = quaternions.from_axis_angle([0, 1.0, 0], 0.3)
    pose = rest.replaced(rotation=np.tile(turn, (4, 1)))
    points, _ = bunch.posed(0, pose, how)
    # All joints turn about one place, so that no point comes farther from it with dual ones.
    assert (np.linalg.norm(points, axis=1) <= np.linalg.norm(body.points, axis=1) + 1e-9).all()
    assert on_the_gpu(bunch, pose, how)[0] < 1e-5


@pytest.mark.parametrize('weight', [0.0, 1e-300, -1e6, 1e6])
def test_morph_weights_of_any_size(weight):
    figure = tube(*SMALL)
    n = len(figure.meshes[0].points)
    figure = tube(*SMALL, morphs=Morphs([np.tile([0.0, 1.0, 0.0], (n, 1))]))
    pose = figure.rest.replaced(weights=[weight])
    points, normals = figure.posed(0, pose)
    np.testing.assert_allclose(points[:, 1], figure.meshes[0].points[:, 1] + weight, rtol=1e-9)
    assert np.isfinite(normals).all()
