"""A still view converges: to areas, to lenses, to lights; and begins again at every change."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.capture.adaptive_quality import SETTLE
from pvibr.maths.sequences import ball, disk, pair
from tests.browser import everything
from tests.marks import slow
from tests.pictures import depth_buffer, off, place, plotter, reduce, shot
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (80, 60)


def scene(size=SIZE, seed=0, pl=None, **options):
    """Return a plotter that shows a few meshes."""
    whole, pl = pl is None, pl or plotter(size, **options)
    rng = np.random.default_rng(seed)
    pl.set_background('white')
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='wheat', name='floor')
    for k in range(4):
        center = [*rng.uniform(-1, 1, 2), 0.5]
        mesh = (
            pv.Cube(center=center, x_length=0.5) if k % 2 else pv.Sphere(radius=0.4, center=center)
        )
        pl.add_mesh(mesh, color=rng.uniform(0.1, 0.9, 3), name=f'{k}')
    place(pl, (1, -6, 3))
    if whole:
        pl.show(auto_close=False)
    return pl


def psnr(one, other):
    return 10 * np.log10(255**2 / max(((one - other) ** 2).mean(), 1e-9))


def frames(pl, count):
    """Return the picture after some frames of a view at rest, the first two included."""
    for _ in range(count + 1):
        pl.render()
    return shot(pl)


def stale(pl, still, changes):
    """Return after which of the changes, names and calls, a view at rest is not that of now."""
    wrong = {}
    for name, change in changes:
        frames(pl, 3)
        if still.unfinished:
            wrong[name] = 'it did not converge before'
        change()
        found = shot(pl)
        still.enabled = False
        if not np.array_equal(found, shot(pl)):
            wrong[name] = 'is not in the next frame'
        still.enabled = True
    return wrong


def screenshot(pl, samples, **how):
    return pl.ibr.screenshot(samples=samples, **how).astype(int)


@pytest.mark.parametrize('name', ['pixel', 'lens', 'anything'])
def test_points_are_stratified(name):
    for power in (1, 2, 3, 4):
        points = np.array([pair(k, name) for k in range(4**power)])
        cells = (points * 2**power).astype(int) @ [1, 2**power]
        assert len(np.unique(cells)) == 4**power
        assert len(np.unique((points[:, 0] * 4**power).astype(int))) == 4**power


def test_sequences_have_nothing_to_do_with_each_other():
    points = np.array([pair(k, 'one') + pair(k, 'two') for k in range(1024)])
    assert np.abs(np.corrcoef(points.T) - np.eye(4)).max() < 0.08


def test_disks_and_balls_are_even():
    flat = np.array([disk(*pair(k, 'a')) for k in range(1024)])
    solid = np.array([ball(*pair(k, 'a'), pair(k, 'b')[0]) for k in range(4096)])
    for points in (flat, solid[:, :2], solid[:, 1:]):  # as seen from anywhere
        squares = (points**2).sum(1)
        assert squares.max() <= 1 + 1e-9
        shares = np.histogram(squares, 4, (0, 1))[0] / len(points)
        assert np.abs(shares - 0.25).max() < 0.02


@pytest.mark.parametrize('angle', [7.0, 33.0, 61.0])
def test_edges_are_as_dark_as_the_area_that_they_cover(angle):
    """A black half plane over white: of each pixel, the polygon that it covers."""
    pl = plotter((32, 24))
    pl.set_background('white')
    half = pv.Plane(center=(5, 0, 0), i_size=10, j_size=40).rotate_z(angle)
    pl.add_mesh(half, color='black', lighting=False)
    place(pl, (0, 0, 10), up=(0, 1, 0), parallel=1.0)
    found = screenshot(pl, 256)[..., 0]
    n = 64  # the same by many points of each pixel
    at = (np.arange(24 * n) + 0.5) / n
    y, x = (12 - at[: 24 * n, None]) / 12, ((np.arange(32 * n) + 0.5) / n - 16) / 12
    inside = x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle)) > 0
    area = inside.reshape(24, n, 32, n).mean((1, 3))
    assert np.abs(found - 255 * (1 - area)).max() < 5
    assert abs((found - 255 * (1 - area)).mean()) < 0.05
    assert ((area > 0.02) & (area < 0.98)).sum() > 20


@pytest.mark.parametrize('seed', [0, 5])
def test_pixels_are_those_of_many_samples(seed):
    pl, big = scene(seed=seed), scene([8 * n for n in SIZE], seed)
    expected = reduce(shot(big), 8)
    found = screenshot(pl, 64)
    assert psnr(found, expected) > 45 > psnr(shot(pl), expected)
    assert abs((found - expected).mean()) < 0.2
    assert psnr(found, screenshot(pl, 256)) > 45


@pytest.mark.parametrize('samples', [4, 8])
def test_it_is_the_same_in_windows_with_samples(samples):
    expected = screenshot(scene(), 16)
    pl = scene()
    pl.enable_anti_aliasing('msaa', multi_samples=samples)
    shot(pl)
    samples = pl.render_window.GetMultiSamples()  # as many as the driver has
    assert samples > 1
    np.testing.assert_array_equal(screenshot(pl, 16), expected)
    pl.ibr.add(pvibr.Accumulation(16))
    np.testing.assert_array_equal(frames(pl, 17), expected)
    assert pl.render_window.GetMultiSamples() == samples


def test_frames_are_those_of_the_screenshot_and_stay():
    pl = scene()
    expected = screenshot(pl, 16)
    still = pl.ibr.add(pvibr.Accumulation(16))
    np.testing.assert_array_equal(frames(pl, 16), expected)
    assert still.report()['samples'] == 16
    assert not still.unfinished
    np.testing.assert_array_equal(frames(pl, 2), expected)
    np.testing.assert_array_equal(screenshot(pl, 16), expected)
    np.testing.assert_array_equal(frames(pl, 17), expected)


def test_the_first_frames_are_no_worse_than_the_one_before():
    pl = scene()
    pl.enable_anti_aliasing('msaa', multi_samples=8)
    before, expected = shot(pl), screenshot(pl, 256)
    pl.ibr.add(pvibr.Accumulation())
    errors = []
    for _ in range(14):
        errors.append(np.abs(shot(pl) - expected).mean())
    assert max(errors) < 1.2 * np.abs(before - expected).mean()


@pytest.mark.parametrize('parallel', [None, 2.0])
def test_lenses_are_those_of_many_eyes(parallel):
    """Of a point at the distance d, the circle of confusion: aperture * |d - focus| / focus."""
    pl = plotter((120, 90))
    pl.set_background('black')
    pl.add_mesh(pv.Disc(inner=0, outer=0.6, c_res=60), color='white', lighting=False)
    place(pl, (0, 0, 8), up=(0, 1, 0), parallel=parallel)
    sharp = screenshot(pl, 256)[..., 0] / 255
    assert np.abs(_blurred(pl, 8.0) - sharp).max() < 0.05  # what is in focus stays
    for focus in (5.0, 14.0):
        scale = 45 / 2.0 if parallel else 45 / np.tan(np.radians(15)) / 8
        circle = 0.3 * abs(8 - focus) / focus * scale
        found = _blurred(pl, focus)
        assert abs(found.sum() / sharp.sum() - 1) < 0.01
        np.testing.assert_allclose(_spread(found) - _spread(sharp), circle**2 / 4, rtol=0.03)


def _blurred(pl, focus):
    lens = pl.ibr.add(pvibr.DepthOfField(radius=0.3, distance=focus))
    found = screenshot(pl, 256)[..., 0] / 255
    pl.ibr.remove(lens)
    return found


def _spread(picture):
    """Return the variance of what is bright along one axis, pixels squared."""
    x = np.arange(picture.shape[1]) - (picture.shape[1] - 1) / 2
    return (picture.sum(0) * x**2).sum() / picture.sum()


@pytest.mark.parametrize('kind', ['sun', 'lamp'])
def test_penumbrae_are_shares_of_the_light(kind):
    """An edge over a floor, and a light as wide as a disk: of it, the segment that is seen."""
    pl = plotter((96, 24), lighting='none')
    pl.add_mesh(pv.Plane(i_size=30, j_size=30), color='white', ambient=0, diffuse=1, specular=0)
    edge = pv.Plane(center=(-10, 0, 2), i_size=20, j_size=30)
    shade = pl.add_mesh(edge, color='white')
    light = pv.Light(position=(0, 0, 8), focal_point=(0, 0, 0), light_type='scene light')
    light.positional = kind == 'lamp'
    if light.positional:
        light.cone_angle, light.exponent = 50, 0
    pl.add_light(light)
    place(pl, (0, -0.01, 1.5), up=(0, 1, 0), parallel=1.0)
    shade.visibility = False
    lit = screenshot(pl, 4)[12, :, 0]
    shade.visibility = True
    pl.ibr.add(pvibr.Shadows(method='pcss', angle=20.0, radius=0.8, resolution=512))
    found = screenshot(pl, 64)[8:16, :, 0].mean(0) / lit
    x = (np.arange(96) + 0.5 - 48) / 12
    # Where the edge is seen before the disk, in its radii.
    half = 2 * np.tan(np.radians(10)) if kind == 'sun' else 0.8 * 2 / 6
    u = np.clip(-x / half, -1, 1)
    expected = (np.arccos(u) - u * np.sqrt(1 - u * u)) / np.pi
    assert np.abs(found - expected).max() < 0.05


@pytest.mark.slow
def test_all_together_converge():
    pl = scene((48, 36), lighting='none')
    pl.add_light(pv.Light(position=(3, -2, 6), light_type='scene light'))
    pl.ibr.add(pvibr.Shadows(method='pcss', angle=4.0, resolution=128))
    pl.ibr.add(pvibr.AmbientOcclusion(0.4))
    pl.ibr.add(pvibr.DepthOfField(radius=0.15))
    expected = screenshot(pl, 256)
    found = screenshot(pl, 64)
    assert psnr(found, expected) > 38
    assert abs((found - expected).mean()) < 0.25
    assert psnr(shot(pl), expected) < 36


CHANGES = {
    'camera': lambda pl: setattr(pl.camera, 'azimuth', 5.0),
    'window center': lambda pl: pl.camera.SetWindowCenter(0.1, 0.0),
    'color': lambda pl: setattr(pl.actors['1'].prop, 'color', 'lime'),
    'hidden': lambda pl: setattr(pl.actors['1'], 'visibility', False),
    'moved': lambda pl: setattr(pl.actors['2'], 'position', (0, 0, 0.3)),
    'points': lambda pl: setattr(
        pl.actors['2'].mapper.dataset, 'points', 1.2 * pl.actors['2'].mapper.dataset.points
    ),
    'added': lambda pl: pl.add_mesh(pv.Cone(center=(0, -1, 1)), color='red'),
    'removed': lambda pl: pl.remove_actor('2'),
    'light': lambda pl: setattr(pl.renderer.lights[0], 'intensity', 0.3),
    'background': lambda pl: pl.set_background('navy'),
    'gradient': lambda pl: pl.set_background('navy', top='red'),
    'effect': lambda pl: pl.ibr.add(pvibr.Vignette()),
    'setting': lambda pl: setattr(pl.ibr['AmbientOcclusion'], 'strength', 3.0),
    'off': lambda pl: setattr(pl.ibr['AmbientOcclusion'], 'enabled', False),
    'poses': lambda pl: setattr(pl.ibr['balls'], 'points', [[0.5, 0, 1.5]]),
    'thing': lambda pl: setattr(pl.ibr['balls'], 'visibility', False),
    'window': lambda pl: pl.render_window.SetSize(90, 60),
    'pass': lambda pl: pl.enable_eye_dome_lighting(),
    'volume': lambda pl: setattr(pl.volume.prop, 'opacity_unit_distance', 0.01),
    'time': lambda pl: setattr(pl.ibr, 'time', 1.0),
}


def test_it_begins_again_after_every_change():
    pl = scene()
    pl.ibr.add_spheres([[0, 0, 1.5]], 0.3, name='balls')
    pl.ibr.add(pvibr.AmbientOcclusion(0.3))
    grid = pv.ImageData(dimensions=(6, 6, 6), spacing=(0.1,) * 3, origin=(-1.5, 0, 1))
    grid['v'] = np.arange(216.0)
    volume = pl.add_volume(grid, show_scalar_bar=False, opacity='linear')
    vars(pl)['volume'] = volume
    still = pl.ibr.add(pvibr.Accumulation(3))
    changes = ((name, lambda change=change: change(pl)) for name, change in CHANGES.items())
    assert stale(pl, still, changes) == {}


@pytest.mark.parametrize('samples', [0, 4])
def test_it_costs_nothing_while_the_view_moves(samples):
    pl = scene()
    pl.render_window.SetMultiSamples(samples)
    still = pl.ibr.add(pvibr.Accumulation(8))
    for k in range(3):
        pl.camera.azimuth = k
        pl.render()
        assert (still.report()['bytes'], pl.ibr.report().picture_bytes) == (0, 0)
    frames(pl, 8)
    assert still.report()['bytes'] > 0
    for k in range(10):
        pl.camera.azimuth = 9 + k
        before = shot(pl)
        assert still.report() == {'bytes': 0, 'samples': 0}
    assert pl.ibr.report().picture_bytes == 0  # not at once: the view may rest again
    assert pl.ibr.report().rows[0].why == 'the view moves'
    pl.ibr.remove(still)
    np.testing.assert_array_equal(shot(pl), before)


@pytest.mark.parametrize('name', ['Mirror', 'Glow', 'Impostor', 'ImageLayers', 'AnimatedActor'])
def test_what_others_draw_is_no_change(name):
    pl = everything.plotter(size=SIZE)
    pl.show(auto_close=False)
    everything.show_only(pl, name)
    frames(pl, 2)
    still = pl.ibr.add(pvibr.Accumulation(4))
    found = frames(pl, 4)
    assert not still.unfinished
    np.testing.assert_allclose(screenshot(pl, 4), found, atol=2)


def test_depth_picks_buffers_and_the_camera_are_those_of_the_view():
    pl = scene()
    pl.ibr.add(pvibr.DepthOfField(radius=0.3))
    camera = pl.renderer.GetActiveCamera()
    shot(pl)
    depth, ids, time = depth_buffer(pl), pl.ibr.buffer('id'), camera.GetMTime()
    still = pl.ibr.add(pvibr.Accumulation(64))
    picture = frames(pl, 5)
    assert still.report()['samples'] == 5
    np.testing.assert_array_equal(depth_buffer(pl), depth)
    np.testing.assert_array_equal(pl.ibr.buffer('id'), ids)
    color = 255 * pl.ibr.buffer('color')[..., :3]
    assert np.abs(color - picture).max() <= 1
    assert still.report()['samples'] == 5
    assert pl.renderer.GetActiveCamera() is camera
    assert camera.GetMTime() == time
    shot(pl)
    assert still.report()['samples'] == 6


def test_text_is_as_sharp_as_ever():
    pl = scene()
    pl.add_text('text', font_size=10, color='magenta')
    pl.add_point_labels([[0.0, 0, 1]], ['label'], font_size=14, always_visible=True)
    before = shot(pl)
    pl.ibr.add(pvibr.Accumulation(16))
    after = frames(pl, 16)
    text = (before == [255, 0, 255]).all(axis=2)
    assert text.sum() > 10
    np.testing.assert_array_equal(after[text], before[text])
    assert off(after, before).max() > 20


def test_subplots_have_each_their_own():
    pl = plotter((160, 60), shape=(1, 2), border=False)
    for k in range(2):
        pl.subplot(0, k)
        scene(pl=pl, seed=k)
    before = shot(pl)
    still = pl.ibr.add(pvibr.Accumulation(16))
    after = frames(pl, 16)
    np.testing.assert_array_equal(after[:, :80], before[:, :80])
    assert psnr(after, before) < 40
    taken = screenshot(pl, 16)
    np.testing.assert_array_equal(taken[:, 80:], after[:, 80:])
    np.testing.assert_array_equal(taken[:, :80], screenshot(scene(), 16))
    pl.subplot(0, 0)
    pl.camera.azimuth = 9
    assert still.report()['samples'] == 0  # since the screenshot
    frames(pl, 3)
    pl.camera.azimuth = 19
    pl.render()
    assert still.report()['samples'] > 2  # a neighbour's motion is none of its own


def test_subplots_with_one_camera():
    pl = plotter((160, 60), shape=(1, 2), border=False)
    for k in range(2):
        pl.subplot(0, k)
        scene(pl=pl, seed=k)
    pl.link_views()
    place(pl, (1, -6, 3))
    found = screenshot(pl, 16)
    for k in range(2):
        half = found[:, 80 * k : 80 * k + 80]
        np.testing.assert_allclose(half, screenshot(scene(seed=k), 16), atol=1)


BESIDE = {
    'SSAA': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'SSAO': lambda pl: pl.enable_ssao(radius=0.4),
    'EDL': lambda pl: pl.enable_eye_dome_lighting(),
    'peeling': lambda pl: (
        pl.enable_depth_peeling(),
        pl.add_mesh(pv.Sphere(radius=0.9), opacity=0.4),
    ),
    'glass': lambda pl: pl.add_mesh(pv.Sphere(radius=0.9), opacity=0.4),
    'volume': lambda pl: pl.add_volume(
        np.arange(216.0).reshape((6,) * 3), opacity='linear', show_scalar_bar=False
    ),
    'bounds': lambda pl: pl.show_bounds(),
    'tones': lambda pl: pl.ibr.add(pvibr.ToneMapping('aces')),
    'sky': lambda pl: pl.ibr.add(pvibr.Sky()),
    'outline': lambda pl: pl.ibr.add(pvibr.Outline()),
    'background': lambda pl: pl.set_background('navy', top='white'),
}


# On software drivers VTK peels nothing in multisampled windows.
@pytest.mark.parametrize(
    ('beside', 'samples'),
    [
        slow(b, n, when=n == 4 and k % 3)
        for k, b in enumerate(BESIDE)
        for n in (0, 4)
        if (b, n) != ('peeling', 4)
    ],
)
def test_beside(beside, samples):
    pl = scene()
    pl.render_window.SetMultiSamples(samples)
    BESIDE[beside](pl)
    place(pl, (1, -6, 3))
    before, expected = shot(pl), screenshot(pl, 32)
    np.testing.assert_array_equal(shot(pl), before)
    pl.ibr.add(pvibr.Accumulation(32))
    found = frames(pl, 32)
    rows = {row.effect: row for row in pl.ibr.report().rows}
    assert rows['Accumulation'].details['samples'] == 32, pl.ibr.report()
    assert off(found, expected).max() <= 2
    assert abs((found - before).mean()) < 4  # VTK's mean of samples is one of light
    assert psnr(found, before) > 20


def test_transparent_backgrounds():
    pl = scene()
    pl.remove_actor('floor')
    found = screenshot(pl, 64, transparent_background=True)
    big = scene([8 * n for n in SIZE])
    big.remove_actor('floor')
    expected = reduce(shot(big, transparent_background=True), 8)
    assert psnr(found[..., 3], expected[..., 3]) > 45


def test_tiles_are_those_of_a_larger_window():
    pl, big = scene(), scene([2 * n for n in SIZE])
    np.testing.assert_allclose(screenshot(pl, 16, scale=2), screenshot(big, 16), atol=2)


def test_two_plotters_and_removal_and_close():
    one, two = scene(), scene(seed=1)
    before = shot(two)
    still = one.ibr.add(pvibr.Accumulation(4))
    on = frames(one, 4)
    np.testing.assert_array_equal(shot(two), before)
    one.ibr.remove(still)
    assert still.report() == {'bytes': 0, 'samples': 0}
    assert one.ibr.report().picture_bytes == 0
    off_ = shot(one)
    one.ibr.add(still)
    np.testing.assert_array_equal(frames(one, 4), on)
    assert off(on, off_).max() > 20
    one.close()
    np.testing.assert_array_equal(shot(two), before)


def test_one_sample_is_the_picture_itself():
    pl = scene()
    before = shot(pl)
    np.testing.assert_array_equal(screenshot(pl, 1), before)
    pl.ibr.add(pvibr.Accumulation(1))
    np.testing.assert_array_equal(frames(pl, 3), before)
    assert 'samples is 1' in str(pl.ibr.report())


def test_eyes_of_stereo_have_each_their_own():
    pl = scene()
    pl.render_window.StereoRenderOn()
    pl.render_window.SetStereoTypeToAnaglyph()
    before, expected = shot(pl), screenshot(pl, 16)
    still = pl.ibr.add(pvibr.Accumulation(16))
    np.testing.assert_array_equal(frames(pl, 16), expected)
    assert psnr(expected, before) > 20
    pl.render_window.StereoRenderOff()
    frames(pl, 16)
    assert not still.unfinished


@pytest.mark.parametrize('samples', [0, -1, 2.5, True, 'many', None])
def test_samples_that_are_none(samples):
    pl = scene()
    refused('samples', pl.ibr.screenshot, samples=samples)
    if samples is not None:
        refused('samples', pvibr.Accumulation, samples, kind=(TypeError, ValueError))


def test_instances_are_those_of_meshes():
    mesh = pv.ParametricTorus(ringradius=0.6, crosssectionradius=0.25, u_res=24, v_res=12)
    places = np.c_[np.random.default_rng(0).uniform(-6, 6, (12, 2)), np.zeros(12)]
    cards, meshes = plotter(SIZE), plotter([6 * n for n in SIZE])
    look = {'color': 'tomato', 'smooth_shading': True}
    things = cards.ibr.add_instances(mesh, places, bake=True, **look)
    for at in places:
        meshes.add_mesh(mesh.translate(at), color='tomato', smooth_shading=True)
    for pl in (cards, meshes):
        place(pl, (0, -30, 16))
        pl.show(auto_close=False)
    expected, single = reduce(shot(meshes), 6), shot(cards)
    things.max_error = 0.25  # levels do not depend on the samples
    assert psnr(screenshot(cards, 64), expected) > psnr(single, expected) + 4


def test_pages_draw_by_themselves_once_the_view_rests(monkeypatch):
    wall = SimpleNamespace(now=100.0)
    monkeypatch.setattr('pvibr.capture.adaptive_quality.perf_counter', lambda: wall.now)
    pl = scene()
    still = pl.ibr.add(pvibr.Accumulation(8))
    # As views of trame do, which then have the server draw and send.
    pl.add_on_render_callback(lambda plotter: plotter.render_window.Render(), render_event=False)

    def samples():
        return still.report()['samples']

    async def rest():
        pl.render()
        await asyncio.sleep(0.1)
        assert samples() == 0
        wall.now += SETTLE
        while still.unfinished:
            await asyncio.sleep(0.01)
        pl.camera.azimuth = 5
        pl.render()
        await asyncio.sleep(0.1)
        assert samples() == 0  # not before it rests again
        pl.ibr.play()
        wall.now += SETTLE
        await asyncio.sleep(0.2)
        assert samples() == 0  # nor while time goes on
        pl.ibr.stop()
        pl.render()
        wall.now += SETTLE
        while still.unfinished:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.1)

    asyncio.run(asyncio.wait_for(rest(), 60))
    assert pl.ibr._adaptive_quality._ticks is None
    np.testing.assert_array_equal(np.asarray(pl.image).astype(int), screenshot(pl, 8))


def test_scripts_without_a_page_draw_nothing_by_themselves():
    pl = scene()
    still = pl.ibr.add(pvibr.Accumulation(8))
    frames(pl, 2)
    assert still.unfinished
    assert pl.ibr._adaptive_quality._ticks is None


@pytest.mark.slow
@pytest.mark.parametrize('effect', ['light', 'lens'])
def test_a_few_samples_fill_what_lies_between_them(effect):
    plotter = pv.Plotter(off_screen=True, window_size=(96, 64), lighting='none')
    plotter.add_light(pv.Light(position=(1, -1, 3), light_type='scene light'))
    plotter.add_mesh(pv.Plane(i_size=8, j_size=8), color='white')
    plotter.add_mesh(pv.Box((-0.5, 0.5, -0.5, 0.5, 1, 1.2)), color='tan')
    plotter.camera_position = [(2, -5, 3), (0, 0, 0.5), (0, 0, 1)]
    light = pvibr.Shadows(method='pcss', angle=14.0, lights='all')
    plotter.ibr.add(light if effect == 'light' else pvibr.DepthOfField(distance=3.0, f_number=1.4))
    converged, few = (plotter.ibr.screenshot(samples=n).astype(float) for n in (256, 4))
    # As points of light and lens, they are off by 6.2 and 5.0.
    assert np.sqrt(((few - converged) ** 2).mean()) < {'light': 5.2, 'lens': 4.2}[effect]
