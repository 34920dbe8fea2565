"""Items of sets: those with NaN are refused or hidden, and their number may change."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
import pyvista as pv

import pvibr
from tests.pictures import off, place, plotter, shot

pytestmark = pytest.mark.sampled

PLACES = np.array([[-1.5, 0.0, 0.3], [-0.5, 0.0, -0.3], [0.5, 0.0, 0.3], [1.5, 0.0, -0.3]])
MATRICES = np.tile(np.eye(4), (4, 1, 1))
MATRICES[:, :3, 3] = PLACES
CUBE = pv.Cube(x_length=0.6, y_length=0.6, z_length=0.8)
WHITE = np.full((8, 8, 4), 255, np.uint8)
SIZES = np.array([0.5, 0.6, 0.7, 0.8])
TURNS = np.array([[1.0, 0, 0, 0], [0.8, 0, 0.6, 0], [0.8, 0, 0.6, 0], [1, 0, 0, 0]])
#: Sets by kind: how to add one, and its arguments with a row per item.
SETS = {
    'points': ('add_instances', {'poses': PLACES}),
    'matrices': ('add_instances', {'poses': MATRICES}),
    'vectors': ('add_instances', {'poses': PLACES, 'orient': PLACES, 'scale': SIZES}),
    'spheres': ('add_spheres', {'points': PLACES, 'radius': SIZES / 2}),
    'cylinders': (
        'add_cylinders',
        {'points_a': PLACES, 'points_b': PLACES + np.array([0.3, 0, 0.4]), 'radius': SIZES / 4},
    ),
    'ellipsoids': (
        'add_ellipsoids',
        {'points': PLACES, 'radii': SIZES[:, None] * [0.5, 0.3, 0.2], 'orientation': TURNS},
    ),
    'cards': ('add_billboards', {'points': PLACES, 'size': SIZES, 'rotation': SIZES}),
    'blended': ('add_billboards', {'points': PLACES, 'size': SIZES[:, None] * [1, 0.5]}),
    'fixed': ('add_billboards', {'points': PLACES, 'orientation': TURNS}),
}
OPTIONS = {
    'add_instances': {'mesh': CUBE, 'cache': False},
    'add_billboards': {'image': WHITE},
}
SPECIFIC = {'blended': {'cutout': None}, 'fixed': {'facing': 'world'}}
ARGUMENTS = [(kind, name) for kind, (_, given) in SETS.items() for name in given]


def stage():
    return place(plotter(), (0.0, -9.0, 1.0), angle=25.0)


def add(pl, kind, rows=slice(None), **changes):
    """Add some rows of a set, with other arguments."""
    method, given = SETS[kind]
    given = {name: changes.pop(name, values[rows]) for name, values in given.items()}
    options = OPTIONS.get(method, {}) | SPECIFIC.get(kind, {}) | {'color': 'white'} | changes
    if method == 'add_billboards' or {'colors', 'scalars'} & options.keys():
        options.pop('color')
    return getattr(pl.ibr, method)(**given, **options)


def picture_of(kind, *args, **changes):
    pl = stage()
    add(pl, kind, *args, **changes)
    return shot(pl)


def with_nan(values, row):
    changed = np.array(values, float)
    changed[(row, *(0,) * (changed.ndim - 1))] = np.nan
    return changed


@pytest.mark.parametrize(('kind', 'name'), ARGUMENTS)
def test_items_with_nan_are_refused_or_hidden(kind, name):
    values = with_nan(SETS[kind][1][name], 1)
    pl = stage()
    with pytest.raises(ValueError, match=re.escape(name) + r"\[1\] must be finite.*nan='hide'"):
        add(pl, kind, **{name: values})
    assert not pl.actors
    items = add(pl, kind, nan='hide', **{name: values})
    assert items.drawn_items().tolist() == [True, False, True, True]
    assert (shot(pl) == picture_of(kind, [0, 2, 3])).all()
    # It lies with a valid item, so that bounds grow by less than its own size.
    bounds, others = items.bounds, add(stage(), kind, [0, 2, 3]).bounds
    np.testing.assert_allclose(bounds, others, atol=0.1)


@pytest.mark.parametrize('kind', SETS)
def test_hidden_items_appear_once_they_have_values(kind):
    name, values = next(iter(SETS[kind][1].items()))
    pl = stage()
    items = add(pl, kind, nan='hide', **{name: with_nan(values, 2)})
    assert np.isnan(getattr(items, name)[2]).any()
    setattr(items, name, getattr(items, name))
    assert (shot(pl) == picture_of(kind, [0, 1, 3])).all()
    if kind != 'vectors':  # new poses are those of the turned items
        setattr(items, name, values)
        assert (shot(pl) == picture_of(kind)).all()
    with pytest.raises(ValueError, match='finite'):
        setattr(items, name, np.full_like(values, np.inf))


def test_some_instances_are_hidden_and_shown_by_their_indices():
    pl = stage()
    items = add(pl, 'points', nan='hide')
    items.update([1, 3], poses=with_nan(PLACES, 1)[[1, 3]])
    assert (shot(pl) == picture_of('points', [0, 2, 3])).all()
    items.update([1], poses=PLACES[1])
    assert (shot(pl) == picture_of('points')).all()


@pytest.mark.parametrize('method', ['add_instances', 'add_spheres', 'add_billboards'])
def test_tables_with_empty_cells(method):
    table = pd.DataFrame(with_nan(PLACES, 1), columns=['x', 'y', 'z'])
    positions = 'poses' if method == 'add_instances' else 'points'
    pl = stage()
    with pytest.raises(ValueError, match=r"1.*must be finite.*nan='hide'"):
        getattr(pl.ibr, method)(**{positions: table}, **OPTIONS.get(method, {}))
    items = getattr(pl.ibr, method)(**{positions: table}, nan='hide', **OPTIONS.get(method, {}))
    assert items.drawn_items().tolist() == [True, False, True, True]


@pytest.mark.parametrize('array', ['size', 'wind'])
def test_glyphs_with_nan(array):
    dataset = pv.PolyData(PLACES)
    dataset['wind'], dataset['size'] = np.roll(PLACES, 1, 0), SIZES.copy()
    dataset[array][1] = np.nan
    glyphs, pl = dataset.ibr.glyph(orient='wind', scale='size', geom=CUBE), stage()
    with pytest.raises(ValueError, match=r"poses\[1\] must be finite, got nan; nan='hide'"):
        pl.ibr.add_instances(glyphs, cache=False)
    items = pl.ibr.add_instances(glyphs, cache=False, nan='hide')
    assert items.drawn_items().tolist() == [True, False, True, True]


def test_all_items_may_be_hidden():
    pl = stage()
    for kind in SETS:
        given = {name: np.full_like(values, np.nan) for name, values in SETS[kind][1].items()}
        assert not add(pl, kind, nan='hide', **given).drawn_items().any()
    assert (shot(pl) == shot(stage())).all()


@pytest.mark.parametrize('kind', SETS)
@pytest.mark.parametrize('opacity', [0.0, 0.5, 1.0])
def test_opacity_of_nan_scalars(kind, opacity):
    scalars = [0.0, np.nan, 0.5, 1.0]
    look = {'show_scalar_bar': False, 'nan_color': 'red', 'nan_opacity': opacity}
    pl = stage()
    if opacity == 0.5 and kind in ('cards', 'fixed'):
        with pytest.raises(ValueError, match=r'nan_opacity must be 0 or 1 for cut-outs, got 0\.5'):
            add(pl, kind, scalars=scalars, **look)
        return
    items = add(pl, kind, scalars=scalars, **look)
    picture = shot(pl)
    if opacity == 0:
        rest = {'clim': (0, 1), 'show_scalar_bar': False}
        others = picture_of(kind, [0, 2, 3], scalars=[0.0, 0.5, 1.0], **rest)
        assert off(picture, others).max() <= 1
        return
    # The set whose colours are those of the table, with this alpha.
    table = pv.LookupTable('viridis', scalar_range=(0, 1))
    colors = np.array([table.map_value(v) for v in (0.0, 0.0, 0.5, 1.0)])
    colors[1] = 1.0, 0.0, 0.0, opacity
    if kind == 'blended':
        own = picture_of(kind, colors=colors[:, :3], opacity=colors[:, 3])
    elif kind in ('cards', 'fixed'):
        own = picture_of(kind, colors=colors[:, :3])
    else:
        own = picture_of(kind, colors=colors)
    assert off(picture, own).max() <= 2
    assert items.drawn_items().all()


def test_hidden_items_are_not_picked():
    for kind in ('points', 'spheres', 'cards'):
        pl = stage()
        items = add(pl, kind, scalars=[0.0, 1.0, np.nan, 2.0], nan_opacity=0.0)
        shot(pl)
        x, y = 60 + 8, 45 + 5
        hit = items.pick(x, y)
        assert hit is None or hit.index != 2
        items.map(nan_opacity=1.0)
        assert items.pick(x, y).index == 2


@pytest.mark.parametrize('kind', SETS)
@pytest.mark.parametrize('count', [2, 4, 700])
def test_the_number_of_items_may_change(kind, count):
    rng = np.random.default_rng(count)
    rows = rng.integers(0, 4, count) if count > 4 else np.arange(count)
    given = {n: v[rows] for n, v in SETS[kind][1].items() if n not in ('orient', 'scale')}
    pl = stage()
    items = add(pl, kind, [0, 1, 2], scalars=[0.0, 1.0, 2.0])
    shot(pl)
    items.update(**given, colors='white')
    assert len(items) == count
    plain = {} if kind != 'vectors' else {'orient': None, 'scale': None}
    assert (shot(pl) == picture_of(kind, colors='white', **given, **plain)).all()
    assert items.scalars is None


@pytest.mark.parametrize('kind', [k for k in SETS if SETS[k][0] != 'add_instances'])
def test_looks_go_with_the_number_and_failures_change_nothing(kind):
    given = SETS[kind][1]
    pl = stage()
    items = add(pl, kind, scalars=[0.0, 1.0, 2.0, 3.0], visible=[True, False, True, True])
    before = shot(pl)
    positions = next(iter(given))
    with pytest.raises(ValueError, match='must'):
        items.update(**{positions: PLACES[:2], 'colors': ['red'] * 5})
    with pytest.raises(ValueError, match='colors must be of shape'):
        items.update(colors=['red'] * 5)
    with pytest.raises(TypeError, match="no argument 'pionts'; did you mean"):
        items.update(pionts=PLACES)
    assert (shot(pl) == before).all()
    assert items.scalars.tolist() == [0, 1, 2, 3]
    items.update(**{name: values[:3] for name, values in given.items()})
    assert items.scalars is None
    assert items.visible.tolist() == [True] * 3
    items.update(scalars=[1.0, 2.0, 3.0], opacity=0.5)
    assert items.scalars.tolist() == [1, 2, 3]
    assert items.opacity == 0.5
    given = {name: values[:3] for name, values in given.items()}
    own = picture_of(kind, opacity=0.5, scalars=[1.0, 2.0, 3.0], **given)
    assert off(shot(pl), own).max() <= 1


@pytest.mark.parametrize('kind', [k for k in SETS if SETS[k][0] != 'add_instances'])
def test_some_items_change_by_their_indices(kind):
    given = {n: v for n, v in SETS[kind][1].items() if n != 'orientation'}
    pl = stage()
    items = add(pl, kind, [0, 1, 1, 1], colors=['red', 'lime', 'lime', 'lime'])
    rest = {n: v[[0, 1, 1, 1]] for n, v in SETS[kind][1].items() if n == 'orientation'}
    mask = np.array([False, False, True, True])
    items.update(mask, **{n: v[2:] for n, v in given.items()}, colors=['blue', 'white'])
    look = {'colors': ['red', 'lime', 'blue', 'white'], **rest}
    assert (shot(pl) == picture_of(kind, **look)).all()
    items.update([-1], visible=False)
    assert items.visible.tolist() == [True, True, True, False]
    items.update([0, 3], scalars=[1.0, 2.0])
    np.testing.assert_array_equal(items.scalars, [1.0, np.nan, np.nan, 2.0])
    with pytest.raises(IndexError, match='ids must be below 4'):
        items.update([4], visible=False)
    name = next(iter(given))
    with pytest.raises(ValueError, match=name):
        items.update([0, 1], **{name: PLACES[:3]})


def test_single_values_apply_to_any_number():
    pl = stage()
    balls, cards = pl.ibr.add_spheres(PLACES, 0.3), pl.ibr.add_billboards(PLACES, WHITE, size=0.2)
    for items in (balls, cards):
        items.points = np.repeat(PLACES, 5, 0)
        assert len(items) == 20
    assert (balls.radius == 0.3).all()
    empty = pl.ibr.add_spheres(np.zeros((0, 3)), 0.4)
    empty.points = PLACES
    assert empty.radius.tolist() == [0.4] * 4
    assert shot(pl).std() > 1


@pytest.mark.parametrize('how', [{'orient': 'wind'}, {'orient': 'wind', 'scale': 'size'}])
def test_arrays_of_cells_place_items_at_cells_as_glyph_does(how):
    grid = pv.ImageData(dimensions=(3, 3, 1)).cast_to_unstructured_grid()
    grid.cell_data['wind'], grid.cell_data['size'] = PLACES, SIZES
    grid.point_data['heat'] = np.arange(9.0)
    pl = stage()
    items = pl.ibr.add_instances(CUBE, grid, cache=False, **how)
    wanted = grid.glyph(**{'scale': False} | how, geom=CUBE)
    matrices = items.poses
    points = np.asarray(CUBE.points, float) @ matrices[:, :3, :3].swapaxes(1, 2)
    points += matrices[:, None, :3, 3]
    np.testing.assert_allclose(points.reshape(-1, 3), wanted.points, atol=1e-6)
    with pytest.raises(ValueError, match='arrays of either points or cells'):
        pl.ibr.add_instances(CUBE, grid, scalars='heat', cache=False, **how)
    balls = pl.ibr.add_spheres(grid, 0.1, scalars='size')
    np.testing.assert_allclose(balls.points, grid.cell_centers().points)
    assert balls.scalars.tolist() == SIZES.tolist()


def test_active_arrays_of_cells():
    grid = pv.ImageData(dimensions=(3, 3, 1)).cast_to_unstructured_grid()
    grid.cell_data['size'] = SIZES
    poses = pvibr.matrices(grid, scale=True)
    np.testing.assert_allclose(poses[:, 0, 0], SIZES)
    np.testing.assert_allclose(poses[:, :3, 3], grid.cell_centers().points)
