"""Picking of figures: rays against posed meshes, and stand-ins for VTK's pickers."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.things.clipping import ClippingPlanes


@dataclass(frozen=True)
class FigureHit:
    """Where a ray met a figure: indices of mesh, cell and nearest vertex, point and distance."""

    mesh: int
    cell: int
    vertex: int
    point: tuple
    distance: float


def nearest_hit(meshes, ray_origin, ray_direction, clipping_planes=None):
    """Return the first hit of a ray with meshes by index, where planes keep it, or None."""
    near, far = ClippingPlanes(clipping_planes).reach(ray_origin, ray_direction)
    rays = ray_origin, ray_direction, near, far
    hits = [_intersect(i, m, *rays) for i, m in meshes.items() if m.n_cells and near < far]
    return min((h for h in hits if h is not None), key=lambda h: h.distance, default=None)


def _intersect(mesh_index, mesh, origin, direction, near, far):
    bounds = np.reshape(mesh.bounds, (3, 2))
    ray_length = np.linalg.norm(bounds.mean(1) - origin) + np.linalg.norm(np.ptp(bounds, axis=1))
    locator = _vtk.vtkStaticCellLocator()
    locator.SetDataSet(mesh)
    locator.BuildLocator()
    t, sub, cell = _vtk.reference(0.0), _vtk.reference(0), _vtk.reference(0)
    point, param = [0.0] * 3, [0.0] * 3
    begin, end = origin + near * direction, origin + min(ray_length, far) * direction
    if not locator.IntersectWithLine(begin, end, 0.0, t, point, param, sub, cell):
        return None
    corner_ids = mesh.regular_faces[int(cell)]
    nearest_vertex = corner_ids[np.linalg.norm(mesh.points[corner_ids] - point, axis=1).argmin()]
    distance = float((np.array(point) - origin) @ direction)
    return FigureHit(mesh_index, int(cell), int(nearest_vertex), tuple(point), distance)


def stand_in(owner, mesh_index, actor):
    """Return an invisible actor that pickers find in place of another."""
    source = _vtk.vtkProgrammableSource()
    source.SetExecuteMethod(_filler(owner, mesh_index, source.GetPolyDataOutput()))
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.ScalarVisibilityOff()
    stand_in_actor = pv.Actor()
    stand_in_actor.SetMapper(mapper)
    stand_in_actor.SetProperty(actor.GetProperty())
    stand_in_actor.UseBoundsOff()
    stand_in_actor.VisibilityOff()
    return stand_in_actor


def _filler(owner, mesh_index, output):
    # VTK keeps the function, which must not keep the figure: a cycle through C++ leaks.
    owner = weakref.ref(owner)

    def fill():
        alive = owner()
        if alive is not None:
            output.ShallowCopy(alive.posed_meshes()[mesh_index])

    return fill
