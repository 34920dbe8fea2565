import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.animation import skinning
from pvibr.maths import quaternions
from pvibr.maths.transforms import transform_normals

SEEDS = st.integers(0, 2**32 - 1)


def rigid_motions(rng, n, size=1.0):
    matrices = np.tile(np.eye(4), (n, 1, 1))
    matrices[:, :3, :3] = quaternions.to_matrices(rng.normal(size=(n, 4)))
    matrices[:, :3, 3] = rng.normal(size=(n, 3)) * size
    return matrices


def random_skin(rng, v=40, m=7, k=5):
    weights = rng.random((v, k)) ** 3 * (rng.random((v, k)) < 0.6)
    weights[:, 0] += 0.01
    return rng.integers(0, m, (v, k)), skinning.normalized_weights(weights)


def blend(how, *args, **options):
    return {'linear': skinning.linear_blend, 'dual': skinning.dual_blend}[how](*args, **options)


@given(arrays(np.float64, (6, 8), elements=st.floats(0, 1e300)))
def test_weights_become_a_partition_of_one(weights):
    weights[:, 3] += 1e-300
    assert np.allclose(skinning.normalized_weights(weights).sum(1), 1, atol=1e-15)


@pytest.mark.parametrize('how', ['linear', 'dual'])
@given(seed=SEEDS)
def test_one_motion_of_all_joints_is_that_motion(how, seed):
    rng = np.random.default_rng(seed)
    joints, weights = random_skin(rng)
    motion = rigid_motions(rng, 1)
    found = blend(how, np.repeat(motion, 7, 0), joints, weights)
    assert np.allclose(found, motion[:, :3], atol=1e-12)


@pytest.mark.parametrize('how', ['linear', 'dual'])
@given(seed=SEEDS)
def test_blending_knows_no_special_origin(how, seed):
    """Skinning in another frame of reference, and back, is the same."""
    rng = np.random.default_rng(seed)
    joints, weights = random_skin(rng)
    matrices, centers = rigid_motions(rng, 7), rng.normal(size=(7, 3))
    matrices[:, :3, :3] *= rng.uniform(0.5, 2.0, (7, 1, 3))
    frame = rigid_motions(rng, 1, 10.0)[0]
    back = np.linalg.inv(frame)
    options = {'centers': centers} if how == 'dual' else {}
    here = blend(how, matrices, joints, weights, **options)
    if how == 'dual':
        options = {'centers': centers @ frame[:3, :3].T + frame[:3, 3]}
    there = blend(how, frame @ matrices @ back, joints, weights, **options)
    points = rng.normal(size=(len(joints), 3))
    moved = skinning.moved_points(here, points) @ frame[:3, :3].T + frame[:3, 3]
    same = skinning.moved_points(there, points @ frame[:3, :3].T + frame[:3, 3])
    assert np.abs(moved - same).max() < 1e-9


@given(seed=SEEDS)
def test_dual_quaternions_stay_rigid(seed):
    rng = np.random.default_rng(seed)
    joints, weights = random_skin(rng)
    found = skinning.dual_blend(rigid_motions(rng, 7), joints, weights)[:, :, :3]
    assert np.allclose(found @ np.swapaxes(found, 1, 2), np.eye(3), atol=1e-9)
    assert np.allclose(np.linalg.det(found), 1)


@given(seed=SEEDS)
def test_the_sign_of_a_quaternion_does_not_matter(seed):
    """A rotation by 2 pi more is the same joint, whatever the others are."""
    rng = np.random.default_rng(seed)
    joints, weights = random_skin(rng)
    matrices = rigid_motions(rng, 7)
    real, dual, _ = skinning.dual_parts(matrices)
    flip = rng.choice([-1.0, 1.0], (7, 1))
    assert np.allclose(skinning.rigid(real * flip, dual * flip), matrices[:, :3], atol=1e-12)
    heaviest = joints[np.arange(len(joints)), weights.argmax(1)]
    dots = (real[joints] * real[heaviest][:, None]).sum(-1)
    signs = np.where(dots < 0, -1.0, 1.0)[..., None]
    total = (weights[..., None] * signs * real[joints]).sum(1)
    # On the heaviest joint's side no sum can vanish.
    assert (np.linalg.norm(total, axis=1) >= weights.max(1) - 1e-12).all()


def test_antipodal_rotations_turn_the_short_way():
    turns = quaternions.to_matrices(
        quaternions.from_axis_angle([0, 0, 1], np.radians([170.0, 190.0]))
    )
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :3, :3] = turns
    half = skinning.dual_blend(matrices, [[0, 1]], [[0.5, 0.5]])
    assert np.allclose(half[0, :, :3], np.diag([-1, -1, 1]))


def ring(degrees, how):
    """Return the radii of a cross-section between a joint at rest and one twisted by an angle."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles), np.zeros(16)], 1)
    matrices = np.tile(np.eye(4), (2, 1, 1))
    turn = quaternions.from_axis_angle([0, 0, 1], np.radians(degrees))
    matrices[1, :3, :3] = quaternions.to_matrices(turn)
    blended = blend(how, matrices, np.tile([0, 1], (16, 1)), np.full((16, 2), 0.5))
    return np.linalg.norm(skinning.moved_points(blended, points), axis=1)


@pytest.mark.parametrize(('degrees', 'area'), [(90, 0.50), (150, 0.07)])
def test_a_twist_keeps_its_cross_section_with_dual_quaternions_only(degrees, area):
    """The area of the section: linear blending leaves cos^2 of half the angle of it."""
    linear, dual = ring(degrees, 'linear'), ring(degrees, 'dual')
    assert np.allclose(linear**2, np.cos(np.radians(degrees / 2)) ** 2)
    assert linear.max() ** 2 == pytest.approx(area, abs=0.005)
    assert dual.min() ** 2 >= 0.95


def test_bulge_lies_between_both():
    rng = np.random.default_rng(1)
    joints, weights = random_skin(rng)
    matrices = rigid_motions(rng, 7)
    linear = skinning.linear_blend(matrices, joints, weights)
    dual = skinning.dual_blend(matrices, joints, weights)
    assert np.allclose(skinning.dual_blend(matrices, joints, weights, bulge=0.0), linear)
    half = skinning.dual_blend(matrices, joints, weights, bulge=0.5)
    assert np.allclose(half, (linear + dual) / 2)


@given(seed=SEEDS)
def test_scale_and_shear_without_rotation_blend_linearly(seed):
    rng = np.random.default_rng(seed)
    joints, weights = random_skin(rng)
    matrices = np.tile(np.eye(4), (7, 1, 1))
    matrices[:, :3, 3] = rng.normal(size=(7, 3))
    half = rng.normal(size=(7, 3, 3)) * 0.3
    matrices[:, :3, :3] += half @ np.swapaxes(half, 1, 2)  # symmetric: stretch, no rotation
    found = skinning.dual_blend(matrices, joints, weights, rng.normal(size=(7, 3)))
    assert np.allclose(found, skinning.linear_blend(matrices, joints, weights), atol=1e-9)


@given(seed=SEEDS)
def test_a_joint_alone_moves_its_vertices_as_it_is(seed):
    """With scale, shear and mirror."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3] = rng.normal(size=(5, 3, 4))
    joints = rng.integers(0, 5, (20, 1))
    found = skinning.dual_blend(matrices, joints, np.ones((20, 1)), rng.normal(size=(5, 3)))
    assert np.allclose(found, matrices[joints[:, 0], :3], atol=1e-9)


@settings(deadline=None)
@given(seed=SEEDS)
def test_normals_go_by_the_inverse_transpose(seed):
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    normals = rng.normal(size=(10, 3))
    found = skinning.moved_normals(np.repeat(matrix[None, :3], 10, 0), normals)
    assert np.allclose(found, transform_normals(matrix, normals), atol=1e-6)
    assert np.allclose(skinning.moved_normals(matrix[None, :3], normals), found)


def test_normals_of_a_flattened_body_exist():
    flat = np.diag([1.0, 1.0, 0.0])
    moved = skinning.moved_normals(
        np.c_[flat, np.zeros(3)][None], [[0, 0, 1.0], [1.0, 0, 0], [0, 0, 0]]
    )
    assert moved.tolist() == [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
