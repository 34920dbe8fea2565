"""Glow and afterglow: only what was chosen, only where it is seen, the same at any frame rate."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl.hidden_window import read_pixels
from tests.refusals import refused

pytestmark = pytest.mark.sampled


def grab(pl):
    """Return what a new frame holds, (height, width, 4) float, row 0 below."""
    pl.render_window.Render()
    return read_pixels(pl.render_window, alpha=True).astype(float)


def lamps(size=(320, 192), *, hide=False, parallel=False, samples=0, opacity=1.0):
    """Two bright spheres beside each other, and a wall before the left one or behind both."""
    pl = pv.Plotter(window_size=size)
    if samples:
        pl.enable_anti_aliasing('msaa', multi_samples=samples)
    pl.set_background('black')
    actors = [
        pl.add_mesh(
            pv.Sphere(radius=0.5, center=(x, 0, 0)), color=c, lighting=False, opacity=opacity
        )
        for x, c in ((-1, 'white'), (1, 'white'))
    ]
    wall = pv.Plane(center=(-1, 0, 1) if hide else (0, 0, -1), i_size=1.5, j_size=1.5)
    pl.add_mesh(wall, color='darkgray', lighting=False)
    pl.camera_position = [(0, 0, 6), (0, 0, 0), (0, 1, 0)]
    pl.camera.parallel_projection = parallel
    pl.show(auto_close=False)
    return pl, actors


def halves(picture):
    middle = picture.shape[1] // 2
    return picture[:, :middle, :3].sum(), picture[:, middle:, :3].sum()


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('samples', [0, 4])
@pytest.mark.parametrize('opacity', [1.0, 0.5])
def test_only_what_was_chosen_shines(parallel, samples, opacity):
    pl, actors = lamps(parallel=parallel, samples=samples, opacity=opacity)
    before = grab(pl)
    glow = pl.ibr.add(pvibr.Glow(actors[1], levels=1, downsample=4, intensity=0.3))
    left, right = halves(grab(pl) - before)
    assert right > 1000
    assert left == 0
    glow.weights = 0.5
    assert halves(grab(pl) - before)[1] == pytest.approx(right / 2, rel=0.15)
    glow.intensity = 0.0
    np.testing.assert_array_equal(grab(pl), before)
    pl.ibr.remove(glow)
    np.testing.assert_array_equal(grab(pl), before)


@pytest.mark.parametrize('samples', [0, 4])
def test_hidden_parts_do_not_shine_through(samples):
    pl, actors = lamps(hide=True, samples=samples)
    before = grab(pl)
    pl.ibr.add(pvibr.Glow(actors[0]))
    np.testing.assert_array_equal(grab(pl), before)
    assert pl.ibr.report().rows[0].details['skipped']


def test_its_light_is_that_of_the_actor():
    """Beside a sphere on black, energy is its own: what is added in all is what it shows."""
    pl, actors = lamps()
    actors[1].prop.color = (0.0, 0.0, 0.2)
    actors[0].visibility = False
    pl.render()
    before = grab(pl)
    own = (before[..., 2] > 45) & (before[..., 0] < 5)
    glow = pl.ibr.add(pvibr.Glow(actors[1], debug='blur', levels=1))
    light = grab(pl)
    assert light[..., 0].max() == 0
    assert light[..., 2].sum() == pytest.approx(before[own][:, 2].sum(), rel=0.05)
    glow.debug = 'bright'
    assert glow.enabled


LIGHTS = {
    'bloom': lambda actor: pvibr.Bloom(threshold=0.7),
    'screen': lambda actor: pvibr.Bloom(threshold=0.7, blend='screen', intensity=0.5),
    'glow': lambda actor: pvibr.Glow(actor),
    'afterglow': lambda actor: pvibr.Afterglow(actor),
    'exposed': lambda actor: pvibr.ToneMapping(auto=True, curve='aces'),
}


def change(pl, what, actor, glow):
    if what == 'zoom':
        pl.camera.view_angle /= 1.5
    elif what == 'place':
        actor.position = (-0.6, 0.2, 0)
    elif what == 'color':
        actor.prop.color = 'blue'
    elif what == 'points':
        actor.mapper.dataset.points[:, 0] -= 0.3
        actor.mapper.dataset.Modified()
    elif what == 'weight':
        glow.weights = 0.2
    elif what == 'setting':
        glow.spread = 1.0


def large_screenshot(pl, glow):
    """Return it, and the scales of frames whose light was made anew."""
    scales, made = [], glow._spread_light
    glow._spread_light = lambda frame, picture: scales.append(frame.scale) or made(frame, picture)
    large = pl.screenshot(scale=2, return_img=True).astype(float)
    del glow._spread_light
    return large, scales


@pytest.mark.parametrize('what', ['', 'zoom', 'place', 'color', 'points', 'weight', 'setting'])
def test_large_screenshots_show_what_changed_since_the_last_frame(what):
    pl, (left, actor) = lamps()
    left.visibility = False
    actor.mapper.scalar_visibility = False
    glow = pl.ibr.add(pvibr.Glow(actor, debug='blur'))
    pl.ibr.add(pvibr.Shadows())
    grab(pl)
    change(pl, what, actor, glow)
    large, scales = large_screenshot(pl, glow)
    assert (2 in scales) == (what != '')
    small = grab(pl)[::-1, :, :3]
    difference = np.abs(large.reshape(192, 2, 320, 2, 3).mean(axis=(1, 3)) - small)
    assert difference.mean() < 1


def test_large_screenshots_know_the_light_of_instances():
    pl = dark((320, 192))
    balls = pl.ibr.add_instances(pv.Sphere(radius=0.1), np.eye(3), color='white')
    pl.show(auto_close=False)
    glow = pl.ibr.add(pvibr.Glow(balls))
    grab(pl)
    assert 2 not in large_screenshot(pl, glow)[1]
    balls.poses = np.eye(3) / 2
    assert 2 in large_screenshot(pl, glow)[1]


@pytest.mark.parametrize('known', [True, False])
@pytest.mark.parametrize('name', LIGHTS)
def test_large_screenshots_are_as_small_ones(name, known):
    """The light of tiles is that of the whole; nearly so where it was never drawn."""
    pl, actors = lamps()
    actors[0].position = (0.95, 0.1, 0)  # across all tiles
    actors[1].visibility = False
    pl.ibr.add(LIGHTS[name](actors[0]))
    grab(pl)
    if not known:
        pl.camera.position = (0.02, 0, 6)
    large = pl.screenshot(scale=2, return_img=True).astype(float)
    small = grab(pl)[::-1, :, :3]
    difference = np.abs(large.reshape(192, 2, 320, 2, 3).mean(axis=(1, 3)) - small)
    assert difference.mean() < (1 if known else 2)
    if known:
        assert (difference > 4).mean() < 0.03  # along edges
    for axis, middle in ((0, 192), (1, 320)):
        steps = np.abs(np.diff(large, axis=axis)).mean(axis=(1 - axis, 2))
        beside = (steps[middle - 5] + steps[middle + 5]) / 2
        assert steps[middle - 1] < 1.5 * beside + (0.2 if known else 1.0)


def test_actors_of_another_subplot_do_not_glow():
    pl = pv.Plotter(shape=(1, 2), window_size=(320, 120))
    actor = pl.add_mesh(pv.Sphere())
    pl.subplot(0, 1)
    pl.ibr.add(pvibr.Glow(actor))
    pl.show(auto_close=False)
    assert 'none of its actors' in pl.ibr.report().rows[0].why


def test_what_may_not_be():
    actor = pv.Actor()
    refused('must be actors', pvibr.Glow, [actor, 3], kind=TypeError)
    refused('got -1', pvibr.Glow, actor, -1)
    refused('weights', pvibr.Glow, actor, (1, 2))


def screen(pl, image, **options):
    """Add a square that fills the middle half of the height, with a texture."""
    plane = pv.Plane(i_size=1.0, j_size=1.0)
    return pl.add_mesh(plane, texture=pv.numpy_to_texture(image), lighting=False, **options)


def dark(size=(160, 96)):
    pl = pv.Plotter(window_size=size)
    pl.set_background('black')
    pl.camera_position = [(0, 0, 6), (0, 0, 0), (0, 1, 0)]
    pl.camera.parallel_projection = True
    pl.camera.parallel_scale = 1.0
    return pl


def test_alpha_of_a_texture_is_how_much_it_shines():
    """The source is RGB times A, and the picture is as without alpha."""
    image = np.zeros((8, 8, 4), np.uint8)
    image[..., 0] = 200
    image[:, :4, 3], image[:4, 4:, 3] = 255, 102
    pl = dark()
    actor = screen(pl, np.ascontiguousarray(image))
    pl.show(auto_close=False)
    before = grab(pl)
    glow = pl.ibr.add(pvibr.Glow(actor, source='alpha', intensity=1e-6))
    middle = (slice(34, 62), slice(66, 94))
    assert np.abs(grab(pl)[middle][..., :3] - [200, 0, 0]).max() <= 1
    glow.debug = 'bright'
    seen = grab(pl)
    quarters = [seen[j, i, 0] for i in (68, 90) for j in (36, 58)]
    assert sorted(quarters) == pytest.approx([0, 80, 200, 200], abs=2)
    assert not seen[..., 1:3].any()
    glow.enabled = False
    np.testing.assert_array_equal(grab(pl), before)
    glow.enabled = True
    grab(pl)
    pl.ibr.remove(glow)
    np.testing.assert_array_equal(grab(pl), before)


def test_only_the_emissive_texture_of_a_material_shines():
    image = np.zeros((8, 8, 3), np.uint8)
    image[:, :4, 1] = 200
    pl = dark()
    plane = pv.Plane(i_size=1.0, j_size=1.0)
    actor = pl.add_mesh(plane, color='red', pbr=True)
    pl.add_mesh(plane.translate((-1.2, 0, 0)), color='white', pbr=True)
    pl.show(auto_close=False)
    glow = pl.ibr.add(pvibr.Glow(actor, source='emissive', debug='bright'))
    grab(pl)
    assert 'none of its actors' in pl.ibr.report().rows[0].why
    texture = pv.numpy_to_texture(image)
    texture.SetUseSRGBColorSpace(True)
    actor.prop.SetEmissiveTexture(texture)
    seen = grab(pl)
    assert glow.enabled
    values = {round(v) for v in (seen[48, 70, 1], seen[48, 90, 1])}
    assert min(values) == 0
    assert max(values) == pytest.approx(200, abs=4)  # 2.2 and sRGB differ
    assert not seen[..., [0, 2]].any()
    actor.prop.SetEmissiveFactor(0.0, 0.0, 0.0)
    assert not grab(pl)[..., :3].any()


STYLES = {
    'surface': {},
    'points': {'style': 'points', 'point_size': 30},
    'gaussian': {'style': 'points_gaussian', 'point_size': 30},
    'spheres': {'style': 'points', 'point_size': 30, 'render_points_as_spheres': True},
    'wireframe': {'style': 'wireframe', 'line_width': 20},
    'tubes': {'style': 'wireframe', 'line_width': 20, 'render_lines_as_tubes': True},
}


@pytest.mark.parametrize('parallel', [True, False])
@pytest.mark.parametrize('style', STYLES)
def test_only_where_something_shines_is_anything_drawn(monkeypatch, style, parallel):
    """And nothing that shines is left out."""
    pl = dark()
    shape = pv.Box((-0.3, 0.2, -0.2, 0.3, -0.2, 0.2)).rotate_z(20)
    actor = pl.add_mesh(shape, color='white', lighting=False, **STYLES[style])
    actor.position = (0.4, 0.3, 0)
    actor.scale = (1.2, 0.7, 1.0)
    pl.camera.parallel_projection = parallel
    pl.show(auto_close=False)
    pl.ibr.add(pvibr.Glow(actor, debug='bright', downsample=16))
    found = grab(pl)
    monkeypatch.setattr('pvibr.effects.glow._is_within_bounds', lambda actor: False)
    assert found[..., :3].any()
    np.testing.assert_array_equal(grab(pl), found)


@pytest.mark.parametrize('max_error', [1.0, 1e9])
def test_instances_shine(max_error):
    """As meshes and as cards."""
    pl = dark((320, 192))
    ball = pv.Sphere(radius=0.2)
    points = [(-0.5, 0, 0), (0.5, 0.3, 0)]
    balls = pl.ibr.add_instances(ball, points, color='white', max_error=max_error, bake=True)
    pl.add_mesh(pv.Plane(center=(0.5, 0.3, 1.0), i_size=0.6, j_size=0.6), color='black')
    pl.show(auto_close=False)
    before = grab(pl)
    glow = pl.ibr.add(pvibr.Glow([balls, pl.add_mesh(ball, opacity=0.0)], (2.0, 1.0)))
    lit = grab(pl) - before
    assert glow.enabled
    assert lit[..., :3].sum() > 1000
    left, right = halves(lit)
    assert left > 3 * right  # the other is hidden
    balls.visibility = False
    assert not grab(pl)[..., :3].any()
    pl.ibr.remove(glow)
    balls.visibility = True
    np.testing.assert_array_equal(grab(pl), before)


def trail(pl, actor, times, x, **settings):
    """Return the last picture of a lamp that was at x at those times."""
    glow = pl.ibr.add(pvibr.Afterglow(actor, **settings))
    for t, place in zip(times, x, strict=True):
        pl.ibr.time = t
        actor.position = (place, 0, 0)
        picture = grab(pl)
    pl.ibr.remove(glow)
    return picture


SETTINGS = {'fade': 0.5, 'debug': 'bright'}


def test_trails_fade_the_same_at_any_frame_rate():
    pl, (_, actor) = lamps()
    few = trail(pl, actor, [0, 1], [-2, 0], **SETTINGS)
    many = trail(pl, actor, np.linspace(0, 1, 9), [-2] + [0] * 8, **SETTINGS)
    np.testing.assert_allclose(few, many, atol=1)
    lit = few[96, 60:100, 0].max()
    assert lit == pytest.approx(255 * np.exp(-1 / 0.5), abs=2)


def test_a_cut_and_time_that_goes_back_end_trails():
    pl, (_, actor) = lamps()
    alone = trail(pl, actor, [0], [0], **SETTINGS)
    np.testing.assert_array_equal(trail(pl, actor, [1, 0], [-2, 0], **SETTINGS), alone)
    glow = pl.ibr.add(pvibr.Afterglow(actor, **SETTINGS))
    actor.position = (-2, 0, 0)
    grab(pl)
    glow.cut()
    actor.position = (0, 0, 0)
    np.testing.assert_array_equal(grab(pl), alone)


def test_trails_outlast_what_made_them():
    pl, (_, actor) = lamps()
    pl.ibr.add(pvibr.Afterglow(actor, **SETTINGS))
    grab(pl)
    actor.visibility = False
    pl.ibr.time = 0.5
    assert grab(pl)[..., 0].max() == pytest.approx(255 / np.e, abs=2)
