"""A hierarchy is the same mesh at every cut: whole, within its error, with what it was given."""

from dataclasses import fields

import numpy as np
import pytest
import pyvista as pv
import trimesh
from scipy.spatial import cKDTree

from pvibr.large.build import TriangleMesh, build_hierarchy
from pvibr.large.columns import Columns
from pvibr.large.cut import cell_pixels, gathered, patches_in_view
from pvibr.large.distribution import merge_points
from pvibr.large.hierarchy import NO_CELL, Hierarchy
from pvibr.large.scalars import scalars_of
from pvibr.large.simplified_cell import nearest_faces
from pvibr.large.sources import source_of
from pvibr.large.vertex_values import vertex_values
from tests.large.surfaces import folded, hierarchy_of, terrain, view_from, views_of, whole_cut

both = pytest.mark.parametrize('make', [terrain, folded])


def edge_counts(faces):
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], 2).reshape(-1, 2), axis=1)
    _, first, counts = np.unique(
        edges[:, 0].astype(np.int64) << 32 | edges[:, 1], return_index=True, return_counts=True
    )
    return edges[first], counts


def distances_to(points, faces, places):
    """Return distances of places from a mesh, by VTK."""
    mesh = pv.PolyData.from_regular_faces(np.asarray(points, float), faces)
    return np.linalg.norm(
        mesh.find_closest_cell(places, return_closest_point=True)[1] - places, axis=1
    )


def on_boundary(hierarchy, make, vertices):
    """Return the distances of vertices from the border of the full mesh."""
    mesh = make()
    edges, counts = edge_counts(mesh.regular_faces)
    border = np.asarray(mesh.points)[np.unique(edges[counts == 1])]
    return cKDTree(border).query(hierarchy.points[vertices] + hierarchy.origin)[0]


@both
def test_no_cut_has_an_open_edge_inside(make):
    """Edges are known by the numbers of their vertices: no distance decides what is shared."""
    hierarchy = hierarchy_of(make)
    sizes = set()
    for view in views_of(hierarchy, 12):
        patches = whole_cut(hierarchy, view)
        vertices, triangles = gathered(hierarchy, patches)
        faces = vertices[triangles]
        assert (np.diff(np.sort(faces, 1), axis=1) > 0).all(), 'a face without area'
        edges, counts = edge_counts(faces)
        assert (counts > 2).sum() <= 2, 'more than a fold or two, where faces lie on each other'
        pixels = cell_pixels(hierarchy, view)
        made_by = hierarchy.patch_cells[patches, 0]
        error = hierarchy.errors[made_by[made_by != NO_CELL]].max(initial=0.0)
        assert (pixels[made_by[made_by != NO_CELL]] <= 1).all()
        far = on_boundary(hierarchy, make, np.unique(edges[counts == 1]))
        spacing = np.linalg.norm(np.ptp(hierarchy.points[edges[counts == 1]], axis=1), axis=1)
        assert far.max() <= 2 * error + spacing.max()
        sizes.add(len(faces))
    assert len(sizes) > 5


@both
def test_each_place_is_covered_once(make):
    """The area of a cut is that of the mesh, about, and each cut is a partition."""
    hierarchy = hierarchy_of(make)
    full = make().area
    for view in views_of(hierarchy, 4, seed=2):
        vertices, triangles = gathered(hierarchy, whole_cut(hierarchy, view))
        corners = hierarchy.points[vertices[triangles]].astype(float)
        sides = corners[:, 1:] - corners[:, :1]
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2
        assert 0.75 * full < area < 1.05 * full


@both
def test_points_of_the_mesh_are_within_the_error(make):
    """An independent distance, of random points that the build never saw."""
    hierarchy, mesh = hierarchy_of(make), make()
    full = trimesh.Trimesh(np.asarray(mesh.points), mesh.regular_faces, process=False)
    points, _ = trimesh.sample.sample_surface(full, 5000, seed=5)
    over: list = []
    for view in views_of(hierarchy, 4, seed=1):
        vertices, triangles = gathered(hierarchy, whole_cut(hierarchy, view))
        faces = vertices[triangles]
        distances = distances_to(hierarchy.points + hierarchy.origin, faces, points)
        gaps = np.linalg.norm(points - hierarchy.origin - view.eye, axis=1)
        pixels = distances * view.pixels_per_unit / gaps
        over.append((pixels > 1).mean())
        assert pixels.max() < 3.5
        assert np.sqrt((pixels**2).mean()) < 0.3
    assert np.mean(over) <= 5e-4


@both
def test_full_cut_is_the_mesh(make):
    hierarchy, mesh = hierarchy_of(make), make()
    patches = whole_cut(hierarchy, view_from(hierarchy, hierarchy.origin), 0.0)
    assert np.array_equal(patches, hierarchy.full_patches)
    vertices, triangles = gathered(hierarchy, patches)
    corners = hierarchy.points[vertices[triangles]] + hierarchy.origin
    order = hierarchy.mesh_cells
    assert np.array_equal(np.sort(order), np.arange(mesh.n_cells))
    expected = np.asarray(mesh.points)[mesh.regular_faces[order]]
    # Corners may start at another one, not turn the other way.
    np.testing.assert_allclose(corners, expected, atol=1e-6)


def test_fewer_triangles_from_farther_away():
    hierarchy = hierarchy_of(terrain)
    counts = []
    for height in (0.1, 0.5, 2.0, 10.0):
        patches = whole_cut(hierarchy, view_from(hierarchy, (0.5, 0.5, height)))
        counts.append(hierarchy.triangle_counts[patches].sum())
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < 0.1 * counts[0]


def test_errors_never_fall_towards_the_coarse():
    hierarchy = hierarchy_of(folded)
    for made_by, replaced_by in hierarchy.patch_cells:
        if made_by != NO_CELL and replaced_by != NO_CELL:
            assert hierarchy.errors[made_by] <= hierarchy.errors[replaced_by]
            low, high = hierarchy.boxes[made_by]
            outer_low, outer_high = hierarchy.boxes[replaced_by]
            assert (outer_low <= low).all()
            assert (high <= outer_high).all()


def test_same_mesh_same_hierarchy():
    mesh = source_of(folded(40)).mesh
    first, second = build_hierarchy(mesh), build_hierarchy(mesh)
    for name, array in first.to_arrays().items():
        np.testing.assert_array_equal(array, getattr(second, name), err_msg=name)


def test_averages_are_by_area_and_know_nan():
    hierarchy = hierarchy_of(terrain)
    mesh = terrain()
    ones = hierarchy.averaged(np.ones(mesh.n_points))
    np.testing.assert_allclose(ones, 1, rtol=1e-6)
    places = hierarchy.averaged(mesh.points - hierarchy.origin)
    error = np.linalg.norm(places - hierarchy.points, axis=1)
    assert error.max() < 0.3
    assert np.median(error) < 0.01
    values = np.where(np.arange(mesh.n_points) == 17, np.nan, 2.0)
    means = hierarchy.averaged(values)[:, 0]
    assert np.isnan(means).sum() == 1
    assert np.nanmax(np.abs(means - 2)) < 1e-6


def test_far_from_the_origin_as_at_it():
    mesh = terrain().copy()
    far = mesh.translate((500_000.0, 5_000_000.0, 0.0)).copy()
    far.points = mesh.points * 1000 + (500_000.0, 5_000_000.0, 0.0)
    hierarchy = build_hierarchy(source_of(far).mesh)
    here = build_hierarchy(
        TriangleMesh(mesh.points * 1000, mesh.regular_faces, np.arange(mesh.n_cells))
    )
    assert len(hierarchy.errors) == len(here.errors)
    np.testing.assert_allclose(hierarchy.points, here.points, atol=1e-4)


def test_soup_is_welded_and_faces_without_area_are_left_out():
    mesh = folded(40)
    corners = np.asarray(mesh.points)[mesh.regular_faces]
    faces = np.arange(3 * mesh.n_cells).reshape(-1, 3)
    faces = np.concatenate([[[0, 0, 1]], faces])
    soup = TriangleMesh(corners.reshape(-1, 3), faces, np.arange(len(faces)))
    hierarchy = build_hierarchy(soup)
    assert hierarchy.n_triangles == mesh.n_cells
    assert hierarchy.areas.size == len(np.unique(np.asarray(mesh.points, np.float32), axis=0))
    assert 0 not in hierarchy.mesh_cells
    coarsest = np.flatnonzero(hierarchy.patch_cells[:, 1] == NO_CELL)
    assert hierarchy.triangle_counts[coarsest].sum() < 0.3 * mesh.n_cells


def test_vertices_where_holes_meet_have_one_parent():
    """Two cells that share such a vertex alone may both merge it."""
    x, y = np.meshgrid(np.arange(120.0), np.arange(120.0))
    grid = pv.StructuredGrid(x, y, 5 * np.sin(x / 9))
    is_left = np.random.default_rng(0).random(grid.n_cells) < 0.6
    mesh = source_of(grid.extract_cells(is_left).extract_surface(algorithm=None)).mesh
    hierarchy = build_hierarchy(mesh)
    hierarchy.check()
    levels = np.searchsorted(hierarchy.level_starts, np.arange(len(hierarchy.points)), 'right')
    is_merged = hierarchy.parents >= 0
    assert (levels[hierarchy.parents[is_merged]] > levels[is_merged]).all()
    # Heights of vertices are those of what was merged into them.
    heights = hierarchy.averaged(mesh.points[:, 2])[:, 0]
    off = np.abs(heights - hierarchy.points[:, 2] - hierarchy.origin[2])
    assert np.nanmax(off) < 4
    assert np.isnan(off).mean() < 2e-4


def test_many_triangles_and_none_with_an_area():
    mesh = TriangleMesh(np.ones((9, 3)), np.zeros((150_000, 3), int), np.arange(150_000))
    with pytest.raises(ValueError, match='none with an area'):
        build_hierarchy(mesh)


def test_triangles_that_share_nothing_go_only_where_they_are_small():
    rng = np.random.default_rng(0)
    corners = rng.random((30_000, 1, 3)) + 0.01 * rng.random((30_000, 3, 3))
    faces = np.arange(90_000).reshape(-1, 3)
    hierarchy = build_hierarchy(TriangleMesh(corners.reshape(-1, 3), faces, np.arange(30_000)))
    assert len(hierarchy.full_patches) > 4
    counts = [
        hierarchy.triangle_counts[whole_cut(hierarchy, view_from(hierarchy, (0, 0, z)))].sum()
        for z in (1.5, 1000)
    ]
    assert counts[0] == 30_000
    assert counts[1] < 10_000


@pytest.mark.parametrize('rows', [1, 2, 100])
def test_merged_points_keep_their_order(rows, tmp_path):
    points = np.array([(1, 0, 0), (0, 0, 0), (1, 0, -0.0), (2, 0, 0), (0, 0, 0)], float)
    for columns in (Columns(), Columns(tmp_path)):
        merge_points(columns, points, np.zeros(3), rows)
        np.testing.assert_array_equal(columns['base.points'][:], points[[0, 1, 3]])
        np.testing.assert_array_equal(columns['vertex_of_point'][:], [0, 1, 0, 2, 1])
        columns.close()


def test_nearest_faces_by_an_independent_distance():
    ball = pv.Sphere(theta_resolution=30, phi_resolution=30)
    places = np.random.default_rng(0).normal(size=(200, 3)) * 0.05 + ball.points[:800:4]
    nearest, distances = nearest_faces(places, np.asarray(ball.points, float), ball.regular_faces)
    expected = distances_to(ball.points, ball.regular_faces, places)
    assert (distances >= expected - 1e-6).all()
    assert np.median(distances - expected) < 1e-6
    assert nearest.max() < ball.n_cells


def test_culled_patches_are_out_of_view():
    hierarchy = hierarchy_of(terrain)
    view = view_from(hierarchy, (0.5, -1, 0.5))
    patches = whole_cut(hierarchy, view)
    for scale, kept in ((1.0, 1.0), (0.2, 0.7)):
        clip = np.diag([1 / scale, 1 / scale, 1.0, 1.0])
        seen = patches_in_view(
            hierarchy, patches, type(view)(view.eye, clip, 1.0, 1e-4, is_parallel=True)
        )
        centers = hierarchy.patch_boxes.mean(1)
        is_inside = (np.abs(centers[patches, :2]) <= scale).all(1)
        assert np.isin(patches[is_inside], seen).all()
        assert len(seen) <= kept * len(patches)


@pytest.mark.parametrize(
    'name', ['vertices', 'triangles', 'patch_cells', 'vertex_starts', 'points']
)
def test_arrays_that_do_not_belong_together_are_found(name):
    arrays = hierarchy_of(folded).to_arrays()
    assert Hierarchy.of_arrays(arrays).n_triangles == folded().n_cells
    broken = arrays[name].copy()
    if name == 'points':
        broken = broken[:-1]
    else:
        broken[-1] = np.iinfo(broken.dtype).max
    with pytest.raises(ValueError, match='belong together'):
        Hierarchy.of_arrays(arrays | {name: broken})


@pytest.mark.parametrize('name', [field.name for field in fields(Hierarchy)])
def test_arrays_of_another_kind_are_found(name):
    arrays = hierarchy_of(folded).to_arrays()
    array = arrays[name]
    others = (
        array[None],
        np.full(len(array), 'x'),
        array.astype(np.int64 if array.dtype.kind != 'i' else np.float64),
    )
    for other in others:
        with pytest.raises(ValueError, match='belong together'):
            Hierarchy.of_arrays(arrays | {name: other})


@pytest.mark.parametrize('seed', [0, 1])
def test_every_vertex_has_a_value_where_holes_meet(seed):
    """Cells that meet at one vertex may each merge it: what has none has that of the nearest."""
    mesh = terrain(300)
    is_kept = np.random.default_rng(seed).random(mesh.n_cells) > 0.1
    mesh = pv.PolyData.from_regular_faces(mesh.points, mesh.regular_faces[is_kept])
    hierarchy = build_hierarchy(source_of(mesh).mesh)
    heights = np.asarray(mesh.points)[:, 2]
    values = hierarchy.averaged(heights)[hierarchy.vertices, 0]
    own = hierarchy.points[hierarchy.vertices, 2] + hierarchy.origin[2]
    assert np.abs(values - own).max() < 0.05
    words = np.where(heights > 0, 'high', 'low')
    source = source_of(mesh)
    kinds = vertex_values(hierarchy, scalars_of(source, words, {})).by_vertex
    assert np.isfinite(kinds[hierarchy.vertices]).all()
