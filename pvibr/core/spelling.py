"""Attributes that do not exist are errors, not new attributes."""

from __future__ import annotations

from difflib import get_close_matches
from inspect import Signature, get_annotations, signature

import pyvista as pv


def nearest(name, names) -> str:
    """Return what a message says of the nearest of some names, nothing if none is near."""
    near = get_close_matches(name, [n for n in names if isinstance(n, str)], 1)
    return f'; did you mean {near[0]!r}?' if near else ''


class _OfInit:
    """The signature of a class that has none of its own: that of its ``__init__``."""

    def __get__(self, cls, _kind=None):
        if cls.__init__ is object.__init__:
            return Signature()
        return signature(cls.__init__.__get__(cls))


class _Complete(type(pv.Actor)):  # type: ignore[misc]
    """Marks what was made: from then on its public attributes are all that it has."""

    # What is called is the class of the class: signatures would be those of ``__call__``.
    __signature__ = _OfInit()

    def __call__(cls, *args, **kwargs):
        made = type.__call__(cls, *args, **kwargs)
        made.__dict__['_complete'] = True
        if cls.keeps_arguments:
            made.__dict__['_made_of'] = args, kwargs
        return made


class Spelled(metaclass=_Complete):
    """Raises on setting an unknown public attribute, and names the nearest one.

    Classes declare what they set later, by a default or an annotation; those of users need not.
    """

    _complete = False
    #: Whether instances know what they were made of, so that they can be made again.
    keeps_arguments = False

    def __setattr__(self, name, value):
        if self._complete and not name.startswith('_') and not _has(self, name):
            kind = type(self).__name__
            near = get_close_matches(name, (n for n in dir(self) if not n.startswith('_')), 1)
            hint = f'did you mean {near[0]!r}?' if near else f'see dir() of the {kind}'
            raise AttributeError(f'{kind} has no attribute {name!r}: {hint}')
        super().__setattr__(name, value)


def _has(owner, name) -> bool:
    own = type(owner).__module__.partition('.')[0].startswith('pvibr')
    if not own or name in owner.__dict__ or hasattr(type(owner), name):
        return True
    return any(name in get_annotations(c) for c in type(owner).__mro__)
