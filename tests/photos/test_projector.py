"""Projected pictures: by closed forms, by float64 maths, and against rays."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.common.rays import Rays, edge_band
from pvibr.maths.cameras import as_camera
from pvibr.maths.draping import sample
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole
from pvibr.things.frame import Frame
from tests.makers import turn_of
from tests.refusals import refused

pytestmark = pytest.mark.sampled

LENS = (-0.25, 0.08, 1e-3, -2e-3)
GREEN = np.zeros((90, 160, 3), np.uint8) + np.uint8([0, 255, 0])
ABOVE = Orthographic.from_extent(-1, 1, -1, 1, zmax=5)


def pinhole(eye=(1.0, -2.0, 5.0), focus=(0.0, 0.0, 0.0), size=(160, 90), lens=(), zoom=1.5):
    eye, focus = np.array(eye, float), np.array(focus, float)
    turn = turn_of(focus - eye, [0.1, 1.0, 0.05])
    K = [[zoom * size[0], 0, size[0] / 2 + 3], [0, zoom * size[0], size[1] / 2 - 2], [0, 0, 1]]
    return Pinhole(K, turn, -turn @ eye, size, lens)


def picture(size=(160, 90)):
    x, y = np.meshgrid(np.linspace(0, 1, size[0]), np.linspace(0, 1, size[1]))
    return np.stack([x, y, 0.5 + 0.4 * np.sin(25 * x) * np.cos(19 * y)], -1)


@pytest.fixture
def stage():
    """Return a function that makes a plotter of meshes, unlit white, seen from the side."""

    def make(*meshes, window=(300, 200), eye=(-2.0, -5.0, 5.0), focus=(0, 0, 0), **settings):
        settings = {'color': 'white', 'lighting': False} | settings
        pl = pv.Plotter(off_screen=True, window_size=window)
        pl.set_background('black')
        for mesh in meshes:
            pl.add_mesh(mesh, **settings)
        pl.camera_position = [eye, focus, (0, 0, 1)]
        pl.show(auto_close=False)
        return pl

    return make


def shot(pl):
    pl.render()
    return np.asarray(pl.screenshot(return_img=True))[..., :3] / 255


def floor(size=4.0):
    return pv.Plane(i_size=size, j_size=size).triangulate()


@pytest.mark.parametrize('lens', [(), LENS])
@pytest.mark.parametrize('window', [(300, 200), (200, 300), (240, 240)])
@pytest.mark.parametrize('lighting', [True, False])
def test_each_pixel_shows_what_float64_says(stage, lens, window, lighting):
    camera, image = pinhole(lens=lens), picture()
    ball = pv.Sphere(radius=0.5, center=(0.4, 0, 0.5))
    pl = stage(floor(), ball, window=window, lighting=lighting)
    surface = Rays([floor(), ball]).surface(Frame.of(pl.renderer))
    photo = pl.ibr.add(pvibr.Projector(image, camera, occlusion=False, outside_brightness=0.0))
    found = shot(pl)
    points, normals = surface.points[surface.hit], surface.normals[surface.hit]
    uv, _ = camera.project(points)
    shown = ((uv > 0) & (uv < 1)).all(1) & ((normals * camera.toward(points)).sum(1) > 0)
    expected = np.where(shown[:, None], np.nan_to_num(sample(image, uv)), 0.0)
    off = np.abs(found[surface.hit] - expected).max(1)
    assert shown.mean() > 0.2
    assert (off > 0.03).mean() < 0.012  # edges, where a pixel's middle is on one side or the other
    assert photo.report()['views drawn'] == 0


def test_the_photograph_seen_from_its_own_camera_is_the_photograph(stage):
    image = picture((300, 200))
    pl = stage(floor(20.0), pv.Sphere(center=(0, 0, 0.5)))
    pl.ibr.add(pvibr.Projector(image, pl.camera))
    error = shot(pl) - image
    hit = Rays([floor(20.0), pv.Sphere(center=(0, 0, 0.5))]).surface(Frame.of(pl.renderer)).hit
    assert hit.mean() > 0.9
    assert 10 * np.log10(1 / (error[hit] ** 2).mean()) > 40


@pytest.mark.parametrize('offset', [0.0, 1e6, 1e9])
@pytest.mark.parametrize('lens', [(), LENS])
def test_hidden_and_shown_are_as_rays_say(stage, offset, lens):
    shift = np.array([1.0, -0.7, 0.3]) * offset * 5
    ball = pv.Sphere(radius=0.5, center=(0.3, 0, 0.9), theta_resolution=60, phi_resolution=60)
    meshes = [floor(), ball, pv.Cube(center=(-0.8, 0, 0.3), x_length=0.4)]
    meshes = [m.triangulate() for m in meshes]
    for mesh in meshes:
        mesh.points = np.asarray(mesh.points, float) + shift
    base = pinhole(lens=lens)
    camera = Pinhole(base.K, base.R, base.t - base.R @ shift, base.size, lens)
    eye = tuple(np.array([-2.0, -5.0, 5.0]) + shift)
    pl = stage(*meshes, eye=eye, focus=tuple(shift), window=(600, 400))
    surface = Rays(meshes).surface(Frame.of(pl.renderer))
    light = pv.Light(position=tuple(camera.position), light_type='scene light')
    light.positional, light.cone_angle = True, 90
    lit = Rays(meshes).lit(surface.points, surface.normals, light)
    uv, _ = camera.project(surface.points.reshape(-1, 3))
    true = lit * ((uv >= 0) & (uv <= 1)).all(1).reshape(lit.shape)
    pl.ibr.add(pvibr.Projector(GREEN, camera))
    painted = shot(pl)[..., 0] < 0.5
    counts = surface.hit & ~edge_band(true, surface)
    assert (counts & (true == 1)).sum() > 10_000
    assert painted[counts & (true == 0)].mean() < 0.003
    assert (~painted[counts & (true == 1)]).mean() < 0.003


def test_nothing_is_painted_behind_a_camera_within_a_box(stage):
    room = pv.Cube(x_length=4, y_length=4, z_length=4)
    pl = stage(room, eye=(0, 0, 0.1), focus=(0, -1, 0.1))
    photo = pl.ibr.add(pvibr.Projector(GREEN, pinhole((0, 0, 0), (0, 1, 0.2))))
    assert (shot(pl)[..., 0] > 0.9).all()
    pl.camera_position = [(0, 0, 0.1), (0, 1, 0.1), (0, 0, 1)]
    assert (shot(pl)[..., 0] < 0.5).mean() > 0.2
    assert photo.enabled


def test_the_back_of_a_sheet_stays_as_it_is(stage):
    pl = stage(floor(2.0), eye=(0, -2, -5))
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    assert not (shot(pl)[..., 1] > shot(pl)[..., 0]).any()
    photo.max_angle = 180.0
    photo.occlusion = False
    assert (shot(pl)[..., 1] > shot(pl)[..., 0]).any()


def test_flat_angles_can_be_left_out(stage):
    pl = stage(pv.Sphere())
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    areas = []
    for angle in (90.0, 60.0, 30.0):
        photo.max_angle = angle
        areas.append((shot(pl)[..., 0] < 0.5).sum())
    assert areas[0] > areas[1] > areas[2] > 0


def middle(pl):
    high, wide = shot(pl).shape[:2]
    return shot(pl)[high // 2, wide // 2]


def test_modes_in_closed_form(stage):
    color = np.full((8, 8, 4), 255, np.uint8)
    color[..., :3], color[..., 3] = (200, 100, 50), 102
    paint = np.array([200, 100, 50]) / 255
    pl = stage(floor(), color='gray', lighting=False)
    base = middle(pl)
    photo = pl.ibr.add(pvibr.Projector(color, ABOVE))
    np.testing.assert_allclose(middle(pl), paint, atol=0.003)
    photo.opacity = 0.25
    np.testing.assert_allclose(middle(pl), 0.75 * base + 0.25 * paint, atol=0.006)
    photo.opacity, photo.mode = 1.0, 'decal'
    np.testing.assert_allclose(middle(pl), 0.6 * base + 0.4 * paint, atol=0.006)
    photo.mode = 'add'
    np.testing.assert_allclose(middle(pl), np.minimum(base + 0.4 * paint, 1), atol=0.006)
    photo.gain = (0.5, 1.0, 1.0)
    expected = base + 0.4 * paint * [0.5, 1, 1]
    np.testing.assert_allclose(middle(pl), np.minimum(expected, 1), atol=0.006)


def test_a_slide_projector_lights_without_any_light(stage):
    pl = stage(floor(), color=(0.5, 0.8, 0.2), lighting=True)
    pl.remove_all_lights()
    pl.add_light(pv.Light(intensity=0.0))  # without any, VTK shows plain colours
    slide = pl.ibr.add(pvibr.Projector(picture(), ABOVE, mode='modulate', gain=(0.5, 0.5, 0.5)))
    found, bright = middle(pl), 0.5 * picture()[45, 80]
    np.testing.assert_allclose(found, bright * [0.5, 0.8, 0.2], atol=0.02)
    assert shot(pl)[-1].max() < 0.01
    slide.enabled = False
    assert shot(pl).max() < 0.01


def test_a_lit_picture_has_the_light_of_the_surface(stage):
    pl = stage(floor(), lighting=True)
    plain = middle(pl)
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE, lit=True))
    np.testing.assert_allclose(middle(pl), plain * [0, 1, 0], atol=0.01)
    photo.lit = False
    np.testing.assert_allclose(middle(pl), [0, 1, 0], atol=0.01)


def test_outside_is_dimmed_and_borders_fade(stage):
    pl = stage(floor(), eye=(0, -0.01, 8))
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE, outside_brightness=0.5))
    found = shot(pl)[..., 0]
    assert set(np.unique(np.round(found, 2))) == {0.0, 0.5}
    photo.feather = 0.25
    soft = shot(pl)[100]
    assert len(np.unique(np.round(soft[..., 0], 2))) > 8
    assert soft[150, 0] < 0.01


def test_no_opacity_changes_nothing(stage):
    pl = stage(floor(), lighting=True)
    plain = shot(pl)
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE, opacity=0.0))
    np.testing.assert_array_equal(shot(pl), plain)
    assert 'opacity' in str(pl.ibr.report())
    photo.opacity = 1.0
    assert np.abs(shot(pl) - plain).max() > 0.5


def test_masks_and_alpha(stage):
    mask = np.zeros((9, 16))
    mask[:, 8:] = 1
    pl = stage(floor(), eye=(0, -0.01, 8))
    pl.ibr.add(pvibr.Projector(GREEN, ABOVE, mask=mask))
    red = shot(pl)[100, :, 0]
    assert red[140] > 0.9
    assert red[160] < 0.1


@pytest.mark.parametrize(
    'settings',
    [
        {'show_edges': True, 'lighting': True},
        {'pbr': True, 'lighting': True},
        {'style': 'points', 'point_size': 8},
        {'style': 'wireframe', 'line_width': 4},
        {'smooth_shading': True, 'lighting': True},
        {'opacity': 0.5},
    ],
)
def test_every_kind_of_surface_receives(stage, settings):
    mesh = pv.Plane(i_size=4, j_size=4, i_resolution=40, j_resolution=40)
    pl = stage(mesh, **settings)
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    found = shot(pl)
    assert (found[..., 1] > found[..., 0] + 0.2).sum() > 500
    assert photo.enabled


def test_depth_is_drawn_again_only_when_a_caster_moves(stage):
    pl = stage(floor())
    ball = pl.add_mesh(pv.Sphere(radius=0.3, center=(0, 0, 1)))
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    for azimuth in (0, 10, 20):
        pl.camera.azimuth = azimuth
        pl.render()
    assert photo.report()['views drawn'] == 1
    ball.position = (0.2, 0, 0)
    pl.render()
    assert photo.report()['views drawn'] == 2


def test_removed_and_added_again_beside_others(stage):
    pl = stage(floor(), pv.Sphere(radius=0.3, center=(0, 0, 0.6)), lighting=True)
    pl.add_light(pv.Light(position=(3, 0, 4), light_type='scene light'))
    plain = shot(pl)
    first = pl.ibr.add(pvibr.Projector(picture(), pinhole(), mode='add', opacity=0.5))
    alone = shot(pl)
    second = pl.ibr.add(pvibr.Projector(GREEN, ABOVE, opacity=0.3))
    shadows = pl.ibr.add(pvibr.Shadows())
    everything = shot(pl)
    assert first.number != second.number
    assert np.abs(everything - alone).max() > 0.2
    pl.ibr.remove(shadows)
    pl.ibr.remove(second)
    np.testing.assert_allclose(shot(pl), alone, atol=1 / 255)
    pl.ibr.remove(first)
    np.testing.assert_array_equal(shot(pl), plain)
    assert first.report()['bytes'] == 0
    pl.ibr.add(first)
    np.testing.assert_allclose(shot(pl), alone, atol=1 / 255)
    first.enabled = False
    np.testing.assert_array_equal(shot(pl), plain)
    assert first.report()['receivers'] == 0


def test_a_subplot_has_its_own():
    pl = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(400, 160), border=False)
    for k in range(2):
        pl.subplot(0, k)
        pl.add_mesh(floor(), color='white', lighting=False)
        pl.camera_position = [(-2, -5, 5), (0, 0, 0), (0, 0, 1)]
    pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    pl.show(auto_close=False)
    green = shot(pl)[..., 0] < 0.1
    green &= shot(pl)[..., 1] > 0.9
    assert not green[:, :200].any()
    assert green[:, 200:].any()


def test_receivers_and_casters_are_chosen(stage):
    pl = stage()
    ground = pl.add_mesh(floor(), color='white', lighting=False)
    ball = pl.add_mesh(pv.Sphere(radius=0.4, center=(0, 0, 1)), color='white', lighting=False)
    pl.camera_position = [(-2, -5, 5), (0, 0, 0), (0, 0, 1)]
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE, actors=[ground], casters=[ground]))
    assert photo in pl.ibr.effects
    free = (shot(pl)[..., 0] < 0.1).sum()
    photo.casters = None
    assert (shot(pl)[..., 0] < 0.1).sum() < free
    photo.actors = [ball]
    pl.render()
    assert photo.report()['receivers'] == 1


def test_instances_receive(stage):
    pl = stage(floor())
    places = [[-0.5, 0, 0.5], [0.5, 0, 0.5]]
    pl.ibr.add_instances(pv.Sphere(radius=0.2), places, color='white', progress=False, bake=True)
    before = shot(pl)
    photo = pl.ibr.add(pvibr.Projector(GREEN, ABOVE))
    assert np.abs(shot(pl) - before).max() > 0.5
    assert photo.enabled


def test_sequences_run_with_time(stage):
    frames = [np.full((8, 8, 3), 60 * k, np.uint8) for k in range(4)]
    pl = stage(floor())
    photo = pl.ibr.add(pvibr.Projector(frames, ABOVE, fps=10.0))
    for time, level in ((0.0, 0), (0.1, 60), (0.35, 180), (0.4, 0)):
        pl.ibr.time = time
        np.testing.assert_allclose(middle(pl), level / 255, atol=0.005)
    photo.loop = False
    pl.ibr.time = 9.0
    np.testing.assert_allclose(middle(pl), 180 / 255, atol=0.005)


def test_films_are_read_by_imageio(stage, tmp_path):
    from imageio import v3

    frames = np.stack([np.full((16, 16, 3), 80 * k, np.uint8) for k in range(3)])
    v3.imwrite(tmp_path / 'film.gif', frames, duration=100, loop=0)
    pl = stage(floor())
    photo = pl.ibr.add(pvibr.Projector(tmp_path / 'film.gif', ABOVE))
    found = []
    for time in (0.0, 0.1, 0.2):
        pl.ibr.time = time
        found.append(middle(pl)[0] * 255)
    np.testing.assert_allclose(found, [0, 80, 160], atol=4)
    pl.ibr.remove(photo)


def sides():
    left = Orthographic.from_extent(-1, 0.4, -1, 1, zmax=5)
    right = Orthographic.from_extent(-0.4, 1, -1, 1, zmax=5)
    return left, right


def test_several_are_mixed_by_weight(stage):
    images = [np.full((9, 9), 0.2), np.full((9, 9), 0.8)]
    pl = stage(floor(), eye=(0, -0.01, 8))
    photos = pl.ibr.add(pvibr.Projector(images, list(sides()), outside_brightness=0.0))
    row = shot(pl)[100, :, 0]
    assert set(np.unique(np.round(row[row > 0], 1))) == {0.2, 0.5, 0.8}
    photos.blend = 'best'
    row = shot(pl)[100, :, 0]
    assert set(np.unique(np.round(row[row > 0], 1))) == {0.2, 0.8}


def test_gains_make_overlaps_alike(stage):
    base = 0.3 + 0.2 * picture((90, 90))
    images = [base, np.clip(1.5 * base, 0, 1)]
    grid = pv.Plane(i_size=4, j_size=4, i_resolution=60, j_resolution=60).triangulate()
    photos = pvibr.Projector(images, list(sides()), gains='auto')
    pl = stage(grid, eye=(0, -0.01, 8))
    pl.ibr.add(photos)
    mixed = shot(pl)
    photos.gains = 'none'
    plain = shot(pl)
    left, right = (slice(95, 105), slice(100, 120)), (slice(95, 105), slice(185, 205))
    assert abs(mixed[left].mean() / mixed[right].mean()) > 1.2 * (
        plain[left].mean() / plain[right].mean()
    )


@pytest.mark.parametrize('samples', [0, 8])
@pytest.mark.parametrize('seed', [3, 11])
def test_no_specks_on_steep_terrain(seed, samples):
    """From above nothing hides any of it: valleys and multisampled borders stay painted."""
    rng, n = np.random.default_rng(seed), 96
    waves = np.fft.fft2(rng.normal(size=(n, n)))
    k = np.hypot(*np.meshgrid(*[np.fft.fftfreq(n, 1 / n)] * 2)) + 1
    heights = np.real(np.fft.ifft2(waves / k**1.6))
    y, x = np.mgrid[-10 : 10 : n * 1j, -10 : 10 : n * 1j]
    mesh = pv.StructuredGrid(x, y, 1.5 * heights / heights.std())
    above = pvibr.Orthographic.from_extent(-10.1, 10.1, -10.1, 10.1)
    pl = pv.Plotter(off_screen=True, window_size=(300, 225))
    if samples:
        pl.enable_anti_aliasing('msaa', multi_samples=samples)
    pl.set_background('black')
    pl.add_mesh(mesh, color='magenta', lighting=False)
    green = np.zeros((8, 8, 3))
    green[..., 1] = 1
    photo = pl.ibr.add(pvibr.Projector(green, above))
    pl.camera_position = [(3, -24, 13), (0, 0, 0), (0, 0, 1)]

    def bare():
        pl.render()
        return (pl.screenshot(return_img=True)[..., 0] > 60).sum()

    with_depth = bare()
    photo.occlusion = False  # what is left faces away
    assert with_depth - bare() <= 15  # of 30 000; 200 and 6 000 by the receiver's plane alone
    assert (
        pvibr.Projector(green, above).bake(mesh.extract_surface(algorithm=None))['covered'].all()
    )


def test_the_first_frame_with_gains_is_right_and_they_can_be_read():
    """Measuring them draws in another window, within the first frame, among open plotters."""
    others = [pv.Plotter(off_screen=True, window_size=(60, 40)) for _ in range(4)]
    for other in others:
        other.ibr.add_spheres(np.zeros((1, 3)), 1.0)
        other.show(auto_close=False)
    base = np.tile(np.linspace(0.3, 0.9, 90)[:, None, None], (1, 90, 3))
    grid = pv.Plane(i_size=4, j_size=4, i_resolution=20, j_resolution=20)
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    pl.add_mesh(grid, color='white')
    photos = pl.ibr.add(pvibr.Projector([base, 0.5 * base], list(sides()), gains='auto'))
    assert photos.found_gains.tolist() == [[1, 1, 1]] * 2
    first = pl.screenshot(return_img=True)
    for _ in range(2):
        pl.render()
    np.testing.assert_array_equal(first, pl.screenshot(return_img=True))
    assert np.abs(photos.found_gains[1] / photos.found_gains[0] - 2).max() < 0.02


@pytest.mark.parametrize('to', ['points', 'cells'])
def test_baked_colours_are_those_of_the_picture(to):
    mesh = pv.Plane(i_size=4, j_size=4, i_resolution=50, j_resolution=50)
    roof = pv.Plane(center=(0, 0, 1), i_size=0.7, j_size=0.7)
    kept = np.array(mesh.points)
    draped = pvibr.Projector(picture(), ABOVE).bake(mesh, to=to, casters=[roof])
    points = mesh.points if to == 'points' else mesh.cell_centers().points
    uv, _ = ABOVE.project(points)
    inside = ((uv >= 0) & (uv <= 1)).all(1) & (np.abs(points[:, :2]).max(1) > 0.36)
    out = np.abs(points[:, :2]).max(1)
    sure = (np.abs(out - 0.36) > 0.03) & (np.abs(out - 1) > 0.03)
    np.testing.assert_array_equal(draped['covered'][sure], inside[sure])
    np.testing.assert_array_equal(draped['views'], draped['covered'])
    expected = 255 * sample(picture(), uv)[inside & sure]
    np.testing.assert_allclose(draped['projected'][inside & sure][:, :3], expected, atol=4)
    np.testing.assert_array_equal(mesh.points, kept)
    assert 'projected' not in mesh.array_names


def test_a_texture_is_baked_where_there_are_coordinates():
    mesh = pv.Plane(i_size=2, j_size=2)
    found, image = pvibr.Projector(picture((64, 64)), ABOVE).bake(mesh, to='texture', size=64)
    np.testing.assert_allclose(image[..., :3] / 255, picture((64, 64)), atol=0.02)
    assert found.active_texture_coordinates is not None
    assert (image[..., 3] == 255).all()


def test_bakes_are_blended_as_frames_are():
    left = Orthographic.from_extent(-1, 0.2, -1, 1, zmax=5)
    right = Orthographic.from_extent(-0.2, 1, -1, 1, zmax=5)
    images = [np.full((9, 9), 0.2), np.full((9, 9), 0.8)]
    mesh = pv.Plane(i_size=2, j_size=2, i_resolution=5, j_resolution=1)
    draped = pvibr.Projector(images, [left, right]).bake(mesh, to='cells')
    assert draped['views'].tolist() == [1, 1, 2, 1, 1]
    np.testing.assert_allclose(
        draped['projected'][:, 0] / 255, [0.2, 0.2, 0.5, 0.8, 0.8], atol=0.01
    )


def test_without_coordinates_a_texture_names_the_remedy(monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'xatlas', None)
    with pytest.raises(ImportError, match='xatlas'):
        pvibr.Projector(GREEN, ABOVE).bake(pv.Sphere(), to='texture')


@pytest.mark.parametrize(
    ('image', 'camera', 'error', 'message'),
    [
        (GREEN, ([[0, 0, 0]] * 3, np.eye(3), [0, 0, 0]), ValueError, 'K'),
        (GREEN, (np.diag([900.0, 900, 1]), np.eye(3), [0, 0, 0]), ValueError, 'another size'),
        (GREEN, (pinhole().K, 2 * np.eye(3), [0, 0, 0]), ValueError, 'rotation'),
        (GREEN, 'nothing', ValueError, 'camera'),
        (np.zeros((3, 3, 7)), ABOVE, ValueError, 'shape'),
        (np.full((3, 3), 9.0), ABOVE, ValueError, 'from 0 to 1'),
        (np.zeros((3, 3), int), ABOVE, ValueError, 'dtype'),
        ([], ABOVE, ValueError, 'empty'),
        ('no_such_file.png', ABOVE, FileNotFoundError, 'no_such_file'),
        (__file__, ABOVE, ValueError, 'readable by imageio'),
    ],
)
def test_bad_input_is_named(image, camera, error, message):
    refused(message, pvibr.Projector, image, camera, kind=error)


def test_bad_numbers_of_views():
    for error, match, images, cameras in (
        (ValueError, '1 to 6', [], []),
        (ValueError, '1 to 6', [GREEN] * 7, [ABOVE] * 7),
        (ValueError, 'got 2, 1 and 1', [GREEN] * 2, [ABOVE]),
        (TypeError, 'must be lists', GREEN, [ABOVE]),
    ):
        refused(match, pvibr.Projector, images, cameras, kind=error)
    refused("'texture'", pvibr.Projector(GREEN, ABOVE).bake, floor(), to='paper')


def test_pictures_above_the_limit_are_reduced_and_it_is_said(stage, monkeypatch):
    monkeypatch.setattr('pvibr.photos.slide.texture_limit', lambda window: 100)
    pl = stage(floor())
    photo = pl.ibr.add(pvibr.Projector(picture((300, 170)), ABOVE))
    np.testing.assert_allclose(middle(pl), picture((300, 170))[85, 150], atol=0.03)
    assert photo.report()['reduced'] == 3


def test_a_photograph_lies_on_its_liver(stage, data_dir):
    from imageio import v3

    folder = data_dir / 'projection' / 'sksurgery_liver'
    pose = np.loadtxt(folder / 'model_to_camera.txt')
    photo = v3.imread(folder / 'fig06_case1b.png')[..., :3]
    K = np.loadtxt(folder / 'calib.left.intrinsics.txt')
    camera = as_camera((K, pose[:3, :3], pose[:3, 3]), (1920, 1080))
    mesh = pv.read(folder / 'liver_sub.ply')
    draped = pvibr.Projector(photo, camera).bake(mesh)
    colors = draped['projected'][draped['covered']][:, :3].astype(int)
    assert draped['covered'].sum() > 100
    assert (colors[:, 0] > colors[:, 1] + 10).mean() > 0.7
