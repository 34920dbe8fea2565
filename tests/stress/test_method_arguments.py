"""Bad values for each argument of each method, effect and function: an error that names it."""

from __future__ import annotations

import inspect
import re
import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.plotter_component import IBRComponent
from pvibr.core.params import params_of
from tests.stress.test_arguments import BAD, CAMERA

#: Further values, of kinds that the table of ``add_*`` lacks.
VALUES = BAD | {
    'minus infinity': -np.inf,
    'zero': 0,
    'half': 0.5,
    'False': False,
    'path': '/no such/folder/a',
    'null in a path': 'a\0b',
    'long text': 'x' * 5000,
    'number as text': '1',
    'bytearray': bytearray(b'xy'),
    'tuple of None': (None, None),
    'triple': (1, 2, 3),
    'text in a list': ['a', 1],
    'nested dict': {'a': {'b': object()}},
    'frozen set': frozenset({1}),
    'range': range(3),
    'iterator': iter([1, 2]),
    'exception': ValueError('x'),
    'module': np,
    'slice': slice(3),
    'ellipsis': ...,
    'not implemented': NotImplemented,
    'scalar array': np.array(np.nan),
    'numpy bool': np.bool_(True),
    'numpy int': np.int64(-5),
    'float16': np.float16(1),
    'date': np.datetime64('2020-01-01'),
    'record': np.zeros(2, [('a', int)]),
}
#: Right arguments of methods that need some, and of those that would draw for long.
METHODS = {
    'add': {'effect': None},
    'buffer': {'name': 'depth'},
    'costs': {},
    'enable_picking': {},
    'export_glb': {'path': 'a.glb'},
    'fly_to': {'camera': CAMERA, 'frames': 1},
    'inspect': {},
    'load_state': {'path': 'a.json'},
    'load_state_text': {'text': '{}'},
    'look': {'name': 'studio'},
    'movie': {'path': 'a.gif', 'frames': 1, 'progress': False},
    'on_close': {'function': print},
    'pick': {'x': 1, 'y': 1},
    'play': {},
    'remove': {'thing': None},
    'restore': {'state': {}},
    'save_state': {'path': 'a.json'},
    'screenshot': {},
    'to_plain_plotter': {},
    'wait': {'timeout': 0.0},
    'web_report': {},
}
#: Those that take as long as a number says, and any name.
LONG = {('movie', 'frames'), ('movie', 'seconds'), ('movie', 'samples'), ('screenshot', 'samples')}
LONG |= {('costs', 'frames')}
ERRORS = (TypeError, ValueError, KeyError, OSError, ImportError, pvibr.PvibrError)
EFFECTS = [name for name in pvibr.EFFECTS if name != 'Projector']  # needs a camera and an image


def named(argument, error, value) -> str:
    """Return what is wrong with an error about an argument."""
    text = str(error)
    if isinstance(value, str) and value[:40] in text:  # of a path, by the system
        return ''
    if re.search(rf'\b{argument.rstrip("s")}', text) or re.search('path|file|folder', text):
        return ''
    return f'nameless for {value!r:.40}: {error!r:.150}'


def state_of(pl):
    return [*pl.ibr.effects], [*pl.renderer.actors], pl.ibr.time, pl.camera_position


def wrong_with(pl, method, right, argument, value):
    """Call a method with a bad value, and return what is wrong with that."""
    before = state_of(pl)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            method(**right | {argument: value})
            pl.render()
    except ERRORS as error:
        if str(state_of(pl)) != str(before):
            return f'left changed by {value!r:.40}'
        return named(argument, error, value)
    except Exception as error:
        return f'wrong for {value!r:.40}: {error!r:.200}'
    return ''


def arguments_of(method):
    found = inspect.signature(method).parameters.values()
    return [p.name for p in found if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]


@pytest.mark.slow
@pytest.mark.parametrize('name', METHODS)
def test_methods(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pl = pv.Plotter(window_size=(32, 32), off_screen=True)
    pl.ibr.add_spheres([(0, 0, 0)])
    pl.show(auto_close=False)
    found = []
    method = getattr(pl.ibr, name)
    for argument in arguments_of(method):
        for value in VALUES.values():
            if (name, argument) in LONG and isinstance(value, (int, float, np.number)):
                continue
            if argument == 'each' and callable(value):  # of the user's
                continue
            found.append(wrong_with(pl, method, METHODS[name], argument, value))
    assert not [text for text in found if text]


def test_every_method_is_here():
    names = {n for n in dir(IBRComponent) if callable(getattr(IBRComponent, n)) and n[0] != '_'}
    no_arguments = {n for n in names if len(arguments_of(getattr(IBRComponent, n))) == 1}
    adds = {n for n in names if n.startswith('add_')}
    # A page takes as long as a plain plotter, whose arguments these are; workers are slow.
    assert names - no_arguments - adds - {'export_html', 'show_web', 'distribute'} == {*METHODS}


@pytest.mark.parametrize('name', EFFECTS)
def test_settings_of_effects(name):
    """Each is refused with its name, or what is set is what a state can hold."""
    effect = getattr(pvibr, name).sample([pv.Actor()])
    for setting in params_of(type(effect)):
        for value in VALUES.values():
            before, wrong = getattr(effect, setting), ''
            try:
                setattr(effect, setting, value)
            except (TypeError, ValueError) as error:
                wrong = str(error)
            if wrong:
                assert f'{name}.{setting} must be' in wrong
                assert getattr(effect, setting) == before
            else:
                effect.restore(effect.state())
            setattr(effect, setting, before)
