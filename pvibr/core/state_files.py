"""Settings of everything in a plotter, as values and as readable files."""

from __future__ import annotations

import json

from pvibr.core.errors import warn
from pvibr.core.files import existing, replacing

#: Version of the file layout; files of other versions are read leniently.
VERSION = 1
#: Maximum size of a file: settings take some kilobytes.
MOST_BYTES = 2**24


def state_of(contents, own) -> dict:
    """Return the settings of things as JSON values."""
    subplots = {
        key: {name: thing.state() | {'enabled': thing.enabled} for name, thing in named.items()}
        for key, named in contents.items()
    }
    return own | {'subplots': subplots}


def restore(contents, state, *, own=None, lenient=False) -> list[str]:
    """Apply settings to things, all or none; return the unknown names."""
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
    """Apply the settings in a text, all or none; return the unknown names."""
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
        raise TypeError(f'{name} is {type(value).__name__} {value!r:.60}: must be a dict of names')
    return value


def _carry_out(plan, lenient):
    """Restore one thing after the other; if one fails, undo all."""
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
            raise TypeError(f'{name}.enabled = {enabled!r}: must be a bool')
        left_out = thing.restore({n: v for n, v in settings.items() if n != 'enabled'})
    except (TypeError, ValueError):
        if not lenient:
            raise
        return [f'{name}.{n} = {v!r:.60}' for n, v in settings.items()]
    thing.enabled = enabled
    return [f'{name}.{n}' for n in left_out]


def warn_of(unknown):
    """Warn once of all unknown names, at the caller's caller."""
    if unknown:
        warn(f'unknown names are not restored: {", ".join(unknown)}; add the effects first')


def to_text(kind, values) -> str:
    """Return values as text of a file."""
    return json.dumps({'pvibr': kind, 'version': VERSION} | values, indent=2, allow_nan=False)


def from_text(kind, text, name='the text') -> tuple[dict, int]:
    """Return the values in a text, and the version of its layout."""
    if not isinstance(text, (str, bytes)):
        raise TypeError(f'text = {text!r:.60}: must be a str or bytes')
    try:
        if isinstance(text, bytes):
            text = text.decode('utf-8-sig')
        values = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{name} is not JSON written by pvibr: {error}') from None
    version = values.pop('version', None) if isinstance(values, dict) else None
    if version is None or values.pop('pvibr', None) != kind or not _is_count(version):
        raise ValueError(
            f'{name} is not a pvibr {kind}: it must begin with "pvibr": "{kind}" and a "version"'
        )
    return values, version


def _is_count(version):
    return isinstance(version, int) and not isinstance(version, bool) and version > 0


def _no_number(word):
    raise ValueError(f'{word} is not a JSON number')


def write(path, text):
    """Write a text file, or keep the old one on failure."""
    with replacing(path) as file:
        file.write_text(text, encoding='utf-8')


def read(path) -> bytes:
    """Return the content of a file of settings."""
    with existing(path).open('rb') as file:
        found = file.read(MOST_BYTES + 1)
    if len(found) > MOST_BYTES:
        raise ValueError(f'{path} is larger than {MOST_BYTES:,} bytes: not a file of settings')
    return found
