"""What panels of notebooks and pages have in common: what they show, and what they may ask for."""

from __future__ import annotations

import asyncio
import itertools
from importlib import resources
from typing import Any

from pvibr.core.state_files import to_text
from pvibr_widgets.model import Model
from pvibr_widgets.rows import Row

_QUIET = 0.06  # seconds without a message after which the page is idle
#: What a page may ask for, and as what its value is taken; None takes none.
_PANEL_ACTIONS: dict[str, Any] = {'code': None, 'save': None, 'load': str, 'reset_all': None}
_GROUP_ACTIONS: dict[str, Any] = {
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


class RemotePanel:
    """A control panel elsewhere, that is told what to show and asks for what users do."""

    def __init__(self, model: Model):
        self.model = model
        self._turns = itertools.count(1)
        self._turn = self._done = 0
        self._draw: asyncio.TimerHandle | None = None
        self._push: asyncio.TimerHandle | None = None

    @property
    def shown(self) -> dict:
        """What is shown, as JSON values; `done` is the last turn whose picture is drawn."""
        own = {'id': '', 'title': 'Plotter', 'rows': [_row_shown(row) for row in self.model.own]}
        return {
            'message': self.model.message,
            'done': self._done,
            'groups': [_group_shown(group) for group in self.model.groups],
            'own': own,
        }

    # -- what users ask for -----------------------------------------------------------------------

    def act(self, action='', *args) -> dict:
        """Perform an action of a control; return what it is about, as text, and its turn."""
        target, convert, rest = self._target_of(action, args)
        answer: list = []
        if target is not None:  # else removed meanwhile, or unknown
            self.model.act(
                lambda: answer.append(getattr(target, action)(*_given(action, convert, rest)))
            )
            self._turn = next(self._turns)
            self._draw_later()
        text = target.text if isinstance(target, Row) else (answer or [''])[0]
        return {'text': text if isinstance(text, str) else '', 'turn': self._turn}

    def _target_of(self, action, args):
        """Return whose action it is, how its value is converted, and its arguments."""
        if action in _PANEL_ACTIONS:
            return self, _PANEL_ACTIONS[action], args
        group = next((g for g in self.model.groups if args[:1] == (_id_of(g),)), None)
        if action in _GROUP_ACTIONS:
            return group, _GROUP_ACTIONS[action], args[1:]
        rows = self.model.own if args[:1] == ('',) else () if group is None else group.rows
        row = next((r for r in rows if args[1:2] == (r.name,)), None)
        return (row if action in _ROW_ACTIONS else None), _ROW_ACTIONS.get(action), args[2:]

    def code(self) -> str:
        """Return all of it as Python."""
        return self.model.code()

    def save(self) -> str:
        """Return all settings as the content of a state file."""
        return to_text('state', self.model.ibr.state())

    def load(self, text):
        """Load the content of a state file."""
        self.model.ibr.load_state_text(text)

    def reset_all(self):
        """Reset all settings."""
        self.model.reset()

    # -- what is told -----------------------------------------------------------------------------

    def _tell(self):
        """Send what is shown."""
        raise NotImplementedError

    def _picture_drawn(self):
        """Send the picture, where the panel has to."""

    def _draw_later(self):
        """Render once for all pending changes: sliders are faster than frames."""
        self._cancel_push()
        loop = current_loop()
        if loop is None:
            self._drawn()
        elif self._draw is None:
            self._draw = loop.call_later(0.01, self._drawn)

    def _drawn(self):
        self._draw, turn = None, self._turn
        self.model.show()
        self._done = turn
        self._picture_drawn()
        self._changed()

    def _changed(self, _rebuilt=False):
        """Tell once the page is idle: a slider must not jump back while it moves."""
        self._cancel_push()
        loop = current_loop()
        if loop is None:
            self._pushed()
        else:
            self._push = loop.call_later(_QUIET, self._pushed)

    def _pushed(self):
        self._push = None
        self._tell()

    def _cancel_push(self):
        if self._push is not None:
            self._push.cancel()
            self._push = None

    def close(self):
        """Stop following the plotter; calling it again is fine."""
        self.model.close()
        self._cancel_push()
        if self._draw is not None:
            self._draw.cancel()
            self._draw = None


def element_script() -> str:
    """Return the JavaScript that defines the element of panels."""
    return text_of('panel.js').replace('PANEL_CSS', text_of('panel.css'))


def text_of(name) -> str:
    """Return a file of this package."""
    return resources.files('pvibr_widgets').joinpath(name).read_text(encoding='utf-8')


def _given(action, convert, values):
    """Return the converted arguments of an action from a page."""
    if convert is None:
        return ()
    if len(values) != 1 or not isinstance(values[0], (str, bool, int, float)):
        raise ValueError(f'{action} {values!r:.60}: must have one value')
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
    shown |= {'optional': row.optional, 'derived': row.derived, 'unit': row.param.unit or ''}
    if row.kind == 'number':
        scale = row.scale
        ends = {'low': scale.numbers[0], 'high': scale.numbers[-1]}
        shown |= {'last': scale.last, 'stop': row.stop} | ends
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


def current_loop():
    """Return the event loop that runs, or None."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
