"""What people do with figures first."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr import Figure, matrices
from pvibr.animation import ClipSource, FigureMesh, Morphs
from pvibr.animation.pose import Pose
from tests.animation.conftest import refused
from tests.figures.makers import bend, bending, worm
from tests.figures.test_animated_actor import differing, plotter, shot


def leaving():
    """A figure whose clip takes it far from where it is at first."""
    figure = worm(clips=[bending()])
    return figure, bend(figure, 0.3, move=8.0)


def camera_of(fill):
    pl = pv.Plotter(window_size=(60, 60))
    fill(pl)
    pl.show(auto_close=False)
    found = np.array([*pl.camera.position, *pl.camera.focal_point])
    pl.close()
    return found


def by_pose(actor, figure, pose):
    actor.pose = pose


def by_matrices(actor, figure, pose):
    actor.pose = figure.world(pose)


def by_driver(actor, figure, pose):
    actor.driver = type('Always', (), {'sample': lambda self, time: pose})()


def by_user_matrix(actor, figure, pose):
    actor.pose = bend(figure, 0.3)
    actor.user_matrix = pv.Transform().translate(8.0, 8.0, 8.0).matrix


@pytest.mark.parametrize('give', [by_pose, by_matrices, by_driver, by_user_matrix])
def test_the_first_camera_sees_what_is_shown(give):
    figure, pose = leaving()
    meshes = camera_of(lambda pl: pl.add_mesh(figure.mesh(pose=pose)))
    figures = camera_of(lambda pl: give(pl.ibr.add_animated(figure), figure, pose))
    # Bounds of joints are those of a box that holds the mesh.
    np.testing.assert_allclose(figures[3:], meshes[3:], atol=0.6)


def test_the_first_camera_sees_the_figure_at_its_time():
    growing = [pv.Sphere(radius=0.1), pv.Sphere(radius=0.1, center=(9, 0, 0))]

    def fill(pl):
        pl.ibr.add_animated(growing)
        pl.ibr.time = 0.75

    assert camera_of(fill)[3] == pytest.approx(6.75)


def test_the_first_frame_is_not_cut():
    """The camera was put before a figure where it was when it was added."""
    far = [pv.Sphere(radius=0.1), pv.Sphere(radius=0.1, center=(0, 0, -9))]
    pl = pv.Plotter(window_size=(60, 60))
    pl.ibr.add_animated(far, color='red')
    pl.camera_position = [(0, 0, 2), (0, 0, 0), (0, 1, 0)]
    pl.reset_camera_clipping_range()
    pl.ibr.time = 0.75
    picture = pl.screenshot(return_img=True).astype(int)
    assert (picture != picture[0, 0]).any()
    pl.close()


def test_play_without_a_clip_plays_the_first():
    figure, _ = leaving()
    pl = pv.Plotter(window_size=(60, 60))
    actor = pl.ibr.add_animated(figure)
    actor.pose = figure.rest
    actor.play()
    pl.ibr.time = 0.7
    expected = ClipSource(figure).sample(0.7)
    assert isinstance(actor.pose, Pose)
    np.testing.assert_allclose(actor.pose.rotation, expected.rotation)
    pl.close()


def test_closing_while_it_plays(tmp_path):
    figure, _ = leaving()
    pl = pv.Plotter(window_size=(60, 60))
    actor = pl.ibr.add_animated(figure, name='worm')
    pl.ibr.play()
    pl.open_gif(tmp_path / 'worm.gif', fps=5)
    for _ in range(3):
        pl.write_frame()
    assert actor.posed == 3
    pl.close()
    assert not pl.ibr.playing


def test_one_figure_in_two_subplots_and_back_again():
    figure, _ = leaving()
    pl = pv.Plotter(shape=(1, 2), window_size=(120, 60))
    left = pl.ibr.add_animated(figure, name='worm')
    pl.subplot(0, 1)
    right = pl.ibr.add_animated(figure, name='worm')
    assert [r.actors['worm'] for r in pl.renderers] == [left, right]
    pl.remove_actor('worm')
    pl.show(auto_close=False)
    assert pl.ibr.effects == ()
    pl.ibr.add(right)
    pl.render()
    assert right.posed == 1
    pl.close()


def test_it_is_placed_as_actors_are():
    figure = worm()
    pl = pv.Plotter()
    ours, theirs = pl.ibr.add_animated(figure), pl.add_mesh(figure.mesh())
    for actor in (ours, theirs):
        actor.position, actor.orientation = (1, 2, 3), (10, 20, 30)
        actor.origin, actor.scale = (0, 0, 1), (1, 2, 0.5)
        actor.user_matrix = pv.Transform().rotate_x(40).matrix
    matrix = pv.array_from_vtkmatrix(theirs.GetMatrix())
    expected = figure.mesh().transform(matrix, inplace=False)
    np.testing.assert_allclose(ours.mesh().points, expected.points, atol=1e-5)
    lows, highs = np.reshape(ours.bounds, (3, 2)).T
    assert (lows <= expected.points.min(0)).all()
    assert (expected.points.max(0) <= highs).all()
    pl.close()


def test_places_that_are_none_are_refused():
    actor = pv.Plotter().ibr.add_animated(worm())
    refused('position', setattr, actor, 'position', (0, np.nan, 0))
    refused('user_matrix', setattr, actor, 'user_matrix', np.eye(3))
    refused('colour', setattr, actor, 'colour', 'red', kind=AttributeError)


def test_data_of_it_bulge_as_it_does():
    figure = worm()
    actor = pv.Plotter().ibr.add_animated(figure, skinning='dual')
    actor.pose, actor.bulge = bend(figure, 0.4), 0.3
    points, _ = figure.posed(0, actor.pose, 'dual', 0.3)
    np.testing.assert_allclose(actor.mesh().points, points, atol=1e-6)


def test_colours_morph():
    mesh = pv.Sphere()
    mesh['paint'] = np.full((mesh.n_points, 3), 100, np.uint8)
    blush = np.zeros((mesh.n_points, 3))
    blush[mesh.points[:, 2] > 0] = [0.6, 0.0, -0.3]
    targets = Morphs([np.zeros((mesh.n_points, 3))], colors=[blush])
    figure = Figure([FigureMesh(mesh, morphs=targets, look={'scalars': 'paint', 'rgb': True})])
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    plain = shot(pl)
    pictures = []
    for weight in (0.5, 1.0, 0.0):
        actor.weights = [weight]
        pictures.append(shot(pl))
        other = plotter()
        other.add_mesh(actor.mesh(), scalars='paint', rgb=True)
        assert differing(pictures[-1], shot(other)) <= 2
        other.close()
    assert differing(pictures[0], pictures[1]) > 200
    assert differing(pictures[2], plain) == 0
    pl.close()


def test_any_number_of_unlike_figures_is_drawn():
    """Forty, each by its own textures, with shadows and colours: as the meshes that they show."""
    pl, plain = plotter(lighting='none'), plotter(lighting='none')
    look, colors = {'smooth_shading': True, 'culling': 'back'}, ('tan', 'red', 'teal')
    for k in range(40):
        figure = worm(k=1 + k % 6)
        made = pl.ibr.add_animated(figure, color=colors[k % 3], **look)
        made.pose = bend(figure, 0.05 * (k % 9) - 0.2, move=(k % 8 - 3.5, 0, 2.5 * (k // 8) - 6))
        plain.add_mesh(made.mesh(), color=colors[k % 3], **look)
    found = []
    for shown in (pl, plain):
        shown.add_mesh(pv.Plane(center=(0, 3, 0), direction=(0, -1, 0), i_size=20, j_size=20))
        shown.add_light(pv.Light(position=(5, -20, 9), light_type='scene light'))
        shown.ibr.add(pvibr.Shadows(resolution=256))
        found.append(shot(shown, [(3.0, -20.0, 2.0), (0, 0, 0), (0, 0, 1)]))
    assert all(figure.enabled for figure in pl.ibr.effects)
    assert differing(*found, level=4) <= 25
    assert len(np.unique(found[1].reshape(-1, 3), axis=0)) > 100


def test_figures_are_turned_and_scaled_as_instances_are():
    figure = worm()
    pl = pv.Plotter(off_screen=True)
    actor = pl.ibr.add_animated(figure, orient=[0, 0, 1.0], scale=2.0, factor=1.5)
    expected = matrices([[0, 0, 0]], orient=[[0, 0, 1.0]], scale=3.0)[0]
    np.testing.assert_allclose(actor.matrix, expected, atol=1e-12)
    assert actor.scale == pytest.approx((3, 3, 3))
    actor.position = (7, 0, 0)
    np.testing.assert_allclose(actor.matrix[:3, :3], expected[:3, :3], atol=1e-12)
    points = [[0, 0, 0], [9.0, 0, 0]]
    turns = Rotation.from_euler('z', [[0.3], [2.0]])
    crowd = pl.ibr.add_animated(figure, points, orient=turns, scale=[1.0, 2.0], cache=False)
    placed = matrices(points, orient=turns, scale=[1.0, 2.0])
    np.testing.assert_allclose(crowd.poses, placed)
    np.testing.assert_allclose(
        matrices(crowd.joints(1)), placed[1] @ figure.world(figure.rest), atol=1e-12
    )
    np.testing.assert_allclose(
        matrices(actor.joints()), actor.matrix @ figure.world(figure.rest), atol=1e-12
    )
    pl.close()


def test_figures_of_files_stand_up(tmp_path):
    mesh = pv.Cube(y_length=5).triangulate()
    mesh.save(tmp_path / 'tower.ply')
    pl = pv.Plotter(off_screen=True)
    lying = pl.ibr.add_animated(tmp_path / 'tower.ply')
    standing = pl.ibr.add_animated(tmp_path / 'tower.ply', up='z')
    assert np.ptp(np.reshape(lying.bounds, (3, 2)), axis=1).argmax() == 1
    assert np.ptp(np.reshape(standing.bounds, (3, 2)), axis=1).argmax() == 2
    with pytest.raises(ValueError, match='up must be'):
        pl.ibr.add_animated(tmp_path / 'tower.ply', up='x')
    pl.close()


def test_reports_name_figures_that_lie_on_their_backs():
    tall = Figure([FigureMesh(pv.Cube(y_length=4))])
    pl = pv.Plotter(off_screen=True)
    lying = pl.ibr.add_animated(tall)
    crowd = pl.ibr.add_animated(tall, [[0, 0, 0], [3, 0, 0]], cache=False)
    standing = pl.ibr.add_animated(tall, up='z')
    turned = pl.ibr.add_animated(tall, orient=Rotation.from_euler('x', [[90]], degrees=True))
    pl.camera.up = 0, 0, 1
    for thing in (lying, crowd):
        assert "up='z'" in thing.report()['up']
    assert 'up' not in standing.report() | turned.report()
    pl.camera.up = 0, 1, 0
    assert 'up' not in lying.report() | crowd.report()
    pl.close()
