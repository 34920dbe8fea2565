"""The posing pass against the float64 reference: read back from its textures."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import FigureMesh, Morphs
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.figures import shapes as shapes_module
from tests.animation.conftest import refused
from tests.figures.makers import bend, growing, morphs, skeleton, skin, tube, worm


def read_back(actor, body=0):
    """Return posed points and normals of a shown figure, in its space."""
    positions, normals = actor._posing.gpu.download(body)
    n = len(actor.figure.meshes[body].points)
    shown = actor._posed[body]
    origin = actor._moment.origin if shown.figure_mesh.skin is not None else shown.rest_mesh.origin
    return positions[:n] + origin, normals[:n]


def check(figure, pose=None, how='linear', bulge=1.0, time=0.0):
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    actor = pl.ibr.add_animated(figure, skinning=how, bulge=bulge)
    if pose is not None:
        actor.pose = pose
    pl.ibr.time = time
    pl.show(auto_close=False)
    points, normals = read_back(actor)
    expected, directions = figure.posed(0, actor.pose, how, bulge)
    size = np.ptp(expected, axis=0).max()
    assert np.abs(points - expected).max() <= 1e-5 * size
    lit = np.linalg.norm(directions, axis=1) > 0.5
    cosine = (normals * directions).sum(1)[lit]
    sine = np.linalg.norm(np.cross(normals, directions), axis=1)[lit]
    assert np.degrees(np.arctan2(sine, cosine)).max() <= 0.1
    pl.close()


@pytest.mark.parametrize('how', ['linear', 'dual'])
@pytest.mark.parametrize(('offset', 'move'), [(0, 0), (1e6, 0), (0, 1e6)])
def test_skinning_agrees_wherever_it_is(how, offset, move):
    figure = worm(offset)
    check(figure, bend(figure, 0.5, move), how)


@pytest.mark.parametrize('k', [1, 3, 5, 8])
@pytest.mark.parametrize('how', ['linear', 'dual'])
def test_any_number_of_joints_a_vertex(k, how):
    mesh, bones = tube(), skeleton()
    few = skin(mesh, bones, min(k, 5))
    rows = np.arange(mesh.n_points)[:, None]
    joints = np.concatenate([few.joints, np.zeros((len(rows), max(k - 5, 0)), int)], 1)
    weights = np.concatenate([few.weights, np.zeros((len(rows), max(k - 5, 0)))], 1)
    few.joints, few.weights = joints[:, ::-1].copy(), weights[:, ::-1].copy()
    figure = Figure([FigureMesh(mesh, skin=few)], bones)
    check(figure, bend(figure, 0.4), how)


@pytest.mark.parametrize('bulge', [0.0, 0.5])
def test_bulge(bulge):
    figure = worm()
    check(figure, bend(figure, 0.6), 'dual', bulge)


def test_mirrored_joints_keep_normals_outward():
    figure = worm()
    check(figure, np.diag([-1.0, 1, 1, 1]) @ figure.world(bend(figure, 0.2)))


def test_morphs_and_joints():
    figure = worm(n_morphs=5)
    check(figure, bend(figure, 0.3, weights=[0.5, 0, -0.7, 0, 1.5]))


SPARSE = Morphs([(np.array([3, 5]), np.ones((2, 3))), None])


@pytest.mark.parametrize(
    ('targets', 'weights'), [(morphs(tube().n_points), [1.0, -0.5, 0.25]), (SPARSE, [2.0, 1.0])]
)
def test_morphs_alone(targets, weights):
    figure = Figure([FigureMesh(tube(), morphs=targets)])
    check(figure, figure.rest.replaced(weights=weights))


@pytest.mark.parametrize('interpolation', ['step', 'linear', 'quadratic', 'cubic'])
@pytest.mark.parametrize('time', [0.0, 1.0, 2.7])
def test_key_frames(interpolation, time):
    check(growing(interpolation=interpolation), time=time)


@pytest.mark.parametrize('how', ['linear', 'dual'])
def test_key_frames_morphs_and_joints_in_their_order(how):
    mesh, bones = tube(), skeleton()
    points = np.asarray(mesh.points, float)
    positions = np.stack([points, points * [1.3, 0.8, 1.0], points - [0, 0, 0.2]])
    frames = VertexAnimation([0.0, 1.0, 2.0], positions)
    body = FigureMesh(mesh, skin=skin(mesh, bones), morphs=morphs(mesh.n_points), frames=frames)
    figure = Figure([body], bones)
    pose = bend(figure, 0.3, weights=[0.3, 0.0, -0.6])
    check(figure, pose.replaced(time=1.3), how)


def test_correctives():
    from pvibr.animation.correctives import Correctives, PoseSpace

    figure = worm()
    bent = bend(figure, 0.5)
    keys = bent.__class__(bent.translation[None], bent.rotation[None])
    space = PoseSpace([1, 2], keys, figure.rest)
    n = figure.meshes[0].mesh.n_points
    fixed = Figure(
        figure.meshes, figure.skeleton, correctives=Correctives(space, {0: morphs(n, 1)})
    )
    check(fixed, bend(figure, 0.4))


def test_more_joints_than_a_row_of_the_state(monkeypatch):
    monkeypatch.setattr('pvibr.figures.pose_sheet.STATE_WIDTH', 8)
    figure = worm(n_morphs=3)
    pose = bend(figure, 0.3, weights=[0.5, 0.1, -0.7])
    check(figure, pose)
    check(figure, pose, 'dual')


def test_shapes_stream_through_a_small_store(monkeypatch):
    """More shapes than there is room for come and go; those in use are right."""
    monkeypatch.setattr(shapes_module, 'BUDGET', 1)
    figure = worm(n_morphs=6)
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    actor = pl.ibr.add_animated(figure)
    pl.show(auto_close=False)
    for shown in ([0], [1, 2], [5], [3, 4], [0, 1, 2, 3, 4, 5]):
        weights = np.zeros(6)
        weights[shown] = 0.5
        actor.weights = weights
        pl.render()
        expected, _ = figure.posed(0, actor.pose)
        assert np.abs(read_back(actor)[0] - expected).max() < 1e-5
        store = actor._posing.gpu._meshes[0].store
        assert store.nbytes <= (8 + 2) * store.rows * 1024 * 32
    pl.close()


def test_each_shape_is_uploaded_once():
    figure = worm(n_morphs=4)
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    actor = pl.ibr.add_animated(figure)
    pl.show(auto_close=False)
    for weight in (0.1, 0.2, 0.3):
        actor.weights = [weight, 0, 0, 1]
        pl.render()
    assert actor._posing.gpu._meshes[0].store.loads == 2
    pl.close()


def test_several_poses_of_one_mould():
    """One pass poses a body many times: each pose has its own rows."""
    from pvibr.figures.posing import MeshPose, Posing
    from pvibr.gl.hidden_window import hidden_window

    figure = worm()
    pl = pv.Plotter(off_screen=True)
    rest_mesh = pl.ibr.add_animated(figure)._posed[0].rest_mesh
    poses = [bend(figure, angle) for angle in (0.0, 0.2, 0.4)]
    places = [
        MeshPose(figure.meshes[0].skin.matrices(figure.world(p)), np.zeros(3)) for p in poses
    ]
    rest_mesh.shapes = None
    with hidden_window() as (window, _):
        posing = Posing(window, [rest_mesh, rest_mesh], poses=3)
        posing.draw([places, places[::-1]])
        for i, pose in enumerate(poses):
            expected, _ = figure.posed(0, pose)
            for one, slot in ((0, i), (1, 2 - i)):
                points, _ = posing.download(one, slot)
                assert np.abs(points[: len(expected)] - expected).max() < 1e-5
        posing.release()
    pl.close()


def test_too_many_vertices_are_said():
    from pvibr.figures.posing import Posing, RestMesh

    one = RestMesh(np.zeros((1, 3)), np.zeros((1, 3)))
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    pl.show(auto_close=False)
    refused('in 100000 poses', Posing, pl.render_window, [one], poses=100000)
    pl.close()
