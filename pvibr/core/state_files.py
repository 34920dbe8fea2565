"""Settings of everything in a plotter, as values and as files that people can read."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

from pvibr.core.errors import PvibrWarning
from pvibr.core.files import replacing

#: Of the layout of the files; files of other versions are read as far as they are understood.
VERSION = 1
#: A file of settings has some kilobytes; what is far larger is something else.
MOST_BYTES = 2**24


def state_of(contents, own) -> dict:
    """Return the settings of things as values that JSON keeps."""
    subplots = {
        key: {name: thing.state() | {'enabled': thing.enabled} for name, thing in named.items()}
        for key, named in contents.items()
    }
    return own | {'subplots': subplots}


def restore(contents, state, *, own=None, lenient=False) -> list[str]:
    """Set things to settings; all of them or none."""
    known = [] if own is None else [k for k in own.state() if k in _mapping('state', state)]
    unknown = [k for k in _mapping('state', state) if k not in ('subplots', *known)]
    plan = [('plotter', own, {k: state[k] for k in known})] if known else []
    for key, named in _mapping('subplots', state.get('subplots', {})).items():
        here = contents.get(key, {})
        for name, settings in _mapping(f'subplot {key}', named).items():
            if name in here:
                plan.append((name, here[name], _mapping(name, settings)))
            else:
                unknown.append(f'subplot {key}: {name}')
    return unknown + _carry_out(plan, lenient)


def load(contents, text, name, *, own=None) -> list[str]:
    """Set things to the settings in a text; return the names that were left out."""
    state, version = from_text('state', text, name)
    return restore(contents, state, own=own, lenient=version != VERSION)


def named(effects) -> dict:
    """Return effects by name; the second of a name is ``'Name 2'``."""
    found: dict = {}
    for effect in effects:
        count = sum(e.name == effect.name for e in found.values())
        found[f'{effect.name} {count + 1}' if count else effect.name] = effect
    return found


def _mapping(name, value) -> dict:
    if not isinstance(value, dict):
        msg = f'{name} is {type(value).__name__} {value!r:.60}: must be a dict of names'
        raise TypeError(msg)
    return value


def _carry_out(plan, lenient):
    """Restore one after the other; where one fails, put back those before it."""
    before = [(thing, thing.state(), thing.enabled) for _, thing, _ in plan]
    unknown = []
    try:
        for name, thing, settings in plan:
            one_by_one = [{n: v} for n, v in settings.items()] if lenient else [settings]
            for part in one_by_one:
                unknown += _restore_one(name, thing, part, lenient)
    except (TypeError, ValueError):
        for thing, settings, enabled in before:
            thing.restore(settings)
            thing.enabled = enabled
        raise
    return unknown


def _restore_one(name, thing, settings, lenient):
    enabled = settings.get('enabled', thing.enabled)
    try:
        if not isinstance(enabled, bool):
            msg = f'{name}.enabled = {enabled!r}: must be a bool'
            raise TypeError(msg)
        left_out = thing.restore({n: v for n, v in settings.items() if n != 'enabled'})
    except (TypeError, ValueError):
        if not lenient:
            raise
        return [f'{name}.{n} = {v!r:.60}' for n, v in settings.items()]
    thing.enabled = enabled
    return [f'{name}.{n}' for n in left_out]


def warn_of(unknown):
    """Say in one warning what was left out, if anything was; it names the caller's caller."""
    if unknown:
        msg = f'not here, so not restored: {", ".join(unknown)}; add the effects first'
        warnings.warn(msg, PvibrWarning, stacklevel=3)


def to_text(kind, values) -> str:
    """Return values as the text of a file."""
    return json.dumps({'pvibr': kind, 'version': VERSION} | values, indent=2, allow_nan=False)


def from_text(kind, text, name='the text') -> tuple[dict, int]:
    """Return the values that a text holds, and the version of its layout."""
    try:
        if isinstance(text, bytes):
            text = text.decode('utf-8-sig')
        values = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        msg = f'{name} is no JSON that pvibr wrote: {error}'
        raise ValueError(msg) from None
    version = values.pop('version', None) if isinstance(values, dict) else None
    if version is None or values.pop('pvibr', None) != kind or not _is_count(version):
        msg = f'{name} holds no pvibr {kind}: it must begin with "pvibr": "{kind}" and a "version"'
        raise ValueError(msg)
    return values, version


def _is_count(version):
    return isinstance(version, int) and not isinstance(version, bool) and version > 0


def _no_number(word):
    msg = f'{word} is no number in JSON'
    raise ValueError(msg)


def write(path, text):
    """Write a text to a file, whole or not at all."""
    with replacing(path) as file:
        file.write_text(text, encoding='utf-8')


def read(path) -> bytes:
    """Return what a file of settings holds."""
    with Path(path).open('rb') as file:
        found = file.read(MOST_BYTES + 1)
    if len(found) > MOST_BYTES:
        msg = f'{path} is larger than {MOST_BYTES:,} bytes: no file of settings'
        raise ValueError(msg)
    return found
