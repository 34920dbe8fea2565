"""What is drawn in which order: nothing shows through, and the first frame is the last."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import minimum_filter

import pvibr
from pvibr.core._vtk import address
from tests.instances.scenes import matrices

SIZE = (160, 120)
BALL = pv.Sphere(theta_resolution=40, phi_resolution=41)
EYE = {'eye': (0, -30, 16), 'focus': (0, 0, 0), 'up': (0, 0, 1)}


def spread(count, seed, low=0.7, high=2.5):
    """Return poses of overlapping things of many sizes."""
    rng = np.random.default_rng(seed)
    out = matrices(rng.uniform(-12, 12, (count, 3)) * [1, 1, 0.4])
    out[:, :3, :3] *= np.exp(rng.uniform(np.log(low), np.log(high), count))[:, None, None]
    return out


def clear(dark, light):
    """Return how much of the background each pixel shows, of frames on black and on white."""
    return np.abs(light - dark).max(-1)


@pytest.fixture(scope='module')
def sets():
    return [spread(150, 1), spread(150, 2), spread(60, 3, 0.1, 5)]


@pytest.fixture(scope='module')
def inside(scenes, see, sets):
    """Pixels that meshes cover with all their neighbours."""
    pl = scenes.actors(BALL, np.concatenate(sets), size=SIZE, camera=EYE)
    covered = see.rgba(pl)[..., 3] > 0.5
    pl.close()
    return minimum_filter(covered, 3)


def add(pl, scenes, poses, color, **kwargs):
    """Add balls that are of one bake whatever their colour is."""
    colors = np.tile(pv.Color(color).float_rgb, (len(poses), 1))
    kwargs |= {'cache': scenes.folder, 'colors': colors, 'blend': 'multiply', 'bake': True}
    return pl.ibr.add_instances(BALL, poses, color='white', **kwargs)


def shown(scenes, sets, level, **kwargs):
    pl = scenes.empty(SIZE)
    for color, poses in zip(('tomato', 'royalblue', 'gold'), sets, strict=True):
        add(pl, scenes, poses, color, force_level=level, **kwargs)
    pl.camera.position, pl.camera.focal_point, pl.camera.up = EYE.values()
    return pl


@pytest.mark.sampled
@pytest.mark.parametrize('level', [None, 'flat', 'blended', {'flat': (0, 30), 'mesh': (30, 1e9)}])
def test_no_background_shows_through_sets(scenes, see, sets, inside, level):
    pl = shown(scenes, sets, level)
    through = see.rgba(pl)[..., 3][inside] < 1 - 60 / 255
    assert inside.sum() > 3000
    assert through.sum() <= 3  # where the outlines of two things meet in a pixel
    pl.close()


RING = pv.ParametricTorus(ringradius=1.0, crosssectionradius=0.15)


@pytest.mark.parametrize('level', ['flat', 'parallax', 'blended', 'fine'])
def test_only_cards_without_a_core_are_left_out_of_its_draws(scenes, level):
    pl = scenes.empty(SIZE)
    poses = spread(150, 4, 0.1, 1.0)
    things = pl.ibr.add_instances(RING, poses, cache=scenes.folder, bake=True, force_level=level)
    pl.camera.position, pl.camera.focal_point, pl.camera.up = EYE.values()
    pl.show(auto_close=False)
    found = bits(pl)
    layer = things.groups[0].cards.layers[level]
    assert layer.core is not None
    layer.core_size = 0.0  # as if each had one
    things.revision += 1
    np.testing.assert_array_equal(found, bits(pl))
    pl.close()


def bits(pl):
    pl.render()
    return pl.screenshot(return_img=True)


def assert_settled(pl, first):
    """The frame that was drawn first is drawn again, to the bit."""
    for _ in range(2):
        np.testing.assert_array_equal(first, bits(pl))


@pytest.mark.parametrize('count', [1, 3])
def test_the_first_frame_is_the_last(scenes, sets, count):
    pl = scenes.empty(SIZE)
    made = [add(pl, scenes, poses, 'gold') for poses in sets[:count]]
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -14, 8), (0, 0, 0), (0, 0, 1)
    pl.reset_camera_clipping_range()
    pl.show(auto_close=False)
    assert_settled(pl, pl.screenshot(return_img=True))
    made.append(add(pl, scenes, sets[1][:60], 'red'))
    assert_settled(pl, bits(pl))
    made[0].poses = sets[2]
    assert_settled(pl, bits(pl))
    pl.window_size = (200, 90)
    assert_settled(pl, bits(pl))
    pl.close()


def test_a_view_is_the_same_picture_whatever_was_drawn_before(scenes, sets):
    pl = shown(scenes, sets, None)
    pl.reset_camera_clipping_range()
    pl.show(auto_close=False)
    first = bits(pl)
    for factor in (4.0, 0.3, 1.7):
        pl.camera.zoom(factor)
        pl.render()
        pl.camera.zoom(1 / factor)
    pl.camera.view_angle = 30.0
    np.testing.assert_array_equal(first, bits(pl))
    pl.close()


STEREO = ('Left', 'Right', 'Anaglyph', 'SplitViewportHorizontal', 'CrystalEyes')


@pytest.mark.sampled
@pytest.mark.parametrize('kind', STEREO)
def test_the_first_frame_of_each_eye_is_the_last(scenes, sets, kind):
    pl = scenes.empty(SIZE)
    made = [
        add(pl, scenes, poses, color)
        for poses, color in zip(sets, ('gold', 'red', 'w'), strict=True)
    ]
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -14, 8), (0, 0, 0), (0, 0, 1)
    pl.camera.SetEyeAngle(6.0)
    pl.reset_camera_clipping_range()
    pl.render_window.StereoCapableWindowOn()
    getattr(pl.render_window, f'SetStereoTypeTo{kind}')()
    pl.render_window.StereoRenderOn()
    pl.show(auto_close=False)
    assert_settled(pl, pl.screenshot(return_img=True))
    made[0].poses = sets[2]
    assert_settled(pl, bits(pl))
    pl.camera.azimuth += 40.0
    assert_settled(pl, bits(pl))
    pl.close()


def test_screenshots_and_deterministic_frames_do_not_depend_on_what_was_before(scenes, sets):
    rng = np.random.default_rng(61)

    def picture(before):
        pl = shown(scenes, sets, None)
        pl.show(auto_close=False)
        eyes = rng.normal(size=(before, 3)) * 20 + [0, -12, 0]
        for eye in (*eyes, (0, -13, 7)):
            pl.camera.position, pl.camera.up = eye, (0, 0, 1)
            pl.renderer.ResetCameraClippingRange(*(-20, 20) * 3)
            pl.render()
        found = pl.screenshot(return_img=True)
        with pvibr.deterministic():
            again = bits(pl)
        pl.close()
        return found, again

    first, second = picture(0)
    np.testing.assert_array_equal(first, second)
    for found in picture(5):
        np.testing.assert_array_equal(first, found)


@pytest.mark.sampled
@pytest.mark.parametrize('edges', [False, True], ids=['many a draw', 'an actor each'])
@pytest.mark.parametrize('seed', [3, 4])
def test_meshes_of_equal_depth_do_not_depend_on_which_was_needed_first(scenes, see, edges, seed):
    places = np.random.default_rng(seed).normal(size=(3, 3)) * 30
    places[1] = places[0] + [8, 0, 0]  # where one of the last set is seen, which is long
    sets = [matrices(places[k]) for k in ([0], [2, 0], [0, 0])]
    sets[2][1, 0, 0] = 20.0
    colors = [['red'], ['gold', 'magenta'], ['lime', 'blue']]

    def picture(before):
        pl = scenes.empty((60, 40))
        for poses, own in zip(sets, colors, strict=True):
            rgb = [pv.Color(color).int_rgb for color in own]
            looks = {'colors': np.array(rgb, np.uint8), 'lighting': False, 'show_edges': edges}
            pl.ibr.add_instances(pv.Cube(), poses, force_level='mesh', bake=False, **looks)
        for place in places[[*before, 0]]:
            see.place(pl, eye=np.add(place, [1, -4, 2]), focus=place, up=(0, 0, 1))
            found = see.rgba(pl)
        pl.close()
        return found

    first = picture([])
    assert first[20, 30, 0] == 0  # neither red nor magenta: what was added last
    assert first[20, 30, 1:3].max() == 1
    for before in ([2], [1, 2], [0, 2], [2, 0, 1]):
        np.testing.assert_array_equal(first, picture(before))


def test_props_of_others_keep_their_order(scenes, sets):
    pl = shown(scenes, sets[:2] + sets[2:], 'flat')
    mine = [pl.add_mesh(pv.Cube(center=(k, 0, 0)), opacity=0.5) for k in range(3)]
    pl.add_text('above')
    pl.show(auto_close=False)
    mine.append(pl.add_mesh(pv.Cube()))
    pl.render()
    time = pl.renderer.GetViewProps().GetMTime()
    props = [address(prop) for prop in pl.renderer.GetViewProps()]
    places = [props.index(address(actor)) for actor in mine]
    assert places == sorted(places)
    cards = [props.index(address(a)) for t in pl.ibr.pipeline.things for _, a in t.order]
    assert max(places) < min(cards)
    pl.render()
    assert pl.renderer.GetViewProps().GetMTime() == time
    pl.close()


def test_effects_that_read_depth_find_soft_edges(scenes, see):
    pl, _ = scenes.instances(BALL, [[0, 0, 0]], level='flat', bake=True, camera=EYE, size=SIZE)
    pl.camera.zoom(6)
    covered = see.rgba(pl)[..., 3]
    depth = pl.ibr.buffer('depth')  # as the effects have it
    found = np.isfinite(depth)
    assert found[covered > 0.55].all()
    assert not found[covered < 0.45].any()
    pl.close()
