"""Python code that recreates the contents of a plotter."""

from __future__ import annotations

import inspect

import pvibr
from pvibr.core.params import params_of

_WIDTH = 88


def code_of(contents, own=None, place_of=None) -> str:
    """Return Python that gives a plotter ``pl`` the same effects and settings."""
    lines, settings = [], {}
    for key, named in contents.items():
        calls = {name: _call_of(thing) for name, thing in named.items()}
        if place_of is not None and any(calls.values()):
            lines.append(f'pl.subplot{_place(place_of(int(key)))}')
        for name, thing in named.items():
            if calls[name] is not None:
                lines += _added(thing, calls[name], f'effect_{len(lines)}')
        rest = {n: t.state() | {'enabled': t.enabled} for n, t in named.items() if not calls[n]}
        if rest:
            settings[key] = rest
    if settings:
        lines += ['# These were made of data; once they are here, this sets them.']
        lines += _wrapped('pl.ibr.restore(', [repr({'subplots': settings})], ')')
    lines += [f'pl.ibr.{name} = {value!r}' for name, value in (own or {}).items()]
    return '\n'.join(['import pvibr', '', *lines])


def _place(place) -> str:
    return str(tuple(map(int, place))) if hasattr(place, '__len__') else f'({int(place)})'


def _added(thing, call, variable) -> list[str]:
    """Return lines that add a thing, with a comment on what its constructor does not take."""
    more = [] if thing.enabled else ['enabled = False']
    if thing.name != type(thing).__name__:
        more.append(f'name = {thing.name!r}')
    head = f'{variable} = pl.ibr.add(' if more else 'pl.ibr.add('
    name, arguments = call
    return [*_wrapped(f'{head}{name}(', arguments, '))'), *(f'{variable}.{m}' for m in more)]


def _wrapped(head, arguments, tail) -> list[str]:
    line = f'{head}{", ".join(arguments)}{tail}'
    if len(line) <= _WIDTH:
        return [line]
    return [head, *(f'    {a},' for a in arguments), tail]


def _call_of(thing) -> tuple[str, list[str]] | None:
    """Return name and arguments of the constructor, None if any is not a plain value."""
    kind = type(thing)
    given = _given(thing)
    if getattr(pvibr, kind.__name__, None) is not kind or given is None:
        return None
    params = params_of(kind)
    given |= {n: getattr(thing, n) for n, p in params.items() if getattr(thing, n) != p.default}
    return f'pvibr.{kind.__name__}', [f'{n}={v!r}' for n, v in given.items()]


def _given(thing) -> dict | None:
    """Return the other arguments of the constructor, None if any is not a plain value."""
    found = {}
    for name, parameter in inspect.signature(type(thing)).parameters.items():
        if parameter.kind is not parameter.VAR_KEYWORD:
            if parameter.default is parameter.empty:
                return None
            # What a constructor takes is an attribute of that name, read only or private.
            value = getattr(thing, name, getattr(thing, f'_{name}', inspect))
            if not _is_plain(value):
                return None
            if value != parameter.default:
                found[name] = value
    return found


def _is_plain(value) -> bool:
    if isinstance(value, (tuple, list)):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, (bool, int, float, str))
