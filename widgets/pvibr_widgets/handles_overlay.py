"""Base of controls in the scene: updated every frame, removed with their subject."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.observers import weakly
from pvibr_widgets.handles_marks import Marks
from pvibr_widgets.handles_stage import Pointer

# Before the pipeline's observer, which takes flat props out and puts them back; and after it, when
# what effects made of this frame is known.
_FIRST, _LAST = 2.0, -2.0
# Above the priority of a camera's style; an area is looked at just before its turn.
_PLACE, _LOOK = 0.5, 0.05
#: Priorities of areas: of a bar over the scene, and of all of the scene.
BAR, SCENE = 0.4, 0.3


class Overlay:
    """Controls drawn over a subplot."""

    thing: Any = None

    def __init__(self, stage, callback=None):
        if callback is not None and not callable(callback):
            raise TypeError(f'callback = {callback!r}: must be a function of one argument')
        self._stage = stage
        self.callbacks: list[Callable] = [] if callback is None else [callback]
        self._marks = Marks(stage.renderer)
        self._enabled = True
        calls = (self._leave, _FIRST), (self._follow, _LAST)
        add = stage.renderer.AddObserver
        self._tags = [add('StartEvent', weakly(call), priority) for call, priority in calls]
        self._hovered: str | None = None
        self._hover = stage.interactor.AddObserver('MouseMoveEvent', weakly(self._on_move))
        stage.ibr.on_close(weakly(self.remove))

    # -- what a subclass does ---------------------------------------------------------------------

    def _is_gone(self) -> bool:
        """Return True if the thing was removed."""
        return False

    def _prepare(self, frame):
        """Prepare before a frame is drawn."""

    def _update(self, frame):
        """Move the controls to the thing for the next frame."""

    def _rest(self):
        """Hide the controls until the next `_update`."""

    def _free(self):
        """Remove the controls from the scene without rendering."""

    def _under(self, pixel) -> str | None:
        """Return the name of the control at a pixel of the window, None for none."""
        return None

    # -- what users do ----------------------------------------------------------------------------

    @property
    def enabled(self) -> bool:
        """Whether the controls are shown and usable."""
        return self._enabled

    @enabled.setter
    def enabled(self, on):
        if self._tags and bool(on) != self._enabled:
            self._enabled = bool(on)
            self._follow()

    def remove(self):
        """Remove the handle from the scene; calling it again is fine."""
        if not self._tags:
            return
        while self._tags:
            self._stage.renderer.RemoveObserver(self._tags.pop())
        self._enabled = False
        self._stage.interactor.RemoveObserver(self._hover)
        with self._stage.still():
            self._free()
        self._marks.remove()

    def _tell(self):
        for call in list(self.callbacks):
            call(self.thing)

    def _on_move(self):
        """Name and highlight what the mouse is over; while it drags, nothing changes."""
        if not self._enabled or self._is_gone():
            return
        found = self._under(np.array(self._stage.interactor.GetEventPosition(), float))
        if found != self._hovered:
            self._hovered = found
            self._stage.draw()

    # -- following --------------------------------------------------------------------------------

    def _leave(self):
        """Remove the controls with the thing."""
        if self._is_gone():
            self.remove()
        elif self._enabled and not self._is_idle():
            self._prepare(self._stage.frame())

    def _is_idle(self) -> bool:
        """Return True for frames nobody sees: picking passes, and tiles outside of the subplot."""
        renderer = self._stage.renderer
        if renderer.GetSelector() is not None or not renderer.IsActiveCameraCreated():
            return True  # a camera that VTK makes with the first frame is set to show everything
        return 0 in self._stage.frame().size

    def _follow(self):
        if not self._tags:
            return
        if self._enabled and not self._is_idle():
            self._update(self._stage.frame())
        else:
            self._marks.hide()
        if not self._enabled:
            self._rest()


class Touch:
    """An invisible region that takes mouse events: VTK's handle widget."""

    def __init__(self, stage, tolerance, begin, drag, end, *, area=None, priority=_PLACE):
        self._stage, self._press = stage, None
        self._rep = _vtk.vtkPointHandleRepresentation2D()
        # A shape of no area: without points VTK crashes.
        self._rep.SetCursorShape(pv.PolyData(np.zeros((3, 3)), [3, 0, 1, 2]))
        self._rep.SetTolerance(int(np.ceil(tolerance)))
        self._rep.PickableOff()
        self._widget = _vtk.vtkHandleWidget()
        self._widget.SetInteractor(stage.interactor)
        self._widget.SetDefaultRenderer(stage.renderer)
        self._widget.SetCurrentRenderer(stage.renderer)
        self._widget.SetRepresentation(self._rep)
        self._widget.SetPriority(priority)
        self._widget.EnableAxisConstraintOff()
        for event, call in zip(('Start', '', 'End'), (begin, drag, end), strict=True):
            self._widget.AddObserver(f'{event}InteractionEvent', weakly(call))
        if area is not None:
            self._area = weakref.WeakMethod(area)
            add = stage.interactor.AddObserver
            self._press = add('LeftButtonPressEvent', weakly(self._meet), priority + _LOOK)

    def _meet(self):
        """Take a press within the area before other observers; ignore others."""
        area, pixel = self._area(), self._stage.interactor.GetEventPosition()
        hit = bool(self._widget.GetEnabled() and area is not None and area(pixel))
        self.reach(hit)
        if hit:
            focal = self._stage.renderer.GetActiveCamera().GetFocalPoint()
            self.place(Pointer(self._stage.frame(), pixel).facing(focal))

    @property
    def usable(self) -> bool:
        """Whether the region takes mouse events."""
        return bool(self._widget.GetEnabled() and self._widget.GetProcessEvents())

    def switch(self, on):
        """Add the region to the window or remove it."""
        if bool(self._widget.GetEnabled()) != bool(on):
            with self._stage.still():
                self._widget.SetEnabled(bool(on))

    def reach(self, on):
        """Enable or disable mouse events."""
        self._widget.SetProcessEvents(bool(on))

    def place(self, point):
        """Move the region."""
        self._rep.SetWorldPosition([float(x) for x in point])
        self._rep.BuildRepresentation()  # it is touched where it was built

    def remove(self):
        """Remove the region from the scene."""
        self.switch(False)
        if self._press is not None:
            self._stage.interactor.RemoveObserver(self._press)
        self._widget.RemoveAllObservers()
        self._widget.SetInteractor(None)
        self._stage.renderer.RemoveViewProp(self._rep)
