"""Billboards over the picture and behind the scene, against the same in numpy."""

import numpy as np
import pytest
import pyvista as pv

from pvibr import Backdrop, Flash, ImageOverlay, Iris, LiveTexture, NightVision, Sky, Vignette
from tests.makers import ENABLED
from tests.pictures import places, shot
from tests.refusals import refused

SIZE = (120, 80)
IMAGE = np.random.default_rng(3).integers(0, 256, (80, 120, 4), np.uint8)
OPAQUE = IMAGE[..., :3]


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=SIZE)
    pl.set_background((0.1, 0.4, 0.6))
    pl.add_mesh(pv.Sphere(), color='tan')
    pl.show(auto_close=False)
    return pl


def test_what_covers_covers_transparent_background_too(pl):
    pl.ibr.add(Iris(opening=0))
    assert (shot(pl, transparent_background=True)[..., 3] == 255).all()


def test_vignette_is_its_formula(pl):
    before = shot(pl)
    pl.ibr.add(Vignette(intensity=0.8, radius=0.3, softness=0.5, center=(0.4, 0.6)))
    far = np.linalg.norm((places(SIZE) - (0.4, 0.6)) * SIZE, axis=-1) / (np.hypot(*SIZE) / 2)
    t = np.clip((far - 0.3) / 0.5, 0, 1)
    expected = before * (1 - 0.8 * t**2 * (3 - 2 * t))[..., None]
    assert np.abs(shot(pl) - expected).max() <= 1


def test_flash_fades_by_the_clock(pl):
    before = shot(pl)
    flash = pl.ibr.add(Flash(duration=0.5, color=(1, 0.5, 0), intensity=0.8))
    pl.ibr.time = 2.0
    np.testing.assert_array_equal(shot(pl), before)
    flash.fire()
    for time in (2.0, 2.25, 3.0):
        pl.ibr.time = time
        cover = 0.8 * np.exp(-(time - 2) / 0.5)
        expected = before + cover * (np.array([255, 127.5, 0]) - before)
        assert np.abs(shot(pl) - expected).max() <= 1
    pl.ibr.time = 1.0
    np.testing.assert_array_equal(shot(pl), before)


def pcg(n):
    n = n * np.uint32(747796405) + np.uint32(2891336453)
    n = ((n >> ((n >> np.uint32(28)) + np.uint32(4))) ^ n) * np.uint32(277803737)
    return (n >> np.uint32(22)) ^ n


def test_night_vision_is_its_formula(pl):
    before = shot(pl) / 255
    night = pl.ibr.add(NightVision(gain=3, grain=0.2, rate=10, color=(0.2, 1, 0.3)))
    pl.ibr.time = 1.25
    y = before @ [0.2126, 0.7152, 0.0722]
    x, row = np.meshgrid(*(np.arange(n, dtype=np.uint32) for n in SIZE))
    with np.errstate(over='ignore'):
        n = pcg(x + pcg(row[::-1] + pcg(np.uint32([[12]]))))
    shine = (1 - np.exp(-3 * y)) / (1 - np.exp(-3.0)) + 0.2 * ((n >> 8) / 2**24 - 0.5)
    seen = shot(pl)
    expected = 255 * np.clip(shine, 0, 1)[..., None] * [0.2, 1, 0.3]
    assert np.abs(seen - expected).max() <= 1
    np.testing.assert_array_equal(shot(pl), seen)
    night.seed = 1
    assert np.abs(shot(pl) - seen).max() > 5


def test_iris_is_a_disk(pl):
    before = shot(pl)
    iris = pl.ibr.add(Iris(opening=0.4, center=(0.5, 0.25), color=(0, 0, 1)))
    reach = 0.4 * (np.hypot(60, 60) + 1)
    inside = reach - np.linalg.norm((places(SIZE) - (0.5, 0.25)) * SIZE, axis=-1)
    open_ = np.clip(inside, 0, 1)[..., None]
    expected = open_ * before + (1 - open_) * [0, 0, 255]
    assert np.abs(shot(pl) - expected).max() <= 1
    iris.opening = 0
    assert (shot(pl) == [0, 0, 255]).all()
    iris.opening, iris.softness = 0.9999, 0.3
    assert np.abs(shot(pl) - before).max() <= 1


def test_iris_of_a_shape(pl):
    """A diamond's inner circle does what the circle does: its corners reach further."""
    before = shot(pl)
    at = np.abs(np.arange(257) - 128)
    diamond = (at[:, None] + at <= 120).astype(float)
    pl.ibr.add(Iris(diamond, opening=0.3, color=(0, 0, 1)))
    reach = 0.3 * (np.hypot(60, 40) + 1)
    p = np.abs((places(SIZE) - 0.5) * SIZE).sum(axis=-1) / np.sqrt(2)
    closed = (shot(pl) == [0, 0, 255]).all(axis=2)
    sure = np.abs(p - reach) > 1.5
    np.testing.assert_array_equal(closed[sure], (p > reach)[sure])
    assert np.abs(shot(pl) - before)[p < reach - 1.5].max() == 0


def test_shape_without_light():
    refused('must have bright, opaque pixels', Iris, np.zeros((4, 4)))


@pytest.mark.parametrize('mode', ImageOverlay.mode.choices)
def test_picture_modes(pl, mode):
    before = shot(pl) / 255
    pl.ibr.add(ImageOverlay(IMAGE, mode=mode, opacity=0.7))
    k, a = IMAGE[..., :3] / 255, 0.7 * IMAGE[..., 3:] / 255
    expected = {
        'over': before * (1 - a) + k * a,
        'add': before + k * a,
        'multiply': before * (1 - a + k * a),
        'screen': 1 - (1 - before) * (1 - k * a),
    }[mode]
    most = 1.5 if mode == 'over' else 1  # blended by the driver in 8 bits
    assert np.abs(shot(pl) - 255 * np.clip(expected, 0, 1)).max() <= most


def test_picture_lies_where_it_should(pl):
    before = shot(pl)
    picture = pl.ibr.add(ImageOverlay(np.ones((10, 10, 3)), place=(0.5, 0.5, 1, 1)))
    white = (shot(pl) == 255).all(axis=2)
    expected = np.zeros((80, 120), bool)
    expected[:40, 70:110] = True  # 40 x 40 in the middle of 60 x 40
    np.testing.assert_array_equal(white, expected)
    picture.fit = 'cover'
    expected[:40, 60:] = True
    np.testing.assert_array_equal((shot(pl) == 255).all(axis=2), expected)
    picture.place = (0.5, 0.5, 0.5, 1)
    np.testing.assert_array_equal(shot(pl), before)
    assert 'place must have' in pl.ibr.report().rows[0].why


def test_pictures_of_a_sequence_follow_the_clock(pl):
    pl.ibr.add(
        ImageOverlay([np.full((4, 4, 3), g) for g in (0.0, 0.5, 1.0)], fps=2, fit='stretch')
    )
    for time, grey in ((0, 0), (0.5, 128), (1.0, 255), (1.5, 0)):
        pl.ibr.time = time
        assert (shot(pl) == grey).all()


@pytest.mark.parametrize('high', [False, True])
@pytest.mark.parametrize('opacity', [1.0, 0.5])
def test_backdrop_shows_where_the_scene_does_not(pl, opacity, high):
    pl.add_mesh(pv.Plane(center=(0, 0.6, 0), direction=(1, 1, 1)), color='red', opacity=opacity)
    pl.set_background('black')
    black = shot(pl, transparent_background=True)
    pl.set_background((0.2, 0.6, 0.4), top=(0.9, 0.1, 0.3))
    before = shot(pl)
    backdrop = pl.ibr.add(Backdrop(IMAGE, opacity=0.8))
    backdrop.needs_hdr = high
    a = 0.8 * IMAGE[..., 3:] / 255
    v = places(SIZE)[..., 1:]
    ground = 255 * ((1 - v) * [0.2, 0.6, 0.4] + v * [0.9, 0.1, 0.3])
    behind = ground * (1 - a) + IMAGE[..., :3] * a
    expected = black[..., :3] + (1 - black[..., 3:] / 255) * behind
    # Two roundings to bytes: of the scene, of its alpha.
    assert np.abs(shot(pl) - expected).max() <= 2
    backdrop.opacity = 0
    np.testing.assert_array_equal(shot(pl), before)


def test_backdrop_and_sky_are_not_both_behind(pl):
    pl.ibr.add(Backdrop(OPAQUE))
    pl.ibr.add(Sky())
    shot(pl)
    rows = pl.ibr.report().rows
    assert [r.state for r in rows] == ['ran', 'skipped']
    assert rows[1].why == 'Sky is behind the scene already'


@pytest.mark.parametrize('parallel', [False, True])
def test_sky_is_where_directions_are(pl, parallel):
    """A panorama painted with its own directions, seen through PyVista's camera."""
    pl.clear()
    lat = np.pi / 2 - (np.arange(512) + 0.5) / 512 * np.pi
    lon = np.pi - (np.arange(1024) + 0.5) / 1024 * 2 * np.pi
    lon, lat = np.meshgrid(lon, lat)
    ball = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)
    pl.ibr.add(Sky(ball / 2 + 0.5, turn=30.0))
    camera = pl.camera
    camera.position, camera.focal_point, camera.up = (3, -4, 2), (0.5, 0.2, 1), (0.2, 0.1, 1)
    camera.view_angle, camera.parallel_projection = 70.0, parallel
    forward = np.array(camera.focal_point) - camera.position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    ndc = (2 * places(SIZE) - 1) * np.tan(np.radians(35)) * [SIZE[0] / SIZE[1], 1]
    to = forward + ndc[..., :1] * right + ndc[..., 1:] * np.cross(right, forward)
    to /= np.linalg.norm(to, axis=-1, keepdims=True)
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    to = np.stack(
        [c * to[..., 0] + s * to[..., 1], c * to[..., 1] - s * to[..., 0], to[..., 2]], -1
    )
    assert np.abs(shot(pl) - 255 * (to / 2 + 0.5)).max() <= 2


def test_gradient_sky_is_its_formula(pl):
    pl.clear()
    sky = pl.ibr.add(Sky(up=(0, 1, 0), intensity=0.5))
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, 0, 5), (0, 0, 0), (0, 1, 0)
    pl.camera.view_angle = 90
    ndc = (2 * places(SIZE) - 1) * [1.5, 1]
    rise = np.arctan2(ndc[..., 1], np.hypot(ndc[..., 0], 1)) / (np.pi / 2)
    end = np.where((rise > 0)[..., None], sky.top, sky.bottom)
    expected = 0.5 * (sky.horizon + np.abs(rise)[..., None] * (end - np.array(sky.horizon)))
    assert np.abs(shot(pl) - 255 * expected).max() <= 1
    sky.up = (0, 0, 0)
    shot(pl)
    assert 'give a direction' in pl.ibr.report().rows[0].why


def test_sky_gives_way_to_a_background_image(pl):
    pl.add_background_image(pv.examples.mapfile)
    before = shot(pl)
    pl.ibr.add(Sky())
    np.testing.assert_array_equal(shot(pl), before)
    assert 'another renderer' in pl.ibr.report().rows[0].why


@pytest.mark.parametrize('name', ['ssao', 'edl', 'peeling', 'ssaa', 'msaa'])
def test_a_plain_sky_is_the_background_itself(pl, name):
    """Whatever pass draws: a backdrop of one colour looks like a background of that colour.

    But for what passes do to a background itself: they darken it beside things, or round it.
    """
    pl.add_mesh(pv.Cube(center=(0.4, 0.3, 0.5)), color='blue', opacity=0.5)
    ENABLED[name](pl)
    pl.set_background((1.0, 1.0, 0.2))
    before = shot(pl)
    pl.set_background('purple')
    pl.ibr.add(Backdrop(np.full((4, 4, 3), [255, 255, 51], np.uint8), fit='stretch'))
    off = np.abs(shot(pl) - before).max(axis=2)
    assert (off > 3).mean() < 0.04
    assert off.max() < 25


def test_behind_a_volume(pl):
    pl.clear()
    grid = pv.ImageData(dimensions=(12, 12, 12))
    grid['v'] = np.linalg.norm(grid.points - 5.5, axis=1)
    pl.add_volume(grid, opacity=[0.4, 0.1, 0, 0], show_scalar_bar=False)
    pl.reset_camera()
    pl.set_background((1.0, 1.0, 0.2))
    before = shot(pl)
    pl.set_background('purple')
    pl.ibr.add(Backdrop(np.full((4, 4, 3), [255, 255, 51], np.uint8), fit='stretch'))
    assert np.ptp(before) > 50
    assert np.abs(shot(pl) - before).max() <= 1


def test_tiles_of_subplots_show_the_same():
    pl = pv.Plotter(shape=(1, 2), window_size=(200, 80), border=False)
    for i in range(2):
        pl.subplot(0, i)
        pl.disable_anti_aliasing()
        pl.add_mesh(pv.Sphere(), color='tan')
        for effect in (Sky(), Vignette(intensity=1), Iris(opening=0.8)):
            pl.ibr.add(effect)
    pl.show(auto_close=False)
    small, large = shot(pl), shot(pl, scale=2)
    large = large.reshape(80, 2, 200, 2, 3).mean(axis=(1, 3))
    assert np.abs(large - small).mean() < 2


def test_images_seen_small_are_their_mean(pl):
    """Levels: a chessboard of single pixels is grey, not one of its colours."""
    board = np.indices((512, 512)).sum(axis=0) % 2 * np.ones((512, 512))
    pl.ibr.add(ImageOverlay(board, place=(0.3, 0.3, 0.5, 0.5), fit='stretch'))
    found = shot(pl)[43:53, 40:56]
    assert np.abs(found - 127.5).max() < 3


@pytest.mark.parametrize('kind', [ImageOverlay, Backdrop])
def test_an_image_may_be_a_live_texture(pl, kind):
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, -4, 0), (0, 0, 0), (0, 0, 1)
    live = LiveTexture(camera, size=SIZE, background=(0, 0, 1, 1))
    effect = pl.ibr.add(kind(live, place=(0, 0, 0.25, 0.25), fit='stretch'))
    before = shot(pl)
    assert 'live texture is in no subplot' in pl.ibr.report().rows[-1].why
    pl.ibr.add(live)
    after = shot(pl)
    np.testing.assert_array_equal(after[:60], before[:60])
    corner = after[60:, :30]
    assert 0.3 < (corner == [0, 0, 255]).all(axis=2).mean() < 0.9
    assert (corner[10, 15] != [0, 0, 255]).any()
    pl.ibr.remove(live)
    np.testing.assert_array_equal(shot(pl), before)
    assert pl.ibr.effects == (effect,)
