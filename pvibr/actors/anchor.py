"""The prop that stands for a thing in the scene: it draws nothing and has the thing's bounds."""

from __future__ import annotations

import pyvista as pv

from pvibr import _vtk


def anchor():
    """Return an actor that draws nothing, without bounds.

    Returns
    -------
    pyvista.Actor
        Not pickable.
    """
    actor = pv.Actor()
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(_vtk.vtkPolyData())
    actor.SetMapper(mapper)
    actor.PickableOff()
    return actor


def set_bounds(actor, bounds):
    """Give an anchor bounds.

    Parameters
    ----------
    actor : pyvista.Actor
        As :func:`anchor` returned it.
    bounds : sequence of 6 float
        World units; with the first low above its high there are none.

    Examples
    --------
    >>> from pvibr.actors.anchor import anchor, set_bounds
    >>> actor = anchor()
    >>> set_bounds(actor, (0.0, 1.0, 0.0, 2.0, 0.0, 3.0))
    >>> actor.GetBounds()
    (0.0, 1.0, 0.0, 2.0, 0.0, 3.0)
    """
    points = _vtk.vtkPoints()
    points.SetDataTypeToDouble()
    if bounds[0] <= bounds[1]:
        points.InsertNextPoint(*bounds[::2])
        points.InsertNextPoint(*bounds[1::2])
    mesh = _vtk.vtkPolyData()
    mesh.SetPoints(points)
    if points.GetNumberOfPoints():
        # VTK takes the bounds of cells: a triangle without area covers no pixel.
        cells = _vtk.vtkCellArray()
        cells.InsertNextCell(3, (0, 1, 1))
        mesh.SetPolys(cells)
    actor.GetMapper().SetInputData(mesh)
