"""Collapses leave some of the points, seams where they were, and a surface in all poses."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.meshes.collapse import collapsed
from pvibr.meshes.decimate import Welded
from pvibr.meshes.surface_distance import Surface, hausdorff


def rungs_of(mesh, poses=(), step=0.7):
    """Points at the corners of the triangles left, rung by rung, and their former triangles."""
    poses = np.asarray(mesh.points, float), *poses
    return collapsed(mesh, Welded.of(mesh), poses, step, smooth=True)


def edge_counts(mesh, corners):
    """How many triangles each edge between places has."""
    places = Welded.of(mesh)
    place_of = np.zeros(mesh.n_points, int)
    place_of[places.corners] = places.faces
    ends = np.sort(place_of[np.stack([corners, np.roll(corners, -1, 1)], 2)].reshape(-1, 2), 1)
    return np.unique(ends, axis=0, return_counts=True)[1]


def ball(**options):
    mesh = pv.Icosphere(nsub=4)
    return mesh.compute_normals(cell_normals=False, split_vertices=False, **options)


def test_a_closed_surface_stays_closed_and_near():
    mesh = ball()
    surface = Surface(np.asarray(mesh.points, float), np.asarray(mesh.regular_faces))
    rungs = [corners for corners, _ in rungs_of(mesh)]
    counts = [len(corners) for corners in rungs]
    assert len(rungs) > 8
    assert (np.diff(counts) < 0).all()
    for corners in rungs:
        assert (edge_counts(mesh, corners) == 2).all()
        # About as far off as a circle's arc from its chord.
        off = hausdorff(surface, Surface(surface.points, corners), 500)
        assert off < 30 / len(corners)


def test_an_open_surface_keeps_its_border():
    mesh = pv.Plane(i_resolution=20, j_resolution=20).triangulate()
    corners = next(c for c, _ in rungs_of(mesh) if len(c) < 20)
    a, b, c = np.asarray(mesh.points, float)[corners.T]
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(1.0)


def test_points_keep_their_side_of_a_seam():
    """Each half has its own texture: no triangle spans both, whatever is left."""
    mesh = ball()
    sides = [mesh.clip((1, 0, 0), invert=i, origin=(0, 0, 0)) for i in (True, False)]
    for i, side in enumerate(sides):
        side.point_data.clear()
        uv = 0.02 * np.asarray(side.points)[:, 1:] + 0.1 + 0.8 * i
        side.active_texture_coordinates = uv.astype(np.float32)
    halves = sides[0].append_polydata(sides[1]).triangulate()
    halves = halves.compute_normals(cell_normals=False, split_vertices=False)
    uv = np.asarray(halves.active_texture_coordinates)
    for corners, _ in rungs_of(halves):
        assert np.ptp(uv[corners], axis=1).max() < 0.2
    assert len(corners) < 0.1 * halves.n_cells


def test_triangles_keep_their_colours():
    mesh = pv.Plane(i_resolution=16, j_resolution=16).triangulate()
    colors = (mesh.cell_centers().points[:, 0] > 0.125).astype(float)
    mesh.cell_data['colour'] = colors
    corners, cells = next(rung for rung in rungs_of(mesh) if len(rung[0]) < 20)
    a, b, c = np.asarray(mesh.points, float)[corners.T]
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    assert (areas * colors[cells]).sum() == pytest.approx(0.375)


def test_joints_keep_their_triangles():
    """A straight tube that a pose bends is not flattened where it bends."""
    mesh = pv.Cylinder(resolution=12, height=4, capping=False).triangulate().subdivide(3)
    mesh = mesh.compute_normals(cell_normals=False, split_vertices=False)
    points = np.asarray(mesh.points, float)
    angle = np.clip(points[:, 0], -0.5, 0.5) * 2.0
    bent = points.copy()
    bent[:, 0], bent[:, 1] = (
        points[:, 0] * np.cos(angle) - points[:, 1] * np.sin(angle),
        points[:, 0] * np.sin(angle) + points[:, 1] * np.cos(angle),
    )
    full = Surface(bent, np.asarray(mesh.regular_faces))
    errors = {}
    for name, poses in {'aware': [bent], 'unaware': []}.items():
        corners = next(c for c, _ in rungs_of(mesh, poses) if len(c) < 0.12 * mesh.n_cells)
        errors[name] = hausdorff(full, Surface(bent, corners), 1000)
    assert errors['aware'] < 0.6 * errors['unaware']
