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


def put_in(renderer, actor, name, kind):
    """Put an anchor into a renderer, under a name where PyVista keeps names.

    Parameters
    ----------
    renderer : vtkRenderer
        PyVista's or another.
    actor : pyvista.Actor
        As :func:`anchor` returned it.
    name : str or None
        What the plotter calls the thing; by default its kind and a number.
    kind : str
        What it is.
    """
    if hasattr(renderer, 'add_actor'):
        name = name or f'{kind}({actor.GetAddressAsString("")})'
        renderer.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)
    else:
        renderer.AddViewProp(actor)


def take_out(renderer, actor):
    """Take an anchor out of a renderer, where it still is in it.

    Parameters
    ----------
    renderer : vtkRenderer
        As :func:`put_in` was given it.
    actor : pyvista.Actor
        The anchor.
    """
    if not renderer.HasViewProp(actor):
        return
    if hasattr(renderer, 'remove_actor'):
        renderer.remove_actor(actor, reset_camera=False, render=False)
    else:
        renderer.RemoveViewProp(actor)
