"""Settings of everything in a plotter, as values and as readable files."""

from __future__ import annotations

import json

from pvibr.core.errors import warn
from pvibr.core.files import existing, replacing

#: Version of the file format; files of other versions are read leniently.
VERSION = 1
#: Maximum size of a file; settings take a few kilobytes.
MOST_BYTES = 2**24


def state_of(contents, plotter_state) -> dict:
    """Return the settings of things as JSON values."""
    subplots = {
        key: {name: thing.state() | {'enabled': thing.enabled} for name, thing in things.items()}
        for key, things in contents.items()
    }
    return plotter_state | {'subplots': subplots}


def restore(contents, state, *, plotter=None, lenient=False) -> list[str]:
    """Apply settings to things, all or none; return the unknown names."""
    state = _mapping('state', state)
    plotter_names = [] if plotter is None else [k for k in plotter.state() if k in state]
    unknown_names = [k for k in state if k not in ('subplots', *plotter_names)]
    steps = [('plotter', plotter, {k: state[k] for k in plotter_names})] if plotter_names else []
    for key, states_by_name in _mapping('subplots', state.get('subplots', {})).items():
        things_here = contents.get(key, {})
        for name, settings in _mapping(f'subplot {key}', states_by_name).items():
            if name in things_here:
                steps.append((name, things_here[name], _mapping(name, settings)))
            else:
                unknown_names.append(f'subplot {key}: {name}')
    return unknown_names + _carry_out(steps, lenient)


def load(contents, text, name, *, plotter=None) -> list[str]:
    """Apply the settings in a text, all or none; return the unknown names."""
    state, version = from_text('state', text, name)
    try:
        return restore(contents, state, plotter=plotter, lenient=version != VERSION)
    except (TypeError, ValueError) as error:
        error.args = (f'{name}: {error}',)
        raise


def named(effects) -> dict:
    """Return effects by name; the second of a name is ``'Name 2'``."""
    effects_by_name: dict = {}
    for effect in effects:
        count = sum(e.name == effect.name for e in effects_by_name.values())
        effects_by_name[f'{effect.name} {count + 1}' if count else effect.name] = effect
    return effects_by_name


def _mapping(name, value) -> dict:
    if not isinstance(value, dict):
        raise TypeError(f'{name} must be a dict of names, got {value!r:.60}')
    return value


def _carry_out(steps, lenient):
    """Restore one thing after the other; undo all if one fails."""
    old_states = [(thing, thing.state(), thing.enabled) for _, thing, _ in steps]
    unknown_names = []
    try:
        for name, thing, settings in steps:
            batches = [{n: v} for n, v in settings.items()] if lenient else [settings]
            for batch in batches:
                unknown_names += _restore_one(name, thing, batch, lenient)
    except (TypeError, ValueError):
        for thing, settings, enabled in old_states:
            thing.restore(settings)
            thing.enabled = enabled
        raise
    return unknown_names


def _restore_one(name, thing, settings, lenient):
    new_enabled = settings.get('enabled', thing.enabled)
    try:
        if not isinstance(new_enabled, bool):
            raise TypeError(f'{name}.enabled must be a bool, got {new_enabled!r}')
        unknown_names = thing.restore({n: v for n, v in settings.items() if n != 'enabled'})
    except (TypeError, ValueError):
        if not lenient:
            raise
        return [f'{name}.{n} = {v!r:.60}' for n, v in settings.items()]
    thing.enabled = new_enabled
    return [f'{name}.{n}' for n in unknown_names]


def warn_of(unknown):
    """Warn once about all unknown names, in the user's code."""
    if unknown:
        warn(f'unknown names were not restored: {", ".join(unknown)}; add the effects first')


def to_text(kind, values) -> str:
    """Return values as the text of a file."""
    return json.dumps({'pvibr': kind, 'version': VERSION} | values, indent=2, allow_nan=False)


def from_text(kind, text, name='the text') -> tuple[dict, int]:
    """Return the values in a text, and the version of its format."""
    if not isinstance(text, (str, bytes)):
        raise TypeError(f'text must be a str or bytes, got {text!r:.60}')
    try:
        if isinstance(text, bytes):
            text = text.decode('utf-8-sig')
        values = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{name} is not JSON written by pvibr: {error}') from None
    version = values.pop('version', None) if isinstance(values, dict) else None
    if version is None or values.pop('pvibr', None) != kind or not _is_count(version):
        raise ValueError(
            f'{name} is not a pvibr {kind}: "pvibr": "{kind}" and a "version" must come first'
        )
    return values, version


def _is_count(version):
    return isinstance(version, int) and not isinstance(version, bool) and version > 0


def _no_number(word):
    raise ValueError(f'{word} is not a JSON number')


def write(path, text):
    """Write a text file; on failure the existing file is unchanged."""
    with replacing(path) as file:
        file.write_text(text, encoding='utf-8')


def read(path) -> bytes:
    """Return the content of a settings file."""
    with existing(path).open('rb') as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f'{path} is larger than {MOST_BYTES:,} bytes: not a settings file')
    return content
