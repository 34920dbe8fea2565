"""A figure's reference pose, its bounds, and what is refused."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Morphs, Pose, Skeleton, Skin, Track
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.maths.transforms import transform_normals, transform_points
from tests.animation.conftest import refused
from tests.makers import sheet

SEEDS = st.integers(0, 2**32 - 1)


def random_pose(rng, n, lead=(), scale=0.0, weights=0):
    return Pose(
        rng.normal(size=(*lead, n, 3)),
        rng.normal(size=(*lead, n, 4)),
        np.exp(scale * rng.normal(size=(*lead, n, 3))),
        rng.normal(size=(*lead, weights)),
        rng.random(lead),
    )


def random_figure(rng, n=6, v=30, k=4, targets=3, scale=0.0, frames=None):
    """Return a figure of a skinned body with morph targets and of an unskinned one."""
    parents = [rng.integers(-1, i) if i else -1 for i in range(n)]
    skeleton = Skeleton(parents, random_pose(rng, n, scale=scale))
    weights = rng.random((v, k)) ** 3 * (rng.random((v, k)) < 0.6)
    weights[:, 0] += 0.01
    bind = np.linalg.inv(skeleton.world(skeleton.rest))
    skin = Skin(np.arange(n), bind, rng.integers(0, n, (v, k)), weights)
    morphs = Morphs(rng.normal(size=(targets, v, 3)) * 0.3, rng.normal(size=(targets, v, 3)))
    mesh = sheet(rng.normal(size=(v, 3)))
    return Figure(
        [FigureMesh(mesh, -1, skin, morphs, frames), FigureMesh(mesh, node=n - 1)], skeleton
    )


def test_at_rest_nothing_moves():
    figure = random_figure(np.random.default_rng(0))
    body = figure.meshes[0]
    for how in ('linear', 'dual'):
        points, normals = figure.posed(0, skinning=how)
        assert np.allclose(points, body.points)
        assert np.allclose(normals, body.normals)


def test_a_body_of_a_node_moves_with_it():
    rng = np.random.default_rng(0)
    figure = random_figure(rng)
    pose = random_pose(rng, 6, scale=0.3, weights=3)
    matrix = figure.world(pose)[5]
    points, normals = figure.posed(1, pose)
    assert np.allclose(points, transform_points(matrix, figure.meshes[1].points))
    assert np.allclose(normals, transform_normals(matrix, figure.meshes[1].normals))


def test_a_skinned_body_ignores_its_node():
    rng = np.random.default_rng(0)
    figure = random_figure(rng)
    body = figure.meshes[0]
    hung = Figure([FigureMesh(body.mesh, 3, body.skin, body.morphs)], figure.skeleton)
    pose = random_pose(rng, 6, weights=3)
    assert np.array_equal(figure.posed(0, pose)[0], hung.posed(0, pose)[0])


def test_matrices_from_outside_are_a_pose():
    rng = np.random.default_rng(0)
    figure = random_figure(rng)
    pose = random_pose(rng, 6, scale=0.3)
    world = figure.skeleton.world(pose)
    by_pose = figure.posed(0, pose.replaced(weights=figure.rest.weights))[0]
    assert np.allclose(figure.posed(0, world)[0], by_pose)
    assert np.allclose(figure.skeleton.local(world), pose.matrices())


def test_weights_of_each_body_are_its_own():
    mesh = sheet(np.eye(3))
    bodies = [FigureMesh(mesh, morphs=Morphs(np.full((n, 3, 3), float(n)))) for n in (1, 2)]
    figure = Figure([bodies[0], FigureMesh(mesh), bodies[1]])
    pose = figure.rest.replaced(weights=[-0.5, 2.0, 3.0])
    assert np.allclose(figure.posed(0, pose)[0], np.eye(3) - 0.5)
    assert np.allclose(figure.posed(1, pose)[0], np.eye(3))
    assert np.allclose(figure.posed(2, pose)[0], np.eye(3) + 10.0)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, how=st.sampled_from(['linear', 'dual']), scale=st.sampled_from([0.0, 0.5]))
def test_bounds_hold_every_posed_vertex(seed, how, scale):
    rng = np.random.default_rng(seed)
    frames = None
    if rng.random() < 0.5:
        frames = VertexAnimation(np.arange(4.0) / 3, rng.normal(size=(4, 30, 3)), None, 'cubic')
    figure = random_figure(rng, scale=scale, frames=frames)
    poses = random_pose(rng, 6, (5,), scale, 3)
    bounds = figure.bounds(poses, how).reshape(5, 3, 2)
    for i in range(5):
        parts = [figure.posed(b, poses[i], how)[0] for b in range(2)]
        points = np.concatenate(parts)
        assert (points >= bounds[i, :, 0]).all()
        assert (points <= bounds[i, :, 1]).all()
        assert np.allclose(figure.bounds(poses[i], how).reshape(3, 2), bounds[i])


def test_bounds_at_rest_are_tight():
    figure = random_figure(np.random.default_rng(3))
    skinned = Figure(figure.meshes[:1], figure.skeleton)
    for how in ('linear', 'dual'):
        assert np.allclose(skinned.bounds(None, how), skinned.mesh().bounds, atol=1e-4)


def test_a_figure_of_nothing_has_empty_bounds():
    assert Figure([]).bounds().tolist() == [1, -1] * 3
    assert Figure([FigureMesh(pv.PolyData())]).bounds().tolist() == [1, -1] * 3
    assert Figure([]).mesh().n_points == 0
    assert Figure([]).mesh(merge=False).n_blocks == 0


def test_a_mesh_keeps_its_data_and_has_posed_normals():
    mesh = pv.Sphere()
    mesh['heat'] = mesh.points[:, 2]
    skeleton = Skeleton([-1], [np.eye(4)])
    up = Clip('up', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 4]])])
    figure = Figure([FigureMesh(mesh, 0)], skeleton, [up])
    posed = figure.mesh(0.5, 'up')
    assert np.allclose(posed.points - mesh.points, [0, 0, 2], atol=1e-6)
    assert np.array_equal(posed['heat'], mesh['heat'])
    assert np.allclose(posed.active_normals, mesh.active_normals, atol=1e-6)
    assert np.array_equal(mesh.points, pv.Sphere().points)


def test_clips_are_found_by_name_number_and_self():
    clips = [Clip('Walk', []), Clip('Run', [])]
    figure = Figure([], clips=clips)
    assert [figure.clip(c) for c in ('Run', 1, clips[1], None)] == [clips[1]] * 3 + [clips[0]]
    refused(r"clip must be in the figure \('Walk', 'Run'\), got 'Fly'", figure.sample, 0.0, 'Fly')
    refused(r'clip must be in the figure \(none\), got 0', Figure([]).sample, 0.0, 0)


def test_skins_refuse_joints_out_of_range():
    one = np.eye(4)[None]
    with pytest.raises(ValueError, match=r'joints\[1, 0\] must be from 0 to 0, got 1'):
        Skin([0], one, [[0], [1]], [[1.0], [1.0]])
    refused('whole numbers', Skin, [0], one, [[0.0]], [[1.0]])
    refused(r'inverse_bind must be \(2, 4, 4\)', Skin, [0, 1], one, [[0]], [[1.0]])


def test_a_figure_refuses_what_does_not_fit():
    mesh = sheet(np.eye(3))
    refused(r'joints of meshes\[0\] must be from -1 to -1, got 2', Figure, [FigureMesh(mesh, 2)])
    with pytest.raises(ValueError, match='skin must have 3 vertices, got 1'):
        FigureMesh(mesh, skin=Skin([0], [np.eye(4)], [[0]], [[1.0]]))
    with pytest.raises(ValueError, match=r'positions\[0\] must have 3 rows, got 4'):
        FigureMesh(mesh, morphs=Morphs(np.zeros((1, 4, 3))))
    with pytest.raises(ValueError, match='frames must have 3 vertices, got 4'):
        FigureMesh(mesh, frames=VertexAnimation([0.0], np.zeros((1, 4, 3))))
    figure = Figure([FigureMesh(mesh, 0)], Skeleton([-1], [np.eye(4)]))
    with pytest.raises(ValueError, match='pose must have 1 matrices, one per joint, got 2'):
        figure.posed(0, np.tile(np.eye(4), (2, 1, 1)))
    refused('skinning must', random_figure(np.random.default_rng(0)).posed, 0, skinning='cubic')
    refused('pose must be a single pose', figure.posed, 0, figure.sample([0.0, 1.0]))
    with pytest.raises(ValueError, match='pose must have 0 morph weights, got 1'):
        figure.weights(0, figure.rest.replaced(weights=[1.0]))


def test_frames_come_before_morphs():
    frames = VertexAnimation([0.0, 1.0], np.stack([np.eye(3), 3 * np.eye(3)]))
    figure = Figure(
        [FigureMesh(sheet(np.eye(3)), morphs=Morphs(np.ones((1, 3, 3))), frames=frames)]
    )
    assert np.array_equal(figure.meshes[0].points, np.eye(3))
    pose = figure.sample(0.5).replaced(weights=[2.0])
    points, normals = figure.posed(0, pose)
    assert np.allclose(points, 2 * np.eye(3) + 2)
    assert np.allclose(normals, figure.meshes[0].normals)


def test_colours_and_tangents_are_morphed_and_tangents_are_moved():
    mesh = sheet(np.eye(3))
    mesh['paint'] = np.full((3, 4), 0.5)
    mesh['Tangents'] = np.tile([1.0, 0.0, 0.0], (3, 1))
    morphs = Morphs(
        np.zeros((1, 3, 3)),
        tangents=[np.tile([-1.0, 1.0, 0.0], (3, 1))],
        colors=[([0], [[1.0, -1.0, 0.0]])],
    )
    look = {'scalars': 'paint', 'rgb': True}
    skeleton = Skeleton([-1], Pose([[0, 0, 0]], scale=2.0))
    figure = Figure([FigureMesh(mesh, 0, morphs=morphs, look=look)], skeleton)
    turned = Pose([[9, 9, 9]], [[1, 0, 0, 1]], weights=[1.0])
    posed = figure.mesh(pose=turned)
    assert posed['paint'].tolist() == [[1, 0, 0.5, 0.5], [0.5] * 4, [0.5] * 4]
    assert np.allclose(posed['Tangents'], [-1, 0, 0])
    assert np.allclose(figure.mesh()['Tangents'], [1, 0, 0])
    assert Figure([FigureMesh(pv.Sphere())]).colors(0) is None
    assert Figure([FigureMesh(pv.Sphere())]).tangents(0) is None


def test_meshes_are_merged_or_kept_apart():
    parts = Figure([FigureMesh(pv.Cube(), name='box'), FigureMesh(pv.Sphere(), name='ball')])
    apart, merged = parts.mesh(merge=False), parts.mesh()
    assert apart.keys() == ['box', 'ball']
    assert merged.n_cells == sum(block.n_cells for block in apart)
    np.testing.assert_array_equal(merged['Normals'], np.vstack([b['Normals'] for b in apart]))
    with pytest.raises(TypeError, match='merge must be'):
        parts.mesh(merge='yes')
