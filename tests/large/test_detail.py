"""At rest the shading of a large mesh is the mesh's, not only its places."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.sharpness import sharpness
from pvibr.large.build import build_hierarchy
from pvibr.large.cut import patches_within
from pvibr.large.detail import lost_lengths, squared_differences
from pvibr.large.hierarchy import NO_CELL
from pvibr.large.sources import source_of
from pvibr.large.vertex_values import Values
from pvibr.maths.flip import flip
from pvibr.things.frame import STEP
from tests.large.looks import OVER, drawn
from tests.large.surfaces import folded, hierarchy_of, terrain
from tests.pictures import place, shot

SCAN = Path(__file__).parents[3] / 'shared/data/meshes/turbineblade.ply'
SIZE = (480, 360)
SCALE = 3


def scan():
    """Return a public scan of a turbine's blade."""
    if not SCAN.exists():
        pytest.skip(f'needs {SCAN.name} of the shared data')
    mesh = pv.read(SCAN)
    mesh.clear_data()
    return mesh


def around(mesh, direction, distance):
    """Return a view of a mesh from some of its sizes away."""
    low, high = np.reshape(mesh.bounds, (3, 2)).T
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    eye = middle + distance * size * np.asarray(direction) / np.linalg.norm(direction)
    return {'eye': tuple(eye), 'focus': tuple(middle)}


def truth_of(mesh, view, **look):
    """Return a picture of the mesh, supersampled."""
    large_size = tuple(SCALE * n for n in SIZE)
    pl, _ = drawn(mesh, view=view, size=large_size, large=False, **look)
    width, height = SIZE
    return shot(pl).reshape(height, SCALE, width, SCALE, 3).mean((1, 3)) / 255


def errors_of(mesh, view, **look):
    """Return FLIP of the large mesh with and without detail, and of the mesh, at one sample.

    Also triangles with and without detail, and its sharpness with it over that of the mesh.
    """
    truth = truth_of(mesh, view, **look)
    pl, thing = drawn(mesh, view=view, size=SIZE, detail='normals', **look)
    plain, _ = drawn(mesh, view=view, size=SIZE, large=False, **look)
    pictures = [shot(pl), shot(plain)]
    counts = [thing.report()['triangles']]
    thing.detail = 'none'
    pictures.insert(1, shot(pl))
    counts.append(thing.report()['triangles'])
    sharp, own_sharp = (sharpness(pictures[k] / 255, truth) for k in (0, 2))
    errors = (float(flip(truth, p / np.float32(255)).mean()) for p in pictures)
    return *errors, counts, sharp / own_sharp


CASES = {
    'terrain': (terrain, (0.3, -1, 0.8), {'scalars': 'pattern', 'smooth_shading': True}, 1.6),
    'folded': (folded, (1, 0.5, 0.4), {'color': 'white', 'smooth_shading': True}, 2.0),
    'flat shading': (terrain, (1, -0.2, 0.7), {'color': 'white'}, 1.6),
    'scan': (scan, (1, 1, 0.3), {'color': 'white', 'smooth_shading': True}, 2.0),
}


@pytest.mark.parametrize('case', CASES)
def test_at_rest_it_looks_like_the_mesh(case):
    make, direction, look, bound = CASES[case]
    mesh = make()
    view = around(mesh, direction, 1.6)
    detailed, plain, own, (fine, coarse), sharp = errors_of(mesh, view, max_error=1.0, **look)
    assert detailed < bound * own
    assert plain > 1.3 * detailed
    assert coarse < fine
    assert sharp > 0.85
    *_, own = found = errors_of(mesh, view, max_error=0.25, **look)[:3]
    assert found[0] < 1.15 * own


def painted(values, name='paint'):
    """Return a flat square of many triangles with values."""
    count = len(values)
    grid = pv.ImageData(dimensions=(count, count, 1), spacing=(1 / (count - 1),) * 3)
    mesh = grid.extract_surface(algorithm='dataset_surface').triangulate()
    mesh.clear_data()
    mesh[name] = values.reshape(count * count, -1).squeeze()
    return mesh


ABOVE = {'eye': (0.5, 0.2, 1.6), 'focus': (0.5, 0.5, 0)}


@pytest.mark.parametrize('kind', ['scalars', 'colours', 'cells'])
def test_colours_of_a_flat_mesh_stay(kind):
    x, y = np.meshgrid(*(np.linspace(0, 1, 240),) * 2)
    pattern = np.sin(60 * x) * np.sin(50 * y)
    look = {'scalars': 'paint', 'lighting': False}
    if kind == 'colours':
        pattern = np.rint(127 * (1 + np.stack([pattern, -pattern, 0 * pattern], -1)))
        pattern, look['rgb'] = pattern.astype(np.uint8), True
    mesh = painted(pattern)
    if kind == 'cells':
        mesh = mesh.point_data_to_cell_data()
    errors = {}
    for detail in ('normals', 'none'):
        pl, _ = drawn(mesh, view=ABOVE, max_error=1.0, detail=detail, **look)
        plain, _ = drawn(mesh, view=ABOVE, large=False, **look)
        errors[detail] = np.abs(shot(pl) - shot(plain)).mean()
    assert errors['normals'] < 8
    if kind != 'cells':  # large cells have their own values as it is
        assert errors['none'] > 3 * errors['normals']


def test_what_is_even_is_not_refined():
    mesh = painted(np.linspace(0, 1, 240)[:, None] * np.ones(240))
    counts = {}
    for look in ({'color': 'white'}, {'scalars': 'paint'}):
        _, thing = drawn(mesh, view=ABOVE, detail='normals', smooth_shading=True, **look)
        counts[tuple(look)] = thing.report()['triangles']
    assert counts[('color',)] < 0.04 * mesh.n_cells  # no cell is simplified further
    assert counts[('scalars',)] < 0.2 * mesh.n_cells
    _, thing = drawn(detail='normals', mesh=terrain(), color='white', lighting=False)
    _, other = drawn(detail='none', mesh=terrain(), color='white', lighting=False)
    assert thing.report()['triangles'] == other.report()['triangles']


def test_smooth_curvature_is_not_refined():
    """What corners give by interpolation is no detail, however much normals differ there."""
    mesh = smooth()
    view = around(mesh, (1, 0.4, 0.5), 0.9)
    look = {'view': view, 'color': 'tan', 'smooth_shading': True}
    pl, thing = drawn(mesh, detail='normals', **look)
    detailed = thing.report()['triangles']
    thing.detail = 'none'
    plain, _ = drawn(mesh, large=False, **look)
    differences = np.abs(shot(pl).astype(int) - shot(plain)).max(-1)
    assert (differences > 3).mean() < 0.01
    assert detailed < 1.3 * thing.report()['triangles'] < 0.2 * mesh.n_cells


def test_values_that_are_all_equal_add_nothing():
    hierarchy = hierarchy_of(terrain)
    values = Values('v', np.full(len(hierarchy.points), 442.0, np.float32))
    lost = lost_lengths(hierarchy, values, (442.0, 442.0), is_lit=True)
    assert np.array_equal(lost, lost_lengths(hierarchy, None, None, is_lit=True))


def test_values_set_anew_and_their_range():
    flat = np.ones((240, 240))
    flat[0, 0] = 0
    mesh = painted(flat)
    x, y = np.meshgrid(*(np.linspace(0, 1, 240),) * 2)
    pl, thing = drawn(mesh, view=ABOVE, detail='normals', scalars='paint', lighting=False)
    coarse = thing.report()['triangles']
    thing.set_scalars((np.sin(60 * x) * np.sin(50 * y)).ravel())
    shot(pl)
    fine = thing.report()['triangles']
    assert fine > 5 * coarse
    thing.mapper.scalar_range = (-100, 100)
    shot(pl)
    assert thing.report()['triangles'] < 0.2 * fine
    thing.set_scalars(flat.ravel())
    shot(pl)
    assert thing.report()['triangles'] == coarse


def test_only_at_rest():
    pl, thing = drawn(terrain(), detail='normals', scalars='pattern')
    fine = thing.report()['triangles']
    view = pl.ibr.pipeline.view()
    thing.prepare(replace(view, quality=STEP))
    moving = thing.report()['triangles']
    thing.detail = 'none'
    shot(pl)
    assert abs(moving - thing.report()['triangles']) < 0.05 * moving < 0.1 * fine
    thing.detail = 'normals'
    shot(pl)
    assert thing.report()['triangles'] == fine == thing.cut().n_cells


def test_pictures_from_other_cameras_have_it():
    """What other effects see of it, such as mirrors, is not blurred either."""
    pl, thing = drawn(terrain(), detail='normals', color='white', smooth_shading=True)
    here = thing.report()['triangles']
    frame = pl.ibr.pipeline.view()
    other = replace(frame, view=copy(frame.view))
    thing.draws(other, depth=True)
    assert thing._other_cut.n_triangles < 0.8 * here
    thing.draws(other)
    assert thing._other_cut.n_triangles == here


@pytest.mark.parametrize('make', [terrain, folded])
def test_probes_are_on_the_cells(make):
    """Each is a vertex of the full mesh, as far from the triangle as the cell's error says."""
    hierarchy = hierarchy_of(make)
    cells, vertices, *corners = hierarchy.probes.T
    assert (np.bincount(cells, minlength=len(hierarchy.errors)) > 100).all()
    assert vertices.max() < len(hierarchy.areas)
    np.testing.assert_allclose(hierarchy.probe_weights.sum(1), 1, atol=1e-5)
    assert hierarchy.probe_weights.min() > -1e-6
    distances = np.sqrt(squared_differences(hierarchy, hierarchy.points))
    is_within = distances <= hierarchy.errors[cells] * (1 + 1e-4) + 1e-6
    assert is_within.mean() > 0.98
    made_by = hierarchy.patch_cells[:, 0]
    for cell in (0, len(hierarchy.errors) - 1):
        own = [
            hierarchy.vertices[slice(*hierarchy.vertex_starts[patch : patch + 2])]
            for patch in np.flatnonzero(made_by == cell)
        ]
        assert np.isin(np.stack(corners)[:, cells == cell], np.concatenate(own)).all()


def smooth():
    """Return a fine mesh of a smooth surface, with its own normals."""
    ball = pv.Icosphere(nsub=6)
    ball.scale((1, 1, 0.7), inplace=True)
    normals = np.array(ball.points) / (1, 1, 0.7**2)
    ball['Normals'] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    ball.point_data.active_normals_name = 'Normals'
    return ball


def test_normals_of_a_smooth_surface_are_its_own():
    """Those of simplified vertices are of where they are, not of what they were merged from."""
    hierarchy = build_hierarchy(source_of(smooth()).mesh)
    points = hierarchy.points + hierarchy.origin
    exact = points / (1, 1, 0.7**2)
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    angles = np.linalg.norm(hierarchy.normals - exact, axis=1)
    levels = np.searchsorted(hierarchy.level_starts, np.arange(len(points)), 'right')
    edges = np.sqrt(4 * np.pi / len(hierarchy.areas)) * 2 ** (levels / 2)
    later = levels > 1
    assert np.quantile((angles / edges)[later], 0.95) < 0.03  # by means alone, 0.18


@pytest.mark.parametrize('make', [terrain, folded])
def test_replacing_loses_no_less(make):
    """Else a cut could have a cell and what replaces a part of it."""
    hierarchy = hierarchy_of(make)
    lengths = lost_lengths(hierarchy, None, None, is_lit=True)
    made_by, replaced_by = hierarchy.patch_cells.T
    both = (made_by != NO_CELL) & (replaced_by != NO_CELL)
    assert both.any()
    assert (lengths[made_by[both]] <= lengths[replaced_by[both]]).all()
    detailed = replace(hierarchy, errors=lengths)
    counts = [
        hierarchy.triangle_counts[patches_within(detailed, lengths, limit)].sum()
        for limit in np.quantile(lengths, (0, 0.3, 0.6, 0.9))
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 2 * counts[-1]


def test_unknown_values_show_where_they_end():
    hierarchy = hierarchy_of(terrain)
    points = hierarchy.points[hierarchy.vertex_of_point]
    by_point = np.where(points[:, 0] < 0, np.nan, 1.0)
    values = Values('a', hierarchy.averaged(by_point)[:, 0])
    lengths = lost_lengths(hierarchy, values, (0, 1), is_lit=False)
    middles = np.abs(hierarchy.boxes.mean(1)[:, 0])
    reaches = np.ptp(hierarchy.boxes, axis=1)[:, 0] / 2
    is_beside = middles < reaches
    assert np.isfinite(lengths).all()
    assert (lengths[~is_beside] == 0).all()
    assert (lengths[is_beside] > 0).mean() > 0.7


def test_moved_and_stretched():
    """Moved and stretched it keeps the detail, with fewer triangles."""
    mesh = terrain()
    pl, thing = drawn(mesh, detail='normals', color='white', smooth_shading=True, max_error=1.0)
    plain, actor = drawn(mesh, large=False, color='white', smooth_shading=True)
    for added in (thing, actor):
        added.position, added.scale = (0.1, 0, 0), (1, 1, 1.5)
    view = {'eye': (0.2, -4.0, 2.8), 'focus': OVER['focus']}
    for plotter in (pl, plain):
        place(plotter, **view)
    assert np.abs(shot(pl) - shot(plain)).mean() < 4
    assert thing.report()['triangles'] < mesh.n_cells
