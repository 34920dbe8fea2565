"""Pose space deformation: key poses are reproduced, far poses get nothing."""

import functools

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation.correctives import Correctives, PoseSpace
from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh, Skin
from pvibr.animation.morphs import Morphs
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton
from pvibr.maths import quaternions
from tests.animation.conftest import refused

RNG = np.random.default_rng(0)
REST = Pose([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])


def bent(degrees, axis=(0, 0, 1), joint=1):
    """Return poses of an arm of three joints, one of them turned."""
    degrees = np.asarray(degrees, dtype=float)
    rotation = np.broadcast_to(REST.rotation, (*degrees.shape, 3, 4)).copy()
    rotation[..., joint, :] = quaternions.from_axis_angle(axis, np.radians(degrees))
    return Pose(np.broadcast_to(REST.translation, (*degrees.shape, 3, 3)), rotation)


def arm(correctives=None, morphs=None):
    """A tube along x, from 0 to 2, bending at 1."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = 0.2 * np.column_stack([0 * angle, np.cos(angle), np.sin(angle)])
    points = np.concatenate([ring + np.array([x, 0, 0]) for x in np.linspace(0, 2, 9)])
    cloud = pv.PolyData(points)
    cloud.point_data['Normals'] = points * [0, 1, 1] / 0.2
    cloud.point_data.active_normals_name = 'Normals'
    far = np.clip((cloud.points[:, 0] - 0.6) / 0.8, 0, 1)
    bind = np.linalg.inv(Skeleton([-1, 0, 1], REST).world(REST))[:2]
    skin = Skin([0, 1], bind, np.tile([0, 1], (len(far), 1)), np.column_stack([1 - far, far]))
    body = FigureMesh(cloud, skin=skin, morphs=morphs)
    return Figure([body], Skeleton([-1, 0, 1], REST, ['root', 'elbow', 'hand']), (), correctives)


def space(degrees, **options):
    return PoseSpace([1], bent(degrees), REST, **options)


@given(st.lists(st.integers(1, 15), min_size=1, max_size=6, unique=True), st.booleans())
def test_each_key_is_reproduced(tens, own):
    degrees = np.array(tens) * 10.0
    radius = np.radians(40 + np.arange(len(tens))) if own else None
    weights = space(degrees, radius=radius).weights(bent(np.append(degrees, 0)))
    np.testing.assert_allclose(weights, np.eye(len(tens) + 1)[:, :-1], atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 3))
def test_key_poses_of_any_joints_are_reproduced(seed, k, j):
    rng = np.random.default_rng(seed)
    keys = Pose(np.zeros((k, j, 3)), rng.normal(size=(k, j, 4)))
    neutral = Pose(np.zeros((j, 3)), rng.normal(size=(j, 4)))
    found = PoseSpace(range(j), keys, neutral)
    np.testing.assert_allclose(found.weights(keys), np.eye(k), atol=1e-9)
    np.testing.assert_allclose(found.weights(neutral), 0, atol=1e-9)
    # A quaternion and its negative are the same rotation.
    other = Pose(keys.translation, -keys.rotation)
    np.testing.assert_allclose(found.weights(other), np.eye(k), atol=1e-9)


def test_far_poses_get_nothing_at_all():
    keys = space([60.0, 90.0], radius=np.radians(30.0))
    far = bent([-150.0, -100.0, 121.0, 180.0])
    assert (keys.weights(far) == 0).all()
    assert (space([40.0]).weights(bent(np.linspace(121, 179, 20))) == 0).all()


def test_the_way_to_a_key_is_even():
    weights = space([90.0]).weights(bent(np.linspace(0, 90, 91)))[:, 0]
    assert (np.diff(weights) > 0).all()
    np.testing.assert_allclose(weights[45], 0.533, atol=1e-3)
    # Only the chosen joint counts, about any axis.
    assert space([90.0]).weights(bent(90.0, joint=2))[0] == pytest.approx(0, abs=1e-12)
    other_way = space([90.0]).weights(bent(90.0, axis=(1, 0, 0)))[0]
    assert other_way < 0.2


def test_weights_have_no_jumps():
    weights = space([30.0, 70.0, 120.0]).weights(bent(np.linspace(-180, 180, 3601)))
    assert np.abs(np.diff(weights, axis=0)).max() < 0.01


def sculpture(figure, keys, skinning='linear'):
    """Return posed shapes with noise, as a sculptor leaves them, and their normals."""
    posed = [figure.posed(0, keys[i], skinning) for i in range(keys.shape[0])]
    points = np.array([p for p, _ in posed]) + RNG.normal(
        0, 0.05, (len(posed), *posed[0][0].shape)
    )
    normals = np.array([n for _, n in posed]) + RNG.normal(0, 0.2, points.shape)
    return points, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@pytest.mark.parametrize('skinning', ['linear', 'dual'])
def test_sculpted_shapes_come_back_at_their_keys(skinning):
    keys = bent([45.0, 90.0, 120.0])
    bare = arm()
    points, normals = sculpture(bare, keys, skinning)
    fixed = arm(
        Correctives.from_sculpted(bare, ['elbow'], keys, points, normals, skinning=skinning)
    )
    for i in range(3):
        found, upright = fixed.posed(0, keys[i], skinning)
        np.testing.assert_allclose(found, points[i], atol=1e-6)
        np.testing.assert_allclose(upright, normals[i], atol=1e-6)
    for pose in (REST, bent(-170.0)):
        np.testing.assert_allclose(
            fixed.posed(0, pose, skinning), bare.posed(0, pose, skinning), atol=1e-12
        )


def test_normals_follow_the_sculpted_shape():
    ball = pv.Sphere(theta_resolution=16, phi_resolution=12)
    body = FigureMesh(
        ball,
        skin=Skin(
            [0], [np.eye(4)], np.zeros((ball.n_points, 1), int), np.ones((ball.n_points, 1))
        ),
    )
    skeleton = Skeleton([-1], Pose([[0.0, 0, 0]]))
    bare = Figure([body], skeleton)
    key = Pose([[[0.0, 0, 0]]], [[quaternions.from_axis_angle([1, 0, 0], 1.0)]])
    flat = bare.posed(0, key[0])[0] * [1, 1, 0.3]
    fixed = Figure([body], skeleton, correctives=Correctives.from_sculpted(bare, [0], key, [flat]))
    points, normals = fixed.posed(0, key[0])
    np.testing.assert_allclose(points, flat, atol=1e-6)
    exact = flat / np.square([1, 1, 0.3])
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert (normals * exact).sum(1).min() > np.cos(np.radians(8))
    rest = bare.posed(0, skeleton.rest)[1]
    np.testing.assert_allclose(fixed.posed(0, skeleton.rest)[1], rest, atol=1e-12)


def test_morph_targets_are_added_before():
    swell = Morphs([RNG.normal(0, 0.1, (len(arm().meshes[0].points), 3))])
    bare, keys = arm(morphs=swell), bent([80.0]).replaced(weights=[[0.7]])
    points, _ = sculpture(bare, keys)
    fixed = arm(Correctives.from_sculpted(bare, [1], keys, points), swell)
    np.testing.assert_allclose(fixed.posed(0, keys[0])[0], points[0], atol=1e-9)
    more = fixed.posed(0, keys[0].replaced(weights=[1.7]))[0] - points[0]
    without = bare.posed(0, keys[0].replaced(weights=[1.7]))[0] - bare.posed(0, keys[0])[0]
    np.testing.assert_allclose(more, without, atol=1e-9)


def test_spaces_of_their_own_do_not_meddle():
    bare = arm()
    keys = [bent([90.0]), bent([60.0], joint=2)]
    made = [
        Correctives.from_sculpted(bare, [j], key, sculpture(bare, key)[0])
        for j, key in zip((1, 2), keys, strict=True)
    ]
    both = made[0] + made[1]
    assert (len(both), len(both.shapes[0])) == (2, 2)
    pose = Pose(REST.translation, quaternions.multiply(keys[0][0].rotation, keys[1][0].rotation))
    np.testing.assert_allclose(both.weights(pose), [1, 1], atol=1e-9)
    plain = bare.posed(0, pose)[0]
    sum_of_both = sum(arm(c).posed(0, pose)[0] - plain for c in made)
    np.testing.assert_allclose(arm(both).posed(0, pose)[0] - plain, sum_of_both, atol=1e-12)


def test_bodies_without_shapes_keep_none_when_added():
    one = Correctives(space([90.0]), {0: Morphs([([2], [[0, 0, 1.0]])])})
    two = Correctives(space([45.0]), {1: Morphs([[[0, 0, 1.0]]])})
    both = one + two
    assert [len(both.shapes[body]) for body in (0, 1)] == [2, 2]
    assert both.shapes[0].total('positions', [1, 1], 3)[:, 2].tolist() == [0, 0, 1]
    assert both.shapes[1].total('positions', [1, 1], 1)[:, 2].tolist() == [1]


def test_a_pose_from_outside_counts_as_well():
    keys = bent([90.0])
    bare = arm()
    points, _ = sculpture(bare, keys)
    fixed = arm(Correctives.from_sculpted(bare, [1], keys, points))
    matrices = bare.skeleton.world(keys[0])
    np.testing.assert_allclose(fixed.posed(0, matrices)[0], points[0], atol=1e-9)


def test_many_poses_at_once():
    keys, poses = space([30.0, 90.0]), bent(np.linspace(0, 120, 60).reshape(4, 15))
    weights = keys.weights(poses)
    assert weights.shape == (4, 15, 2)
    one = Pose(poses.translation[2, 3], poses.rotation[2, 3])
    np.testing.assert_allclose(weights[2, 3], keys.weights(one), atol=1e-12)


def test_bad_input_is_named():
    refused('got equal key0 and key1', space, [30.0, 30.0])
    refused('got equal the neutral pose and key0', space, [0.0])
    refused('small enough to separate', space, [10.0, 10.1, 10.2, 10.3], radius=100.0)
    refused(r'radius must be positive.* got -1.0', space, [10.0], radius=-1.0)
    refused(r'one of the 3 joints, got \[3\]', PoseSpace, [3], bent([10.0]), REST)
    refused(r'keys must be .* got \(\)', PoseSpace, [1], REST, REST)
    refused(r'must hold 1 names.* got 2', space, [10.0], names=['a', 'b'])
    with pytest.raises(ValueError, match=r'shapes\[0\] must have 2 shapes.* got 1'):
        Correctives(space([10.0, 20.0]), {0: Morphs([[[0, 0, 1.0]]])})
    refused(r'pose must have joints up to 1, got 1', space([10.0]).weights, Pose([[0.0, 0, 0]]))
    with pytest.raises(ValueError, match='points must be'):
        Correctives.from_sculpted(arm(), [1], bent([90.0]), np.zeros((1, 2, 3)))
    bare, twist = arm(), bent([180.0], axis=(1, 0, 0))
    with pytest.raises(ValueError, match=r'linear skinning must .* got 12, first'):
        Correctives.from_sculpted(bare, [1], twist, bare.posed(0, twist[0])[0][None])


@given(st.floats(-180, 180))
def test_bounds_hold_what_is_corrected(degrees):
    fixed = bounded()
    points, _ = fixed.posed(0, bent(degrees))
    low, high = np.reshape(fixed.bounds(bent(degrees)), (3, 2)).T
    assert (points >= low - 1e-9).all()
    assert (points <= high + 1e-9).all()


@functools.cache
def bounded():
    keys, bare = bent([60.0, 110.0]), arm()
    points = [bare.posed(0, keys[i])[0] for i in range(2)]
    points = np.array(points) + np.array([[[0, 0, 3.0]], [[0, -2.0, 0]]])
    return arm(Correctives.from_sculpted(bare, [1], keys, points))
