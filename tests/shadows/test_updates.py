"""Of shadow maps only those are drawn again that show what changed."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.makers import MATT

SIZE = 1e4
PLACES = {
    'directional': (0.3, 0.2, 1.0),
    'spot': (0.2, 0.1, 0.5),
    'point': (0.02, 0.01, 0.05),
}
WHOLE = {'directional': 1, 'spot': 1, 'point': 6}


class Land:
    """Boxes of a metre on ground of ten kilometres, near and far."""

    def __init__(self, kind, window=(96, 72), seed=3):
        self.pl = pv.Plotter(off_screen=True, window_size=window, lighting='none')
        lamp = pv.Light(position=SIZE * np.array(PLACES[kind]), light_type='scene light')
        lamp.positional, lamp.exponent = kind != 'directional', 0.0
        lamp.cone_angle = 90.0 if kind == 'point' else 30.0
        self.lamp = lamp
        self.pl.add_light(lamp)
        ground = pv.Plane(i_size=SIZE, j_size=SIZE, i_resolution=20, j_resolution=20)
        self.pl.add_mesh(ground, **MATT)
        rng = np.random.default_rng(seed)
        away, turn = SIZE * 10 ** rng.uniform(-3.8, -0.4, 12), rng.uniform(0, 2 * np.pi, 12)
        places = np.c_[away * np.cos(turn), away * np.sin(turn), np.full(12, 0.5)]
        self.boxes = [self.pl.add_mesh(pv.Cube(center=c), **MATT) for c in places]
        self.shadows = self.pl.ibr.add(pvibr.Shadows(resolution=256))

    def look(self, away, turn=0.6):
        eye = away * np.array([np.sin(turn), -np.cos(turn), 0.6]) + [0, 0, 0.2]
        self.pl.camera_position = [eye, (0, 0, 0), (0, 0, 1)]
        self.pl.camera.clipping_range = (max(0.05 * away, 0.3), 3 * SIZE)

    def drawn(self):
        if self.pl.ren_win.GetNeverRendered():
            self.pl.show(auto_close=False)
        self.pl.render()
        return self.shadows.report()['views drawn']

    def picture(self):
        self.drawn()
        return self.pl.screenshot(return_img=True).astype(int)


def may_be_in(view, bounds):
    """Return whether a box's corners are not all beside one plane of a view."""
    x, y, z = np.reshape(bounds, (3, 2))
    corners = np.array(np.meshgrid(x, y, z, [1.0])).reshape(4, -1)
    clip = view.clip_from_view @ view.view_from_world @ corners
    sides = [*(clip[:2] - clip[3]), *(-clip[:2] - clip[3]), clip[2] - clip[3]]
    return not any((side > 0).all() for side in sides)


@pytest.mark.parametrize('kind', PLACES)
def test_one_moved_actor_has_those_views_drawn_again_that_it_is_in(kind):
    land = Land(kind)
    land.look(5.0)
    before = land.drawn()
    views = land.shadows.views_of(land.lamp)
    assert len(views) > WHOLE[kind] + 2
    seen = []
    for box, way in zip(
        land.boxes[:8], np.random.default_rng(1).uniform(-1, 1, (8, 2)), strict=True
    ):
        old = box.GetBounds()
        box.position = (*(40 * way), 0)
        expected = sum(may_be_in(v, old) or may_be_in(v, box.GetBounds()) for v in views)
        now = land.drawn()
        assert now - before == expected
        before = now
        seen.append(expected)
    assert min(seen) < len(views) - 2
    moved = land.picture()
    land.pl.ibr.remove(land.shadows)
    land.pl.ibr.add(pvibr.Shadows(resolution=256))
    np.testing.assert_array_equal(moved, land.picture())


@pytest.mark.parametrize('kind', ['spot', 'point'])
def test_a_dive_has_few_views_drawn_again(kind):
    land = Land(kind, window=(48, 36))
    land.look(SIZE / 2)
    before = land.drawn()
    for away in np.geomspace(SIZE / 2, 5, 60):
        land.look(away)
        now = land.drawn()
    assert now - before <= 40
    for k in range(12):  # to and fro about a place
        land.look(5.0 * 1.1 ** (k % 2))
        now, last = land.drawn(), now
        assert now == last or k < 2


@pytest.mark.parametrize('method', ['pcf', 'pcss', 'msm'])
def test_maps_that_became_more_are_as_if_drawn_anew(method):
    land = Land('directional')
    land.boxes[0].position = (-np.array(land.boxes[0].center)) + [0.5, 0.5, 0.5]
    land.shadows.method = method
    for away in (SIZE / 2, 300.0, 6.0):
        land.look(away)
        found = land.picture()
    land.pl.ibr.remove(land.shadows)
    again = pvibr.Shadows(resolution=256, method=method)
    land.pl.ibr.add(again)
    fresh = land.picture()
    assert np.abs(found - fresh).max(-1).mean() < 0.5
    assert fresh.min() < 20


def test_actors_come_go_and_change_their_shape():
    land = Land('directional')
    land.look(5.0)
    near = land.pl.add_mesh(pv.Cube(center=(0, 0, 0.5)), color='white')
    before = land.drawn()
    views = land.shadows.views_of(land.lamp)
    far = max(land.boxes, key=lambda box: np.hypot(*box.center[:2]))
    few = sum(may_be_in(view, far.GetBounds()) for view in views)
    assert few < len(views)
    points = pv.vtk_points(far.mapper.dataset.points + 0.1)
    changes = [
        (lambda: far.SetVisibility(False), few),
        (lambda: far.SetVisibility(True), few),
        (lambda: far.mapper.dataset.SetPoints(points), few),
        (lambda: near.SetVisibility(False), len(views)),
        (lambda: None, 0),
    ]
    for change, expected in changes:
        change()
        now = land.drawn()
        assert now - before == expected
        before = now


@pytest.mark.parametrize('kind', PLACES)
def test_texels_per_pixel_are_those_of_a_step_on_the_ground(kind):
    land = Land(kind)
    land.look(5.0)
    land.drawn()
    camera, views = land.pl.camera, land.shadows.views_of(land.lamp)
    eye = np.array(camera.position)
    away = eye[2]  # nothing is nearer than the ground below
    place = eye + away * np.array(camera.direction)
    pixel = 2 * away * np.tan(np.radians(camera.view_angle / 2)) / 72
    finest = 0.0
    for view in views:
        ends = [[*place, 1.0], [*(place + 1e-3 * view.view_from_world[0, :3]), 1.0]]
        ends = np.array(ends) @ view.texture_from_world().T
        at = ends[:, :2] / ends[:, 3:]
        if ends[0, 3] > 0 and np.abs(at[0] - 0.5).max() < 0.5:
            finest = max(finest, 256 * np.linalg.norm(at[1] - at[0]) / 1e-3)
    found = land.shadows.report()['texels per pixel']
    assert found == pytest.approx(pixel * finest, rel=0.02)
