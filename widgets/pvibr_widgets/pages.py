"""The control panel in trame pages: applications, and notebooks rendered by trame."""

from __future__ import annotations

import asyncio
import itertools
import re
from importlib import resources
from typing import Any

from pvibr.core.errors import require
from pvibr.core.state_files import to_text
from pvibr_widgets.model import Group, Model
from pvibr_widgets.rows import Row

_numbers = itertools.count()
_QUIET = 0.06  # seconds without a message after which the page is idle
#: What a page may ask for, and as what its value is taken; None takes none.
_PAGE_ACTIONS: dict[str, Any] = {'help': bool, 'code': None, 'load': str, 'reset_all': None}
_GROUP_ACTIONS: dict[str, Any] = {
    'open': bool,
    'switch': bool,
    'remove': None,
    'apply': str,
    'keep': str,
    'forget': str,
}
_ROW_ACTIONS: dict[str, Any] = {
    'move': int,
    'choose': int,
    'set': bool,
    'derive': bool,
    'write': str,
    'paint': str,
    'reset': None,
}
_METHODS = {'help': 'show_help', 'code': 'show_code'}


def trame_panel(plotter, server=None, *, update=None, presets=None):
    """Add a control panel to a trame page during its layout.

    Parameters
    ----------
    plotter : pyvista.Plotter or vtkRenderer
        Plotter to control.
    server : trame.Server, str or None
        The page's, or its name.
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
    >>> panel.act('write', panel.shown['groups'][0]['id'], 'spread', '0.25')
    '0.25'
    >>> bloom.spread
    0.25
    >>> pl.close()
    """
    return PagePanel(Model(plotter, presets=presets), _server_of(server), update)


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
            classes='pvibr-button',
            __properties=[('aria_expanded', 'aria-expanded')],
            aria_expanded=(shown,),
        )
        with html.Div(v_show=(shown,), classes='pvibr-drawer'):
            html.Button('Close', type='button', click=f'{shown} = false', classes='pvibr-button')
            trame_panel(plotter, server, presets=presets)

    return add


class PagePanel:
    """A control panel in a page, bound to a variable of the server's state."""

    def __init__(self, model, server, update=None):
        self.model, self._server, self._update = model, server, update
        self.name = f'pvibr_panel_{next(_numbers)}'
        self._helps, self._code = False, ''
        self._draw = None
        self._push = None
        self.element = self._laid_out()
        model.listen(self._changed)
        self._show()

    def _laid_out(self):
        html = require('trame.widgets.html', 'jupyter', 'Panels in pages')
        client = require('trame.widgets.client', 'jupyter', 'Panels in pages')
        act, save = f'{self.name}_act', f'{self.name}_save'
        self._server.controller.trigger(act)(self.act)
        self._server.controller.trigger(save)(self.state_text)
        _, text, rows = re.split('<!--.*?-->', _text_of('panel.html'), flags=re.DOTALL)
        for word, name in (('ROWS', rows), ('PANEL', self.name), ('ACT', act), ('SAVE', save)):
            text = text.replace(word, name)
        with html.Div(text, trame_server=self._server) as element:
            client.Style(_text_of('panel.css'))
        return element

    @property
    def shown(self) -> dict:
        """The content of the page as JSON values."""
        return {
            'message': self.model.message,
            'help': self._helps,
            'code': self._code,
            'groups': [_group_shown(group) for group in self.model.groups],
            'own': {'id': '', 'rows': [_row_shown(row) for row in self.model.own]},
        }

    def state_text(self) -> str:
        """Return all settings as the content of a state file."""
        return to_text('state', self.model.ibr.state())

    # -- actions of pages -------------------------------------------------------------------------

    def act(self, action, *args) -> str:
        """Perform an action of a control."""
        target, rest = self._target_of(action, args)
        if target is None:  # removed meanwhile, or unknown
            return ''
        if isinstance(target, Group) and action == 'open':
            target.is_open = bool(rest and rest[0])
            return ''
        self.model.act(
            lambda: getattr(target, _METHODS.get(action, action))(*_given(action, rest))
        )
        self._draw_later()
        return target.text if isinstance(target, Row) else ''

    def _target_of(self, action, args):
        """Return the function of an action and its arguments, None if it does not exist."""
        if action in _PAGE_ACTIONS:
            return self, args
        group = next((g for g in self.model.groups if args[:1] == (_id_of(g),)), None)
        if action in _GROUP_ACTIONS:
            return group, args[1:]
        rows = self.model.own if args[:1] == ('',) else () if group is None else group.rows
        row = next((r for r in rows if args[1:2] == (r.name,)), None)
        return (row if action in _ROW_ACTIONS else None), args[2:]

    def show_help(self, helps):
        """Show or hide the help of settings."""
        self._helps = helps

    def show_code(self):
        """Show the Python code."""
        self._code = self.model.code()

    def load(self, text):
        """Load the content of a state file."""
        self.model.ibr.load_state_text(text)

    def reset_all(self):
        """Reset all settings."""
        self.model.reset()

    # -- updates of pages -------------------------------------------------------------------------

    def _draw_later(self):
        """Render once for all pending changes: sliders are faster than frames."""
        self._cancel_push()
        loop = _loop()
        if loop is None:
            self._drawn()
        elif self._draw is None:
            self._draw = loop.call_later(0.01, self._drawn)

    def _drawn(self):
        self._draw = None
        self.model.show()
        if self._update is not None:
            self._update()

    def _changed(self, _rebuilt):
        """Update the page when it is idle: a slider must not jump back while it moves."""
        self._cancel_push()
        loop = _loop()
        if loop is None:
            self._show()
        else:
            self._push = loop.call_later(_QUIET, self._show)

    def _cancel_push(self):
        if self._push is not None:
            self._push.cancel()
            self._push = None

    def _show(self):
        self._push = None
        with self._server.state as state:
            state[self.name] = self.shown

    def close(self):
        """Stop following the plotter; calling it again is fine."""
        self.model.close()
        self._cancel_push()
        if self._draw is not None:
            self._draw.cancel()
            self._draw = None


def _given(action, values):
    """Return the converted arguments of an action from a page."""
    convert = _PAGE_ACTIONS.get(action) or _GROUP_ACTIONS.get(action) or _ROW_ACTIONS.get(action)
    if convert is None:
        return ()
    if len(values) != 1 or not isinstance(values[0], (str, bool, int, float)):
        msg = f'{action} {values!r:.60}: must have one value'
        raise ValueError(msg)
    return (convert(values[0]),)


def _group_shown(group) -> dict:
    try:
        presets, why = group.presets, group.why
    except (OSError, ValueError) as error:
        presets, why = [], str(error)
    return {
        'id': _id_of(group),
        'title': group.title,
        'enabled': group.enabled,
        'why': why,
        'open': group.is_open,
        'presets': presets,
        'rows': [_row_shown(row) for row in group.rows],
    }


def _row_shown(row) -> dict:
    shown = {n: getattr(row, n) for n in ('name', 'kind', 'label', 'help', 'text', 'error')}
    shown |= {'optional': row.optional, 'derived': row.derived}
    if row.kind == 'number':
        shown |= {'last': row.scale.last, 'stop': row.stop}
    elif row.kind == 'choice':
        shown |= {'choices': row.choices, 'choice': row.choice}
    elif row.kind == 'color':
        shown['color'] = row.color
    elif row.kind == 'switch':
        shown['value'] = bool(row.value)
    return shown


def _id_of(group) -> str:
    """Return a unique name of a group."""
    return f'{group.key}_{id(group.thing)}'


def _text_of(name) -> str:
    return resources.files('pvibr_widgets').joinpath(name).read_text(encoding='utf-8')


def _loop():
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


def _server_of(server):
    app = require('trame.app', 'jupyter', 'Panels in pages')
    return app.get_server(server) if server is None or isinstance(server, str) else server
