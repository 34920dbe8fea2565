"""What every thing in a scene keeps to, whatever it draws."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.errors import ClosedError
from pvibr.effects import ORDER
from tests.figures.makers import bending, worm
from tests.makers import turn_of
from tests.pictures import off, place, plotter, shot, shown
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (120, 90)
PLACES = np.array([(-2.0, 0.0, 0.0), (0.0, 0.8, 0.2), (2.0, -0.5, -0.2)])
EYE = np.array((3.0, -11.0, 4.0))
BALL = pv.Sphere(radius=0.8, theta_resolution=60, phi_resolution=60)
TORUS = pv.ParametricTorus(ringradius=0.6, crosssectionradius=0.25, u_res=60, v_res=30)
LOOK = {'color': 'tomato', 'smooth_shading': True}
FIGURE = worm(clips=[bending()])
ENDS = PLACES + np.array((0.5, 0.3, 0.9))
AXES = np.array([(0.8, 0.4, 0.6), (0.5, 0.9, 0.3), (0.4, 0.4, 0.9)])


def meshes(pl, *found, **look):
    return [pl.add_mesh(mesh, **LOOK | look) for mesh in found]


def balls(pl):
    return meshes(pl, *(BALL.translate(at) for at in PLACES))


def shown_by_meshes(pl):
    return meshes(pl, BALL.translate(PLACES[0]), TORUS.translate(PLACES[1]))


def rods(pl):
    for a, b in zip(PLACES, ENDS, strict=True):
        size = {'radius': 0.3, 'height': np.linalg.norm(b - a), 'resolution': 90}
        rod = pv.Cylinder(center=(a + b) / 2, direction=b - a, **size)
        meshes(pl, rod.compute_normals(split_vertices=True))


def eggs(pl):
    egg = pv.Sphere(radius=1.0, theta_resolution=60, phi_resolution=60)
    found = (egg.scale(axes).translate(at) for axes, at in zip(AXES, PLACES, strict=True))
    return meshes(pl, *(egg.compute_normals() for egg in found))


COARSE = pv.Sphere(radius=0.8, theta_resolution=24, phi_resolution=24)


def coarse_ones():
    """Coarse balls as one mesh."""
    return pv.merge([COARSE.translate(at) for at in PLACES])


def under_photos(pl):
    """Balls in magenta under photographs in tomato from all around."""
    K, cameras = [[60, 0, 31.5], [0, 60, 31.5], [0, 0, 1]], []
    for eye in np.array(pv.Sphere(radius=9, theta_resolution=7, phi_resolution=5).points, float):
        R = turn_of(-eye, (0.1, 0.2, 1.0))
        cameras.append(pvibr.Pinhole(K, R, -R @ eye, (64, 64)))
    photos = [pvibr.Photo(f'{k}', camera, tomato()) for k, camera in enumerate(cameras)]
    return pl.ibr.add_photos(coarse_ones(), photos, color='magenta', lit=True, name='it')


@cache
def tomato():
    """Return the path of a picture that is all tomato."""
    path = Path(mkdtemp(), 'tomato.png')
    Image.new('RGB', (64, 64), 'tomato').save(path)
    return path


def signs(pl):
    for at in PLACES:
        right = np.cross((0, 0, 1), EYE - at)
        up = np.cross(EYE - at, right)
        sides = [0.6 * side / np.linalg.norm(side) for side in (right, up)]
        corners = [at + np.dot(k, sides) for k in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        square = pv.PolyData(np.array(corners), faces=[4, 0, 1, 2, 3])
        meshes(pl, square, color='white', lighting=False, smooth_shading=False)


#: The share of pixels that may look otherwise than with meshes, and by how much all in the mean.
BOUND = (0.02, 1.0)
#: Soft edges write depth: what darkens along edges of depth darkens beside them.
SOFT_EDGES = {'ssao': (0.08, 2.5), 'edl': (0.1, 6.0)}
#: Images of actors are off by their outlines.
IMAGES = dict.fromkeys(('nothing', 'ssaa', 'msaa', 'ssao', 'edl', 'peeling'), (0.01, 0.6))


class Case(NamedTuple):
    """How a thing is added, and the meshes that show the same."""

    add: Callable
    plain: Callable
    bounds: dict = {}  # by mode, else BOUND
    replaces: dict = {}  # what is reported of the meshes that it is given and shows in images


EVERY = {
    'Instances': Case(
        lambda pl: pl.ibr.add_instances(BALL, PLACES, name='it', bake=True, **LOOK),
        balls,
        SOFT_EDGES,
    ),
    'Crowd': Case(
        lambda pl: pl.ibr.add_animated(FIGURE, PLACES, name='it', **LOOK),
        lambda pl: meshes(pl, *(FIGURE.mesh(0.0, 'bend').translate(at) for at in PLACES)),
    ),
    'AnimatedActor': Case(
        lambda pl: pl.ibr.add_animated(FIGURE, name='it', **LOOK),
        lambda pl: meshes(pl, FIGURE.mesh()),
    ),
    'Billboards': Case(
        lambda pl: pl.ibr.add_billboards(
            PLACES, np.full((8, 8, 3), 255, np.uint8), size=1.2, name='it'
        ),
        signs,
    ),
    'Spheres': Case(lambda pl: pl.ibr.add_spheres(PLACES, 0.8, color='tomato', name='it'), balls),
    'Cylinders': Case(
        lambda pl: pl.ibr.add_cylinders(PLACES, ENDS, 0.3, color='tomato', name='it'), rods
    ),
    'Ellipsoids': Case(
        lambda pl: pl.ibr.add_ellipsoids(PLACES, AXES, color='tomato', name='it'), eggs
    ),
    'Impostor': Case(
        lambda pl: pl.ibr.add_impostor(shown_by_meshes(pl), only_if_faster=False),
        shown_by_meshes,
        IMAGES,
        {'shown': 2, 'meshes': {}},
    ),
    'LargeMesh': Case(
        lambda pl: pl.ibr.add_large_mesh(
            pv.merge([BALL.translate(at) for at in PLACES]), max_error=0.5, name='it', **LOOK
        ),
        lambda pl: meshes(pl, pv.merge([BALL.translate(at) for at in PLACES])),
    ),
    'PhotoMesh': Case(
        under_photos,
        lambda pl: meshes(
            pl, pv.merge([COARSE.translate(p) for p in PLACES]), smooth_shading=False
        ),
    ),
    'ImageLayers': Case(
        lambda pl: pl.ibr.add_image_layers([shown_by_meshes(pl)], only_if_faster=False),
        shown_by_meshes,
        IMAGES,
        {'taken': 1},
    ),
}
MODES = {
    'nothing': lambda pl: None,
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'msaa': lambda pl: pl.enable_anti_aliasing('msaa', multi_samples=4),
    'ssao': lambda pl: pl.enable_ssao(radius=0.5, kernel_size=32),
    'edl': lambda pl: pl.enable_eye_dome_lighting(),
    'peeling': lambda pl: pl.enable_depth_peeling(8),
}


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)
    monkeypatch.setattr('pvibr.figures.pose_atlas.TILES', (32,))


def stage(pl):
    """Something to stand on, and to look through."""
    pl.set_background((0.1, 0.2, 0.3))
    pl.add_mesh(pv.Plane(center=(0, 0, -2.2), i_size=14, j_size=14), color='white')
    pl.add_mesh(pv.Sphere(radius=0.7, center=(1, -3, 0)), color='blue', opacity=0.4)
    return place(pl, EYE)


def drawn(name, mode='nothing', *, plain=False):
    """Return a plotter with a thing, with meshes or with neither, and what was added."""
    pl, thing = stage(plotter(SIZE)), None
    MODES[mode](pl)
    if name is not None:
        thing = (EVERY[name].plain if plain else EVERY[name].add)(pl)
    place(pl, EYE)
    pl.show(auto_close=False)
    shot(pl)
    return pl, thing


@cache
def without(mode='nothing'):
    """Return the picture of the stage alone."""
    return shot(drawn(None, mode)[0])


def test_every_thing_is_here():
    found = {name: getattr(pvibr, name) for name in set(pvibr.__all__) - {*ORDER}}
    kinds = {n for n, k in found.items() if isinstance(k, type) and issubclass(k, Effect)}
    assert kinds - {'Effect', 'LiveTexture', 'Mirror'} == set(EVERY)


every = pytest.mark.parametrize('name', EVERY)


@every
@pytest.mark.parametrize('mode', MODES)
def test_other_passes_see_it_as_meshes(name, mode):
    """And nothing of the frame before stays, and nothing is left of it when it is removed."""
    share, mean = EVERY[name].bounds.get(mode, BOUND)
    pl, thing = drawn(name, mode)
    picture, report = shot(pl), pl.ibr.report()
    assert report.rows, report
    assert {row.state for row in report.rows} == {'ran'}, report
    assert EVERY[name].replaces.items() <= thing.report().items(), thing.report()
    np.testing.assert_array_equal(shot(pl), picture)
    pl.ibr.remove(thing)
    after = shot(pl)
    other, _ = drawn(name, mode, plain=True)
    truth = shot(other)
    empty = truth if EVERY[name].replaces else without(mode)
    assert off(after, empty).max() <= 1
    shown = off(truth, empty) > 15
    assert EVERY[name].replaces or shown.mean() > 0.03, 'the reference shows nothing'
    assert (off(picture, truth) > 15).mean() < share
    assert np.abs(picture - truth).mean() < mean


@every
def test_removed_in_every_way_and_added_again(name):
    pl, thing = drawn(name)
    on, rows = shot(pl), len(pl.ibr.report().rows)
    empty = drawn(name, plain=True) if EVERY[name].replaces else drawn(None)
    props, empty = empty[0].renderer.GetViewProps().GetNumberOfItems(), shot(empty[0])
    ways = [thing.remove, lambda: pl.ibr.remove(thing), pl.ibr.clear]
    if not EVERY[name].replaces:
        ways.append(lambda: pl.remove_actor('it', render=False))
    for way in ways:
        way()
        assert pl.ibr.effects == ()
        assert thing.pipeline is None
        assert off(shot(pl), empty).max() <= 1
        assert pl.renderer.GetViewProps().GetNumberOfItems() == props
        assert thing.report()['bytes'] == 0
        pl.ibr.add(thing)
        assert (off(shot(pl), on) <= 1).all()
        assert len(pl.ibr.report().rows) == rows
    pl.clear()
    assert pl.ibr.effects == ()
    shot(pl)
    assert pl.renderer.GetViewProps().GetNumberOfItems() == 0


@pytest.mark.parametrize('name', [name for name in EVERY if not EVERY[name].replaces])
def test_hidden_and_shown(name):
    pl, thing = drawn(name)
    on, empty = shot(pl), without()
    thing.visibility = False
    assert off(shot(pl), empty).max() <= 1
    assert pl.ibr.report().rows[0].state == 'skipped'
    thing.visibility = True
    np.testing.assert_array_equal(shot(pl), on)


@every
def test_added_to_another_plotter(name):
    """Once the plotter is closed that it was in; a plotter that is closed takes nothing."""
    pl, thing = drawn(name)
    on = shot(pl)
    thing.remove()
    pl.close()
    refused('create a new one', pl.ibr.add, thing, kind=ClosedError)
    if not EVERY[name].replaces:  # its actors were closed with the plotter
        other = drawn(None)[0]
        other.ibr.add(thing)
        place(other, EYE)
        assert (off(shot(other), on) <= 1).all()


@every
def test_own_subplot(name):
    pl = plotter((2 * SIZE[0], SIZE[1]), shape=(1, 2), border=False)
    for column in range(2):
        pl.subplot(0, column)
        stage(pl)
    before = shown(pl)
    EVERY[name].add(pl)
    place(pl, EYE)
    shot(pl)
    after = shot(pl)
    np.testing.assert_array_equal(after[:, : SIZE[0]], before[:, : SIZE[0]])
    alone = shot(drawn(name)[0])
    assert (off(after[:, SIZE[0] :], alone) > 15).mean() < 0.01
    pl.subplot(0, 0)
    assert pl.ibr.effects == ()


@every
def test_two_plotters_know_nothing_of_each_other(name):
    one, other = drawn(name)[0], drawn(name)[0]
    before = shot(other)
    np.testing.assert_array_equal(shot(one), before)
    one.close()
    np.testing.assert_array_equal(shot(other), before)


@every
def test_windows_of_any_size(name):
    pl, thing = drawn(name)
    on = shot(pl)
    for size in ((1, 1), (130, 7), (7, 90), SIZE):
        pl.window_size = size
        found = shot(pl)
        assert found.shape[:2] == size[::-1]
    assert thing.enabled, pl.ibr.report()
    assert (off(found, on) > 15).mean() < 0.01


@every
def test_listed_once_as_an_actor(name):
    """Nothing alien is in what PyVista lists, and names of ``plotter.ibr`` find it."""
    pl, thing = drawn(name)
    handed = EVERY[name].replaces
    assert len(pl.actors) == 2 + 1 + (2 if handed else 0)
    assert sum(actor is thing for actor in pl.actors.values()) == 1
    assert all(hasattr(actor, 'prop') for actor in pl.actors.values())
    found = pl.meshes
    assert len(found) == len(pl.actors) - bool(handed)
    assert all(isinstance(mesh, pv.PolyData) and mesh.n_points > 1 for mesh in found)
    assert list(pl.ibr) == [thing]
    assert len(pl.ibr) == 1
    assert pl.ibr[thing.name] is thing
    assert thing in pl.ibr
    assert thing.name in pl.ibr
    assert 'else' not in pl.ibr
    refused(f"no thing 'else' is in .*: '{thing.name}'", pl.ibr.remove, 'else', kind=KeyError)
    pl.ibr.remove(thing.name)
    assert not list(pl.ibr)
    assert pl.ibr


def added(name, *, plain=False):
    """Return a plotter with a thing or with meshes, nothing drawn yet, and what was added."""
    pl = stage(plotter(SIZE))
    return pl, (EVERY[name].plain if plain else EVERY[name].add)(pl)


@every
def test_bounds_of_the_scene_hold_it(name):
    pl, thing = added(name)
    low, high = np.reshape(pl.bounds, (3, 2)).T
    least, most = np.reshape(added(name, plain=True)[0].bounds, (3, 2)).T
    assert (low < least + 1e-3).all()
    assert (high > most - 1e-3).all()
    assert (high - low < most - least + 2).all()
    thing.remove()
    if not EVERY[name].replaces:
        np.testing.assert_array_equal(pl.bounds, stage(plotter(SIZE)).bounds)


def test_things_without_items_have_no_bounds():
    pl = plotter(SIZE)
    pl.add_mesh(pv.Sphere(center=(5, 5, 5)))
    before = pl.bounds
    empty = pl.ibr.add_spheres(np.zeros((0, 3)))
    assert pl.bounds == before
    assert empty.mapper.dataset.n_points == 0


@every
@pytest.mark.parametrize('look', ['opacity', 'lighting'])
def test_its_material_is_that_of_an_actor(name, look):
    pl, thing = drawn(name)
    before = shot(pl)
    value = 0.3 if look == 'opacity' else not thing.prop.lighting
    setattr(thing.prop, look, value)
    assert (off(shot(pl), before) > 15).mean() > 0.005


@every
def test_label_is_in_the_legend(name):
    pl, thing = added(name)
    thing.label = 'what it is'
    legend = pl.add_legend()
    assert [legend.GetEntryString(k) for k in range(legend.GetNumberOfEntries())] == ['what it is']
    pl.remove_legend()
    thing.remove()
    refused('No labels', pl.add_legend)
    with pytest.raises(TypeError, match=r'label.* must be a str'):
        thing.label = 3


@every
def test_pyvista_sets_what_is_pickable(name):
    pl, thing = added(name)
    pl.pickable_actors = []
    assert thing.pickable is False
    pl.pickable_actors = [thing]
    assert thing.pickable is True


@every
def test_clipped_or_told_why_not(name):
    pl, thing = added(name)
    plane = _vtk.vtkPlane()
    plane.SetNormal(0.4, 0.3, 1.0)
    if name in ('Crowd', 'Impostor', 'ImageLayers'):
        with pytest.raises(AttributeError, match=f'{thing.name} cannot be clipped: '):
            thing.mapper.AddClippingPlane(plane)
        assert thing.mapper.clipping_planes is None
        return
    before = shot(pl)
    thing.mapper.AddClippingPlane(plane)
    cut = shot(pl)
    assert (off(cut, before) > 15).mean() > 0.005
    thing.mapper.RemoveAllClippingPlanes()
    np.testing.assert_array_equal(shot(pl), before)
