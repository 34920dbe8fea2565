"""Lighter meshes: where they lie, and what of their look they keep."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts
from pvibr.meshes.surface_distance import Surface, hausdorff
from tests.makers import soup


def light(mesh, share=0.25, **looks):
    """Return the triangles of a mesh and of a simplified one."""
    (part,) = as_parts(mesh, **looks)
    return part.mesh, lighter(part, share).mesh


def moved(pair):
    """Return the distance between two meshes, relative to the size of the first."""
    surfaces = [Surface(m.points, m.regular_faces) for m in pair]
    return hausdorff(*surfaces) / np.ptp(pair[0].points, axis=0).max()


def corners(mesh, name):
    """Return the places and the values of an array at the corners of triangles."""
    faces = mesh.regular_faces
    return np.asarray(mesh.points, float)[faces], np.asarray(mesh.point_data[name])[faces]


def facets(places):
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def ball(n=50):
    return pv.Sphere(theta_resolution=n, phi_resolution=n)


def prism():
    return pv.Cylinder(resolution=6, capping=True).triangulate().subdivide(4, 'linear')


def test_smooth_surfaces_stay_in_place_and_smooth():
    full, less = light(ball(), smooth_shading=True)
    assert less.n_cells == pytest.approx(0.25 * full.n_cells, rel=0.1)
    assert moved((full, less)) < 0.01
    places, normals = corners(less, 'Normals')
    out = places / np.linalg.norm(places, axis=2, keepdims=True)
    assert (normals * out).sum(2).min() > 0.99


def test_a_mesh_whose_winding_is_inside_out_keeps_it():
    _, less = light(ball().flip_faces(), smooth_shading=False)
    places = np.asarray(less.points, float)[less.regular_faces]
    assert (facets(places) * places.mean(1)).sum(1).max() < 0
    turned = ball()
    turned.point_data.active_normals = -turned.points
    (part,) = as_parts(turned)
    part.actor.prop.interpolation = 'Gouraud'
    places, normals = corners(lighter(part, 0.25).mesh, turned.point_data.active_normals_name)
    assert (facets(places) * places.mean(1)).sum(1).min() > 0
    assert (normals.sum(1) * places.mean(1)).sum(1).max() < 0


def test_flat_surfaces_stay_flat_and_sharp():
    full, less = light(prism(), 1 / 16)
    assert less.n_cells < full.n_cells / 12
    assert moved((full, less)) < 1e-3
    assert less.point_data.active_normals is None


def test_creases_of_smooth_surfaces_stay_creases():
    can = pv.Cylinder(resolution=60, capping=True, height=1).triangulate().subdivide(2, 'linear')
    full, less = light(can, smooth_shading=True, split_sharp_edges=True)
    assert moved((full, less)) < 0.005
    places, normals = corners(less, 'Normals')
    cap = np.abs(facets(places)[:, 0]) > 0.999
    areas = np.linalg.norm(np.cross(*(places[cap, k] - places[cap, 0] for k in (1, 2))), axis=1)
    wrong = (np.abs(normals[cap][..., 0]) < 0.999).mean(1)
    assert (areas * wrong).sum() < 0.005 * areas.sum()  # slivers along the rim
    round_ = places[~cap] * [0, 1, 1]
    round_ /= np.linalg.norm(round_, axis=2, keepdims=True)
    assert np.percentile((normals[~cap] * round_).sum(2), 1) > 0.98


@pytest.mark.parametrize('looks', [{}, {'smooth_shading': True}])
def test_triangles_that_share_no_points_are_a_surface(looks):
    full, less = light(soup(ball()), **looks)
    assert less.n_cells == pytest.approx(0.25 * full.n_cells, rel=0.1)
    assert moved((full, less)) < 0.01
    assert less.n_points < less.n_cells


def test_texture_coordinates_keep_their_seam():
    tube = pv.Plane(i_resolution=60, j_resolution=30).triangulate()
    u, v = tube.active_texture_coordinates.T.astype(float)
    angle = 2 * np.pi * u
    points = np.stack([np.cos(angle), np.sin(angle), 3 * v], 1)
    mesh = pv.PolyData.from_regular_faces(points, tube.regular_faces)
    mesh.active_texture_coordinates = np.stack([u, v], 1).astype(np.float32)
    full, less = light(mesh)
    assert less.n_cells < 0.3 * full.n_cells
    places, at = corners(less, less.point_data.active_texture_coordinates_name)
    true = np.arctan2(places[..., 1], places[..., 0]) / (2 * np.pi) % 1
    off = np.abs(at[..., 0] - true)
    assert np.minimum(off, 1 - off).max() < 0.02  # 0 and 1 are the same place
    assert np.ptp(at[..., 0], axis=1).max() < 0.5  # no triangle runs backwards round the tube
    np.testing.assert_allclose(at[..., 1], places[..., 2] / 3, atol=0.02)


def test_points_that_no_triangle_uses_do_no_harm():
    mesh = ball()
    mesh['paint'] = mesh.points[:, 0].copy()
    half = pv.PolyData.from_regular_faces(mesh.points, mesh.regular_faces[::2])
    half['paint'] = mesh['paint']
    full, less = light(half, scalars='paint')
    assert 0 < less.n_cells < full.n_cells


@pytest.mark.parametrize('count', [1, 2, 3])
def test_the_last_triangles_of_a_part_are_not_simplified_to_none(count):
    points = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 9], [0, 1, 9], [0.5, 0, 9.0]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]])[:count]
    (part,) = as_parts(pv.PolyData.from_regular_faces(points, faces))
    found = lighter(part, 0.25)
    assert found is None or found.mesh.n_cells > 0


@pytest.mark.parametrize('kind', [np.float64, np.uint8])
def test_point_arrays_are_kept_in_their_type(kind):
    mesh = ball()
    mesh['paint'] = np.rint(127 + 250 * mesh.points).astype(kind)
    _, less = light(mesh, scalars='paint', rgb=True)
    assert less['paint'].dtype == kind
    np.testing.assert_allclose(less['paint'], 127 + 250 * less.points, atol=8)


def test_cell_arrays_are_those_of_the_nearest_triangle():
    mesh = ball()
    mesh.cell_data['side'] = (mesh.cell_centers().points[:, 0] > 0).astype(float)
    _, less = light(mesh, scalars='side')
    x = less.cell_centers().points[:, 0]
    clear = np.abs(x) > 0.05
    np.testing.assert_array_equal(less.cell_data['side'][clear], x[clear] > 0)


def test_cell_arrays_are_kept_where_points_are_split_at_creases():
    can = pv.Cylinder(resolution=60).triangulate().subdivide(2)
    can = can.compute_normals(split_vertices=True, feature_angle=30.0)
    can['side'] = (np.abs(can.cell_centers().points[:, 0]) < 0.49).astype(float)
    (part,) = as_parts(can)
    part.actor.prop.interpolation = 'Phong'
    mesh = lighter(part, 0.25).mesh
    middle = np.abs(mesh.cell_centers().points[:, 0])
    assert (mesh.cell_data['side'][middle < 0.45] == 1).all()
    assert (mesh.cell_data['side'][middle > 0.499] == 0).all()


def test_pages_of_a_book_are_simplified_though_they_share_an_edge():
    page = pv.Plane(i_size=1, j_size=1, i_resolution=16, j_resolution=16).translate((0.5, 0, 0))
    book = pv.merge([page.rotate_y(40.0 * k) for k in range(3)]).extract_surface(algorithm=None)
    full, less = light(book.triangulate())
    assert less.n_cells < 0.3 * full.n_cells
    assert moved((full, less)) < 1e-4


def test_the_distance_of_surfaces_is_that_of_their_nearest_places():
    rng = np.random.default_rng(2)
    surface = Surface(rng.normal(size=(30, 3)), rng.permutation(30).reshape(10, 3))
    places = rng.normal(size=(40, 3)) * 2
    found, weights, away = surface.nearest(places)
    u, v = np.meshgrid(*[np.linspace(0, 1, 61)] * 2)
    grid = np.stack([u, v, 1 - u - v], -1)[u + v <= 1 + 1e-9]
    tried = np.einsum('gk,mkj->mgj', grid, surface.corners)
    brute = np.linalg.norm(places[:, None, None] - tried, axis=3).min((1, 2))
    assert (away <= brute + 1e-6).all()
    np.testing.assert_allclose(away, brute, atol=0.05)
    at = np.einsum('ki,kij->kj', weights, surface.corners[found])
    np.testing.assert_allclose(np.linalg.norm(at - places, axis=1), away, atol=1e-6)
