"""The control panel in trame pages: applications, and notebooks rendered by trame."""

from __future__ import annotations

import asyncio
import itertools

from pvibr.core.errors import require
from pvibr.core.plotters import is_closed, is_dragged
from pvibr_widgets.model import Model
from pvibr_widgets.picture import Picture
from pvibr_widgets.remote import RemotePanel, current_loop, element_script, text_of

_numbers = itertools.count()
#: Seconds without a frame after which the view is at rest.
_REST = 0.3
#: Sides of pictures, in pixels.
_LEAST, _MOST = 16, 4096
#: Pages of trame keep browsers from zooming, which readers of small text need.
_ZOOMS = """
document.querySelector('meta[name=viewport]')
  ?.setAttribute('content', 'width=device-width, initial-scale=1');
"""
_BUTTON = (
    'font: 14px/1.4 sans-serif; min-height: 28px; margin: 4px 8px; padding: 0 8px; '
    'color: #1b1b1b; background: #fff; border: 1px solid #767676; border-radius: 4px'
)
_BESIDE = 'display: flex; flex-wrap: wrap; height: 100vh; width: 100%'
_VIEW = 'flex: 3 1 20em; min-width: 0; min-height: 50%; position: relative'
_SIDE = 'flex: 1 1 22em; max-height: 100%; overflow: auto; background: #fff'
_DRAWER = (
    'position: fixed; top: 0; right: 0; width: min(24em, 100%); height: 100%; z-index: 2; '
    'box-shadow: 0 0 6px rgba(0, 0, 0, 0.4); background: #fff; overflow: auto'
)


def trame_panel(plotter, server=None, *, picture=False, update=None, presets=None):
    """Add a control panel to a trame page during its layout.

    Parameters
    ----------
    plotter : pyvista.Plotter or vtkRenderer
        Plotter to control.
    server : trame.Server, str or None
        The page's, or its name.
    picture : bool, optional
        Put the plotter's picture beside the panel, to fill the page. Each tab has one of its own
        size; while the view moves in one, the others show that.
    update : callable, optional
        Sends a picture to the page, after each change: where the page's view is none of PyVista's,
        its ``update``.
    presets : Presets, optional
        By default those in the file of whoever runs the server.

    Returns
    -------
    PagePanel
        With the :class:`pvibr_widgets.model.Model` as its ``model``, and the element of the page
        as its ``element``.

    Raises
    ------
    ImportError
        If trame is not installed.

    Examples
    --------
    >>> from trame.app import get_server
    >>> from trame.ui.vuetify3 import SinglePageLayout
    >>> import pvibr
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> bloom = pl.ibr.add(pvibr.Bloom())
    >>> server = get_server('pvibr-example', client_type='vue3')
    >>> with SinglePageLayout(server) as layout:
    ...     with layout.content:
    ...         panel = trame_panel(pl, server)
    >>> panel.act('write', panel.shown['groups'][0]['id'], 'spread', '0.25')['text']
    '0.25'
    >>> bloom.spread
    0.25
    >>> pl.close()
    """
    server, model = _server_of(server), Model(plotter, presets=presets)
    if not picture:
        return PagePanel(model, server, update)
    html = require('trame.widgets.html', 'jupyter', 'Panels in pages')
    client = require('trame.widgets.client', 'jupyter', 'Panels in pages')
    # One above the other where a window is narrow.
    with html.Div(style=_BESIDE, trame_server=server):
        with html.Main(PagePicture(model, server).element, style=_VIEW):
            client.Script(text_of('picture.js'), trame_server=server)
        with html.Div(style=_SIDE):
            return PagePanel(model, server, update)


def menu_item(plotter, *, presets=None):
    """Return a function that adds a control panel to the menu of PyVista's pages.

    Parameters
    ----------
    plotter : pyvista.Plotter
        What is shown and controlled.
    presets : Presets, optional
        Presets; those of the user's file by default.

    Returns
    -------
    callable
        For ``plotter_ui(plotter, add_menu_items=...)``, and in notebooks for
        ``plotter.show(jupyter_kwargs={'add_menu_items': ...})``.

    Raises
    ------
    ImportError
        If trame is not installed.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> add = menu_item(pl)
    >>> callable(add)
    True
    """
    html = require('trame.widgets.html', 'jupyter', 'Panels in pages')
    core = require('trame_client.widgets.core', 'jupyter', 'Panels in pages')

    def add(*_args, **_kwargs):
        server = core.HTML_CTX.element_stack[-1].server
        shown = f'pvibr_drawer_{next(_numbers)}'
        server.state[shown] = False
        html.Button(
            'pvibr',
            type='button',
            click=f'{shown} = !{shown}',
            style=_BUTTON,
            __properties=[('aria_expanded', 'aria-expanded')],
            aria_expanded=(shown,),
        )
        with html.Div(v_show=(shown,), style=_DRAWER):
            html.Button('Close', type='button', click=f'{shown} = false', style=_BUTTON)
            trame_panel(plotter, server, presets=presets)

    return add


class PagePicture:
    """The picture of a plotter in a page, in the size of each tab."""

    # The window has the size of the tab used last. Others show its frames while the view moves,
    # and a still of their own at rest.
    def __init__(self, model, server):
        self._model, self._server = model, server
        self._picture = Picture(model.plotter)
        self._is_still = True
        self._next: asyncio.TimerHandle | None = None
        self.name = f'pvibr_picture_{next(_numbers)}'
        server.controller.trigger(f'{self.name}_ask')(self.ask)
        asked = f"(asked) => trigger('{self.name}_ask', asked)"
        self.element = (
            f'<pvibr-picture :send.prop="{asked}" :frame.prop="{self.name}" '
            'style="position: absolute; inset: 0"></pvibr-picture>'
        )
        server.state[self.name] = 0
        model.each_frame(self._ended)

    def ask(self, action, x, y, button, keys, width, height, has) -> dict:
        """Do what a tab asks for; return the picture for it, unless it has that."""
        if is_closed(self._model.plotter):
            return {'has': has, 'picture': None}
        picture = self._picture
        size = tuple(min(max(int(side), _LEAST), _MOST) for side in (width, height))
        if action or not picture.frame:
            picture.resize(size)
        if action:
            self._model.act(picture.point, action, x, y, button, keys)
        if not self._is_still:
            size = picture.size
        now = [picture.frame, *size]
        return {'has': now, 'picture': None if now == has else picture.jpeg(size)}

    def _ended(self, *_):
        if self._picture.count():
            self._is_still = False
            self._call(0, self._tell)

    def _call(self, seconds, function):
        loop = current_loop()
        if self._next is not None:
            self._next.cancel()
        self._next = None if loop is None else loop.call_later(seconds, function)

    def _tell(self):
        """Have tabs ask for the frame."""
        with self._server.state as state:
            state[self.name] += 1
        if not self._is_still:
            self._call(_REST, self._rest)

    def _rest(self):
        """Have tabs ask for pictures of their own sizes, unless the view still moves."""
        plotter = self._model.plotter
        if is_closed(plotter):
            return
        self._is_still = not (plotter.ibr.playing or is_dragged(plotter.render_window))
        if self._is_still:
            self._tell()
        else:
            self._call(_REST, self._rest)


class PagePanel(RemotePanel):
    """A control panel in a page, bound to a variable of the server's state."""

    def __init__(self, model, server, update=None):
        super().__init__(model)
        self._server, self._update = server, update
        self.name = f'pvibr_panel_{next(_numbers)}'
        self.element = self._laid_out()
        model.listen(self._changed)
        self._tell()

    def _laid_out(self):
        html = require('trame.widgets.html', 'jupyter', 'Panels in pages')
        client = require('trame.widgets.client', 'jupyter', 'Panels in pages')
        act = f'{self.name}_act'
        self._server.controller.trigger(act)(self.act)
        # Templates of Vue 2 and 3 know this way to give an element what is no text.
        asked = f"(asked) => trigger('{act}', asked)"
        text = f'<pvibr-panel :data.prop="{self.name}" :send.prop="{asked}"></pvibr-panel>'
        with html.Div(text, classes='pvibr-panel', trame_server=self._server) as element:
            client.Script(element_script() + _ZOOMS, trame_server=self._server)
        return element

    def _tell(self):
        with self._server.state as state:
            state[self.name] = self.shown

    def _picture_drawn(self):
        if self._update is not None:
            self._update()


def _server_of(server):
    app = require('trame.app', 'jupyter', 'Panels in pages')
    return app.get_server(server) if server is None or isinstance(server, str) else server
