"""The prop that stands for a thing in the scene: it draws nothing and has the thing's bounds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.effect import Effect


def anchor():
    """Return an actor that draws nothing, without bounds."""
    actor = pv.Actor()
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(_vtk.vtkPolyData())
    actor.SetMapper(mapper)
    actor.PickableOff()
    return actor


def set_bounds(actor, bounds):
    """Give an anchor bounds."""
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


class Anchored(Effect):
    """A thing in a scene: actors that draw it, and an anchor that stands for all of them.

    A subclass sets ``_anchor``, and has ``bounds`` and ``actors()``.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    _anchor: Any = None
    _title = ''  # what plotters call it where it has no name of its own

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds: x, y and z, low and high."""
        raise NotImplementedError

    def actors(self) -> list:
        """Return the actors that draw it, those that are not visible now too."""
        raise NotImplementedError

    def drawn(self) -> list:
        """Return the actors that are visible."""
        return [actor for actor in self.actors() if actor.GetVisibility()]

    @property
    def center(self) -> tuple[float, ...]:
        """Middle of the bounds, world units."""
        return tuple(np.reshape(self.bounds, (3, 2)).mean(1).tolist())

    @property
    def actor(self):
        """The prop that stands for all of it in the plotter's ``actors``."""
        return self._anchor

    @property
    def props(self) -> tuple:
        """The prop that stands for it in the scene."""
        return (self._anchor,)

    def attach(self, pipeline):
        """Put its props into the scene."""
        super().attach(pipeline)
        renderer, anchor = pipeline.renderer, self._anchor
        if hasattr(renderer, 'add_actor'):
            name = self._name or f'{self._title}({anchor.GetAddressAsString("")})'
            renderer.add_actor(anchor, name=name, reset_camera=False, render=False, pickable=False)
        else:
            renderer.AddViewProp(anchor)
        self._put_in(renderer)

    def detach(self):
        """Take its props out of the scene."""
        renderer, anchor = self.pipeline.renderer, self._anchor
        self._take_out(renderer)
        if renderer.HasViewProp(anchor):
            if hasattr(renderer, 'remove_actor'):
                renderer.remove_actor(anchor, reset_camera=False, render=False)
            else:
                renderer.RemoveViewProp(anchor)
        super().detach()

    def _put_in(self, renderer):
        for actor in self.actors():
            renderer.AddViewProp(actor)

    def _take_out(self, renderer):
        for actor in self.actors():
            renderer.RemoveViewProp(actor)

    def remove(self):
        """Take it out of its plotter and free what it holds on the GPU; it may be added again."""
        if self.pipeline is not None:
            self.pipeline.remove(self)
