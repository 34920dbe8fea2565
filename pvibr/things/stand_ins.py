"""Meshes of single items, which are there only while VTK's own pickers look for them."""

from __future__ import annotations

import weakref
from collections import deque
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.observers import weakly
from pvibr.core.plotters import put_inner
from pvibr.gl.scene_pass import hidden_name
from pvibr.things.frame import Frame
from pvibr.things.picking import pixel_ray

#: Items that a click finds, and that pickers that draw do, the nearest.
_CLICKED, _DRAWN = 8, 1024
#: Places that a picker by rays asks about: its own, then two corners of the viewport.
_LAST = 3
#: Tolerance of PyVista's pickers, as a share of the diagonal.
_TOLERANCE = 0.025


class StandIns:
    """Actors of items: some that pickers by rays ask for meshes, and some that others draw."""

    #: Whether any thing asks a renderer for a ray: no picker does then.
    _looking = False

    def __init__(self, thing):
        self._thing: Any = weakref.ref(thing)
        self._renderer: Any = None
        self._observers: list[int] = []
        #: The last places that the renderer was asked about: all that is known of a picker.
        self._asked: deque = deque(maxlen=_LAST)
        self._found: tuple = ((), [])
        self._point: tuple = ()
        self._clips: list = []
        self._shown: tuple | None = None
        #: Indices of the items that actors of either kind stand for.
        self._under: dict = {}
        self._within: list[int] = []
        self._clicked: list = []
        self._drawn: list = []
        self._warned = self._is_empty = False

    def put_in(self, renderer):
        """Be in a scene."""
        self._renderer = renderer
        if not self._clicked:
            self._clicked = [_lazy_actor(self, k) for k in range(_CLICKED)]
        self._drawn = [_actor(_vtk.vtkPolyDataMapper()) for _ in range(_CLICKED)]
        self.clip(self._clips)
        for actor in self.actors():
            put_inner(renderer, actor)
        self._empty()
        self._observers = [
            renderer.AddObserver('ModifiedEvent', weakly(self._note)),
            renderer.AddObserver('StartEvent', weakly(self._hide)),
            renderer.AddObserver('EndEvent', weakly(self._offer)),
        ]
        self._offer()

    def actors(self) -> list:
        """Return the actors of both kinds."""
        return [*(actor for actor, _ in self._clicked), *self._drawn]

    def clip(self, planes):
        """Cut items off by planes, or None."""
        self._clips = list(planes or ())
        for actor in self.actors():
            _clip(actor, self._clips)

    def take_out(self):
        """Leave the scene."""
        for tag in self._observers:
            self._renderer.RemoveObserver(tag)
        for actor in self.actors():
            self._renderer.RemoveViewProp(actor)
        self._renderer, self._observers, self._drawn, self._within = None, [], [], []
        self._shown = None

    def _note(self):
        point = self._renderer.GetDisplayPoint()[:2]
        if self._looking or (self._asked and self._asked[-1] == point):
            return
        self._asked.append(point)
        if point != self._point and not self._has_drawn(*point):
            self._empty()
        self._point = point
        for _, source in self._clicked:
            source.Modified()

    def _has_drawn(self, x, y) -> bool:
        """Return True if a picker that drew a pixel asks for the place of what it found there."""
        if self._shown is None:
            return False
        (x0, y0, x1, y1), _, content = self._shown
        thing = self._thing()
        inside = x0 - 1 <= x <= x1 + 1 and y0 - 1 <= y <= y1 + 1
        return inside and thing is not None and content == thing.content_key()

    def _empty(self):
        """Have no meshes for pickers that draw: pickers by rays would find them."""
        if self._shown is None and self._is_empty:
            return
        self._shown, self._is_empty = None, True
        for actor in self._drawn:
            actor.GetMapper().SetInputDataObject(_vtk.vtkPolyData())

    def _hide(self):
        if self._renderer.GetSelector() is None:
            self._empty()
        for actor in self.actors():
            actor.VisibilityOff()

    def _offer(self):
        """Let pickers find items between frames."""
        thing = self._thing()
        there = thing is not None and thing.pickable and thing.visibility
        for actor, _ in self._clicked:
            actor.SetVisibility(there)
        # The hardware picker draws only what was visible before it asks for the first frame.
        for actor in self._drawn[:_CLICKED]:
            actor.SetVisibility(there)
        self._asked.clear()

    # -- pickers by rays ----------------------------------------------------------------------

    def fill(self, k, output):
        """Put the mesh of the item into an output that is the k-th under a picker."""
        thing = self._thing()
        found = self._candidates(thing) if thing is not None and self._renderer else []
        output.Initialize()
        if k < len(found):
            self._under[k] = found[k]
            output.ShallowCopy(_named(thing, found[k]))

    def _candidates(self, thing) -> list[int]:
        if len(self._asked) < _LAST:
            return []
        key = tuple(self._asked), thing.content_key()
        if self._found[0] != key:
            self._under = {}
            self._found = key, self._near(thing, *self._place())
        return self._found[1]

    def _place(self):
        """Return the pixel of a picker, which goes on to ask for both corners of the viewport."""
        width, height = self._renderer.GetRenderWindow().GetSize()
        _, _, right, top = self._renderer.GetViewport()
        at_end = np.allclose(self._asked[-1], (width * right, height * top))
        return self._asked[0] if at_end else self._asked[-1]

    def _near(self, thing, x, y) -> list[int]:
        with self._looks():
            start, direction = pixel_ray(self._renderer, x, y)
            hit = thing.pick(x, y)
        frame = Frame.of(self._renderer)
        centers, radii = thing.item_spheres()
        away = centers - start
        along = away @ direction
        gaps = np.linalg.norm(away - along[:, None] * direction, axis=1)
        pixel = (1.0 if frame.parallel else np.maximum(along, 0)) / frame.pixel_scale
        reach = radii + _TOLERANCE * np.hypot(*frame.size) * pixel
        near = np.flatnonzero(thing.visible & (gaps <= reach) & (along + radii > 0))
        near = near[np.argsort((along - radii)[near], kind='stable')].tolist()
        first = [] if hit is None else [hit.index]
        return list(dict.fromkeys([*first, *near[:_CLICKED]]))[:_CLICKED]

    @contextmanager
    def _looks(self):
        """Ask the renderer for rays, and leave it as the picker has it."""
        renderer = self._renderer
        world, display = renderer.GetWorldPoint(), renderer.GetDisplayPoint()
        StandIns._looking = True
        try:
            yield
        finally:
            renderer.SetDisplayPoint(*display)
            renderer.SetWorldPoint(*world)
            StandIns._looking = False

    # -- pickers that draw --------------------------------------------------------------------

    def draw(self, frame):
        """Show items in the area of a picker that draws the scene, in each of its passes."""
        thing = self._thing()
        view = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        area = tuple(self._renderer.GetSelector().GetArea())
        key = area, view, thing.content_key()
        if key == self._shown:
            self._show_drawn()
            return
        self._shown = key
        found = self._in_area(thing, frame)
        if len(found) > _DRAWN and not self._warned:
            self._warned = True
            warn(
                f"{thing.name}: VTK's hardware pickers see items as meshes, the nearest {_DRAWN} "
                f'of {len(found)} there; plotter.ibr.pick and rectangles through the scene see all'
            )
        found = found[:_DRAWN]
        for _ in range(len(found) - len(self._drawn)):
            self._drawn.append(_actor(_vtk.vtkPolyDataMapper()))
            _clip(self._drawn[-1], self._clips)
            put_inner(self._renderer, self._drawn[-1])
        self._within, self._is_empty = found, False
        for actor, index in zip(self._drawn, found, strict=False):
            actor.GetMapper().SetInputDataObject(_named(thing, index))
        self._show_drawn()

    def _show_drawn(self):
        for k, actor in enumerate(self._drawn):
            actor.SetVisibility(k < len(self._within))

    def _in_area(self, thing, frame) -> list[int]:
        centers, radii = thing.item_spheres()
        view, clip = frame.view_from_world, frame.clip_from_view
        eye = centers @ view[:3, :3].T + view[:3, 3]
        seen = eye @ clip[:, :3].T + clip[:, 3]
        depth = np.maximum(seen[:, 3], 1e-30)
        pixels = (seen[:, :2] / depth[:, None] + 1) / 2 * frame.size + frame.origin
        sizes = radii * frame.pixel_scale / (1.0 if frame.parallel else depth)
        x0, y0, x1, y1 = self._renderer.GetSelector().GetArea()
        gaps = np.maximum((x0, y0) - pixels, pixels - (x1, y1)).max(1)
        inside = (gaps <= sizes + 1) & (-eye[:, 2] > 0) | (-eye[:, 2] <= radii)
        found = np.flatnonzero(thing.visible & inside & (-eye[:, 2] + radii > 0))
        return found[np.argsort(-eye[found, 2], kind='stable')].tolist()

    def index_of(self, actor) -> int | None:
        """Return the index of the item that a picked actor stands for, None for none."""
        for k, (own, _) in enumerate(self._clicked):
            if own is actor:
                return self._under.get(k)
        pairs = zip(self._drawn, self._within, strict=False)
        return next((index for own, index in pairs if own is actor), None)

    def release(self, window):
        """Free GPU memory; the context is current."""
        for actor in self._drawn if window is not None else ():
            actor.ReleaseGraphicsResources(window)


def _named(thing, index):
    mesh = thing.item_mesh(index)
    mesh.field_data['index'] = [index]
    return mesh


def _actor(mapper):
    mapper.ScalarVisibilityOff()
    actor = pv.Actor()
    actor.SetMapper(mapper)
    actor.SetObjectName(hidden_name('stand-in for pickers'))
    actor.UseBoundsOff()
    actor.VisibilityOff()
    return actor


def _clip(actor, planes):
    own = _vtk.vtkPlaneCollection()  # mappers that share one empty it for each other
    for plane in planes:
        own.AddItem(plane)
    actor.GetMapper().SetClippingPlanes(own)


def _lazy_actor(owner, k):
    """Return an actor whose mesh is made when it is asked for, and what makes it."""
    source = _vtk.vtkProgrammableSource()
    # PyVista's pickers return it as it is: as PyVista's own mesh, which `fill` keeps.
    output, owner = pv.PolyData(), weakref.ref(owner)
    source.GetExecutive().SetOutputData(0, output)

    def fill():
        # VTK keeps the function, which must not keep the thing: a cycle through C++ leaks.
        alive = owner()
        if alive is not None:
            alive.fill(k, output)

    source.SetExecuteMethod(fill)
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    return _actor(mapper), source
