"""Looks: worn, changed, replaced and taken off; the ground that belongs to them."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.presets import LOOKS
from tests.pictures import plotter, shot

SIZE = (160, 120)


def scene(*, offset=(0, 0, 0), up=2, add=True):
    """Return a plotter with a cone on its base and a ball beside it, seen from the side."""
    pl = plotter(SIZE)
    pl.set_background('white')
    if add:
        fill(pl, offset, up)
    return pl


def fill(pl, offset=(0, 0, 0), up=2):
    axes = np.roll(np.eye(3), 2 - up, axis=0)
    for mesh, color in (
        (pv.Cone(center=(0, 0, 1), direction=(0, 0, 1), height=2, resolution=24), 'tomato'),
        (pv.Sphere(radius=0.4, center=(1.0, 0.3, 0.4)), 'steelblue'),
    ):
        moved = mesh.copy()
        moved.points = (mesh.points.astype(float) @ axes) + offset
        pl.add_mesh(moved.compute_normals(), color=color)
    look_at(pl, offset, up)


def look_at(pl, offset=(0, 0, 0), up=2):
    axes = np.roll(np.eye(3), 2 - up, axis=0)
    eye, focus = np.array([1, -7, 2.6]) @ axes + offset, np.array([0, 0, 0.9]) @ axes + offset
    pl.camera_position = [tuple(eye), tuple(focus), tuple(axes[2])]


@pytest.mark.parametrize('name', LOOKS)
def test_worn_and_taken_off(name):
    pl = scene()
    pl.show(auto_close=False)
    before, lights = shot(pl), [light.intensity for light in pl.renderer.lights]
    worn = pl.ibr.look(name)
    assert name in repr(worn)
    after = shot(pl)
    assert np.abs(after.astype(float) - before).max() > 60
    assert {row.state for row in pl.ibr.report().rows} == {'ran'}
    assert pl.ibr.look(None) is None
    assert [light.intensity for light in pl.renderer.lights] == lights
    assert len(pl.ibr) == 0
    np.testing.assert_array_equal(shot(pl), before)
    pl.ibr.look(name)
    np.testing.assert_array_equal(shot(pl), after)


def test_one_replaces_another():
    pl = scene()
    pl.ibr.look('dusk')
    pl.show(auto_close=False)
    pl.ibr.look('paper')
    fresh = scene()
    fresh.ibr.look('paper')
    fresh.show(auto_close=False)
    np.testing.assert_array_equal(shot(pl), shot(fresh))


def test_before_there_is_a_scene():
    pl = scene(add=False)
    look_at(pl)
    pl.ibr.look('studio')
    fill(pl)
    pl.show(auto_close=False)
    other = scene()
    other.ibr.look('studio')
    other.show(auto_close=False)
    np.testing.assert_array_equal(shot(pl), shot(other))


def test_effects_that_were_there_come_back():
    pl = scene()
    mine = pl.ibr.add(pvibr.Shadows(method='hard'))
    bloom = pl.ibr.add(pvibr.Bloom())
    pl.ibr.look('studio')
    assert mine not in pl.ibr
    assert bloom in pl.ibr
    pl.ibr.look('dusk')
    pl.ibr.look(None)
    assert set(pl.ibr.effects) == {mine, bloom}
    pl.ibr.look('dusk')
    pl.ibr.clear()
    assert not len(pl.ibr)
    assert len(pl.renderer.lights) == len(scene().renderer.lights)


def test_what_was_added_since_stays_as_the_look_goes():
    """As in a notebook's cell that is run again and again."""
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    for _ in range(3):
        own = pl.ibr.add(pvibr.Shadows())
        look = pl.ibr.look('studio')
        assert own.pipeline is None
        assert pl.ibr['Shadows'] is look.effects['Shadows']
        shot(pl)
    newer = pl.ibr.add(pvibr.Shadows())
    pl.ibr.look(None)
    assert pl.ibr.effects == (newer,)


def test_own_subplot():
    pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]), border=False)
    for k in range(2):
        pl.subplot(0, k)
        fill(pl)
    pl.show(auto_close=False)
    before = shot(pl)
    pl.ibr.look('dusk')
    after = shot(pl)
    np.testing.assert_array_equal(after[:, : SIZE[0]], before[:, : SIZE[0]])
    assert (after[:, SIZE[0] :] != before[:, SIZE[0] :]).mean() > 0.5


@pytest.mark.parametrize('up', [0, 1])
def test_up_is_as_the_camera_stands(up):
    pictures = []
    for axis in (2, up):
        pl = scene(up=axis)
        look = pl.ibr.look('daylight')
        pl.show(auto_close=False)
        assert look.up == tuple(np.eye(3)[axis])
        pictures.append(shot(pl).astype(float))
    assert np.abs(pictures[0] - pictures[1]).mean() < 1


def test_at_large_coordinates():
    pictures = []
    for offset in ((0, 0, 0), (4.5e5, -3e6, 800.0)):
        pl = scene(offset=offset)
        pl.ibr.look('studio')
        pl.show(auto_close=False)
        pictures.append(shot(pl).astype(float))
    assert np.abs(pictures[0] - pictures[1]).mean() < 1.5


def test_wrong_arguments_leave_what_is_worn():
    pl = scene()
    worn = pl.ibr.look('studio')
    for arguments, error in (
        ({'name': 'studo'}, "did you mean 'studio'"),
        ({'name': 3}, 'name must .* got 3'),
        ({'name': 'dusk', 'up': (0, 0, 0)}, 'up must'),
        ({'name': 'dusk', 'up': (0, np.nan, 0)}, r'up\[1\] must be finite, got nan'),
        ({'name': 'dusk', 'up': 'z'}, 'up must be'),
    ):
        with pytest.raises(ValueError, match=error):
            pl.ibr.look(**arguments)
    with pytest.raises(TypeError, match='ground'):
        pl.ibr.look('dusk', ground='yes')
    assert all(effect in pl.ibr for effect in worn.effects.values())
    assert 'Ground' not in pl.ibr.look('dusk', ground=False).effects


# -- the ground ---------------------------------------------------------------------------------


def test_ground_is_no_part_of_bounds_and_no_caster():
    pl = scene()
    bounds = pl.bounds
    pl.ibr.add(pvibr.Ground())
    shadows = pl.ibr.add(pvibr.Shadows())
    pl.add_light(pv.Light(position=(2, -3, 5), light_type='scene light'))
    pl.show(auto_close=False)
    np.testing.assert_array_equal(pl.bounds, bounds)
    pl.reset_camera()
    seen = pl.camera_position
    pl.ibr.clear()
    pl.reset_camera()
    np.testing.assert_allclose(pl.camera_position.position, seen.position, rtol=1e-12)
    assert shadows.report()['views drawn'] <= 2


@pytest.mark.parametrize('height', [0.05, 2.6, 40.0])
@pytest.mark.parametrize('parallel', [False, True])
def test_ground_is_seen_wherever_it_is(height, parallel):
    """Where a ray meets the plane below all, the picture is not the background."""
    pl = scene()
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(0, 0, 1), light_type='scene light'))
    ground = pl.ibr.add(pvibr.Ground('black', size=60.0))
    pl.camera_position = [(1, -7, height), (0, 0, 0.9), (0, 0, 1)]
    if parallel:
        pl.enable_parallel_projection()
        pl.camera.parallel_scale = 4
    pl.reset_camera_clipping_range()
    pl.show(auto_close=False)
    found = shot(pl)[..., 0]
    camera = pl.camera
    eye, focus = np.array(camera.position), np.array(camera.focal_point)
    ahead = (focus - eye) / np.linalg.norm(focus - eye)
    right = np.cross(ahead, camera.up) / np.linalg.norm(np.cross(ahead, camera.up))
    half = 4.0 if parallel else np.tan(np.radians(camera.view_angle / 2))
    x, y = ((np.arange(n) + 0.5 - n / 2) * half / (SIZE[1] / 2) for n in SIZE)
    aside = x[None, :, None] * right - y[:, None, None] * np.cross(right, ahead)
    start, ray = (eye + aside, ahead) if parallel else (eye, ahead + aside)
    start, ray = np.broadcast_to(start, aside.shape), np.broadcast_to(ray, aside.shape)
    low = pl.bounds.z_min
    with np.errstate(divide='ignore'):
        way = (low - start[..., 2]) / ray[..., 2]
    at = start + way[..., None] * ray
    radius = ground.size * np.linalg.norm(np.ptp(np.reshape(pl.bounds, (3, 2)), axis=1)) / 2
    near = (way > 0) & (ray[..., 2] < 0) & (np.hypot(at[..., 0], at[..., 1]) < 0.04 * radius)
    far = ~(way > 0) | (np.hypot(at[..., 0], at[..., 1]) > 1.05 * radius)
    assert near.any() or height < 1
    # Black near the scene, white beyond; things are neither, above the plane.
    above = np.abs(shot(pl).astype(int) - found[..., None]).max(-1) > 8
    assert (found[near & ~above] < 128).all()
    background = far & ~above
    assert (found[background] > 250).mean() > 0.9 if background.any() else True


@pytest.mark.parametrize('samples', [0, 4])
@pytest.mark.parametrize('sky', [True, False])
def test_ground_meets_the_sky_without_a_step(samples, sky):
    pl = scene()
    if samples:
        pl.enable_anti_aliasing('msaa', multi_samples=samples)
    pl.set_background('steelblue')
    pl.ibr.look('daylight')
    if not sky:
        pl.ibr.remove('Sky')
    pl.camera_position = [(1, -7, 1.6), (0, 0, 1.2), (0, 0, 1)]
    pl.show(auto_close=False)
    edge = shot(pl)[:, 2:26].astype(int)  # columns beside the scene, across the horizon
    assert np.abs(np.diff(edge, axis=0)).max() <= 12


def test_ground_below_the_eye_hides_nothing_from_below():
    pl = scene()
    pl.camera_position = [(1, -7, -3), (0, 0, 0.9), (0, 0, 1)]
    pl.show(auto_close=False)
    before = shot(pl)
    pl.ibr.add(pvibr.Ground('black'))
    np.testing.assert_array_equal(shot(pl), before)


def test_ground_is_none_of_the_users_actors():
    pl = scene()
    pl.show(auto_close=False)
    listed = set(pl.actors), len(pl.renderer.actors), pl.renderer.GetActors().GetNumberOfItems()
    ground = pl.ibr.add(pvibr.Ground())
    assert pl.renderer.HasViewProp(ground.props[0])
    now = set(pl.actors), len(pl.renderer.actors), pl.renderer.GetActors().GetNumberOfItems()
    assert now == listed


def test_ground_fades_as_evenly_far_from_the_origin():
    pictures = []
    for offset in ((0, 0, 0), (2e7, -3e7, 1e6)):
        pl = plotter(SIZE)
        pl.set_background('white')
        pl.add_mesh(pv.Cube(), color='tomato', lighting=False).position = offset
        pl.ibr.add(pvibr.Ground('navy')).props[0].prop.lighting = False
        pl.camera_position = [np.add((1, -9, 2.6), offset), np.add((0, 0, 0.9), offset), (0, 0, 1)]
        pl.show(auto_close=False)
        pictures.append(shot(pl))
    assert np.abs(pictures[0] - pictures[1]).mean() < 1


def test_glass_is_seen_before_the_faded_ground():
    pictures = []
    for opacity in (0.0, 0.5):
        pl = scene()
        pl.set_background('white')
        pl.ibr.add(pvibr.Ground('white'))
        pl.add_mesh(pv.Sphere(center=(0, -3, 1.6)), color='navy', opacity=opacity, lighting=False)
        pl.camera_position = [(0, -7, 2.6), (0, 0, 1.1), (0, 0, 1)]
        pl.show(auto_close=False)
        pictures.append(shot(pl).astype(int))
    darker = (pictures[0] - pictures[1])[..., 0]
    inside = np.abs(pictures[0] - pictures[1]).max(-1) > 5
    assert np.median(darker[inside]) > 100
    assert (darker[inside] > 60).mean() > 0.95  # wherever the ground behind it has faded, too


@pytest.mark.parametrize('company', ['ssaa', 'enable_ssao', 'eye_dome_lighting', 'depth_peeling'])
def test_ground_beside_what_a_plotter_enables(company):
    pl = scene()
    if company == 'ssaa':
        pl.enable_anti_aliasing('ssaa')
    else:
        getattr(pl, f'enable_{company.removeprefix("enable_")}')()
    pl.show(auto_close=False)
    before = shot(pl)
    ground = pl.ibr.add(pvibr.Ground('black'))
    shown = shot(pl)
    assert pl.ibr.report().rows[0].state == 'ran'
    assert shown[-1, SIZE[0] // 2].max() < 60
    np.testing.assert_array_equal(shot(pl), shown)
    ground.size = 0.0
    np.testing.assert_array_equal(shot(pl), before)
    ground.size = 16.0
    np.testing.assert_array_equal(shot(pl), shown)
    pl.ibr.remove(ground)
    np.testing.assert_array_equal(shot(pl), before)


def test_ground_that_is_off_is_not_drawn():
    pl = scene()
    pl.show(auto_close=False)
    before, planes = shot(pl), pl.camera.clipping_range
    ground = pvibr.Ground('black')
    ground.enabled = False
    pl.ibr.add(ground)
    np.testing.assert_array_equal(shot(pl), before)
    ground.enabled = True
    shown = shot(pl)
    assert np.abs(shown.astype(int) - before).max() > 100
    ground.enabled = False
    np.testing.assert_array_equal(shot(pl), before)
    assert pl.camera.clipping_range == planes


@pytest.mark.parametrize(('high', 'most'), [(100.0, 1.0), (0.0, 30.0), (1e4, 30.0)])
def test_the_gap_under_things_is_small_beside_their_height(high, most):
    pl = plotter((64, 48))
    pl.add_mesh(pv.Box((-1e4, 1e4, -1e4, 1e4, 0, 0) if not high else (-1e4, -9e3, 0, 1, 0, high)))
    pl.add_mesh(pv.Box((9e3, 1e4, -1e4, 1e4, 0, high)))
    ground = pl.ibr.add(pvibr.Ground())
    pl.show(auto_close=False)
    gap = -ground.props[0].user_matrix[2, 3]
    assert 0 < gap <= most


def test_a_picture_falls_on_the_ground():
    pl = scene()
    pl.ibr.look('studio')
    before = shot(pl).astype(int)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, 0, 9), (0, 0, 0), (0, 1, 0)
    red = np.zeros((4, 4, 3), np.uint8) + np.array([255, 0, 0], np.uint8)
    pl.ibr.add(pvibr.Projector(red, camera))
    changed = shot(pl).astype(int) - before
    corner = changed[-30:, 40:120]  # of the ground alone, before the cone
    assert np.median(corner[..., 1]) < -60
    assert {row.state for row in pl.ibr.report().rows} == {'ran'}


@pytest.mark.parametrize('middle', [10.0, 45.0, 70.0])
def test_a_sky_is_half_way_where_it_is_said_to_be(middle):
    pl = plotter((40, 30), lighting='none')
    sky = pl.ibr.add(pvibr.Sky(top='black', horizon='white', middle=middle))
    angle = np.radians(middle)
    pl.camera_position = [(0, 0, 0), (np.cos(angle), 0, np.sin(angle)), (0, 0, 1)]
    pl.camera.view_angle = 4.0
    seen = shot(pl)[15, 20]
    np.testing.assert_allclose(seen, 127.5, atol=3)
    way = np.array([[np.cos(angle), 0, np.sin(angle)]])
    frame = type('Frame', (), {'renderer': pl.renderer})
    np.testing.assert_allclose(sky.colors(way, frame), 0.5, atol=1e-6)
