"""Turntables: pictures from around an axis, shown to eyes that are level with it."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import pvibr
from pvibr.instances.atlas import Atlas
from pvibr.instances.bake import bake_parts
from pvibr.instances.limits import limits_of
from pvibr.instances.measure import LAYOUTS, side_directions
from pvibr.maths.vectors import as_units
from pvibr.meshes.parts import as_parts
from pvibr.meshes.turntable import SIDE_ELEVATION, Turns
from tests.refusals import refused

pytestmark = pytest.mark.all_sizes

axes = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(axes, st.integers(1, 30))
def test_views_are_all_around_the_axis(axis, views):
    turns = Turns(tuple(as_units('axis', axis).tolist()), views)
    frames = turns.frames()
    assert frames.shape == (turns.columns, turns.columns, 3, 3)
    assert views <= turns.columns**2 < views + 2 * turns.columns
    rows = frames.reshape(-1, 3, 3)[:views]
    np.testing.assert_allclose(rows @ rows.transpose(0, 2, 1), [np.eye(3)] * views, atol=1e-12)
    np.testing.assert_allclose(rows[:, 1], [turns.axis] * views, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rows), 1)
    if views > 2:
        np.testing.assert_allclose(rows[:, 2].sum(0), 0, atol=1e-9)
        steps = (rows[:, 2] * np.roll(rows[:, 2], -1, 0)).sum(1)
        np.testing.assert_allclose(steps, np.cos(2 * np.pi / views), atol=1e-9)


@given(axes, st.booleans())
def test_side_directions_are_near_the_horizon(axis, half):
    turns = Turns(tuple(as_units('axis', axis).tolist()), 8)
    rises = side_directions(8, turns, half) @ turns.axis
    assert np.abs(rises).max() < SIDE_ELEVATION
    assert (rises.min() > 0) == half
    assert np.ptp(rises) > SIDE_ELEVATION / 2


@pytest.fixture(scope='module')
def fir():
    """Discs of many colours about a slanted stem: no two sides are alike."""
    rng = np.random.default_rng(4)
    pieces = []
    for _ in range(50):
        height = rng.uniform(0.2, 3)
        out = (3.2 - height) * 0.5 * np.sqrt(rng.uniform())
        angle = rng.uniform(0, 2 * np.pi)
        center = (out * np.cos(angle) + 0.1 * height, out * np.sin(angle), height)
        piece = pv.Disc(center=center, inner=0, outer=0.2, normal=rng.normal(size=3), c_res=8)
        piece = piece.triangulate()
        paint = np.uint8([255, 0, 0] if center[0] > 0 else [0, 80, 255])
        piece['paint'] = np.tile(paint, (piece.n_points, 1))
        pieces.append(piece)
    return pieces[0].append_polydata(*pieces[1:])


LOOK = {'scalars': 'paint', 'rgb': True}


@pytest.fixture(scope='module')
def foliage(fir):
    return pvibr.foliage_levels(fir, texels=256, view_size=32, views=12, **LOOK)


def plotter(**kwargs):
    pl = pv.Plotter(off_screen=True, window_size=(120, 120), **kwargs)
    pl.set_background('white')
    return pl


def unlike(one, other):
    """Return how different pictures are where either shows something, and how their outlines."""
    a, b = ((p < 0.97).any(2) for p in (one, other))
    return np.abs(one - other)[a | b].mean(), 1 - (a & b).sum() / (a | b).sum()


def pose(angle, scale=1.0, shift=(0, 0, 0)):
    matrix = np.eye(4)
    c, s = np.cos(angle), np.sin(angle)
    matrix[:3, :3] = scale * np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    matrix[:3, 3] = shift
    return matrix


@pytest.mark.sampled
@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize('parallel', [None, 2.2], ids=['perspective', 'parallel'])
def test_the_side_that_the_eye_sees_is_shown_and_lit(fir, foliage, atlases, parallel, offset, see):
    matrix = pose(0.9, 1.2, (offset, -offset, offset))
    pl, truth = plotter(), plotter()
    things = pl.ibr.add_instances(foliage, [matrix], cache=atlases)
    truth.ibr.add_instances(fir, [matrix], max_error=1e-9, cache=atlases, **LOOK)
    things.force_level = {'blended': (0.0, 1e9), 'turntable': (0.0, 1e9)}
    focus = matrix[:3, 3] + [0, 0, 1.9]
    cards, meshes = [], []
    for azimuth in 0.9 + 2 * np.pi * np.array([0.0, 3.0, 7.0]) / 12:
        eye = focus + 300 * np.array([np.cos(azimuth), np.sin(azimuth), 0])
        for p, pictures in ((pl, cards), (truth, meshes)):
            pictures.append(see.grab(see.place(p, eye, focus, angle=0.9, parallel=parallel)))
        assert things.report()['turntable'] == 1
        assert things.report()['blended'] == 0
    pl.close()
    truth.close()
    for k, card in enumerate(cards):
        colors, outlines = zip(*(unlike(card, mesh) for mesh in meshes), strict=True)
        assert colors[k] < 0.12
        assert outlines[k] < 0.28
        others = [value for j, value in enumerate(colors) if j != k]
        assert colors[k] < 0.5 * min(others)


def test_from_above_it_gives_way(foliage, atlases, see):
    pl = plotter()
    things = pl.ibr.add_instances(foliage, [[0, 0, 0]], cache=atlases)
    all_sizes, near, far_away = (0.0, 1e9), (20.0, 1e9), (0.0, 20.0)
    things.force_level = {'blended': all_sizes, 'billboard': far_away, 'turntable': near}
    for rise, far, expected in (
        (0.3, 20, 'turntable'),
        (0.3, 200, 'billboard'),
        (0.4, 20, 'blended'),
        (0.4, 200, 'blended'),
        (-0.4, 20, 'blended'),
        (-0.3, 20, 'turntable'),
    ):
        focus = np.array([0, 0, 1.6])
        eye = focus + far * np.array([np.sqrt(1 - rise**2), 0, rise])
        picture = see.grab(see.place(pl, eye, focus))
        assert (picture < 0.9).any()
        shown = [n for n in ('billboard', 'turntable', 'blended') if things.report()[n]]
        assert shown == [expected]


def test_a_billboard_is_lit_from_where_the_light_is(foliage, atlases, see):
    pl = plotter(lighting='none')
    pl.add_light(pv.Light(position=(1, 0, 0), light_type='scene light', positional=False))
    things = pl.ibr.add_instances(foliage, [[0, 0, 0]], cache=atlases)
    things.force_level = {'blended': (0.0, 1e9), 'billboard': (0.0, 1e9)}
    seen = []
    for side in (1, -1):
        see.place(pl, (14 * side, 0, 1.6), (0, 0, 1.6), angle=18)
        picture = see.grab(pl)
        seen.append(1 - picture[(picture < 0.97).any(2)].mean())
    assert seen[1] > 1.1 * seen[0]  # behind, it is darker, though the picture is the same


def test_each_level_joins_by_its_measured_error(foliage, atlases, see):
    pl = plotter()
    things = pl.ibr.add_instances(foliage, [[0, 0, 0], [9, 0, 0]], cache=atlases, max_error=2.0)
    errors = things.atlases[0].errors
    assert {'billboard', 'turntable', 'mesh1', 'mesh2'} <= set(errors)
    assert errors['turntable'].shape == (sum(len(layout.sizes) for layout in LAYOUTS), 16, 4)
    assert (errors['turntable'][2:, :, 1].mean(1) <= errors['billboard'][2:, :, 1].mean(1)).all()
    see.place(pl, (0, -60, 1.6), (0, 0, 1.6))
    see.grab(pl)
    assert 'turntable from the side to' in things.report()['atlas 0']
    # What was baked is read again, and a set without foliage may stand beside one with it.
    mixed = pl.ibr.add_instances([foliage, pv.Cube()], [[0, 5, 0], [9, 5, 0]], cache=atlases)
    assert mixed.atlases[0].turntable.turns == things.atlases[0].turntable.turns
    assert mixed.atlases[1].turntable is None
    see.grab(pl)
    assert mixed.report()['instances'] == 2
    things.remove()
    mixed.remove()
    assert (see.grab(pl) == 1).all()


def test_sizes_follow_from_errors():
    good, bad = (
        np.tile([[[0.4, 0.0, 0.2, 0.0]], [[displacement, 0.0, 0.2, 0.0]]], (1, 16, 1))
        for displacement in (1.4, 2.5)
    )
    table = dict.fromkeys(('splat', 'parallax', 'blended', 'fine'), good)
    table |= {'sizes': np.array([8.0, 16.0]), 'flat': bad}
    plain = limits_of(table, 1, 1.0)
    assert plain.side_cards == {}
    both = limits_of(table | {'billboard': bad, 'turntable': good}, 1, 1.0)
    assert (both.cards['flat'] == plain.cards['flat']).all()
    assert (both.mesh_from == plain.mesh_from).all()
    spans = both.side_cards
    assert spans['billboard'].T.tolist() == [[6.0, 12.0]] * 16
    assert spans['turntable'].T.tolist() == [[12.0, 16.0]] * 16
    assert (spans['flat'][0] == spans['flat'][1]).all()


def test_it_is_kept_in_files(fir, tmp_path):
    parts = as_parts(fir, **LOOK)
    turns = Turns((0.0, 0.6, 0.8), 5)
    atlas = bake_parts(parts, views=2, tile=8, turns=turns)
    assert atlas.turntable.geometry.shape == (24, 24, 4)
    atlas.save(tmp_path / 'a.npz')
    again = Atlas.load(tmp_path / 'a.npz').turntable
    assert again.turns == turns
    assert np.array_equal(again.albedo, atlas.turntable.albedo)
    arrays = atlas.to_arrays()
    for name, wrong in (
        ('turns', np.zeros(4)),
        ('turns', np.full(4, np.nan)),
        ('turns.albedo', None),
        ('turns.geometry', np.zeros((25, 25, 4), np.uint8)),
        ('turns.geometry', np.zeros(0)),
    ):
        refused('not a turntable', Atlas.from_arrays, arrays | {name: wrong})


def test_a_list_of_parts_is_one_mesh(fir, atlases):
    both = as_parts(fir, **LOOK) + as_parts(pv.Cylinder(height=0.1))
    pl = plotter()
    things = pl.ibr.add_instances(both, [[0, 0, 0], [9, 0, 0]], cache=atlases)
    assert len(things.atlases) == 1
    assert replace(both[0], turns=None) == both[0]
