"""A frame in which nothing moved is drawn as it was; whatever changes is seen in the next one."""

import numpy as np
import pytest
import pyvista as pv

import pvibr

_PLACES = np.random.default_rng(4).uniform(-6, 6, (300, 3)) * (1, 1, 0.1)
_OTHER_MESH = pv.Cube(x_length=0.7)


def _turn(plotter, _things):
    plotter.camera.Azimuth(20.0)


def _zoom_by_vtk(plotter, _things):
    plotter.renderer.GetActiveCamera().SetViewAngle(20.0)


def _parallel(plotter, _things):
    plotter.enable_parallel_projection()


def _resize(plotter, _things):
    plotter.window_size = [260, 140]


def _light(plotter, _things):
    plotter.renderer.lights[0].intensity = 0.2


def _color(_plotter, things):
    things.prop.color = 'red'


def _colors(_plotter, things):
    things.colors = np.tile(np.uint8([[20, 200, 30]]), (len(things), 1))


def _scalars(_plotter, things):
    things.scalars = np.arange(len(things))


def _mask(_plotter, things):
    things.visible = np.arange(len(things)) % 2 == 0


def _hide_by_vtk(_plotter, things):
    things.SetVisibility(False)


def _move(_plotter, things):
    things.position = (1.0, 2.0, 0.5)


def _turn_by_vtk(_plotter, things):
    things.RotateZ(30.0)


def _poses(_plotter, things):
    things.poses = np.add(_PLACES, (0.5, 0, 0))


def _max_error(_plotter, things):
    things.max_error = 20.0


def _level(_plotter, things):
    things.force_level = 'flat'


def _add_mesh(plotter, _things):
    plotter.add_mesh(_OTHER_MESH, color='white', name='cube')


def _effect(plotter, _things):
    plotter.ibr.add(pvibr.AmbientOcclusion())


def _remove(plotter, things):
    plotter.ibr.remove(things)


_CHANGES = [
    *(_turn, _zoom_by_vtk, _parallel, _resize, _light, _color, _colors, _scalars),
    *(_mask, _hide_by_vtk, _move, _turn_by_vtk, _poses, _max_error, _level, _add_mesh),
    *(_effect, _remove),
]


def _scene():
    plotter = pv.Plotter(off_screen=True, window_size=(200, 150))
    mesh = pv.Sphere(theta_resolution=24, phi_resolution=20)
    plotter.add_mesh(_OTHER_MESH.translate((5, 0, 2)), color='white')
    things = plotter.ibr.add_instances(mesh, _PLACES, bake=True)
    plotter.camera_position = [(12, -11, 6), (0, 0, 0), (0, 0, 1)]
    plotter.show(auto_close=False)
    return plotter, things, mesh


def _picture(plotter):
    plotter.render()
    return plotter.screenshot(return_img=True).astype(int)


@pytest.mark.parametrize('change', _CHANGES, ids=lambda change: change.__name__.strip('_'))
def test_a_change_after_still_frames_is_seen(change):
    """It is drawn as by a plotter that saw no still frame."""
    plotter, things, _ = _scene()
    before = [_picture(plotter) for _ in range(4)]
    assert all((picture == before[0]).all() for picture in before)
    change(plotter, things)
    after = _picture(plotter)
    assert after.shape != before[0].shape or (after != before[0]).any()
    fresh_plotter, fresh_things, _ = _scene()
    change(fresh_plotter, fresh_things)
    np.testing.assert_array_equal(after, _picture(fresh_plotter))


def test_a_changed_mesh_is_seen():
    plotter, _, mesh = _scene()
    before = [_picture(plotter) for _ in range(4)][-1]
    mesh.points *= 1.4
    assert (_picture(plotter) != before).any()


def test_still_frames_prepare_nothing():
    plotter, things, _ = _scene()
    for _ in range(3):
        plotter.render()
    frame = plotter.ibr.pipeline.view()
    assert things.is_prepared(frame)
    things.visible = np.arange(len(things)) > 5
    assert not things.is_prepared(frame)
