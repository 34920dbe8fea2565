"""Surfaces: closed and turned outward, or not."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.maths.surfaces import encloses, winding


def surface(mesh):
    mesh = mesh.triangulate()
    return np.asarray(mesh.points, float), np.asarray(mesh.regular_faces)


@pytest.mark.parametrize(
    'mesh',
    [pv.Cube(), pv.Sphere(), pv.ParametricTorus(), pv.Sphere().scale([1, 1, 1e-3])],
    ids=['split corners', 'ball', 'seams', 'thin'],
)
def test_closed_surfaces_enclose(mesh):
    points, faces = surface(mesh)
    # A parametric surface's two ends are one but for rounding.
    points = np.round(points, 6)
    assert encloses(points, faces)
    assert encloses(1e9 + 1e-3 * faces.max() + points * 1024, faces)
    assert not encloses(points, faces[:, ::-1])
    assert not encloses(points, faces[1:])


def test_a_turned_triangle_or_an_open_sheet_does_not():
    points, faces = surface(pv.Sphere())
    faces = faces.copy()
    faces[7] = faces[7, ::-1]
    assert not encloses(points, faces)
    assert not encloses(*surface(pv.Plane()))
    assert not encloses(points, faces[:0])


def test_every_piece_counts():
    points, faces = surface(pv.Sphere())
    both = np.concatenate([points, points + np.array([3, 0, 0])])
    assert encloses(both, np.concatenate([faces, faces + len(points)]))
    assert not encloses(both, np.concatenate([faces, faces[:, ::-1] + len(points)]))


def test_a_sheet_with_two_sides_in_one_place_does_not():
    points, faces = surface(pv.Plane())
    assert not encloses(points, np.concatenate([faces, faces[:, ::-1]]))


def test_winding_tells_inward_from_open():
    points, faces = surface(pv.Sphere())
    assert winding(points, faces) == 1
    assert winding(points, faces[:, ::-1]) == -1
    assert winding(points, faces[1:]) == winding(points, faces[:0]) == 0
    both = np.concatenate([points, points + 3])
    mixed = np.concatenate([faces, faces[:, ::-1] + len(points)])
    assert winding(both, mixed) == 0
