"""Effects that draw with actors of their own, and the prop that stands for each in the scene."""

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


def joined_bounds(boxes) -> tuple[float, ...]:
    """Return the bounds of all of some boxes, empty ones left out."""
    found = np.array([b for b in boxes if b and b[0] <= b[1]]).reshape(-1, 6)
    if not len(found):
        return (1.0, -1.0) * 3
    ends = np.stack([found[:, ::2].min(0), found[:, 1::2].max(0)], 1)
    return tuple(ends.ravel().tolist())


class Thing(Effect):
    """An effect that draws with actors of its own; a subclass overrides the hooks it needs.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    FOR_USERS: tuple[str, ...] = ('actors', 'bounds', 'center', 'actor', 'pick')

    _anchor: Any = None
    _title = ''  # what plotters call it where it has no name of its own

    # -- hooks: what draws it ----------------------------------------------------------------

    def actors(self) -> list:
        """Return the actors that draw it, invisible ones included."""
        raise NotImplementedError

    def drawn(self) -> list:
        """Return the actors that draw it in the frame that it was prepared for."""
        return [actor for actor in self.actors() if actor.GetVisibility()]

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors that draw it in a frame that is not its own, or its depth alone."""
        self.prepare(frame)
        return self.depths() if depth else self.drawn()

    def soft_edged(self) -> list:
        """Return the actors whose edges blend with what was drawn before them."""
        return []

    def depths(self) -> list:
        """Return the actors that draw its depth, as lights see it."""
        return self.drawn()

    def solids(self) -> list:
        """Return the actors whose meshes cast its shadow volumes, None for what has no mesh."""
        return [None]

    # -- hooks: what is known of it ----------------------------------------------------------

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds: x, y and z, low and high; of nothing (1, -1, 1, -1, 1, -1)."""
        raise NotImplementedError

    @property
    def cast_bounds(self) -> Any:
        """World bounds of what casts shadows."""
        return self.bounds

    def content_key(self) -> tuple:
        """Return a value that changes whenever the drawn content does, the camera left out."""
        raise NotImplementedError

    def follow(self):
        """Take over a new time of the pipeline."""

    def scalar_mapper(self):
        """Return a mapper with the table of the shown scalars, None without scalars."""
        return

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return ''

    # -- its place in the scene --------------------------------------------------------------

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
        """Add its props to the scene."""
        super().attach(pipeline)
        renderer, anchor = pipeline.renderer, self._anchor
        if anchor is None:
            pass
        elif isinstance(renderer, pv.Renderer):
            name = self._name or f'{self._title}({anchor.GetAddressAsString("")})'
            renderer.add_actor(anchor, name=name, reset_camera=False, render=False, pickable=False)
        else:
            renderer.AddViewProp(anchor)
        self._put_in(renderer)

    def detach(self):
        """Remove its props from the scene."""
        renderer, anchor = self.pipeline.renderer, self._anchor
        self._take_out(renderer)
        if anchor is not None and renderer.HasViewProp(anchor):
            if isinstance(renderer, pv.Renderer):
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
