"""Scalar bars show the numbers of the colours that are drawn."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.animation import FigureMesh, Skeleton

RANDOM = np.random.default_rng(3)
PLACES = np.c_[np.linspace(-2, 2, 7), np.zeros(7), np.zeros(7)]
VALUES = RANDOM.uniform(-3, 8, 7)
OTHERS = RANDOM.uniform(2, 30, 7)
THINGS = {
    'Spheres': lambda ibr, **how: ibr.add_spheres(PLACES, 0.2, **how),
    'Cylinders': lambda ibr, **how: ibr.add_cylinders(PLACES, PLACES + 1, 0.2, **how),
    'Ellipsoids': lambda ibr, **how: ibr.add_ellipsoids(PLACES, (0.2, 0.3, 0.4), **how),
    'Billboards': lambda ibr, **how: ibr.add_billboards(PLACES, np.ones((4, 4, 3)), **how),
    'Instances': lambda ibr, **how: ibr.add_instances(pv.Cube(), PLACES, bake=False, **how),
}
every = pytest.mark.parametrize('kind', THINGS)
TITLE = {'scalar_bar_args': {'title': 't'}}


def expected(values, clim, cmap='viridis'):
    """Return colours after the map of matplotlib."""
    table = pv.LookupTable(cmap, scalar_range=clim)
    return np.array([table.map_value(v)[:3] for v in values]) * 255


def range_of(pl, title='t'):
    return pl.scalar_bars[title].GetLookupTable().GetRange()


class Column:
    """A column of a table, as pandas and polars have it."""

    name = 'heat'

    def __array__(self, dtype=None, copy=None):
        return VALUES.astype(dtype or float)


@pytest.fixture
def pl():
    plotter = pv.Plotter(off_screen=True, window_size=(200, 150))
    yield plotter
    plotter.close()


def agree(pl, thing, values, clim, cmap='viridis', title='t'):
    """Assert that a thing and its bar show values by a map and a range."""
    np.testing.assert_allclose(thing.colors, expected(values, clim, cmap), atol=1.01)
    assert range_of(pl, title) == pytest.approx(clim)
    assert thing.clim == pytest.approx(clim)
    table = pl.scalar_bars[title].GetLookupTable()
    middle = pv.LookupTable(cmap, scalar_range=clim).map_value(np.mean(clim))
    np.testing.assert_allclose(table.map_value(np.mean(clim)), middle, atol=0.01)


@every
def test_bars_follow_map_and_clim(pl, kind):
    thing = THINGS[kind](pl.ibr, scalars=VALUES, **TITLE)
    agree(pl, thing, VALUES, (VALUES.min(), VALUES.max()))
    thing.map(clim=(-10, 10))
    agree(pl, thing, VALUES, (-10, 10))
    thing.map(cmap='plasma', n_colors=16)
    assert pl.scalar_bars['t'].GetMaximumNumberOfColors() == 16
    thing.map(cmap='plasma', n_colors=256)
    agree(pl, thing, VALUES, (-10, 10), 'plasma')
    thing.clim = 0, 4
    agree(pl, thing, VALUES, (0, 4), 'plasma')
    thing.scalars = OTHERS
    agree(pl, thing, OTHERS, (0, 4), 'plasma')


@every
def test_update_scalar_bar_range_recolours(pl, kind):
    thing = THINGS[kind](pl.ibr, scalars=VALUES, **TITLE)
    pl.render()
    pl.update_scalar_bar_range((-4, 20), 't')
    agree(pl, thing, VALUES, (-4, 20))
    thing.mapper.scalar_range = 0, 1
    agree(pl, thing, VALUES, (0, 1))


@every
def test_one_title_is_one_bar_and_one_range(pl, kind):
    first = THINGS[kind](pl.ibr, scalars=VALUES, **TITLE)
    second = THINGS['Spheres'](pl.ibr, scalars=OTHERS, **TITLE)
    assert list(pl.scalar_bars.keys()) == ['t']
    both = min(VALUES.min(), OTHERS.min()), max(VALUES.max(), OTHERS.max())
    agree(pl, first, VALUES, both)
    agree(pl, second, OTHERS, both)
    first.clim = 1, 2
    agree(pl, first, VALUES, (1, 2))
    agree(pl, second, OTHERS, (1, 2))
    pl.update_scalar_bar_range((5, 7), 't')
    agree(pl, first, VALUES, (5, 7))
    agree(pl, second, OTHERS, (5, 7))
    second.remove()
    first.clim = 0, 3
    agree(pl, first, VALUES, (0, 3))
    first.remove()
    assert not pl.scalar_bars


def test_a_mesh_shares_its_bar(pl):
    mesh = pv.Sphere()
    mesh['t'] = mesh.points[:, 2] * 40
    before = pl.add_mesh(mesh, scalars='t')
    thing = pl.ibr.add_spheres(PLACES, 0.2, scalars=VALUES, **TITLE)
    both = -20, 20
    agree(pl, thing, VALUES, both)
    after = pl.add_mesh(mesh, scalars=mesh['t'] * 2, scalar_bar_args={'title': 't'})
    agree(pl, thing, VALUES, (-40, 40))
    thing.clim = 0, 5
    assert before.mapper.scalar_range == after.mapper.scalar_range == (0, 5)
    pl.remove_actor(after)
    pl.remove_actor(before)
    pl.update_scalar_bar_range((1, 6), 't')
    agree(pl, thing, VALUES, (1, 6))


@every
def test_scalars_set_later_bring_a_bar(pl, kind):
    thing = THINGS[kind](pl.ibr, **TITLE)
    hidden = THINGS[kind](pl.ibr, show_scalar_bar=False)
    assert not pl.scalar_bars
    thing.scalars = VALUES
    hidden.scalars = VALUES
    assert list(pl.scalar_bars.keys()) == ['t']
    agree(pl, thing, VALUES, (VALUES.min(), VALUES.max()))
    thing.scalars = None
    assert not pl.scalar_bars
    thing.scalars = OTHERS
    agree(pl, thing, OTHERS, (OTHERS.min(), OTHERS.max()))
    thing.colors = np.zeros((7, 3))
    assert not pl.scalar_bars


def test_a_bar_comes_into_the_subplot_of_its_thing():
    pl = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(200, 100))
    thing = pl.ibr.add_spheres(PLACES, 0.2, **TITLE)
    pl.subplot(0, 1)
    thing.scalars = VALUES
    assert pl.renderers[0].HasViewProp(pl.scalar_bars['t'])
    assert pl.renderers.active_index == 1
    pl.close()


WAYS = {
    'remove': lambda pl, thing: thing.remove(),
    'remove_actor': lambda pl, thing: pl.remove_actor(thing),
    'remove_actor by name': lambda pl, thing: pl.remove_actor('it'),
    'clear': lambda pl, thing: pl.clear(),
    'clear_actors': lambda pl, thing: pl.clear_actors(),
    'ibr.clear': lambda pl, thing: pl.ibr.clear(),
    'replaced': lambda pl, thing: pl.ibr.add_spheres(PLACES, 0.2, name='it'),
    'replaced by a mesh': lambda pl, thing: pl.add_mesh(pv.Cube(), name='it'),
}


@pytest.mark.parametrize('way', WAYS)
def test_bars_go_with_their_thing(pl, way):
    thing = pl.ibr.add_spheres(PLACES, 0.2, name='it', scalars=VALUES)
    assert list(pl.scalar_bars.keys()) == ['it']
    pl.render()
    WAYS[way](pl, thing)
    pl.render()
    assert not pl.scalar_bars
    again = pl.ibr.add_spheres(PLACES, 0.2, name='it', scalars=OTHERS)
    agree(pl, again, OTHERS, (OTHERS.min(), OTHERS.max()), title='it')


def test_replacing_takes_the_new_range(pl):
    for values in (VALUES, OTHERS):
        thing = pl.ibr.add_spheres(PLACES, 0.2, name='it', scalars=values, **TITLE)
    agree(pl, thing, OTHERS, (OTHERS.min(), OTHERS.max()))


@every
def test_titles_are_names_of_arrays(pl, kind):
    cloud = pv.PolyData(PLACES)
    cloud['depth'] = VALUES
    thing = THINGS[kind](pl.ibr, scalars=Column())
    assert list(pl.scalar_bars.keys()) == ['heat']
    thing.scalars = cloud['depth']
    assert list(pl.scalar_bars.keys()) == ['depth']
    thing.scalars = 2 * cloud['depth']  # not that array
    assert list(pl.scalar_bars.keys()) != ['depth']


def test_a_name_selects_an_array_of_the_points(pl):
    cloud = pv.PolyData(PLACES)
    cloud['depth'] = VALUES
    x, y, z = PLACES.T
    table = {'x': x, 'y': y, 'z': z, 'kind': ['oak'] * len(x), 'depth': VALUES}
    oriented = table | {'qw': x, 'qx': x, 'qy': x, 'qz': x, 'scale': 2 * VALUES}
    spheres = pl.ibr.add_spheres(oriented, 0.2, scalars='scale')
    agree(pl, spheres, 2 * VALUES, (2 * VALUES.min(), 2 * VALUES.max()), title='scale')
    spheres.remove()
    for points in (cloud, table, oriented):
        for add in (
            lambda p: pl.ibr.add_spheres(p, 0.2, scalars='depth'),
            lambda p: pl.ibr.add_cylinders(p, PLACES + 1, 0.2, scalars='depth'),
            lambda p: pl.ibr.add_ellipsoids(p, (0.2, 0.3, 0.4), scalars='depth'),
            lambda p: pl.ibr.add_billboards(p, np.ones((4, 4, 3)), scalars='depth'),
        ):
            thing = add(points)
            assert list(pl.scalar_bars.keys()) == ['depth']
            agree(pl, thing, VALUES, (VALUES.min(), VALUES.max()), title='depth')
            thing.remove()
        with pytest.raises((KeyError, ValueError), match="did you mean 'depth'"):
            pl.ibr.add_spheres(points, 0.2, scalars='dept')
    with pytest.raises(ValueError, match=r"points = .*no column 'z'"):
        pl.ibr.add_spheres({'x': x, 'y': y}, 0.2)
    with pytest.raises((TypeError, ValueError), match='scalars'):
        pl.ibr.add_spheres(PLACES, 0.2, scalars='depth')


def test_updates_keep_the_bar(pl):
    cloud = pv.PolyData(PLACES)
    cloud['depth'] = VALUES
    thing = THINGS['Instances'](pl.ibr, scalars=cloud['depth'])
    thing.update([1, 2], scalars=[3.0, 4.0])
    assert list(pl.scalar_bars.keys()) == ['depth']
    thing.update(poses=PLACES[:3])
    assert not pl.scalar_bars
    thing.update(poses=PLACES, scalars=OTHERS)
    title = 'scalars'
    assert list(pl.scalar_bars.keys()) == [title]
    agree(pl, thing, OTHERS, thing.clim, title=title)


def picture(pl):
    pl.render()
    return pl.screenshot(return_img=True).astype(int)


def figure(mesh):
    return pvibr.Figure([FigureMesh(mesh, node=0)], Skeleton([-1], [np.eye(4)]))


OF_MESHES = {
    'instances': lambda ibr, mesh, **how: ibr.add_instances(mesh, PLACES, bake=False, **how),
    'baked': lambda ibr, mesh, **how: ibr.add_instances(mesh, PLACES, bake=True, **how),
    'figure': lambda ibr, mesh, **how: ibr.add_animated(figure(mesh), **how),
    'crowd': lambda ibr, mesh, **how: ibr.add_animated(figure(mesh), PLACES[:2], **how),
}


@pytest.mark.parametrize('kind', OF_MESHES)
def test_scalars_of_meshes_follow_the_bar(kind):
    mesh = pv.Sphere(radius=0.4)
    mesh['h'] = mesh.points[:, 2]
    pictures = []
    for late in (True, False):
        pl = pv.Plotter(off_screen=True, window_size=(200, 150))
        OF_MESHES[kind](pl.ibr, mesh, **({} if late else {'clim': (0.1, 0.6)}))
        picture(pl)
        if late:
            pl.update_scalar_bar_range((0.1, 0.6), 'h')
        pictures.append(picture(pl))
        assert range_of(pl, 'h') == pytest.approx((0.1, 0.6))
        pl.close()
    assert abs(pictures[0] - pictures[1]).mean() < (1 if kind == 'baked' else 0.01)


def test_a_changed_mesh_keeps_the_range_of_its_bar(pl):
    mesh = pv.Sphere(radius=0.4)
    mesh['h'] = mesh.points[:, 2]
    thing = pl.ibr.add_instances(mesh, PLACES, bake=False)
    mesh['h'] = 3 * mesh.points[:, 2]
    picture(pl)
    assert range_of(pl, 'h') == pytest.approx((-1.2, 1.2))
    pl.update_scalar_bar_range((0, 1), 'h')
    mesh['h'] = 5 * mesh.points[:, 2]
    picture(pl)
    assert range_of(pl, 'h') == thing.mapper.scalar_range == (0, 1)


def test_a_bar_with_a_place_of_its_own_goes_too(pl):
    how = {'title': 't', 'position_x': 0.1, 'position_y': 0.1}
    thing = pl.ibr.add_spheres(PLACES, 0.2, scalars=VALUES, scalar_bar_args=how)
    thing.remove()
    assert not pl.scalar_bars


def with_arrays():
    mesh = pv.Sphere()
    mesh['vector'] = mesh.points.astype(float)
    mesh['words'] = np.where(mesh.points[:, 0] > 0, 'east', 'west')
    mesh['flags'] = mesh.points[:, 0] > 0
    mesh['roots'] = mesh.points[:, 0] + 1j
    mesh['x-1'] = mesh.points[:, 0]
    return mesh


@pytest.mark.parametrize('name', ['vector', 'vector of one', 'words', 'flags', 'roots', 'x-1'])
def test_bars_of_meshes_are_those_of_add_mesh(name):
    """Titles are names of arrays, whatever PyVista makes of these; words have no numbers."""
    mesh = with_arrays()
    array = name.removesuffix(' of one')
    look = {'scalars': array} | ({'component': 1} if name != array else {})
    ours, theirs = pv.Plotter(off_screen=True), pv.Plotter(off_screen=True)
    with warnings.catch_warnings():
        warnings.filterwarnings('ignore', message='Casting complex')
        ours.ibr.add_instances(mesh, PLACES, **look)
        theirs.add_mesh(mesh, **look)
    assert list(ours.scalar_bars.keys()) == list(theirs.scalar_bars.keys()) == [array]
    bars = [pl.scalar_bars[array] for pl in (ours, theirs)]
    assert bars[0].GetNumberOfLabels() == bars[1].GetNumberOfLabels()
    for bar in bars:
        assert bar.GetDrawTickLabels() == (name not in ('words', 'flags'))


@pytest.mark.parametrize('name', ['vector', 'words', 'x-1'])
def test_bars_of_actors_have_the_names_of_arrays(pl, name):
    actor = pv.Plotter(off_screen=True).add_mesh(with_arrays(), scalars=name)
    pl.ibr.add_instances(actor, PLACES, show_scalar_bar=True)
    assert list(pl.scalar_bars.keys()) == [name]


def test_the_bar_comes_back_with_its_thing(pl):
    spheres = pl.ibr.add_spheres(PLACES, 0.2, scalars=VALUES, scalar_bar_args={'title': 'heat'})
    spheres.remove()
    assert not list(pl.scalar_bars.keys())
    pl.ibr.add(spheres)
    agree(pl, spheres, VALUES, (VALUES.min(), VALUES.max()), title='heat')
