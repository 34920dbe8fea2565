"""Values of cells: as on the original faces where these show, means by area elsewhere."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.large import stored
from pvibr.large.original_cells import VISIBLE, edge_lengths, with_visible_cells
from pvibr.large.scalars import scalars_of
from pvibr.large.sources import source_of
from pvibr.large.vertex_values import vertex_values
from tests.large.looks import FAR, NEAR, OVER, blocks, drawn, pictures
from tests.large.surfaces import hierarchy_of, terrain
from tests.pictures import off, shot
from tests.refusals import refused


def with_cells():
    """Return the terrain with arrays of its cells of all kinds."""
    mesh = terrain().copy()
    centers, rng = mesh.cell_centers().points, np.random.default_rng(3)
    mesh.clear_data()
    mesh['height'] = np.asarray(mesh.points)[:, 2]
    wave = np.sin(20 * centers[:, 0]) + 0.2 * rng.random(len(centers))
    mesh.cell_data['wave'] = wave
    mesh.cell_data['holes'] = np.where(np.hypot(*(centers[:, :2].T - 0.5)) < 0.2, np.nan, wave)
    mesh.cell_data['colours'] = np.rint(255 * (wave[:, None] + 1) / 2.2 * (1, 0.5, 0)).astype('u1')
    mesh.cell_data['kind'] = np.floor(5 * centers[:, 1]).astype(int)
    mesh.cell_data['word'] = np.array(['oak', 'ash', 'elm'])[
        np.floor(2.9 * centers[:, 1]).astype(int)
    ]
    mesh.cell_data['is high'] = centers[:, 2] > 0
    mesh.cell_data['flow'] = np.c_[wave, centers[:, :2]]
    mesh.set_active_scalars('wave', preference='cell')
    return mesh


LOOKS = {
    'active': {},
    'by name': {'scalars': 'wave', 'cmap': 'viridis', 'clim': [-1, 1]},
    'smooth': {'scalars': 'wave', 'smooth_shading': True},
    'NaN': {'scalars': 'holes', 'nan_color': 'red'},
    'colours': {'scalars': 'colours', 'rgb': True},
    'categories': {'scalars': 'kind', 'categories': True},
    'words': {'scalars': 'word'},
    'truth': {'scalars': 'is high'},
    'norm': {'scalars': 'flow'},
    'component': {'scalars': 'flow', 'component': 1},
    'array': {'scalars': np.arange(terrain().n_cells)},
    'not interpolated': {'scalars': 'wave', 'interpolate_before_map': False},
    'of points': {'scalars': 'height', 'preference': 'cell'},
}


@pytest.mark.parametrize('look', LOOKS)
def test_without_error_they_are_as_on_the_mesh(look):
    picture, truth, thing = pictures(with_cells(), max_error=0.0, **LOOKS[look])
    assert (off(picture, truth) > 3).mean() < 3e-3
    assert thing.report()['triangles'] > 0.9 * thing.n_triangles


@pytest.mark.parametrize('look', [n for n in LOOKS if n not in ('not interpolated', 'array')])
def test_from_afar_they_are_means(look):
    picture, truth, thing = pictures(with_cells(), max_error=1.0, view=FAR, **LOOKS[look])
    assert thing.report()['triangles'] < 0.4 * thing.n_triangles
    assert np.abs(blocks(picture) - blocks(truth)).mean() < 2


def test_faces_that_show_have_their_own_values():
    picture, truth, thing = pictures(with_cells(), view=NEAR, scalars='wave', lighting=False)
    assert thing.report()['triangles'] < thing.n_triangles
    foreground = np.s_[120:]
    assert (off(picture[foreground], truth[foreground]) > 8).mean() < 0.02


def test_flat_faces_show_as_well():
    """Where nothing is lost by fewer triangles but the values, they stay."""
    grid = pv.Plane(i_resolution=120, j_resolution=120)
    grid.cell_data['checks'] = np.add(*np.divmod(np.arange(grid.n_cells), 120)) % 2
    view = {'eye': (0.0, -0.4, 0.5), 'focus': (0.0, 0.0, 0.0)}
    picture, truth, _ = pictures(grid, view=view, scalars='checks', lighting=False)
    assert (off(picture, truth) > 8).mean() < 0.01


def test_means_are_by_area():
    hierarchy, mesh = hierarchy_of(terrain), with_cells()
    scalars = scalars_of(source_of(mesh), 'wave', {})
    values = vertex_values(hierarchy, scalars)
    triangles = hierarchy.full_triangles
    corners = hierarchy.points[triangles].astype(float)
    areas = np.linalg.norm(np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))), axis=1)
    wave = mesh.cell_data['wave'][hierarchy.mesh_cells]
    np.testing.assert_allclose(values.by_triangle, wave, rtol=1e-6)
    weights, sums = (
        np.bincount(triangles.ravel(), np.repeat(w, 3), len(hierarchy.points))
        for w in (areas, areas * wave)
    )
    for first, last, children in hierarchy.merges():
        parents = hierarchy.parents[children]
        assert first <= parents.min() <= parents.max() < last
        np.add.at(weights, parents, weights[children])
        np.add.at(sums, parents, sums[children])
    is_used = weights > 0
    expected = sums[is_used] / weights[is_used]
    np.testing.assert_allclose(values.by_vertex[is_used], expected, atol=1e-5)


def test_categories_stay_categories():
    hierarchy, mesh = hierarchy_of(terrain), with_cells()
    scalars = scalars_of(source_of(mesh), 'kind', {'categories': True})
    kinds = vertex_values(hierarchy, scalars).by_vertex
    used = np.unique(hierarchy.vertices)
    assert set(np.unique(kinds[used])) == {0, 1, 2, 3, 4}
    # Most of a vertex of any level is of the kind of its place.
    place = np.floor(5 * (hierarchy.points[used, 1] + hierarchy.origin[1]))
    assert (kinds[used] == np.clip(place, 0, 4)).mean() > 0.9


def test_errors_grow_to_the_size_of_faces():
    hierarchy = hierarchy_of(terrain)
    lengths = edge_lengths(hierarchy)
    seen = with_visible_cells(hierarchy, lengths)
    assert (seen.errors >= hierarchy.errors).all()
    for (maker, owner), length in zip(hierarchy.patch_cells, lengths, strict=True):
        if owner >= 0:
            below = length / VISIBLE if maker < 0 else seen.errors[maker]
            assert seen.errors[owner] >= below
    step = 1 / 179
    assert step < np.median(lengths[hierarchy.full_patches]) < 2.5 * step


def test_set_anew_of_points_and_cells():
    mesh = with_cells()
    pl, thing = drawn(mesh, max_error=0.0, scalars='height')
    for scalars in ('holes', 'height', mesh.cell_data['wave'] ** 2, 'word'):
        thing.set_scalars(scalars)
        other, _ = drawn(mesh, large=False, scalars=scalars)
        assert (off(shot(pl), shot(other)) > 3).mean() < 3e-3
    refused('one value per point', thing.set_scalars, np.zeros(3), kind=ValueError)
    refused('component', drawn, mesh, scalars='flow', component=3, kind=ValueError)
    refused('preference', drawn, mesh, scalars='wave', preference='face', kind=ValueError)


def test_values_that_could_be_of_both():
    ball = pv.Icosphere(nsub=3)
    strip = ball.extract_cells(np.arange(ball.n_points)).extract_surface(
        algorithm='dataset_surface'
    )
    mesh = pv.PolyData(
        np.r_[strip.points, np.zeros((strip.n_cells - strip.n_points, 3))], strip.faces
    )
    assert mesh.n_points == mesh.n_cells
    values = np.random.default_rng(0).random(mesh.n_cells)
    for preference in ('point', 'cell'):
        picture, truth, _ = pictures(
            mesh,
            max_error=0.0,
            scalars=values,
            preference=preference,
            view={'eye': (2, 2, 2), 'focus': (0, 0, 0)},
        )
        assert (off(picture, truth) > 3).mean() < 3e-3


def test_bar_of_words():
    pl, thing = drawn(with_cells(), scalars='word', show_scalar_bar=True)
    assert list(pl.scalar_bars.keys()) == ['word']
    table = thing.mapper.lookup_table
    assert list(table.annotations.values()) == ['ash', 'elm', 'oak']
    assert thing.mapper.scalar_range == (-0.5, 2.5)


def test_file_keeps_them(tmp_path):
    mesh = with_cells()
    path = mesh.ibr.large(tmp_path / 'a.pvl', progress=False)
    _, source = stored.load(path)
    assert set(source.cell_arrays) == set(mesh.cell_data.keys())
    assert source.active == 'wave'
    for look in ({}, {'scalars': 'word'}, {'scalars': mesh.cell_data['kind']}):
        (from_file, _), (from_mesh, _) = (drawn(m, **look) for m in (path, mesh))
        np.testing.assert_array_equal(shot(from_file), shot(from_mesh))


def test_cells_of_volumes_colour_their_surface():
    grid = pv.ImageData(dimensions=(40, 40, 4), spacing=(1 / 39, 1 / 39, 0.02))
    grid.cell_data['number'] = np.arange(grid.n_cells)
    picture, truth, _ = pictures(grid, max_error=0.0)
    assert (off(picture, truth) > 3).mean() < 3e-3


def test_cut_has_them():
    _, thing = drawn(with_cells(), view=OVER, scalars='wave')
    assert thing.cut(max_error=0).array_names[0] == 'wave'


def test_transform_is_an_argument():
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    _, thing = drawn(terrain(), user_matrix=matrix)
    np.testing.assert_allclose(thing.bounds, 2 * np.array(terrain().bounds), atol=1e-5)
    refused('user_matrix', drawn, terrain(), user_matrix=np.eye(3), kind=ValueError)
