"""Picking with the mouse: hits are passed to a callback and highlighted."""

from __future__ import annotations

import weakref

import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.observers import weakly

_MARK, _MESSAGE = '_pvibr_picked', '_pvibr_picking_message'


class ClickPicking:
    """Picks on clicks and on the P key until it is stopped."""

    def __init__(self, plotter, pick, callback, *, left_clicking, use_picker):
        # Observers must not keep the plotter alive.
        self._plotter = weakref.proxy(plotter)
        self._pick, self._callback = pick, callback
        self._picker = _vtk.vtkCellPicker() if use_picker else None
        self._look: dict | None = None
        button_name = 'Left' if left_clicking else 'Right'
        self._message = f'{button_name}-click or press P to pick under the mouse'
        add_observer = plotter.iren.add_observer
        self._observers = [
            add_observer(f'{button_name}ButtonPressEvent', weakly(self.clicked)),
            add_observer('KeyPressEvent', weakly(self._pressed)),
        ]

    def show(self, **look):
        """Highlight what is picked, with these looks."""
        self._look = look

    def tell(self, message, font_size):
        """Show a message, or with True the instructions."""
        text = self._message if message is True else str(message)
        self._plotter.add_text(text, font_size=font_size, name=_MESSAGE, render=False)

    def _pressed(self):
        if self._plotter.iren.interactor.GetKeySym() in ('p', 'P'):
            self.clicked()

    def clicked(self):
        """Pick under the mouse."""
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
            mark_options = {'name': _MARK, 'pickable': False, 'reset_camera': False}
            self._plotter.add_mesh(_mesh_of(thing, hit), **self._look, **mark_options)

    def stop(self):
        """Stop picking, and remove message and highlight."""
        iren = self._plotter.iren
        for tag in self._observers if iren is not None else ():
            iren.remove_observer(tag)
        self._observers = []
        for name in (_MARK, _MESSAGE):
            self._plotter.remove_actor(name, render=False)


def _mesh_of(thing, hit) -> pv.DataSet:
    """Return the hit item as a mesh in world units."""
    if hasattr(thing, 'item_mesh'):
        return thing.item_mesh(hit.index)
    actor = getattr(hit, 'actor', None)
    if actor is None:
        return thing.dataset()
    matrix = pv.array_from_vtkmatrix(actor.GetMatrix())
    return pv.wrap(actor.GetMapper().GetInput()).transform(matrix, inplace=False)
