import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr.meshes.parts import as_parts
from pvibr.substitutes.cloud_maths import Planes, greedy_planes, kmeans_planes
from pvibr.substitutes.cloud_texture import largest_scale, shelves


def triangles(mesh):
    mesh = mesh.triangulate()
    return np.asarray(mesh.points, float), mesh.regular_faces


MESHES = {
    'ball': pv.Sphere(),
    'torus': pv.ParametricTorus(u_res=40, v_res=20, w_res=20),
    'box': pv.Cube().rotate_x(20).rotate_z(37),
    'leaf': pv.Plane(i_resolution=3, j_resolution=3).rotate_y(70),
    'airplane': pv.examples.load_airplane(),
}


@pytest.mark.parametrize('name', MESHES)
@pytest.mark.parametrize('share', [0.02, 0.1])
def test_every_corner_is_within_the_bound(name, share):
    points, faces = triangles(MESHES[name])
    epsilon = share * np.linalg.norm(np.ptp(points, axis=0))
    planes = greedy_planes(points, faces, epsilon)
    assert planes.displacements(points, faces).max() <= epsilon
    assert np.allclose(np.linalg.norm(planes.normals, axis=1), 1)
    assert set(planes.owner) == set(range(len(planes)))


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.2), st.sampled_from([1, 20, 200]))
def test_every_corner_of_any_triangles_is_within_the_bound(seed, share, count):
    rng = np.random.default_rng(seed)
    sizes = rng.choice([1e-3, 0.05, 1.0], (count, 1, 1))
    flat = rng.choice([0.0, 1.0], (count, 1, 3), p=[0.3, 0.7])  # walls, lines and points too
    points = rng.normal(size=(count, 1, 3)) + sizes * flat * rng.normal(size=(count, 3, 3))
    points, faces = points.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)
    epsilon = share * np.linalg.norm(np.ptp(points, axis=0)) + 1e-9
    planes = greedy_planes(points, faces, epsilon)
    assert planes.displacements(points, faces).max() <= epsilon


@pytest.mark.parametrize('share', [0.01, 0.02, 0.04])
def test_every_corner_of_a_building_is_within_the_bound(share, data_dir):
    (part,) = as_parts(data_dir / 'meshes/city/building_H.gltf')
    points, faces = triangles(part.mesh)
    epsilon = share * np.linalg.norm(np.ptp(points, axis=0))
    planes = greedy_planes(points, faces, epsilon)
    assert planes.displacements(points, faces).max() <= epsilon


@pytest.mark.parametrize('scale', [1e-9, 1e9])
@pytest.mark.parametrize('offset', [0.0, 1e3])
def test_scale_and_place_do_not_matter(scale, offset):
    points, faces = triangles(MESHES['torus'])
    points = (points + offset) * scale
    epsilon = 0.03 * np.linalg.norm(np.ptp(points, axis=0))
    planes = greedy_planes(points, faces, epsilon)
    assert planes.displacements(points, faces).max() <= epsilon * (1 + 1e-6)
    assert len(planes) < 40


def test_a_box_has_six_planes_on_its_walls():
    points, faces = triangles(MESHES['box'])
    planes = greedy_planes(points, faces, 0.05)
    assert len(planes) == 6
    assert planes.displacements(points, faces).max() < 1e-7


def test_a_larger_bound_needs_fewer_planes():
    points, faces = triangles(MESHES['ball'])
    counts = [len(greedy_planes(points, faces, e)) for e in (0.02, 0.05, 0.15)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 2 * counts[-1]


def test_triangles_without_area_have_a_plane_too():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5.0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [3, 3, 3], [0, 1, 4]])
    planes = greedy_planes(points, faces, 0.01)
    assert planes.displacements(points, faces).max() <= 0.01
    assert np.isfinite(planes.normals).all()


@pytest.mark.parametrize('count', [1, 4, 50])
def test_kmeans_has_so_many_planes_at_most(count):
    points, faces = triangles(MESHES['torus'])
    planes = kmeans_planes(points, faces, count)
    assert 1 <= len(planes) <= count
    again = kmeans_planes(points, faces, count)
    assert np.array_equal(planes.normals, again.normals)


def test_more_means_are_nearer():
    points, faces = triangles(MESHES['ball'])
    mean = [kmeans_planes(points, faces, k).displacements(points, faces).mean() for k in (4, 40)]
    assert mean[1] < mean[0] / 2


def test_distances_have_a_side():
    planes = Planes(np.array([[0, 0, 1.0], [1, 0, 0]]), np.array([1.0, 0]), np.zeros(0, int))
    assert planes.distances([2, 0, 3]).tolist() == [2, 2]


@pytest.mark.parametrize('seed', range(5))
def test_rectangles_do_not_overlap(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.uniform(0.01, 1, (60, 2)) ** 2
    scale, texels, corners = largest_scale(sizes, 256, 2)
    taken = np.zeros((256, 256), int)
    for (x, y), (w, h) in zip(corners, texels, strict=True):
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1
    assert taken.sum() == texels.prod(1).sum() > 0.6 * 256**2
    assert (texels >= sizes * scale + 4 - 1e-6).all()


def test_what_is_wider_than_its_shelf_has_no_height():
    assert shelves([(9, 1)], 8)[1] > 1000
