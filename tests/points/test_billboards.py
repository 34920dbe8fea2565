"""Billboards stand where they should, turned as told, in the right order, under every load."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.maths.facing import azimuths, cards
from pvibr.things.frame import Frame

pytestmark = pytest.mark.sampled

WHITE = np.full((8, 8, 4), 255, np.uint8)
SIZE = (160, 100)


def plotter(eye=(0, -10, 3), focus=(0, 0, 0), up=(0, 0, 1), size=SIZE, **kwargs):
    pl = pv.Plotter(off_screen=True, window_size=size, **kwargs)
    pl.disable_anti_aliasing()
    pl.set_background('black')
    aim(pl, eye, focus, up)
    return pl


def aim(pl, eye, focus=(0, 0, 0), up=(0, 0, 1), parallel=None):
    pl.camera.position, pl.camera.focal_point, pl.camera.up = eye, focus, up
    if parallel:
        pl.camera.parallel_projection = True
        pl.camera.parallel_scale = parallel


def grab(pl, see):
    pl.renderer.ResetCameraClippingRange()
    return np.rint(255 * see.grab(pl)).astype(int)


def pixels(pl, points):
    """Return where points are on the screen, pixels from the upper left corner."""
    frame = Frame.of(pl.renderer)
    eye = np.asarray(points) @ frame.view_from_world[:3, :3].T + frame.view_from_world[:3, 3]
    clip = np.c_[eye, np.ones(len(eye))] @ frame.clip_from_view.T
    ndc = clip[:, :2] / clip[:, 3:]
    return np.stack([(ndc[:, 0] + 1) / 2 * frame.size[0], (1 - ndc[:, 1]) / 2 * frame.size[1]], 1)


def covered_by(pl, corners):
    """Return which pixels' centres a convex polygon covers."""
    xy = pixels(pl, corners)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    sides = []
    for a, b in zip(xy, np.roll(xy, -1, 0), strict=True):
        sides.append((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]))
    return (np.array(sides) >= 0).all(0) | (np.array(sides) <= 0).all(0)


TURNS = {
    'spherical': {},
    'plane': {'towards': 'plane'},
    'upright': {'axis': (0, 0, 1)},
    'cylindrical': {'facing': 'cylindrical'},
    'about a slanted axis': {'facing': 'cylindrical', 'axis': (1, 2, -1)},
    'screen': {'facing': 'screen'},
    'world': {'facing': 'world', 'orientation': (0.8, 0.6, 0.2, 0.1)},
    'rolled': {'rotation': 0.7},
}
EYES = {'front': (2, -9, 3), 'above': (1, 0.1, 11), 'below': (-3, 4, -9), 'pole': (0, 0, 10)}


@pytest.mark.parametrize('offset', [0.0, 1e6, 1e9])
@pytest.mark.parametrize('parallel', [None, 3.0], ids=['perspective', 'parallel'])
@pytest.mark.parametrize('turn', TURNS.values(), ids=TURNS.keys())
def test_cards_cover_what_the_twin_says(turn, parallel, offset, see):
    point, size, anchor = np.array([0.4, 0.2, -0.3]), np.array([2.0, 1.2]), np.array([0.5, 0.2])
    pl = plotter()
    shift = np.array([offset, -offset, offset])
    pl.ibr.add_billboards([point + shift], WHITE, size=[size], anchor=anchor, **turn)
    for eye in EYES.values():
        up = (0, 1, 0) if eye == EYES['pole'] else (0, 0, 1)
        aim(pl, np.array(eye) + shift, shift, up, parallel)
        drawn = grab(pl, see)[..., 0] > 127
        view = Frame.of(pl.renderer).view_from_world
        asked = {'facing': 'spherical', **turn}
        (axes,) = cards([point + shift], view, parallel=bool(parallel), **asked)
        uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        flat = (uv - anchor) * size
        truth = covered_by(pl, point + shift + flat @ axes[:, :2].T)
        assert (drawn != truth).sum() <= 0.02 * max(truth.sum(), 100)


@pytest.mark.parametrize('distance', [3.0, 30.0, 3000.0])
@pytest.mark.parametrize('parallel', [None, 5.0])
def test_pixels_are_pixels_at_any_distance(distance, parallel, see):
    pl = plotter((0, -distance, 0))
    aim(pl, (0, -distance, 0), parallel=parallel)
    pl.ibr.add_billboards([[0, 0, 0]], WHITE, size=[[31, 17]], size_unit='pixel')
    drawn = grab(pl, see)[..., 0] > 127
    assert abs(drawn.any(0).sum() - 31) <= 1
    assert abs(drawn.any(1).sum() - 17) <= 1


def test_a_screenshot_of_twice_the_size_has_twice_the_pixels():
    pl = plotter()
    pl.ibr.add_billboards([[0, 0, 0]], WHITE, size=20, size_unit='pixel')
    pl.show(auto_close=False)
    assert abs((pl.screenshot(scale=2)[..., 0] > 127).any(0).sum() - 40) <= 2


def quadrants():
    image = np.zeros((16, 16, 4), np.uint8)
    image[..., 3] = 255
    image[:8, :8, 0] = image[:8, 8:, 1] = image[8:, :8, 2] = 255
    image[8:, 8:, :3] = 255
    return image


def test_images_are_upright(see):
    pl = plotter((0, -10, 0))
    pl.ibr.add_billboards([[0, 0, 0]], quadrants(), size=2)
    picture = grab(pl, see)
    y, x = SIZE[1] // 2, SIZE[0] // 2
    got = [picture[y + j, x + i].tolist() for j in (-9, 9) for i in (-9, 9)]
    assert got == [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]


def test_each_shows_its_own_image_and_no_neighbour(see):
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [0, 255, 255]])
    sizes = [(4, 4), (16, 8), (5, 13), (1, 1), (32, 32)]
    images = [
        np.tile(c.astype(np.uint8), (h, w, 1)) for c, (w, h) in zip(colors, sizes, strict=True)
    ]
    index = np.array([4, 2, 0, 1, 3])
    points = np.c_[np.arange(5) - 2.0, np.zeros(5), np.zeros(5)] * 1.5
    for distance in (12, 200):
        pl = plotter((0, -distance, 0))
        size = [[distance / 12] * 2] * 5
        points_there = points * distance / 12
        pl.ibr.add_billboards(points_there, images, index=index, size=size)
        picture = grab(pl, see)
        found = np.unique(picture.reshape(-1, 3), axis=0)
        assert len(found) == 6
        for (x, y), k in zip(pixels(pl, points_there), index, strict=True):
            assert picture[int(y), int(x)].tolist() == colors[k].tolist()
        pl.close()


def test_a_flipbook_goes_by_time(see):
    grey = np.repeat(np.array([[10, 60, 110, 160]], np.uint8), 8, 1)
    pl = plotter((0, -10, 0))
    thing = pl.ibr.add_billboards(
        [[-1, 0, 0], [1, 0, 0]],
        np.tile(grey, (8, 1)),
        frames=(4, 1),
        fps=2.0,
        index=[0, 1],
        size=1.0,
    )
    spots = pixels(pl, thing.points).astype(int)
    before = thing.content_key()
    for time, expected in ((0.0, (10, 60)), (0.5, (60, 110)), (1.6, (160, 10)), (2.0, (10, 60))):
        pl.ibr.time = time
        picture = grab(pl, see)
        assert tuple(picture[y, x, 0] for x, y in spots) == expected
    pl.ibr.time = 0.5
    assert thing.content_key() != before


@pytest.mark.parametrize('blend_views', [False, True])
@pytest.mark.parametrize('axis', [(0, 0, 1), (0.96, 0, 0.28)])
def test_the_view_from_the_right_side_is_shown(axis, blend_views, see):
    views, yaws = 8, np.array([0.0, 1.0])
    grey = (np.arange(views) * 30 + 10).astype(np.uint8)
    images = [np.full((8, 8), g, np.uint8) for g in grey]
    points = np.array([[-1.0, 0, 0], [1, 0, 0]])
    pl = plotter()
    thing = pl.ibr.add_billboards(
        points,
        images,
        facing='cylindrical',
        axis=axis,
        views=views,
        blend_views=blend_views,
        yaw=yaws,
        size=0.8,
    )
    for angle in np.linspace(0, 2 * np.pi, 13)[:-1] + 0.1:
        eye = 12 * np.array([np.cos(angle), np.sin(angle), 0.4])
        aim(pl, eye)
        picture = grab(pl, see)
        azimuth = azimuths(points, Frame.of(pl.renderer).view_from_world, axis)
        place = (azimuth - yaws) / (2 * np.pi) * views
        low = np.floor(place).astype(int)
        share = place - low if blend_views else np.rint(place) - low
        expected = grey[low % views] * (1 - share) + grey[(low + 1) % views] * share
        for (x, y), value in zip(pixels(pl, points), expected, strict=True):
            assert abs(picture[int(y), int(x), 0] - value) <= 1.5
    assert thing.layout.n_images == 1


def test_colours_and_scalars_multiply_the_image(see):
    pl = plotter((0, -10, 0))
    half = np.full((8, 8), 0.5)
    thing = pl.ibr.add_billboards([[-1, 0, 0], [1, 0, 0]], half, colors=[[1.0, 0, 0], [0, 1.0, 0]])
    spots = pixels(pl, thing.points).astype(int)

    def seen():
        picture = grab(pl, see)
        return [picture[y, x].tolist() for x, y in spots]

    assert seen() == [[128, 0, 0], [0, 128, 0]]
    thing.scalars = [0.0, 1.0]
    thing.map('gray')
    assert seen() == [[0, 0, 0], [128, 128, 128]]
    thing.visible = np.array([False, True])
    assert seen() == [[0, 0, 0], [128, 128, 128]]
    thing.colors = None
    assert seen() == [[0, 0, 0], [128, 128, 128]]


def test_a_scalar_bar_comes_as_with_instances():
    pl = plotter()
    pl.ibr.add_billboards([[0, 0, 0], [1, 0, 0]], WHITE, scalars=[1.0, 2.0], name='growth')
    assert 'growth' in pl.scalar_bars


def test_near_ones_hide_far_ones_whatever_the_order(see):
    points = [[0, 1, 0], [0, -1, 0], [0, 0, 0]]
    pl = plotter((0, -10, 0))
    pl.ibr.add_billboards(points, WHITE, colors=np.eye(3))
    assert grab(pl, see)[50, 80].tolist() == [0, 255, 0]
    aim(pl, (0, 10, 0))
    assert grab(pl, see)[50, 80].tolist() == [255, 0, 0]


def over(colors, alphas):
    """Return colours from far to near, one over the other, on black."""
    out = np.zeros(3)
    for color, alpha in zip(colors, alphas, strict=True):
        out = out * (1 - alpha) + np.asarray(color) * alpha
    return 255 * out


@pytest.mark.parametrize('peeling', [False, True])
def test_blended_ones_are_drawn_from_far_to_near(peeling, see):
    rng = np.random.default_rng(3)
    depths = rng.permutation(12) * 0.2
    points = np.c_[np.zeros(12), depths, np.zeros(12)]
    colors, alphas = rng.uniform(size=(12, 3)), rng.uniform(0.1, 0.6, 12)
    pl = plotter((0, -10, 0))
    if peeling:
        pl.enable_depth_peeling(20)
    pl.ibr.add_billboards(points, WHITE, colors=colors, opacity=alphas, cutout=None, size=2)
    for side in (1, -1):
        aim(pl, (0, -10 * side, 0))
        order = np.argsort(-side * depths)
        expected = over(colors[order], alphas[order])
        assert np.abs(grab(pl, see)[50, 80] - expected).max() <= 5


def pane(pl, y, color, opacity):
    plane = pv.Plane(center=(0, y, 0), direction=(0, 1, 0), i_size=6, j_size=6)
    return pl.add_mesh(plane, color=color, opacity=opacity, lighting=False)


@pytest.mark.parametrize('peeling', [False, True])
def test_blended_ones_and_translucent_props_take_turns(peeling, see):
    pl = plotter((0, -10, 0))
    if peeling:
        pl.enable_depth_peeling(20)
    panes = [pane(pl, -1.0, 'blue', 0.5), pane(pl, 1.0, 'lime', 0.5), pane(pl, 5.0, 'white', 1.0)]
    at = np.array([-2.0, 0.0, 2.0])
    points = np.c_[np.zeros(3), at, np.zeros(3)]
    pl.ibr.add_billboards(
        points, WHITE, colors=[[1.0, 0, 0]] * 3, opacity=0.25, cutout=None, size=2
    )
    for side in (1, -1):
        aim(pl, (0, -10 * side, 0))
        layers = [(y, (1, 0, 0), 0.25) for y in at]
        layers += [(-1.0, (0, 0, 1), 0.5), (1.0, (0, 1, 0), 0.5), (5.0, (1, 1, 1), 1.0)]
        layers.sort(key=lambda row: -side * row[0])
        expected = over([c for _, c, _ in layers], [a for _, _, a in layers])
        assert np.abs(grab(pl, see)[50, 80] - expected).max() <= 4
    assert pl.renderer.GetUseOIT()
    assert all(pl.renderer.HasViewProp(one) for one in panes)


def discs():
    """Return an image of small discs: less than half of it is covered."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:128, :128]
    alpha = np.zeros((128, 128))
    for cx, cy in rng.uniform(4, 124, (70, 2)):
        alpha = np.maximum(alpha, np.clip(3.5 - np.hypot(x - cx, y - cy), 0, 1))
    image = np.full((128, 128, 4), 255, np.uint8)
    image[..., 3] = np.rint(255 * alpha)
    return image


def test_cut_outs_keep_what_they_cover_when_far(see):
    image = discs()
    share = (image[..., 3] >= 128).mean()
    pl = plotter((0, -10, 0), size=(300, 300))
    thing = pl.ibr.add_billboards([[0, 0, 0]], image, size=140, size_unit='pixel')
    for pixels_wide in (250, 120, 60, 30, 20):
        thing.remove()
        thing = pl.ibr.add_billboards([[0, 0, 0]], image, size=pixels_wide, size_unit='pixel')
        covered = (grab(pl, see)[..., 0] > 127).sum() / pixels_wide**2
        assert abs(covered - share) < 0.15 * share, pixels_wide


def test_what_is_transparent_has_no_colour(see):
    image = np.zeros((32, 32, 4), np.uint8)
    image[..., 1] = 255
    image[8:24, 8:24] = (255, 0, 0, 255)
    pl = plotter((0, -10, 0))
    for cutout in (0.5, None):
        thing = pl.ibr.add_billboards([[0, 0, 0]], image, size=3, cutout=cutout)
        picture = grab(pl, see)
        assert picture[..., 0].max() == 255
        assert picture[..., 1].max() == 0
        thing.remove()


def test_cut_outs_throw_shadows_of_their_holes(see):
    image = np.full((32, 32, 4), 255, np.uint8)
    image[:, 12:20, 3] = 0
    pl = plotter((0, -12, 9), lighting='none', size=(200, 150))
    light = pv.Light(position=(0, 5, 8), focal_point=(0, 0, 0), light_type='scene light')
    light.positional = False
    pl.add_light(light)
    pl.add_mesh(pv.Plane(i_size=12, j_size=12), color='white')
    bright = grab(pl, see)[..., 0]
    pl.ibr.add(pvibr.Shadows())
    billboards = pl.ibr.add_billboards(
        [[0, 0, 0]], image, size=2, facing='cylindrical', anchor='bottom', colors=[[1.0, 0, 0]]
    )
    picture = grab(pl, see)
    floor = (picture[..., 0] == picture[..., 2]) & (bright > 0)
    dark = floor & (picture[..., 0] < 0.5 * bright)
    assert dark.sum() > 100
    # Two stripes with light between them.
    row = dark[np.argmax(dark.sum(1))]
    assert np.count_nonzero(np.diff(row.astype(int)) == 1) == 2
    billboards.remove()
    assert (grab(pl, see)[..., 0] >= 0.9 * bright).all()


def lamp(pl, toward=(0, 0, 1)):
    """Put a floor, a light from one direction, and shadows into a plotter."""
    pl.add_light(pv.Light(position=toward, light_type='scene light', positional=False))
    pl.add_mesh(pv.Plane(i_size=80, j_size=80), color='white')
    pl.ibr.add(pvibr.Shadows())


def shadow(picture, pixel):
    """Return area and middle of what is in shadow on a floor seen from above, world units."""
    rows, columns = np.nonzero((picture.max(2) < 60) & (picture.max(2) == picture.min(2)))
    if not len(rows):
        return 0.0, np.zeros(2)
    center = np.array([columns.mean() - SIZE[0] / 2, SIZE[1] / 2 - rows.mean()])
    return len(rows) * pixel**2, center * pixel


@pytest.mark.parametrize(
    ('looks', 'casts'),
    [
        ({'opacity': 0.8}, True),
        ({'opacity': 0.3}, False),
        ({'opacity': [0.9, 0.2]}, True),
        ({'cutout': 0.5, 'opacity': 0.7}, True),
        ({'cutout': 0.5, 'opacity': 0.4}, False),
    ],
)
def test_of_those_that_blend_what_is_half_opaque_throws_shadows(looks, casts, see):
    image = np.full((32, 32, 4), 255, np.uint8)
    image[:, :8, 3] = 100  # the left quarter is less than half opaque
    pl = plotter(lighting='none')
    lamp(pl)
    both = [[-4, 0, 3], [4, 0, 3]]
    points = both if np.ndim(looks['opacity']) else both[:1]
    looks = {'cutout': None, 'facing': 'world', **looks}
    colors = [[1.0, 0, 0]] * len(points)
    thing = pl.ibr.add_billboards(points, image, size=4, colors=colors, **looks)
    aim(pl, (0, 0, 1), (0, 0, 0), (0, 1, 0), parallel=10)  # below the cards: the floor alone
    area, center = shadow(grab(pl, see), 0.2)
    assert area == pytest.approx(12.0 * casts, abs=0.8)
    if casts:
        np.testing.assert_allclose(center, [-3.5, 0], atol=0.3)
    # What light sees is not what the eye sees: from above they blend as before.
    aim(pl, (0, 0, 6), (0, 0, 0), (0, 1, 0), parallel=10)
    picture = grab(pl, see)
    x, y = pixels(pl, [[-3.5, 0, 3]])[0].astype(int)
    assert picture[y, x, 0] > picture[y, x, 2]
    assert len(thing.drawn()) >= 1
    assert all(actor in thing._draws.actors for actor in thing.drawn())


@pytest.mark.parametrize('cutout', [0.5, None])
@pytest.mark.parametrize('parallel', [None, 16.0], ids=['perspective', 'parallel'])
def test_shadows_of_pixel_sizes_are_as_large_as_the_camera_sees_them(parallel, cutout, see):
    pl = plotter(lighting='none')
    lamp(pl, (1, 0, 1))
    thing = pl.ibr.add_billboards(
        [[0, 0, 8.0]],
        WHITE,
        size=[[14, 10]],
        size_unit='pixel',
        cutout=cutout,
        colors=[[1.0, 0, 0]],
    )
    for far in (60.0, 80.0, 60.0):
        scale = parallel and parallel * far / 60
        aim(pl, (0, 0, far), (0, 0, 0), (0, 1, 0), scale)
        at_floor, at_card = (
            2 * (scale or z * np.tan(np.pi / 12)) / SIZE[1] for z in (far, far - 8)
        )
        area, center = shadow(grab(pl, see), at_floor)
        assert area == pytest.approx(14 * 10 * at_card**2 * np.sqrt(2), rel=0.12)
        np.testing.assert_allclose(center, [-8, 0], atol=0.5)
        reach = np.hypot(7, 5) * at_card
        assert reach <= thing.cast_bounds[1] <= 2.1 * reach


def test_lit_ones_take_light(see):
    pl = plotter((0, -10, 0), lighting='none')
    light = pv.Light(position=(0, -1, 0), focal_point=(0, 0, 0), light_type='scene light')
    light.intensity = 0.5
    pl.add_light(light)
    pl.ibr.add_billboards([[-1, 0, 0]], WHITE, lighting=True)
    pl.ibr.add_billboards([[1, 0, 0]], WHITE)
    picture = grab(pl, see)
    lit, unlit = (picture[50, x, 0] for x in pixels(pl, [[-1, 0, 0], [1, 0, 0]])[:, 0].astype(int))
    assert unlit == 255
    assert abs(lit - 127) <= 2


def test_buffers_know_them(see):
    pl = plotter((0, -10, 0))
    ball = pl.add_mesh(pv.Sphere(center=(2, 0, 0)))
    thing = pl.ibr.add_billboards([[-2, 0, 0]], WHITE)
    ids = pl.ibr.buffer('id')
    x, y = pixels(pl, [[-2, 0, 0]])[0].astype(int)
    assert pl.ibr.buffer_objects[int(ids[y, x])] is thing
    np.testing.assert_allclose(pl.ibr.buffer('normal')[y, x], [0.2, 0, 0.98], atol=0.02)
    assert ball in pl.ibr.buffer_objects


def test_a_pick_sees_through_holes():
    pl = plotter((0, -10, 0))
    ring = np.full((33, 33, 4), 255, np.uint8)
    ring[11:22, 11:22, 3] = 0
    thing = pl.ibr.add_billboards([[0, 2, 0], [0, 0, 0]], [WHITE, ring], index=[0, 1], size=[9, 3])
    pl.show(auto_close=False)
    x, y = SIZE[0] // 2, SIZE[1] // 2
    behind, front = thing.pick(x, y), pl.ibr.pick(x + 20, y)
    assert (behind.index, front.index) == (0, 1)
    np.testing.assert_allclose(behind.point, [0, 2, 0], atol=0.1)
    np.testing.assert_allclose(front.distance + pl.camera.clipping_range[0], 10, atol=0.3)
    thing.visible = np.array([False, True])
    assert thing.pick(x, y) is None
    thing.pickable = False
    assert thing.pick(x + 20, y) is None


def test_bounds_hold_the_cards_and_the_camera_sees_them():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    thing = pl.ibr.add_billboards([[1, 2, 3], [5, 6, 7]], WHITE, size=2)
    half = np.sqrt(2)
    np.testing.assert_allclose(
        thing.bounds, [1 - half, 5 + half, 2 - half, 6 + half, 3 - half, 7 + half]
    )
    np.testing.assert_allclose(pl.camera.focal_point, thing.center)
    np.testing.assert_allclose(pl.bounds, thing.bounds)


def test_what_moves_is_drawn_where_it_is(see):
    pl = plotter((0, -10, 0))
    thing = pl.ibr.add_billboards([[-2, 0, 0]], WHITE)
    left = grab(pl, see)[..., 0]
    thing.points = [[2, 0, 0]]
    right = grab(pl, see)[..., 0]
    assert left[:, :80].max() == right[:, 80:].max() == 255
    assert left[:, 80:].max() == right[:, :80].max() == 0
    assert thing.center == (2.0, 0.0, 0.0)
    thing.size = [[0.5, 2.0]]
    high = grab(pl, see)[..., 0] > 128
    thing.rotation = np.pi / 2
    wide = grab(pl, see)[..., 0] > 128
    for picture, sides in ((high, (0.5, 2.0)), (wide, (2.0, 0.5))):
        shown = np.flatnonzero(picture.any(0)).size, np.flatnonzero(picture.any(1)).size
        scale = SIZE[1] / (2 * 10 * np.tan(np.radians(pl.camera.view_angle / 2)))
        assert np.allclose(shown, np.multiply(sides, scale), atol=1)
    for name in ('size', 'rotation'):
        with pytest.raises(ValueError, match=name):
            setattr(thing, name, np.nan)
    thing.rotation = 0
    thing.size = 1
    thing.visibility = False
    assert grab(pl, see).max() == 0
    thing.visibility = True
    thing.VisibilityOff()
    assert grab(pl, see).max() == 0


def test_many_are_one_draw_and_what_is_out_of_view_is_left_out(see):
    rng = np.random.default_rng(1)
    points = rng.uniform(-100, 100, (20_000, 3))
    pl = plotter((0, 0, 0), (1, 0, 0))
    thing = pl.ibr.add_billboards(points, WHITE, size=1)
    assert grab(pl, see).max() == 255
    assert len(thing.drawn()) == 1
    assert thing.report()['drawn'] < 10_000


def test_more_than_a_draw_holds(see):
    x, y = np.meshgrid(np.arange(400.0), np.arange(200.0))
    points = np.c_[x.ravel(), np.zeros(x.size), y.ravel()]
    pl = plotter((200, -2000, 100), (200, 0, 100))
    aim(pl, (200, -2000, 100), (200, 0, 100), parallel=120)
    thing = pl.ibr.add_billboards(points, WHITE, size=1)
    drawn = grab(pl, see)[..., 0] > 127
    rows, columns = np.flatnonzero(drawn.any(1)), np.flatnonzero(drawn.any(0))
    assert drawn[rows[1] : rows[-1], columns[1] : columns[-1]].all()
    assert len(thing.drawn()) == 2


@pytest.mark.parametrize('lenses', [False, True], ids=['plain', 'EDL'])
def test_any_number_of_sets_share_the_texture_units(lenses, see):
    # A shader has sixteen to some thirty textures; a set has five, and VTK's passes need some.
    pl = plotter((0, 0, 10), up=(0, 1, 0))
    pl.camera.parallel_projection, pl.camera.parallel_scale = True, 5
    places = np.c_[np.tile(np.linspace(-7, 7, 8), 2), np.repeat([-2, 2], 8), np.zeros(16)]
    color = np.random.default_rng(0).uniform(0.3, 1, (16, 3))
    for k, (place, one) in enumerate(zip(places, color, strict=True)):
        if k % 2:
            pl.ibr.add_billboards([place], WHITE, size=1.6, colors=[one])
        else:
            pl.ibr.add_spheres([place], 0.8, colors=[one], lighting=False)
    if lenses:
        pl.enable_eye_dome_lighting()
    picture = grab(pl, see)
    x, y = pixels(pl, places).astype(int).T
    got = picture[y, x]
    if lenses:  # darker, the colours the same
        got = got / got.max(1, keepdims=True) * (255 * color).max(1, keepdims=True)
    assert np.abs(got - 255 * color).max() <= (4 if lenses else 1)
    assert (picture[0] == 0).all()


def test_a_live_texture_is_an_image(see):
    pl = plotter((0, -10, 0))
    pl.add_mesh(pv.Sphere(center=(50, 0, 0)), color='red', lighting=False)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (50, -1, 0), (50, 0, 0), (0, 0, 1)
    live = pl.ibr.add(pvibr.LiveTexture(camera, size=(32, 32)))
    pl.ibr.add_billboards([[0, 0, 0]], live, size=3)
    grab(pl, see)
    assert grab(pl, see)[50, 80].tolist() == [255, 0, 0]


def test_a_texture_and_a_file_are_images(tmp_path, see):
    import imageio.v3 as iio

    iio.imwrite(tmp_path / 'a.png', quadrants())
    for image in (tmp_path / 'a.png', str(tmp_path / 'a.png'), pv.numpy_to_texture(quadrants())):
        pl = plotter((0, -10, 0))
        pl.ibr.add_billboards([[0, 0, 0]], image, size=2)
        assert grab(pl, see)[41, 71].tolist() == [255, 0, 0]
        pl.close()


GOOD = {'points': [[0, 0, 0]], 'image': WHITE}


@pytest.mark.parametrize(
    ('wrong', 'words'),
    [
        ({'points': [[0, 0, np.nan]]}, 'finite'),
        ({'points': np.eye(4)}, 'points'),
        ({'image': np.zeros((0, 3))}, r'must have shape .* got \(0, 3\)'),
        ({'image': np.zeros((4, 4), complex)}, 'dtype'),
        ({'size': -1}, 'size'),
        ({'size': np.nan}, 'size'),
        ({'size': [1, 2, 3]}, 'size'),
        ({'size': [[1, np.nan]]}, 'size'),
        ({'size': [[-1, 1]]}, 'size'),
        ({'size': np.inf, 'size_unit': 'pixel'}, 'size'),
        ({'image': np.zeros((1, 20_000))}, 'got 20000 x 4'),
        ({'image': np.zeros((4, 4, 4, 0))}, 'image'),
        ({'image': pv.Texture()}, 'image must have shape'),
        ({'image': np.full((4, 4), np.nan)}, 'image must have floats'),
        ({'facing': 'spherical', 'axis': (0, np.nan, 1)}, 'axis'),
        ({'facing': 'cylindrical', 'axis': [[0, 0, 0]]}, 'axis'),
        ({'facing': 'world', 'orientation': (0, 0, 0, 0)}, 'orientation'),
        ({'facing': 'cylinder'}, 'facing'),
        ({'towards': 'eye'}, 'towards'),
        ({'facing': 'cylindrical', 'axis': (0, 0, 0)}, 'axis'),
        ({'facing': 'screen', 'axis': (0, 0, 1)}, 'axis'),
        ({'orientation': (1, 0, 0, 0)}, 'orientation'),
        ({'rotation': np.inf}, 'rotation'),
        ({'index': 1}, 'index'),
        ({'index': [0.5]}, 'index'),
        ({'cutout': 0}, 'cutout'),
        ({'cutout': np.nan}, 'cutout'),
        ({'opacity': 1.5}, 'opacity'),
        ({'opacity': [0.5]}, 'opacity'),
        ({'size_unit': 'inch'}, 'size_unit'),
        ({'anchor': 'left'}, 'anchor'),
        ({'frames': (3, 1)}, 'frames'),
        ({'frames': [[1, 2], [3]]}, 'frames'),
        ({'views': 2}, 'views'),
        ({'views': 0}, 'views'),
        ({'views': 2, 'facing': 'cylindrical'}, 'divide'),
        ({'yaw': np.nan}, 'yaw'),
        ({'colors': [[1.0, 2.0, 0.0]]}, 'colors'),
        ({'scalars': [1.0, 2.0]}, 'scalars'),
    ],
)
def test_bad_values_are_refused_and_add_nothing(wrong, words):
    pl = plotter()
    with pytest.raises(ValueError, match=words):
        pl.ibr.add_billboards(**GOOD | wrong)
    assert not pl.ibr.effects
    assert not list(pl.renderer.GetViewProps())


@pytest.mark.parametrize(
    'wrong',
    [
        {'points': 'here'},
        {'points': [[0, 0], [0, 0, 0]]},
        {'size': 'large'},
        {'rotation': 'x'},
        {'blend_views': None},
        {'facing': 'cylindrical', 'axis': 'z'},
        {'image': None},
        {'image': pv.ImageData()},
        {'shininess': 3},
    ],
)
def test_other_types_are_refused_and_add_nothing(wrong):
    pl = plotter()
    with pytest.raises(TypeError, match=list(wrong)[-1]):
        pl.ibr.add_billboards(**GOOD | wrong)
    assert not pl.ibr.effects


@pytest.mark.parametrize('content', [b'', b'no picture', None], ids=['empty', 'text', 'half'])
def test_a_file_that_is_no_picture_is_named_and_adds_nothing(content, tmp_path):
    import imageio.v3 as iio

    file = tmp_path / 'broken.png'
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 4), np.uint8)
    iio.imwrite(file, noise)
    file.write_bytes(file.read_bytes()[:3000] if content is None else content)
    pl = plotter()
    with pytest.raises(ValueError, match=r'broken\.png'):
        pl.ibr.add_billboards([[0, 0, 0]], file)
    assert not pl.ibr.effects
    assert not list(pl.renderer.GetViewProps())


def test_images_larger_than_the_driver_takes_lose_their_largest_levels(see, monkeypatch):
    monkeypatch.setattr('pvibr.textures.sheet.texture_limit', lambda _: 64)
    image = np.full((256, 256, 4), (255, 0, 0, 255), np.uint8)
    image[:, 128:, :3] = (0, 0, 255)
    pl = plotter((0, -10, 0))
    thing = pl.ibr.add_billboards([[0, 0, 0]], image, size=3)
    picture = grab(pl, see)
    left, right = pixels(pl, [[-0.7, 0, 0], [0.7, 0, 0]])[:, 0].astype(int)
    assert picture[50, left].tolist() == [255, 0, 0]
    assert picture[50, right].tolist() == [0, 0, 255]
    assert thing.report()['texture'] == '64 x 64'


def test_images_that_do_not_fit_at_all_are_blurred_with_a_warning(see, monkeypatch):
    images = [np.full((5, 7, 4), (0, 200 + k, 0, 255), np.uint8) for k in range(30)]
    pictures = []
    for limit in (16_384, 8):
        monkeypatch.setattr('pvibr.textures.sheet.texture_limit', lambda _, limit=limit: limit)
        pl = plotter((0, -10, 0))
        pl.add_mesh(pv.Sphere(radius=0.5), color='red', lighting=False)
        pl.ibr.add_billboards(np.zeros((30, 3)) - [0, 2, 0], images, size=2)
        if limit == 8:
            with pytest.warns(pvibr.PvibrWarning, match='blurred: .* 8 x 8 texels'):
                pictures.append(grab(pl, see))
        else:
            pictures.append(grab(pl, see))
    exact, drawn = (p.astype(int) for p in pictures)
    covered = exact[..., 1] > 150
    assert covered.mean() > 0.02
    assert (np.abs(exact - drawn)[covered].max(-1) <= 60).mean() > 0.95


def test_none_and_no_size_draw_nothing(see):
    pl = plotter()
    none = pl.ibr.add_billboards(np.zeros((0, 3)), WHITE)
    pl.ibr.add_billboards([[0, 0, 0]], WHITE, size=0)
    assert grab(pl, see).max() == 0
    assert none.pick(10, 10) is None
    assert none.bounds == (1, -1, 1, -1, 1, -1)


def test_pictures_without_alpha_and_of_16_bits_are_fine(see):
    pl = plotter((0, -10, 0))
    pl.ibr.add_billboards([[0, 0, 0]], np.full((4, 4, 3), 65535 // 2, np.uint16), size=2)
    assert grab(pl, see)[50, 80].tolist() == [127] * 3


def test_everything_is_given_back():
    pl = plotter()
    thing = pl.ibr.add_billboards([[0, 0, 0]], WHITE)
    pl.show(auto_close=False)
    assert thing.report()['bytes'] > 0
    pl.close()
    assert thing.report()['bytes'] == 0


@pytest.mark.parametrize('cutout', [None, 0.5])
@pytest.mark.parametrize('away', [4, 15, 60])
def test_thin_images_show_nothing_of_their_neighbours(away, cutout, see):
    """A strip of 90 x 3, between others of other colours, at any distance."""
    shapes = (3, 90), (90, 3), (2, 70), (5, 5)
    images = []
    for k in range(12):
        image = np.zeros((*shapes[k % 4], 4), np.uint8)
        image[..., k % 3], image[..., 3] = 255, 255
        images.append(image)
    rng, pl = np.random.default_rng(away), plotter()
    for k in rng.permutation(12):
        cards = pl.ibr.add_billboards(
            np.zeros((1, 3)), images, index=k, size=[[2.0, 2.0]], lighting=False, cutout=cutout
        )
        pl.set_background('black')
        pl.camera.position, pl.camera.focal_point, pl.camera.up = (
            (0, -away, 0),
            (0, 0, 0),
            (0, 0, 1),
        )
        pl.camera.clipping_range = 0.1, 100
        picture = see.grab(pl)
        lit = picture[picture.max(2) > 0.2]
        assert len(lit), 'nothing is seen'
        others = np.delete(lit, k % 3, axis=1)
        assert (others / lit[:, k % 3, None]).max() < 0.01
        cards.remove()


@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('parallel', [None, 2.5])
@pytest.mark.parametrize('kind', ['billboards', 'spheres'])
def test_two_blended_sets_that_mix(kind, parallel, seed, see):
    """Two sets, and two more far apart, look as one with the items of all."""
    rng = np.random.default_rng(seed)
    points, colors = rng.uniform(-2, 2, (400, 3)), rng.uniform(size=(400, 3))
    points[2::4] += 0, 1, 0
    disc = np.full((8, 8, 4), 255, np.uint8)
    pictures = []
    for count in (1, 4):
        pl = plotter()
        for k in range(count):
            look = {'colors': colors[k::count], 'opacity': 0.6, 'lighting': False}
            if kind == 'spheres':
                pl.ibr.add_spheres(points[k::count], 0.15, **look)
            else:
                pl.ibr.add_billboards(points[k::count], disc, size=0.3, cutout=None, **look)
        aim(pl, (1, -9, 2), parallel=parallel)
        pictures.append(see.grab(pl))
        pl.close()
    truth, picture = pictures
    off = np.abs(picture - truth).max(2) > 0.02
    assert (np.ptp(truth, axis=2) > 0.1).mean() > 0.1
    assert off.mean() < 0.005


@pytest.mark.parametrize('cutout', [None, 0.5])
@pytest.mark.parametrize('seed', [62, 63])
def test_no_background_shows_through_where_soft_edges_overlap(cutout, seed, see):
    """Three sets of soft discs cover no less than the one of them that covers most."""
    rng = np.random.default_rng(seed)
    away = np.linalg.norm(np.indices((64, 64)) - 31.5, axis=0) / 32
    disc = np.full((64, 64, 4), 255, np.uint8)
    disc[..., 3] = np.clip((1 - away) / 0.3, 0, 1) * 255
    sets = rng.uniform(-3, 3, (3, 40, 3))

    def covered(shown):
        pl = plotter((0, -14, 2))
        for points in shown:
            pl.ibr.add_billboards(points, disc, size=2.0, cutout=cutout, lighting=False)
        pl.renderer.ResetCameraClippingRange(*(-5, 5) * 3)
        found = see.rgba(pl)[..., 3]
        pl.close()
        return found

    most = np.max([covered([points]) for points in sets], axis=0)
    assert (most > 0.99).mean() > 0.2
    assert (most - covered(sets)).max() < 8 / 255
