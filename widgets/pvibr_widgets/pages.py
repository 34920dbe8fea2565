"""The control panel in trame pages: applications, and notebooks rendered by trame."""

from __future__ import annotations

import itertools

from pvibr.core.errors import require
from pvibr_widgets.model import Model
from pvibr_widgets.remote import RemotePanel, element_script

_numbers = itertools.count()
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
        Put PyVista's view of the plotter beside the panel, to fill the page.
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
    ui = require('trame_pyvista.ui', 'jupyter', 'Panels in pages')
    # One above the other where a window is narrow.
    with html.Div(style=_BESIDE, trame_server=server):
        with html.Main(style=_VIEW, classes='pvibr-view'):
            ui.plotter_ui(plotter, mode='server', server=server, add_menu=False)
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
            client.Script(element_script(), trame_server=self._server)
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
