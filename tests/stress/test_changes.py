"""Changes of a whole scene that leave its picture: every thing and effect, from one table.

The limit that numbers allow: places and cameras are float64, vertices float32 about an origin of
their own. The scene is about 8 wide and seen on 120 pixels, of 0.07 each. At 1e12 from the origin
float64 places it to 1.2e-4, a 500th of a pixel, and lengths in shaders are those of the scene, of
which float32 keeps 6e-8. A scale multiplies all lengths; their squares stay in float32 from 1e-19
to 1e19. So all but edges between two pixels must be the same for all that is tried here.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pvibr.api.plotter_component import IBRComponent
from tests.browser import everything
from tests.browser.everything import EVERYTHING, THINGS
from tests.pictures import off, plotter, shot
from tests.stress.scenes import HOME, PLACED, SIZE, Place, fill, picture

TURN = Rotation.from_rotvec([0.3, 1.2, -0.8]).as_matrix()
#: Where the scene lies.
PLACES = {
    'turned': Place(turn=TURN),
    **{f'scaled by {s:g}': Place(s) for s in (1e-9, 1e-4, 1e4, 1e9)},
    **{f'moved by {d:g}': Place(1.0, (d, -d, d / 2)) for d in (1e3, 1e6, 1e9, 1e12)},
    'UTM': Place(30.0, (5e5, 5e6, 300.0), TURN),
}
#: The share of pixels that may be off by more than 15 of 255, and by how much all in the mean.
SHARE, MEAN = 0.005, 0.5


@pytest.fixture(autouse=True, scope='module')
def _light():
    with everything.lighter():
        yield


@cache
def unchanged(name, **how):
    """Return the picture of a scene about the origin."""
    found, idle = picture(name, **how)
    assert not idle
    return found


def check(name, expected, found, share=SHARE):
    differ = off(expected, found)
    assert (differ > 15).mean() <= share, name
    assert differ.mean() <= MEAN, name


every = pytest.mark.parametrize('name', EVERYTHING)


def test_every_way_to_add_is_in_the_table():
    """By the classes that are made: `everything` has all effects, and a thing of each method."""
    made = {'add_animated': 'AnimatedActor', 'add_photos': 'PhotoMesh'}
    ways = {name for name in dir(IBRComponent) if name.startswith('add_')}
    kinds = {made.get(way, ''.join(map(str.title, way.split('_')[1:]))) for way in ways}
    assert kinds <= {*THINGS}
    assert {*THINGS} - {'Instances'} <= {*PLACED} <= {*EVERYTHING}


@every
def test_all_at_once(name):
    """Turned, scaled and moved, and what is beside it added in another order."""
    found, idle = picture(name, PLACES['UTM'], backwards=True)
    assert not idle
    check(name, unchanged(name), found)


@pytest.mark.stress
@every
@pytest.mark.parametrize('place', [name for name in PLACES if name != 'UTM'])
def test_each_place(name, place):
    found, idle = picture(name, PLACES[place])
    assert not idle
    check(name, unchanged(name), found)


@pytest.mark.slow
@every
@pytest.mark.parametrize('how', [{'parallel': True}, {'samples': 4}, {'samples': 8}], ids=str)
def test_turned_and_moved_for_each_kind_of_view(name, how):
    found, idle = picture(name, Place(1e-3, (70.0, -20.0, 10.0), TURN), **how)
    assert not idle
    check(name, unchanged(name, **how), found)


@pytest.mark.slow
@every
def test_a_subplot_is_as_a_window(name):
    pl = plotter((2 * SIZE[0], SIZE[1]), shape=(1, 2), border=False, lighting='light kit')
    for column in range(2):
        pl.subplot(0, column)
        fill(pl, name, HOME)
    pl.show(auto_close=False)
    shot(pl)
    found = shot(pl)
    for half in np.split(found, 2, axis=1):
        check(name, unchanged(name), half, share=0.01)


#: Across a plane that is none of the axes'; and what is fixed on the screen, or to a photograph.
MIRROR = np.eye(3) - 2 * np.outer(*[np.array([0.6, -0.8, 0.0])] * 2)
ON_SCREEN = {'ImageOverlay', 'NightVision', 'Projector', 'Projector, two images', 'LiveTexture'}
ON_SCREEN |= {'Mirror', 'PhotoMesh'}


@pytest.mark.sampled
@pytest.mark.parametrize('name', [name for name in EVERYTHING if name not in ON_SCREEN])
def test_mirrored_scene_is_its_picture_mirrored(name):
    found, idle = picture(name, Place(turn=MIRROR), lighting='none')
    assert not idle
    check(name, unchanged(name, lighting='none'), found[:, ::-1])


@pytest.mark.sampled
@every
@pytest.mark.parametrize('near', [1.0, 1e-3])
def test_near_to_far(name, near):
    """As a millionth is near, or all is near to what is far: near to far as 1 to 1e7."""
    if (name, near) == ('Ground', 1e-3):
        pytest.skip('depths of 24 bits do not tell it from the floor just above it')
    depths = near, near * 1e7
    found, idle = picture(name, depths=depths)
    assert not idle
    check(name, unchanged(name), found, share=SHARE if near == 1 else 0.05)


@pytest.mark.stress
@every
@pytest.mark.parametrize('samples', [0, 4, 8])
def test_windows_of_any_size(name, samples):
    pl = plotter(SIZE, lighting='light kit')
    pl.render_window.SetMultiSamples(samples)
    fill(pl, name, HOME)
    pl.show(auto_close=False)
    shot(pl)
    before = shot(pl)
    for size in ((1, 1), (40, 2000), (16384, 64), SIZE):
        pl.window_size = size
        assert shot(pl).shape[1::-1] == size
        assert {row.state for row in pl.ibr.report().rows} == {'ran'}, pl.ibr.report()
    # What was drawn as meshes may be shown in an image now, whose outlines are off.
    check(name, before, shot(pl), share=0.01)


@pytest.mark.stress
def test_ten_million_points():
    points = np.random.default_rng(0).normal(size=(10_000_000, 3))
    pl = plotter(SIZE)
    pl.ibr.add_spheres(points, 1e-3, color='white')
    pl.show(auto_close=False)
    middle = shot(pl)[SIZE[1] // 2 - 5 :, SIZE[0] // 2 - 5 :][:10, :10]
    assert middle.mean() > 20
