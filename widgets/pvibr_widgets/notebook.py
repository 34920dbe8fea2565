"""The control panel in a notebook, beside the picture."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections import deque
from typing import Any

from pvibr.core.errors import require
from pvibr.core.plotters import is_closed
from pvibr_widgets.model import Model
from pvibr_widgets.picture import Picture
from pvibr_widgets.remote import RemotePanel, current_loop, element_script, text_of


def notebook_panel(plotter, *, picture=True, presets=None):
    """Return a control panel for a notebook, beside its picture: the last line of a cell shows it.

    It works through the kernel, wherever notebooks do. The picture follows each change, and mouse,
    wheel and arrow keys turn it.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Plotter to control.
    picture : bool, optional
        Whether the picture is part of it; without, another view of the plotter shows it, as of the
        backends ``'trame'`` and ``'server'``.
    presets : Presets, optional
        Presets; those of the user's file by default.

    Returns
    -------
    NotebookPanel
        With the :class:`pvibr_widgets.model.Model` as its ``model``, and the anywidget as its
        ``widget``.

    Raises
    ------
    ImportError
        If anywidget is not installed.

    Examples
    --------
    >>> import pvibr
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> bloom = pl.ibr.add(pvibr.Bloom())
    >>> panel = notebook_panel(pl)
    >>> pl.close()
    """
    return NotebookPanel(Model(plotter, presets=presets), picture=picture)


@functools.cache
def _widget_class():
    """Return the class of the widget: anywidget is an extra."""
    base: Any = require('anywidget', 'jupyter', 'Panels in notebooks').AnyWidget
    import traitlets

    class Widget(base):
        _esm = element_script() + text_of('picture.js') + text_of('notebook.js')
        shown = traitlets.Dict().tag(sync=True)
        picture = traitlets.Bytes().tag(sync=True)
        size: object = traitlets.List().tag(sync=True)
        # Pages take all bytes to be equal.
        frame = traitlets.Int().tag(sync=True)

    return Widget


class NotebookPanel(RemotePanel):
    """A control panel of a notebook."""

    def __init__(self, model, *, picture=True):
        super().__init__(model)
        self._shows, self._picture = picture, Picture(model.plotter)
        self._shell = None
        self._thread = threading.get_ident()
        self._waiting: deque = deque()
        self._home = current_loop()
        self.widget = _widget_class()()
        self._next = None
        if picture:
            self.widget.size = list(self._picture.size)
            self.model.each_frame(self._ended)
            self.model.act(self._picture.resize, self._picture.size)
            self._picture_drawn()
        self.widget.on_msg(self._heard)
        model.listen(self._changed)
        self._follow_cells()
        self._tell()

    def _repr_mimebundle_(self, **options):
        return self.widget._repr_mimebundle_(**options)

    def _follow_cells(self):
        """Refresh after each cell, whose changes may not have been rendered."""
        with contextlib.suppress(ImportError):
            from IPython import get_ipython

            self._shell = get_ipython()
            if self._shell is not None:
                self._shell.events.register('post_run_cell', self._after_cell)

    def _after_cell(self, *_):
        self.model.refresh()

    def _heard(self, _widget, content, _buffers):
        """Act in the thread of the plotter: messages may arrive in others."""
        self._waiting.append(content)
        if self._home is None or threading.get_ident() == self._thread:
            self._catch_up()
        else:
            self._home.call_soon_threadsafe(self._catch_up)

    def _catch_up(self):
        while self._waiting:
            content = self._waiting.popleft()
            action, *values = content.get('args') or ['']
            if action == 'point':
                self.model.act(self._picture.point, *values)
                self._picture_drawn()
                answer = {'text': '', 'turn': self._done}
            else:
                answer = self.act(action, *values)
            self.widget.send({'id': content.get('id')} | answer)

    def _tell(self):
        self.widget.shown = self.shown

    def _picture_drawn(self):
        plotter, self._next = self.model.plotter, None
        if not self._shows or is_closed(plotter):
            return
        with self.widget.hold_sync():
            self.widget.picture = self._picture.jpeg()
            self.widget.frame = self._picture.frame

    def _ended(self, *_):
        """Send the picture of a frame that was not asked for here, as of an animation."""
        self._picture.count()
        loop = current_loop()
        if self._next is None and loop is not None:
            self._next = loop.call_soon(self._picture_drawn)

    def close(self):
        """Close the panel, not the plotter; calling it again is fine."""
        super().close()
        if self._next is not None:
            self._next.cancel()
        if self._shell is not None:
            self._shell.events.unregister('post_run_cell', self._after_cell)
            self._shell = None
        self.widget.close()
