"""Setting an unknown attribute is an error that suggests the nearest name."""

from __future__ import annotations

from difflib import get_close_matches
from inspect import Signature, get_annotations, signature

import pyvista as pv


def nearest(name, names) -> str:
    """Return '; did you mean ...?' with the nearest name, or an empty string."""
    close_matches = get_close_matches(name, [n for n in names if isinstance(n, str)], 1)
    return f'; did you mean {close_matches[0]!r}?' if close_matches else ''


class _OfInit:
    """The signature of a class without one of its own: that of its ``__init__``."""

    def __get__(self, cls, _kind=None):
        if cls.__init__ is object.__init__:
            return Signature()
        return signature(cls.__init__.__get__(cls))


class Complete(type(pv.Actor)):  # type: ignore[misc]
    """Metaclass of what is complete once constructed: its public attributes are then fixed."""

    # A class calls `check_attribute` from its `__setattr__`; it declares attributes by a default
    # or an annotation. Users' subclasses are exempt.

    # Otherwise inspect would report the signature of the metaclass's ``__call__``.
    __signature__ = _OfInit()

    def __call__(cls, *args, **kwargs):
        """Return a complete instance."""
        instance = type.__call__(cls, *args, **kwargs)
        instance.__dict__['_complete'] = True
        if getattr(cls, 'keeps_arguments', False):
            instance.__dict__['_made_of'] = args, kwargs
        return instance


def check_attribute(owner, name):
    """Raise an AttributeError that names the nearest one if an attribute is unknown."""
    if '_complete' in owner.__dict__ and not name.startswith('_') and not _has(owner, name):
        class_name = type(owner).__name__
        hint = nearest(name, [n for n in dir(owner) if not n.startswith('_')])
        hint = hint or f'; see dir() of the {class_name}'
        raise AttributeError(f'{class_name} has no attribute {name!r}{hint}')


def _has(owner, name) -> bool:
    is_ours = type(owner).__module__.partition('.')[0].startswith('pvibr')
    if not is_ours or name in owner.__dict__ or hasattr(type(owner), name):
        return True
    return any(name in get_annotations(c) for c in type(owner).__mro__)
