"""The control panel in a notebook."""

from __future__ import annotations

import asyncio
import contextlib
import html
import io
import threading
from collections import deque
from typing import Any

from pvibr.core.errors import require
from pvibr_widgets.model import Model

W: Any = require('ipywidgets', 'jupyter', 'Panels in notebooks')

# Each widget has a layout of its own, which goes with it.
_NARROW = {'width': 'auto', 'min_width': '2.6em'}
_WIDE = {'flex': '1 1 auto', 'width': 'auto'}
_NAME = {'width': '7em'}
_ERROR = '<span role="alert" style="color: var(--jp-error-color1, #b00020)">{}</span>'
_HELP = '<small style="opacity: 0.8">{}</small>'


def notebook_panel(plotter, *, picture=False, presets=None):
    """Return a control panel for a notebook: the last line of a cell shows it.

    It works through the kernel, whatever shows the plotter: beside a ``'trame'`` or ``'server'``
    backend the picture there follows; where the backend is ``'static'``, ask for a `picture`.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Plotter to control.
    picture : bool, optional
        Whether the panel shows the picture itself, drawn again after each change.
    presets : Presets, optional
        Presets; those of the user's file by default.

    Returns
    -------
    ipywidgets.VBox
        With the :class:`pvibr_widgets.model.Model` as its ``model``.

    Raises
    ------
    ImportError
        If there are no ipywidgets.

    Examples
    --------
    >>> import pvibr
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> bloom = pl.ibr.add(pvibr.Bloom())
    >>> panel = notebook_panel(pl)
    >>> panel.group('Bloom').row('spread').controls['text'].value = '0.25'
    >>> bloom.spread
    0.25
    >>> pl.close()
    """
    return Panel(Model(plotter, presets=presets), picture=picture)


class Panel(W.VBox):
    """A control panel made of ipywidgets."""

    def __init__(self, model, *, picture=False):
        self.model = model
        self._home = _Home(model)
        self.rows = [RowView(self._home, row) for row in model.own]
        self.groups: list[GroupBox] = []
        self._shell = None
        self.path = W.Text('pvibr.json', description='File', layout=_WIDE)
        self.code = W.Textarea(
            description='Python', disabled=False, layout={'width': 'auto', 'display': 'none'}
        )
        self.help = W.ToggleButton(value=False, description='Help', tooltip='explain each setting')
        self._message = W.HTML()
        self._groups = W.VBox()
        self._picture = W.Image(format='png') if picture else None
        super().__init__(self._build(), layout={'max_width': '48em'})
        self.help.observe(lambda _: self._home.do(lambda: None), 'value')
        model.listen(self._changed)
        self._follow_cells()
        self._changed(True)

    def _build(self):
        do, model = self._home.do, self.model
        tools = W.HBox(
            [
                _button(
                    'Copy as Python', 'show all of this as Python', lambda: do(self._show_code)
                ),
                _button('Reset all', 'give everything its defaults', lambda: do(model.reset)),
                self.help,
            ],
            layout={'flex_flow': 'row wrap'},
        )
        files = W.HBox(
            [
                self.path,
                _button('Save', 'write all settings', lambda: do(model.save, self.path.value)),
                _button('Load', 'read all settings', lambda: do(model.load, self.path.value)),
            ]
        )
        shown = [] if self._picture is None else [self._picture]
        return [*shown, tools, files, self.code, self._message, *self.rows, self._groups]

    def _follow_cells(self):
        """Refresh after each cell, whose changes may not have been rendered."""
        with contextlib.suppress(ImportError):
            from IPython import get_ipython

            self._shell = get_ipython()
            if self._shell is not None:
                self._shell.events.register('post_run_cell', self._after_cell)

    def _after_cell(self, *_):
        self.model.refresh()

    def close(self):
        """Close the panel, not the plotter; calling it again is fine."""
        self.model.close()
        if self._shell is not None:
            self._shell.events.unregister('post_run_cell', self._after_cell)
            self._shell = None
        for child in getattr(self, 'children', ()):
            _close(child)
        self.groups = []
        self.set_trait('children', ())
        super().close()

    def _show_code(self):
        self.code.value = self.model.code()
        self.code.rows = self.code.value.count('\n') + 1
        self.code.layout.display = None
        self.model.message = 'select and copy'

    def group(self, name):
        """Return a group by its name in the state."""
        return next(box for box in self.groups if box.group.name == name)

    def _changed(self, rebuilt):
        if self._home.is_behind and not rebuilt:  # newer values of the page must stay
            return
        if rebuilt:
            for box in self.groups:
                _close(box)
            self.groups = [GroupBox(self._home, group) for group in self.model.groups]
            self._groups.children = self.groups
        _say(self._message, '<span role="status">{}</span>', self.model.message)
        for view in self.rows:
            view.update_value(self.help.value)
        for box in self.groups:
            box.update_rows(self.help.value)
        if self._picture is not None and self.model.groups:
            self._picture.value = _png_of(self.model.plotter)


class _Home:
    """Runs calls in the plotter's thread: messages of pages may arrive in others."""

    def __init__(self, model):
        self._model, self._thread = model, threading.get_ident()
        self._waiting: deque = deque()
        try:
            self._loop: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
        except RuntimeError:
            self._loop = None

    @property
    def is_behind(self) -> bool:
        """Whether calls are waiting."""
        return bool(self._waiting)

    def do(self, action, *args):
        """Run a call now or soon."""
        if self._loop is None or self._thread == threading.get_ident():
            self._model.do(action, *args)
        else:
            self._waiting.append((action, args))
            self._loop.call_soon_threadsafe(self._catch_up)

    def _catch_up(self):
        if self._waiting:
            while self._waiting:
                action, args = self._waiting.popleft()
                self._model.act(action, *args)
            self._model.show()


class GroupBox(W.VBox):
    """An effect or a thing: its switch, presets and rows."""

    def __init__(self, home, group):
        self.group = group
        self._do = do = home.do
        self.title = W.ToggleButton(
            value=group.is_open, description=group.title, layout=_WIDE, tooltip='show its settings'
        )
        self.enabled = W.Checkbox(
            group.enabled, description='on', indent=False, layout={'width': '5em'}
        )
        self.remove = _button('Remove', f'remove {group.title}', lambda: do(group.remove))
        self.preset = W.Dropdown(description='Preset', layout=_WIDE)
        self.name = W.Text(placeholder='name', tooltip='name of a new preset', layout=_NAME)
        self._why = W.HTML()
        self.rows = [RowView(home, row) for row in group.rows]
        self._body = W.VBox([self._sets(), *self.rows])
        head = W.HBox([self.title, self.enabled, self.remove])
        super().__init__([head, self._why, self._body])
        self.layout.border, self.layout.padding = '1px solid rgba(128, 128, 128, 0.4)', '4px'
        self.enabled.observe(lambda change: self._switch(change['new']), 'value')
        self.title.observe(lambda change: self._open(change['new']), 'value')
        self._open(group.is_open)

    def _sets(self):
        group, do = self.group, self._do
        controls = [
            self.preset,
            _button('Apply', 'apply the preset', lambda: do(group.apply, self.preset.value)),
            _button('Forget', 'forget the preset', lambda: do(group.forget, self.preset.value)),
            self.name,
            _button('Keep', 'keep a new preset', lambda: do(group.keep, self.name.value)),
        ]
        return W.HBox(controls, layout={'flex_flow': 'row wrap'})

    def _switch(self, on):
        if on != self.group.enabled:
            self._do(self.group.switch, on)

    def _open(self, is_open):
        self.group.is_open = is_open
        self.title.icon = 'caret-down' if is_open else 'caret-right'
        self._body.layout.display = None if is_open else 'none'

    def row(self, name):
        """Return the view of a setting."""
        return next(view for view in self.rows if view.row.name == name)

    def update_rows(self, helps):
        """Update the widgets."""
        self.enabled.value = self.group.enabled
        _say(self._why, _ERROR, self.group.why)
        try:
            names, chosen = tuple(self.group.presets), self.preset.value
            if names != self.preset.options:
                self.preset.options = names
                self.preset.value = chosen if chosen in names else names[0]
        except (OSError, ValueError) as error:
            _say(self._why, _ERROR, str(error))
        for view in self.rows:
            view.update_value(helps)


class RowView(W.VBox):
    """A setting: its label, control, check box and message."""

    def __init__(self, home, row):
        self.row = row
        self._do = home.do
        self._updating = 0  # the thread that shows what is
        self.controls: dict[str, Any] = dict(self._made())
        self._help = W.HTML(_HELP.format(html.escape(row.help)))
        self._error = W.HTML()
        super().__init__([W.HBox([*self.controls.values()]), self._help, self._error])

    def _made(self):
        row = self.row
        style = {'description_width': '10em'}
        common = {'tooltip': row.help, 'style': style, 'layout': _WIDE}
        if row.kind == 'switch':
            yield self._control('switch', W.Checkbox(description=row.label, **common), row.set)
        elif row.kind == 'choice':
            options = [(word, i) for i, word in enumerate(row.choices)]
            choice = W.Dropdown(options=options, description=row.label, **common)
            yield self._control('choice', choice, row.choose)
        elif row.kind == 'color':
            yield self._control('color', W.ColorPicker(description=row.label, **common), row.paint)
        else:
            yield from self._written(common)
        if row.optional:
            derived = W.Checkbox(
                description='auto',
                indent=False,
                layout={'width': '4.5em'},
                tooltip='derived from the scene',
            )
            yield self._control('derived', derived, row.derive)
        yield 'reset', _button('↺', f'reset {row.label}', lambda: self._do(row.reset))

    def _written(self, common):
        row, narrow = self.row, {'layout': _NAME}
        if row.kind == 'number':
            slider = W.IntSlider(
                min=0, max=row.scale.last, readout=False, description=row.label, **common
            )
            yield self._control('slider', slider, row.move)
            text = W.Text(continuous_update=False, tooltip=row.label, **narrow)
        else:
            text = W.Text(continuous_update=False, description=row.label, **common)
        yield self._control('text', text, row.write)

    def _control(self, key, control, action):
        def moved(change):
            if self._updating != threading.get_ident():
                self._do(action, change['new'])

        control.observe(moved, 'value')
        return key, control

    def update_value(self, helps):
        """Update the widgets."""
        row = self.row
        shown = {'text': row.text, 'switch': bool(row.value), 'derived': row.derived}
        if row.kind in ('choice', 'color'):
            shown[row.kind] = getattr(row, row.kind)
        self._updating = threading.get_ident()
        try:
            if (slider := self.controls.get('slider')) is not None:
                slider.max = row.scale.last
                slider.value = row.stop
            for key in shown.keys() & self.controls.keys():
                self.controls[key].value = shown[key]
        finally:
            self._updating = 0
        self._help.layout.display = None if helps else 'none'
        _say(self._error, _ERROR, row.error)


def _say(line, form, text):
    line.value = form.format(html.escape(text)) if text else ''
    line.layout.display = None if text else 'none'


def _close(box):
    """Close a widget and its children, in the page too."""
    for child in getattr(box, 'children', ()):
        _close(child)
    for part in (getattr(box, 'style', None), box.layout):
        if part is not None:
            part.close()
    box.close()


def _button(text, tooltip, clicked):
    button = W.Button(description=text, tooltip=tooltip, layout=_NARROW)
    button.on_click(lambda _: clicked())
    return button


def _png_of(plotter):
    """Return a screenshot of a plotter as PNG."""
    file = io.BytesIO()
    plotter.screenshot(file, return_img=False)
    return file.getvalue()
