"""Signatures and docstrings that list every keyword, including those passed on."""

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
    """An argument: its parameter in the signature, and its entry in the docstring."""

    parameter: Parameter
    entry: str


def takes(*, without=(), **sources):
    """Declare the keywords that a function accepts as ``**name``: those of a callable, or names.

    A class's ``**settings`` need no declaration: they are its `Param` settings.
    """

    def mark(function):
        function.takes = sources, without
        return function

    return mark


def arguments_of(taker) -> dict[str, Argument]:
    """Return the arguments of a function or class by name, without self."""
    function = _constructor(taker) if isinstance(taker, type) else taker
    documented = reversed(taker.__mro__) if isinstance(taker, type) else [taker]
    sections = (_sections(home.__doc__)[1] for home in documented)
    entries = {name: entry for section in sections for name, entry in _entries(section).items()}
    sources: dict[str, object] = {}
    sources, without = getattr(function, 'takes', (sources, ()))
    if isinstance(taker, type):
        sources = sources | {'settings': params_of(taker)}
    arguments: dict[str, Argument] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        plain = parameter.replace(annotation=Parameter.empty)
        if parameter.kind is not Parameter.VAR_KEYWORD:
            arguments[name] = Argument(plain, entries.get(name, ''))
        elif name not in sources:
            arguments[f'**{name}'] = Argument(plain, entries.get(f'**{name}', ''))
        else:
            passed_on = keywords_of(sources[name], {*arguments, *without})
            arguments |= _documented(passed_on, entries, entries.get(f'**{name}', ''))
    arguments.pop('self', None)
    return arguments


def _documented(arguments, entries, shared_entry) -> dict[str, Argument]:
    """Return arguments with their entries in a docstring, or else a common entry."""
    documented = {n: a._replace(entry=entries.get(n, a.entry)) for n, a in arguments.items()}
    undocumented = [name for name, argument in documented.items() if not argument.entry]
    if undocumented and shared_entry:
        names = ', '.join(undocumented)
        shared_entry = '\n'.join([f'{names} : optional', *shared_entry.splitlines()[1:]])
    documented |= {name: documented[name]._replace(entry=shared_entry) for name in undocumented}
    # Arguments that share an entry come last.
    entry_counts = Counter(argument.entry for argument in documented.values())
    return dict(sorted(documented.items(), key=lambda item: entry_counts[item[1].entry] > 1))


def _constructor(cls):
    return cls.__init__


def keywords_of(source, excluded=()) -> dict[str, Argument]:
    """Return the keywords that a source accepts, without those in `known`."""
    if isinstance(source, (tuple, list)):
        keywords: dict[str, Argument] = {}
        for part in source:
            keywords |= keywords_of(part, {*excluded, *keywords})
        return keywords
    if isinstance(source, str):
        keywords = {source: Argument(Parameter(source, Parameter.KEYWORD_ONLY, default=None), '')}
    elif isinstance(source, dict):
        keywords = {name: _setting(param) for name, param in source.items()}
    else:
        keywords = arguments_of(source)
        if not source.__module__.startswith('pvibr.'):  # documented elsewhere
            keywords = {name: argument._replace(entry='') for name, argument in keywords.items()}
    return {
        name: Argument(p.replace(kind=Parameter.KEYWORD_ONLY), entry)
        for name, (p, entry) in keywords.items()
        if name not in excluded and p.default is not Parameter.empty
    }


def _setting(param) -> Argument:
    value_kind = param.allowed().removeprefix('a ').removeprefix('an ')
    text = textwrap.fill(param.doc, _WIDTH, initial_indent=' ' * 4, subsequent_indent=' ' * 4)
    parameter = Parameter(param.name, Parameter.KEYWORD_ONLY, default=param.default)
    return Argument(parameter, f'{param.name} : {value_kind}, default: {param.default!r}\n{text}')


@functools.cache
def accepts(taker, name) -> bool:
    """Return True if a function or class has an argument of a name."""
    return name in arguments_of(taker)


def explicit(method):
    """List the keywords that a method `takes` in its signature and docstring."""
    arguments = arguments_of(method)
    vars(method)['__signature__'] = method_signature(arguments)
    method.__doc__ = docstring_of(method, arguments)
    return method


def signature_of(arguments) -> Signature:
    """Return a signature of arguments."""
    return Signature([argument.parameter for argument in arguments.values()])


def method_signature(arguments) -> Signature:
    """Return a method's signature, with self."""
    itself = Parameter('self', Parameter.POSITIONAL_OR_KEYWORD)
    return Signature([itself, *signature_of(arguments).parameters.values()])


def docstring_of(taker, arguments, returns='') -> str:
    """Return the docstring of a function or class with a section of these arguments."""
    head, _, tail = _sections(taker.__doc__)
    entries = '\n'.join(dict.fromkeys(a.entry for a in arguments.values() if a.entry))
    section = f'Parameters\n----------\n{entries}' if entries else ''
    return '\n\n'.join(part for part in (head, section, returns, tail) if part) + '\n'


def _sections(doc) -> tuple[str, str, str]:
    """Return a docstring's text before, in and after its section of parameters."""
    doc = inspect.cleandoc(doc or '')
    headings = list(_SECTION.finditer(doc))
    starts = [heading.start() for heading in headings] + [len(doc)]
    head, section, tail = doc[: starts[0]], '', doc[starts[0] :]
    if headings and headings[0]['name'] == 'Parameters':
        section, tail = doc[headings[0].end() : starts[1]], doc[starts[1] :]
    return head.strip(), section.strip(), tail.strip()


def _entries(section) -> dict[str, str]:
    """Return the entries of a section of parameters by name; an entry may have several."""
    entries = re.split(r'\n(?=\S)', section)
    return {
        name.strip(): entry
        for entry in entries
        for name in entry.partition('\n')[0].partition(' :')[0].split(',')
    }
