"""Signatures and docstrings that name every keyword, also those that are passed on."""

from __future__ import annotations

import functools
import inspect
import re
import textwrap
from collections import Counter
from inspect import Parameter, Signature
from typing import NamedTuple

from pvibr.core.params import params_of

_SECTION = re.compile(r'^(?P<name>\w[\w ]*)\n-{3,}\n', re.MULTILINE)
_WIDTH = 95


class Argument(NamedTuple):
    """An argument: its place in the signature, and its entry in the docstring."""

    parameter: Parameter
    entry: str


def takes(*, without=(), **sources):
    """Declare what a function accepts as ``**name``: a function's or class's keywords, or names.

    A class's ``**settings`` need no declaration: they are its `Param` settings.
    """

    def mark(function):
        function.takes = sources, without
        return function

    return mark


def arguments_of(taker) -> dict[str, Argument]:
    """Return all arguments of a function or a class by name, without self."""
    function = _constructor(taker) if isinstance(taker, type) else taker
    homes = reversed(taker.__mro__) if isinstance(taker, type) else [taker]
    entries = {n: e for home in homes for n, e in _entries(_sections(home.__doc__)[1]).items()}
    sources: dict[str, object] = {}
    sources, without = getattr(function, 'takes', (sources, ()))
    if isinstance(taker, type):
        sources = sources | {'settings': params_of(taker)}
    found: dict[str, Argument] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        plain = parameter.replace(annotation=Parameter.empty)
        if parameter.kind is not Parameter.VAR_KEYWORD:
            found[name] = Argument(plain, entries.get(name, ''))
        elif name not in sources:
            found[f'**{name}'] = Argument(plain, entries.get(f'**{name}', ''))
        else:
            more = keywords_of(sources[name], {*found, *without})
            found |= _documented(more, entries, entries.get(f'**{name}', ''))
    found.pop('self', None)
    return found


def _documented(arguments, entries, common) -> dict[str, Argument]:
    """Return arguments with the entries of a docstring; those without one have a common entry."""
    found = {n: a._replace(entry=entries.get(n, a.entry)) for n, a in arguments.items()}
    bare = [name for name, argument in found.items() if not argument.entry]
    if bare and common:
        common = '\n'.join([f'{", ".join(bare)} : optional', *common.splitlines()[1:]])
    found |= {name: found[name]._replace(entry=common) for name in bare}
    # Those of one entry stand together, behind those of their own.
    uses = Counter(argument.entry for argument in found.values())
    return dict(sorted(found.items(), key=lambda item: uses[item[1].entry] > 1))


def _constructor(cls):
    return cls.__init__


def keywords_of(source, known=()) -> dict[str, Argument]:
    """Return what a source accepts by keyword, except for known names."""
    if isinstance(source, (tuple, list)):
        found: dict[str, Argument] = {}
        for part in source:
            found |= keywords_of(part, {*known, *found})
        return found
    if isinstance(source, str):
        found = {source: Argument(Parameter(source, Parameter.KEYWORD_ONLY, default=None), '')}
    elif isinstance(source, dict):
        found = {name: _setting(param) for name, param in source.items()}
    else:
        found = arguments_of(source)
        if not source.__module__.startswith('pvibr.'):  # others document their arguments
            found = {name: argument._replace(entry='') for name, argument in found.items()}
    return {
        name: Argument(p.replace(kind=Parameter.KEYWORD_ONLY), entry)
        for name, (p, entry) in found.items()
        if name not in known and p.default is not Parameter.empty
    }


def _setting(param) -> Argument:
    kind = param.allowed().removeprefix('a ').removeprefix('an ')
    text = textwrap.fill(param.doc, _WIDTH, initial_indent=' ' * 4, subsequent_indent=' ' * 4)
    parameter = Parameter(param.name, Parameter.KEYWORD_ONLY, default=param.default)
    return Argument(parameter, f'{param.name} : {kind}, default: {param.default!r}\n{text}')


@functools.cache
def accepts(taker, name) -> bool:
    """Return True if a function or class has an argument of this name."""
    return name in arguments_of(taker)


def explicit(method):
    """Name what a method `takes` in its signature and docstring."""
    arguments = arguments_of(method)
    vars(method)['__signature__'] = method_signature(arguments)
    method.__doc__ = docstring_of(method, arguments)
    return method


def signature_of(arguments) -> Signature:
    """Return the signature of arguments."""
    return Signature([argument.parameter for argument in arguments.values()])


def method_signature(arguments) -> Signature:
    """Return the signature of a method, with self."""
    itself = Parameter('self', Parameter.POSITIONAL_OR_KEYWORD)
    return Signature([itself, *signature_of(arguments).parameters.values()])


def docstring_of(taker, arguments, returns='') -> str:
    """Return the docstring of a function or class with a section of these arguments."""
    head, _, tail = _sections(taker.__doc__)
    entries = '\n'.join(dict.fromkeys(a.entry for a in arguments.values() if a.entry))
    section = f'Parameters\n----------\n{entries}' if entries else ''
    return '\n\n'.join(part for part in (head, section, returns, tail) if part) + '\n'


def _sections(doc) -> tuple[str, str, str]:
    """Return what a docstring says before, in, and after its section of parameters."""
    doc = inspect.cleandoc(doc or '')
    marks = list(_SECTION.finditer(doc))
    begins = [mark.start() for mark in marks] + [len(doc)]
    head, tail = doc[: begins[0]], doc[begins[0] :]
    if marks and marks[0]['name'] == 'Parameters':
        return head.strip(), doc[marks[0].end() : begins[1]].strip(), doc[begins[1] :].strip()
    return head.strip(), '', tail.strip()


def _entries(section) -> dict[str, str]:
    """Return the entries of a section of parameters by name; some have several."""
    entries = re.split(r'\n(?=\S)', section)
    return {
        name.strip(): entry
        for entry in entries
        for name in entry.partition('\n')[0].partition(' :')[0].split(',')
    }
