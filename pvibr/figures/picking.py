"""Picking of figures: rays against posed meshes, and stand-ins for VTK's pickers."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.scene.clipping import ClippingPlanes


@dataclass(frozen=True)
class FigureHit:
    """Where a ray met a figure: indices of mesh, cell and nearest vertex, point and distance."""

    mesh: int
    cell: int
    vertex: int
    point: tuple
    distance: float


def nearest_hit(meshes, start, direction, planes=None):
    """Return the first hit of a ray with meshes by index, where planes keep it, or None."""
    first, last = ClippingPlanes(planes).reach(start, direction)
    rays = start, direction, first, last
    hits = [_meet(i, mesh, *rays) for i, mesh in meshes.items() if mesh.n_cells and first < last]
    return min((h for h in hits if h is not None), key=lambda h: h.distance, default=None)


def _meet(number, mesh, start, direction, first, last):
    bounds = np.reshape(mesh.bounds, (3, 2))
    reach = np.linalg.norm(bounds.mean(1) - start) + np.linalg.norm(np.ptp(bounds, axis=1))
    locator = _vtk.vtkStaticCellLocator()
    locator.SetDataSet(mesh)
    locator.BuildLocator()
    t, sub, cell = _vtk.reference(0.0), _vtk.reference(0), _vtk.reference(0)
    point, param = [0.0] * 3, [0.0] * 3
    begin, end = start + first * direction, start + min(reach, last) * direction
    if not locator.IntersectWithLine(begin, end, 0.0, t, point, param, sub, cell):
        return None
    corners = mesh.regular_faces[int(cell)]
    nearest = corners[np.linalg.norm(mesh.points[corners] - point, axis=1).argmin()]
    distance = float((np.array(point) - start) @ direction)
    return FigureHit(number, int(cell), int(nearest), tuple(point), distance)


def stand_in(owner, number, actor):
    """Return an invisible actor that pickers find in place of another."""
    source = _vtk.vtkProgrammableSource()
    source.SetExecuteMethod(_filler(owner, number, source.GetPolyDataOutput()))
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.ScalarVisibilityOff()
    made = pv.Actor()
    made.SetMapper(mapper)
    made.SetProperty(actor.GetProperty())
    made.UseBoundsOff()
    made.VisibilityOff()
    return made


def _filler(owner, number, output):
    # VTK keeps the function, which must not keep the figure: a cycle through C++ leaks.
    owner = weakref.ref(owner)

    def fill():
        alive = owner()
        if alive is not None:
            output.ShallowCopy(alive.posed_meshes()[number])

    return fill
