"""Picking by the mouse: what a click hits goes to a function, and is marked."""

from __future__ import annotations

import weakref

import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.observers import weakly

_MARK, _MESSAGE = '_pvibr_picked', '_pvibr_picking_message'


class ClickPicking:
    """Picks at clicks, or where the mouse is at the key P, until it is stopped."""

    def __init__(self, plotter, pick, callback, *, left_clicking, use_picker):
        # What observes must not keep what it observes.
        self._plotter = weakref.proxy(plotter)
        self._pick, self._callback = pick, callback
        self._picker = _vtk.vtkCellPicker() if use_picker else None
        self._look: dict | None = None
        button = 'Left' if left_clicking else 'Right'
        self._message = f'{button}-click or press P to pick under the mouse'
        events = {f'{button}ButtonPressEvent': self.clicked, 'KeyPressEvent': self._pressed}
        self._observers = [
            plotter.iren.add_observer(event, weakly(method)) for event, method in events.items()
        ]

    def show(self, **look):
        """Mark what is picked as a mesh of these looks."""
        self._look = look

    def tell(self, message, font_size):
        """Show a message, True for one that says how to pick."""
        text = self._message if message is True else str(message)
        self._plotter.add_text(text, font_size=font_size, name=_MESSAGE, render=False)

    def _pressed(self):
        if self._plotter.iren.interactor.GetKeySym() in ('p', 'P'):
            self.clicked()

    def clicked(self):
        """Pick where the mouse is."""
        x, y = self._plotter.iren.get_event_position()
        with self._plotter.iren.poked_subplot():
            thing, hit = self._pick(x, y)
            self._mark(thing, hit)
            if hit is None or self._callback is None:
                return
            if self._picker is None:
                self._callback(hit)
            else:
                self._picker.Pick(x, y, 0, self._plotter.renderer)
                self._callback(hit, self._picker)

    def _mark(self, thing, hit):
        if self._look is None:
            return
        if hit is None:
            self._plotter.remove_actor(_MARK)
        else:
            how = {'name': _MARK, 'pickable': False, 'reset_camera': False}
            self._plotter.add_mesh(_mesh_of(thing, hit), **self._look, **how)

    def stop(self):
        """Pick no more, and take away message and mark."""
        iren = self._plotter.iren
        for tag in self._observers if iren is not None else ():
            iren.remove_observer(tag)
        self._observers = []
        for name in (_MARK, _MESSAGE):
            self._plotter.remove_actor(name, render=False)


def _mesh_of(thing, hit) -> pv.DataSet:
    """Return what was hit as a mesh in world units."""
    if hasattr(thing, 'item_mesh'):
        return thing.item_mesh(hit.index)
    actor = getattr(hit, 'actor', None)
    if actor is None:
        return thing.dataset()
    matrix = pv.array_from_vtkmatrix(actor.GetMatrix())
    return pv.wrap(actor.GetMapper().GetInput()).transform(matrix, inplace=False)
