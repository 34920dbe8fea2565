"""Meshes and poses that are no good ones: sheared, mirrored, with triangles of no area."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from pyvista import examples

import pvibr
from pvibr.animation import FigureMesh, Skeleton
from tests.browser import everything
from tests.pictures import off, place, plotter, shot

SIZE = (120, 90)
POINTS = np.array([[-1.6, 0, 0], [0, 0, 0], [1.6, 0, 0]])
#: What a pose does to an item.
LINEAR = {
    'mirrored': np.diag([-1.0, 1, 1]),
    'turned inside out': -np.eye(3),
    'sheared': np.array([[1.0, 0.6, 0], [0, 1, 0.3], [0, 0, 1]]),
    'sheared and mirrored': np.array([[-1.0, 0.6, 0], [0, 1, 0], [0, 0.4, 0.7]]),
    'flat': np.diag([1.0, 0.5, 1e-3]),
}


def bean():
    """Return a mesh without any symmetry."""
    mesh = pv.Sphere(radius=0.6, theta_resolution=24, phi_resolution=24)
    mesh.points[:, 2] += 0.5 * mesh.points[:, 0] ** 2 + 0.3 * mesh.points[:, 1]
    return mesh


def figure(mesh):
    return pvibr.Figure([FigureMesh(mesh, node=0)], Skeleton([-1], np.eye(4)[None]))


def matrices(linear):
    found = np.tile(np.eye(4), (len(POINTS), 1, 1))
    found[:, :3, :3], found[:, :3, 3] = linear, POINTS
    return found


def seen(fill, lighting='light kit'):
    pl = plotter(SIZE, lighting=lighting)
    pl.set_background('white')
    with everything.lighter():
        fill(pl)
        place(pl, (0.7, -6, 2), (0, 0, 0.1))
        pl.show(auto_close=False)
        shot(pl)
        found = shot(pl)
    assert {row.state for row in pl.ibr.report().rows} <= {'ran'}, pl.ibr.report()
    pl.close()
    return found


def copies(linear, smooth_shading=True):
    """Return what adds transformed meshes, whose normals are outwards."""

    def fill(pl):
        for pose in matrices(linear):
            mesh = bean().transform(pose, inplace=False)
            if np.linalg.det(pose) < 0:
                mesh.flip_faces(inplace=True)
            pl.add_mesh(mesh, color='tan', smooth_shading=smooth_shading)

    return fill


def actors(linear):
    """Return what adds actors with poses of their own."""

    def fill(pl):
        for pose in matrices(linear):
            pl.add_mesh(bean(), color='tan', smooth_shading=True).user_matrix = pose

    return fill


#: Things that take poses of meshes.
POSED = {
    'instances': lambda pl, poses: pl.ibr.add_instances(
        bean(), poses, color='tan', smooth_shading=True
    ),
    'crowd': lambda pl, poses: pl.ibr.add_animated(
        figure(bean()), poses, color='tan', max_error=0.5
    ),
    'figures': lambda pl, poses: [
        setattr(
            pl.ibr.add_animated(figure(bean()), color='tan', name=str(k)),
            'user_matrix',
            pose,
        )
        for k, pose in enumerate(poses)
    ],
    'large meshes': lambda pl, poses: [
        setattr(
            pl.ibr.add_large_mesh(
                bean(), color='tan', smooth_shading=True, cache=False, name=str(k)
            ),
            'user_matrix',
            pose,
        )
        for k, pose in enumerate(poses)
    ],
}


@pytest.mark.sampled
@pytest.mark.parametrize('name', POSED)
@pytest.mark.parametrize('kind', LINEAR)
def test_poses(name, kind):
    """Each is as a copy of the mesh that was transformed, or as VTK's actor in that pose."""
    linear = LINEAR[kind]
    if name == 'large meshes':
        expected = seen(actors(linear))
    else:
        expected = seen(copies(linear, name == 'instances'))
    found = seen(lambda pl: POSED[name](pl, matrices(linear)))
    differ = off(expected, found)
    assert (differ > 25).mean() < 0.01
    assert differ.mean() < 1.0


def test_figures_of_meshes_with_normals_of_cells():
    """Those of points move with the figure."""
    poses = matrices(np.eye(3))
    found, expected = (
        seen(lambda pl, mesh=mesh: pl.ibr.add_animated(figure(mesh), poses, color='tan'))
        for mesh in (bean().compute_normals(), bean().compute_normals(cell_normals=False))
    )
    assert (off(expected, found) > 25).mean() < 0.01


def damaged(mesh):
    """Return a mesh with triangles of no area, points twice and points of no triangle."""
    faces, n = mesh.regular_faces, mesh.n_points
    points = np.concatenate([mesh.points, mesh.points[:50], [[0, 0, 0.1]] * 3])
    twins = np.where(faces[::3] < 50, faces[::3] + n, faces[::3])  # the same places
    none = np.array([[0, 0, 0], [5, 5, 9], [4, 4 + n, 7], [n + 1, n + 1, n + 1]])
    rest = np.delete(faces, np.s_[::3], axis=0)
    return pv.PolyData.from_regular_faces(points, np.concatenate([twins, none, rest]))


def photos(pl, mesh):
    K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
    camera = pvibr.Pinhole(K, np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 5.0], (2048, 1024))
    pl.ibr.add_photos(mesh, pvibr.Photo('a.jpg', camera, examples.mapfile))


#: Things that are made of a mesh.
OF_MESHES = {
    'instances': lambda pl, mesh: pl.ibr.add_instances(mesh, POINTS, color='tan'),
    'large mesh': lambda pl, mesh: pl.ibr.add_large_mesh(mesh, color='tan', cache=False),
    'figure': lambda pl, mesh: pl.ibr.add_animated(figure(mesh), color='tan'),
    'crowd': lambda pl, mesh: pl.ibr.add_animated(figure(mesh), POINTS, color='tan'),
    'impostor': lambda pl, mesh: pl.ibr.add_impostor(pl.add_mesh(mesh, color='tan')),
    'image layers': lambda pl, mesh: pl.ibr.add_image_layers([pl.add_mesh(mesh, color='tan')]),
    'photographs': photos,
}
#: The actors themselves are VTK's.
OF_ACTORS = {'impostor', 'image layers'}


@pytest.mark.sampled
@pytest.mark.parametrize('name', OF_MESHES)
def test_triangles_of_no_area(name):
    """They change nothing."""
    mesh = bean()
    mesh.clear_data()
    found = seen(lambda pl: OF_MESHES[name](pl, damaged(mesh)), 'none')
    expected = seen(lambda pl: OF_MESHES[name](pl, mesh), 'none')
    assert (off(expected, found) > 25).mean() < 0.01


@pytest.mark.filterwarnings('ignore:invalid value')
@pytest.mark.parametrize('name', [name for name in OF_MESHES if name not in OF_ACTORS])
@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_points_that_are_no_numbers_are_refused(name, value):
    mesh = bean()
    mesh.clear_data()
    mesh.points[7, 1] = value
    pl = plotter(SIZE)
    with pytest.raises(ValueError, match=r'points.* must be finite'):
        OF_MESHES[name](pl, mesh)
    assert not pl.ibr.effects
