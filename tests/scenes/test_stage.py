import numpy as np
import pytest
import pyvista as pv

from pvibr.capture.montage import compose, error_colors
from pvibr.maths.image_error import silhouette_iou
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import Stage, add_ground, covered, in_view, mesh_actors, spheres

CAMERA = [(6.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]


@pytest.fixture
def ground():
    ground = pv.Plane(i_size=8, j_size=8, center=(0, 0, -1))
    ground['color_rgb'] = np.full((ground.n_points, 3), (90, 160, 60), np.uint8)
    return ground


def balls(xs):
    poses = np.tile(np.eye(4), (len(xs), 1, 1))
    poses[:, 1, 3] = xs
    return [as_parts(pv.Sphere(), color='red')], poses, np.zeros(len(xs), int)


def test_a_picture_is_the_camera_s_whatever_the_samples(ground):
    pictures = []
    for samples in (1, 4):
        with Stage((80, 60), ground, samples=samples, multi_samples=0) as stage:
            stage.bounds = ground.bounds
            stage.add(mesh_actors(*balls([-1.0, 1.0])))
            stage.look(CAMERA)
            pictures.append(stage.picture())
    once, many = pictures
    assert once.shape == many.shape == (60, 80, 3)
    assert np.abs(once - many).mean() < 0.01
    # What is averaged has values between those of one sample.
    assert len(np.unique(many.round(6))) > len(np.unique(once.round(6)))


def test_pixels_are_those_that_a_plotter_shows_by_default(monkeypatch):
    monkeypatch.setattr(pv.global_theme, 'anti_aliasing', 'msaa')
    plotter = pv.Plotter(off_screen=True, window_size=[80, 60])
    with Stage((80, 60), background=plotter.background_color) as stage:
        samples = stage.window.GetMultiSamples()
        assert samples == plotter.render_window.GetMultiSamples() > 0
        for pl in (plotter, stage.plotter):
            pl.add_mesh(pv.ParametricTorus(), color='gold')
        stage.look(CAMERA)
        pixels = stage.picture() * 255
        plotter.camera_position = CAMERA
        assert np.abs(pixels - plotter.screenshot(return_img=True)).max() < 1e-9
        stage.window.SetMultiSamples(0)
        assert np.abs(pixels - stage.picture() * 255).max() > 20
    plotter.close()
    for multi_samples in (None, samples):  # a reference is averaged in one way only
        with Stage((8, 6), samples=4, multi_samples=multi_samples) as stage:
            assert stage.window.GetMultiSamples() == 0


def test_lights_given_are_the_only_ones(ground):
    pictures = []
    for lights in ((), [pv.Light(position=(0, 0, 1), color=color) for color in ('red', 'lime')]):
        with Stage((80, 60), ground, lights=lights) as stage:
            stage.bounds = ground.bounds
            stage.look(CAMERA)
            pictures.append(stage.picture())
            assert len(stage.renderer.lights) == (len(lights) or 5)
    kit, two = (picture[45, 40] for picture in pictures)
    assert (kit > 0).all()
    assert two[2] == 0 < two[0] < two[1]


def test_a_ground_with_normals_is_smooth(ground):
    plotter = pv.Plotter(off_screen=True)
    assert add_ground(plotter, ground).prop.interpolation.name == 'PHONG'
    bare = ground.copy()
    bare.point_data.clear()
    bare['color_rgb'] = ground['color_rgb']
    assert add_ground(plotter, bare).prop.interpolation.name == 'FLAT'


def test_coverage_by_depth_and_by_two_grounds_agree(ground):
    with Stage((80, 60), ground, multi_samples=0) as stage:
        stage.bounds = (-5, 5, -5, 5, -2, 2)
        stage.look(CAMERA)
        stage.draw()
        empty = stage.depth()
        stage.add(mesh_actors(*balls([-1.0, 1.0])))
        before = stage.picture()
        by_depth = covered(stage.depth(), empty, 1)
        by_color = stage.coverage()
        assert np.array_equal(stage.picture(), before)
    assert 0.02 < by_depth.mean() < 0.3
    assert silhouette_iou(by_color, by_depth) > 0.99


def test_in_view_is_what_changes_the_picture():
    meshes, poses, index = balls([-9.0, -1.0, 0.0, 1.0, 9.0])
    with Stage((60, 60)) as stage:
        stage.bounds = (-12, 12, -12, 12, -2, 2)
        stage.look(CAMERA)
        rows = in_view(stage.frame(), *spheres(meshes, poses, index))
    assert set(rows) == {1, 2, 3}
    assert rows[0] == 2  # the nearest first


def test_seconds_are_one_for_each_camera():
    with Stage((16, 16)) as stage:
        assert stage.seconds([CAMERA, CAMERA]).shape == (2,)
        assert stage.seconds([CAMERA] * 9, limit=1e-9).shape == (1,)
        assert stage.driver() != 'unknown'


def test_pictures_side_by_side():
    tile = np.zeros((10, 40, 3))
    figure = compose([(tile, 'a'), (tile, 'b'), (tile, 'c')], columns=2)
    assert figure.shape == (2 * 36, 84, 3)
    assert error_colors(np.array([[0.0, 1.0]])).sum(-1).argmax() == 1
