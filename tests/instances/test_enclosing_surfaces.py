"""Surfaces: closed and turned outward, or not."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.enclosing_surfaces import winding


def eight(other):
    """Return a closed tube around z whose section is an eight with a loop of another size."""
    around, along = np.meshgrid(*2 * [np.linspace(0, 2 * np.pi, 49)[:-1]], indexing='ij')
    size = np.where(np.sin(along) > 0, 1.0, other)
    out, up = 2 + 0.4 * size * np.sin(2 * along), size * np.sin(along)
    points = np.stack([out * np.cos(around), out * np.sin(around), up], -1).reshape(-1, 3)
    k = np.arange(48 * 48).reshape(48, 48)
    a, b, c, d = (np.roll(k, shift, (0, 1)) for shift in ((0, 0), (-1, 0), (-1, -1), (0, -1)))
    return points, np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])


def surface(mesh):
    mesh = mesh.triangulate()
    return np.asarray(mesh.points, float), np.asarray(mesh.regular_faces)


@pytest.mark.parametrize(
    'mesh',
    [pv.Cube(), pv.Sphere(), pv.ParametricTorus(), pv.Sphere().scale([1, 1, 1e-3])],
    ids=['split corners', 'ball', 'seams', 'thin'],
)
def test_closed_surfaces(mesh):
    points, faces = surface(mesh)
    # A parametric surface's two ends are one but for rounding.
    points = np.round(points, 6)
    assert winding(points, faces) == 1
    assert winding(1e9 + 1e-3 * faces.max() + points * 1024, faces) == 1
    assert winding(points, faces[:, ::-1]) == -1
    assert winding(points, faces[1:]) == 0


def test_a_turned_triangle_or_an_open_sheet():
    points, faces = surface(pv.Sphere())
    faces = faces.copy()
    faces[7] = faces[7, ::-1]
    assert winding(points, faces) == 0
    assert winding(*surface(pv.Plane())) == 0
    assert winding(points, faces[:0]) == 0


def test_every_piece_counts():
    points, faces = surface(pv.Sphere())
    both = np.concatenate([points, points + np.array([3, 0, 0])])
    assert winding(both, np.concatenate([faces, faces + len(points)])) == 1
    assert winding(both, np.concatenate([faces, faces[:, ::-1] + len(points)])) == 0


def test_a_sheet_with_two_sides_in_one_place():
    points, faces = surface(pv.Plane())
    assert winding(points, np.concatenate([faces, faces[:, ::-1]])) == 0


@pytest.mark.parametrize('other', [0.7, 0.2])
@pytest.mark.parametrize('turn', [0, 1, 2])
def test_a_loop_that_is_wound_the_other_way(other, turn):
    points, faces = eight(other)
    points = np.roll(points, turn, 1)
    assert winding(points, faces) == winding(points, faces[:, ::-1]) == 0


def test_loops_that_overlap_or_hide_are_no_hindrance():
    """The inside of a torus through its own axis is hidden by the outside."""
    for mesh in (
        pv.ParametricTorus(ringradius=0.3, crosssectionradius=0.5),
        pv.Cube() + pv.Cube(center=(1, 0.3, 0)),
        pv.Cylinder(resolution=300),
    ):
        points, faces = surface(mesh)
        points = np.round(points, 6)
        assert winding(points, faces) == 1
        assert winding(points, faces[:, ::-1]) == -1
