"""Figures in a scene: pictures beside those of posed meshes, time, bounds, coming and going."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Figure
from pvibr.animation import FigureMesh, Pose, Skeleton
from tests import pictures
from tests.animation.conftest import refused
from tests.figures.makers import bend, bending, growing, worm

pytestmark = pytest.mark.sampled

VIEW = [(6.0, 5.0, 3.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]


def plotter(size=(160, 120), **kwargs):
    return pictures.plotter(size, **kwargs)


def shot(pl, view=VIEW):
    pl.camera_position = view
    pl.camera.clipping_range = (1.0, 30.0)
    return pictures.shown(pl)


def scene(figure, pose, look, effect=None, *, as_mesh=False):
    """A picture of a figure, or of its posed mesh, over a floor in the light of one lamp."""
    pl = plotter(lighting='none')
    pl.add_light(pv.Light(position=(6, -6, 8), light_type='scene light'))
    pl.add_mesh(pv.Plane(center=(0, 0, -2.5), i_size=12, j_size=12), color='white')
    look = {'show_scalar_bar': False} | look
    if as_mesh:
        thing = pl.add_mesh(figure.mesh(pose=pose), **look)
        actors = [thing]
    else:
        thing = pl.ibr.add_animated(figure, **look)
        thing.pose = pose
        actors = thing.actors()
    if effect is not None:
        pl.ibr.add(effect(actors))
    return shot(pl), pl


def differing(a, b, level=1):
    """How many pixels differ by more than a level."""
    return int((np.abs(a - b).max(-1) > level).sum())


LOOKS = {
    'plain': {'color': 'tan'},
    'smooth': {'color': 'tan', 'smooth_shading': True, 'specular': 0.5},
    'scalars': {'scalars': 'height', 'cmap': 'viridis', 'clim': [-2, 2]},
    'cells': {'scalars': 'number', 'cmap': 'tab10', 'preference': 'cell'},
    'edges': {'color': 'tan', 'show_edges': True},
    'wireframe': {'style': 'wireframe'},
    'points': {'style': 'points', 'point_size': 3},
    'translucent': {'color': 'red', 'opacity': 0.5},
    'metal': {'pbr': True, 'metallic': 0.6, 'smooth_shading': True},
}


@pytest.mark.parametrize('look', LOOKS.values(), ids=LOOKS)
def test_picture_is_that_of_the_posed_mesh(look):
    figure = worm()
    mesh = figure.meshes[0].mesh
    mesh.cell_data['number'] = np.arange(mesh.n_cells) % 7
    pose = bend(figure, 0.3)
    ours, theirs = (scene(figure, pose, look, as_mesh=m)[0] for m in (False, True))
    empty, _ = scene(figure, pose, {'opacity': 0.0}, as_mesh=True)
    assert differing(theirs, empty) > 300
    assert differing(ours, theirs) <= 5


EFFECTS = {
    'pcf': lambda actors: pvibr.Shadows(resolution=1024),
    'volume': lambda actors: pvibr.Shadows(method='volume'),
    'msm': lambda actors: pvibr.Shadows(resolution=1024, method='msm'),
    'outline': lambda actors: pvibr.Outline(),
    'glow': lambda actors: pvibr.Glow(actors),
    'depth of field': lambda actors: pvibr.DepthOfField(radius=8.0),
    'projector': lambda actors: pvibr.Projector(
        np.tile(np.uint8([[[255, 0, 0]], [[0, 255, 255]]]), (32, 64, 1)),
        pvibr.Orthographic((0, 8, 0), (-1, 0, 0), (0, 0, 1), width=4.0, height=4.0),
    ),
}


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=EFFECTS)
def test_effects_are_those_on_the_posed_mesh(effect):
    figure = worm()
    pose, look = bend(figure, 0.35), {'color': 'tan', 'smooth_shading': True}
    ours, pl = scene(figure, pose, look, effect)
    theirs, _ = scene(figure, pose, look, effect, as_mesh=True)
    without, _ = scene(figure, pose, look, as_mesh=True)
    assert all(row['state'] == 'ran' for row in pl.ibr.report().as_dict()['rows'])
    assert differing(theirs, without) > 100
    assert differing(ours, theirs) <= 10


@pytest.mark.parametrize('name', ['depth', 'normal', 'id'])
def test_buffers_are_those_of_the_posed_mesh(name):
    figure = worm()
    found = []
    for as_mesh in (False, True):
        _, pl = scene(figure, bend(figure, 0.3), {'smooth_shading': True}, as_mesh=as_mesh)
        found.append(np.nan_to_num(pl.ibr.buffer(name), posinf=0.0))
    assert np.abs(found[0] - found[1]).max() < 1e-3
    assert len(np.unique(found[0])) >= 3


def test_a_moving_figure_throws_a_moving_shadow():
    """Maps and volumes notice a new pose; a still one draws nothing anew."""
    figure = worm(clips=[bending()])
    for method in ('pcf', 'volume'):
        pl = plotter(lighting='none')
        pl.add_light(pv.Light(position=(6, -6, 8), light_type='scene light'))
        pl.add_mesh(pv.Plane(center=(0, 0, -2.5), i_size=12, j_size=12), color='white')
        pl.ibr.add_animated(figure)
        shadows = pl.ibr.add(pvibr.Shadows(method=method, resolution=512))
        drawn = []
        for time in (0.0, 0.0, 1.0, 1.0):
            pl.ibr.time = time
            shot(pl)
            drawn.append(shadows.report()['views drawn' if method == 'pcf' else 'masks drawn'])
        assert drawn[0] == drawn[1] < drawn[2] == drawn[3]
        pl.close()


def test_depth_is_never_that_of_the_rest_pose():
    """What draws depth alone must not take an actor's mesh for what it shows."""
    from pvibr.gl.doubles import Doubles

    pl = plotter()
    actor = pl.ibr.add_animated(worm()).actors()[0]
    assert Doubles().of(actor) is actor


# -- time ------------------------------------------------------------------------------------


def test_time_poses_and_stillness_uploads_nothing():
    figure = worm(clips=[bending()])
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    pictures = []
    for time in (0.0, 0.0, 1.0, 1.0, 2.0):
        pl.ibr.time = time
        pictures.append(shot(pl))
    assert actor.posed == 3
    assert differing(pictures[0], pictures[2]) > 100
    assert differing(pictures[0], pictures[4]) == 0  # the clip begins again
    shot(pl, [(0.0, 8.0, 1.0), *VIEW[1:]])
    assert actor.posed == 3  # the camera moves no joint


def test_play_and_stop():
    figure = worm(clips=[bending(2.0)])
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    pl.ibr.time = 10.0
    actor.play('bend', speed=2.0, loop=False)
    pl.ibr.time = 10.5
    middle = figure.sample(1.0)
    assert np.allclose(figure.world(actor.pose), figure.world(middle))
    actor.stop()
    pl.ibr.time = 100.0
    assert np.allclose(figure.world(actor.pose), figure.world(middle))
    refused('bend', actor.play, 'walk')
    refused('speed', actor.play, 'bend', speed=np.inf)


def test_a_fade_goes_from_what_is_shown_to_the_clip():
    figure = worm(clips=[bending(2.0)])
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    actor.pose = before = bend(figure, 0.2)
    actor.play('bend', fade=1.0)
    shown = []
    for time in (0.0, 0.5, 1.0):
        pl.ibr.time = time
        shown.append(figure.world(actor.pose))
    assert np.allclose(shown[0], figure.world(before))
    assert np.allclose(shown[2], figure.world(figure.sample(1.0)))
    assert not np.allclose(shown[1], figure.world(figure.sample(0.5)))


def test_any_sampler_drives_it():
    figure = worm()

    class Wave:
        def sample(self, time):
            return bend(figure, 0.3 * np.sin(time))

    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    actor.driver = Wave()
    pl.ibr.time = 1.0
    assert np.allclose(actor.pose.rotation, bend(figure, 0.3 * np.sin(1.0)).rotation)
    refused('sample', setattr, actor, 'driver', 'Wave', kind=TypeError)


def test_an_error_of_a_driver_puts_it_off_and_says_so():
    class Broken:
        def sample(self, time):
            msg = 'out of joint'
            raise RuntimeError(msg)

    pl = plotter()
    actor = pl.ibr.add_animated(worm())
    pl.show(auto_close=False)
    actor.driver = Broken()
    with pytest.warns(pvibr.PvibrWarning, match='out of joint'):
        pl.render()
    assert not actor.enabled


def test_matrices_of_a_simulator():
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.pose = figure.world(bend(figure, 0.3))
    by_matrices = shot(pl)
    actor.pose = bend(figure, 0.3)
    assert differing(by_matrices, shot(pl)) == 0
    refused('matrices', setattr, actor, 'pose', np.eye(4)[None])
    refused('must be a single pose', setattr, actor, 'pose', figure.sample([0.0, 1.0]))


def test_weights_win_over_the_clip():
    figure = worm(n_morphs=3, clips=[bending()])
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    actor.weights = [0.0, 2.0, -1.0]
    pl.ibr.time = 0.5
    assert actor.pose.weights.tolist() == [0.0, 2.0, -1.0]
    assert np.allclose(actor.pose.rotation, figure.sample(0.5).rotation)
    actor.weights = None
    assert actor.weights.tolist() == [0.0, 0.0, 0.0]
    refused('weights', setattr, actor, 'weights', [1.0])


def test_a_pose_without_weights_rests_its_morphs():
    figure = worm(n_morphs=2)
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    bent = bend(figure, 0.2)
    actor.pose = Pose(bent.translation, bent.rotation)
    assert actor.weights.tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match='must have 2 morph weights, got 3'):
        actor.pose = Pose(bent.translation, bent.rotation, weights=[1, 2, 3])


# -- bounds ----------------------------------------------------------------------------------


def test_bounds_hold_every_pose_and_follow_it():
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    for move in (0.0, 3.0, 1e4):
        for angle in (0.0, 0.4, -0.8):
            actor.pose = pose = bend(figure, angle, move)
            points, _ = figure.posed(0, pose)
            low, high = np.reshape(actor.bounds, (3, 2)).T
            assert (low <= points.min(0) + 1e-6).all()
            assert (high >= points.max(0) - 1e-6).all()
            assert np.allclose(pl.bounds, actor.bounds)
    assert (high - low).max() < 12


def test_it_is_drawn_wherever_its_pose_takes_it():
    """VTK's culler must not think of the pose at rest."""
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    for move in ([0, 0, 0], [40.0, 0, 0], [0, -300.0, 20.0]):
        actor.pose = bend(figure, 0.2, np.array(move))
        center = np.array(actor.center)
        pl.camera_position = [center + np.array([5, 4, 2]), center, (0, 0, 1)]
        pl.camera.clipping_range = (1.0, 30.0)
        pl.show(auto_close=False)
        pl.render()
        assert len(np.unique(pl.screenshot(None).reshape(-1, 3), axis=0)) > 5


def test_a_figure_that_outgrows_the_camera_is_not_cut():
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    pl.camera_position = [(9.0, 0, 0), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    actor.pose = bend(figure, 0.0, np.array([-30.0, 0, 0]))
    assert actor.center[0] < -25
    pl.render()
    away = pl.camera.clipping_range[1]
    assert away > 39


def test_a_still_box_uploads_no_vertices():
    figure = worm(clips=[bending()])
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    pl.show(auto_close=False)
    for time in np.linspace(0, 2, 9):
        pl.ibr.time = time
        pl.render()
    before = actor._posed[0].mesh.GetPoints().GetMTime()
    for time in np.linspace(0, 2, 23):
        pl.ibr.time = time
        pl.render()
    assert actor._posed[0].mesh.GetPoints().GetMTime() == before


# -- rigid bodies, matrices ------------------------------------------------------------------


def test_unskinned_bodies_move_with_their_joints():
    bones = Skeleton([-1, 0], Pose([[0.0, 0, 0], [0, 0, 2.0]]))
    figure = Figure([FigureMesh(pv.Cube(), node=1), FigureMesh(pv.Sphere(), node=-1)], bones)
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.pose = Pose([[1.0, 0, 0], [0, 0, 2.0]])
    cube, ball = actor.actors()
    pl.show(auto_close=False)
    assert np.allclose(cube.center, (1, 0, 2))
    assert np.allclose(ball.center, 0, atol=1e-6)
    mesh = plotter()
    mesh.add_mesh(actor.mesh(), color='tan')
    assert differing(shot(pl), shot(mesh)) <= 5
    assert actor.report()['bytes'] == 0


def test_user_matrix():
    figure = worm()
    turn = pv.Transform().rotate_x(70).translate(1, 0, 0.5).matrix
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan', smooth_shading=True)
    actor.pose = bend(figure, 0.3)
    actor.user_matrix = turn
    mesh = plotter()
    mesh.add_mesh(actor.mesh(), color='tan', smooth_shading=True)
    assert differing(shot(pl), shot(mesh)) <= 5
    low, high = np.reshape(actor.bounds, (3, 2)).T
    assert (actor.mesh().points >= low - 1e-6).all()
    assert (actor.mesh().points <= high + 1e-6).all()


def test_key_framed_body_is_drawn():
    figure = growing()
    pl, mesh = plotter(), plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    pl.ibr.time = 2.5
    mesh.add_mesh(figure.mesh(2.5), color='tan')
    assert differing(shot(pl), shot(mesh)) <= 5
    assert np.allclose(actor.mesh().points, figure.mesh(2.5).points)


# -- coming and going ------------------------------------------------------------------------


def test_a_name_is_replaced_and_a_figure_can_come_again():
    figure = worm()
    pl = plotter()
    first = pl.ibr.add_animated(figure, name='worm', show_scalar_bar=False)
    shown = shot(pl)
    second = pl.ibr.add_animated(figure, name='worm', color='tan')
    assert first.pipeline is None
    assert pl.ibr.effects == (second,)
    pl.ibr.remove(second)
    assert 'worm' not in pl.actors
    assert differing(shown, shot(pl)) > 100
    pl.ibr.add(first)
    assert differing(shown, shot(pl)) == 0
    pl.remove_actor('worm')
    pl.render()
    assert pl.ibr.effects == ()


def test_two_subplots_show_two_times():
    figure = worm(clips=[bending()])
    pl = plotter((200, 100), shape=(1, 2))
    for column, start in enumerate((0.0, -1.0)):
        pl.subplot(0, column)
        pl.ibr.add_animated(figure, color='tan').play('bend', start=start)
        pl.camera_position = VIEW
    picture = pl.screenshot(None).astype(int)
    assert differing(picture[:, :100], picture[:, 100:]) > 50


def test_hidden_figures_are_not_posed():
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.visibility = False
    empty = shot(pl)
    assert actor.posed == 0
    assert len(np.unique(empty.reshape(-1, 3), axis=0)) == 1
    actor.visibility = True
    assert differing(shot(pl), empty) > 100
    actor.VisibilityOff()
    assert differing(shot(pl), empty) == 0


def test_one_body_can_be_hidden():
    both = Figure([worm().meshes[0], FigureMesh(pv.Cube(center=(0, 1.5, 0)))], worm().skeleton)
    pl = plotter()
    actor = pl.ibr.add_animated(both, color='tan')
    whole = shot(pl)
    actor.actors()[0].visibility = False
    without = shot(pl)
    assert differing(whole, without) > 100
    assert len(actor.drawn()) == 1
    assert [a is actor.actors()[1] for a in actor.solids()] == [True]
    pl.renderer.SetWorldPoint(0, 0, 0.5, 1)
    pl.renderer.WorldToDisplay()
    hit = pl.ibr.pick(*pl.renderer.GetDisplayPoint()[:2])
    assert hit is None or hit.mesh == 1
    actor.actors()[0].visibility = True
    assert differing(whole, shot(pl)) == 0


def test_skinning_can_be_changed():
    figure = worm()
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.pose = bend(figure, 0.5)
    linear = shot(pl)
    actor.skinning = 'dual'
    assert differing(linear, shot(pl)) > 5
    refused('skinning', setattr, actor, 'skinning', 'cubic')


def test_report_counts():
    pl = plotter()
    actor = pl.ibr.add_animated(worm())
    shot(pl)
    report = actor.report()
    assert report['poses'] == 1
    assert report['vertices'] == worm().meshes[0].mesh.n_points
    assert report['bytes'] > 32 * report['vertices']


def test_scalar_bar():
    pl = plotter()
    pl.ibr.add_animated(worm(), scalars='height')
    assert 'height' in pl.scalar_bars


# -- picking ---------------------------------------------------------------------------------


def picked_scene():
    figure = worm()
    pl = plotter((200, 200))
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.pose = bend(figure, 0.4)
    shot(pl)
    vertex = 700
    points, normals = figure.posed(0, actor.pose)
    toward = np.array(VIEW[0]) - points
    facing = np.flatnonzero((normals * toward).sum(1) > 0.9 * np.linalg.norm(toward, axis=1))
    vertex = facing[0]
    pl.renderer.SetWorldPoint(*points[vertex], 1.0)
    pl.renderer.WorldToDisplay()
    return pl, actor, vertex, points, pl.renderer.GetDisplayPoint()[:2]


def test_pick_finds_the_posed_mesh():
    pl, actor, vertex, points, (x, y) = picked_scene()
    hit = pl.ibr.pick(x, y)
    assert np.linalg.norm(hit.point - points[vertex]) < 1e-3
    assert hit.mesh == 0
    assert hit.vertex == vertex
    assert vertex in actor.posed_meshes()[0].regular_faces[hit.cell]
    assert pl.ibr.pick(1, 1) is None
    actor.pickable = False
    assert pl.ibr.pick(x, y) is None


def test_pickers_of_pyvista_find_the_posed_mesh():
    pl, actor, vertex, points, (x, y) = picked_scene()
    from pvibr.core import _vtk

    picker = _vtk.vtkCellPicker()
    picker.SetTolerance(1e-5)
    assert picker.Pick(x, y, 0, pl.renderer)
    assert np.linalg.norm(np.array(picker.GetPickPosition()) - points[vertex]) < 0.05
    assert picker.GetActor() in actor.actors()
    assert picker.GetDataSet().GetNumberOfPoints() == len(points)
    actor.pose = bend(actor.figure, 0.4, np.array([0, 500.0, 0]))
    pl.render()
    assert not picker.Pick(x, y, 0, pl.renderer)


def test_hardware_picking_finds_the_actor():
    pl, actor, _, _, (x, y) = picked_scene()
    from pvibr.core import _vtk

    picker = _vtk.vtkPropPicker()
    assert picker.PickProp(x, y, pl.renderer)
    assert picker.GetActor() in actor.actors()
    assert not picker.PickProp(2, 2, pl.renderer)


def test_a_stand_in_is_never_drawn():
    pl, actor, *_ = picked_scene()
    before = pl.screenshot(None).astype(int)
    actor.pose = bend(actor.figure, 0.4, np.array([0, 500.0, 0]))
    pl.render()
    after = pl.screenshot(None)
    assert differing(before, after.astype(int)) > 100
    assert len(np.unique(after.reshape(-1, 3), axis=0)) == 1
