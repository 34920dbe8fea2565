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


class _Complete(type(pv.Actor)):  # type: ignore[misc]
    """Marks instances as complete after construction: public attributes are then fixed."""

    # Otherwise inspect would report the signature of the metaclass's ``__call__``.
    __signature__ = _OfInit()

    def __call__(cls, *args, **kwargs):
        instance = type.__call__(cls, *args, **kwargs)
        instance.__dict__['_complete'] = True
        if cls.keeps_arguments:
            instance.__dict__['_made_of'] = args, kwargs
        return instance


class Spelled(metaclass=_Complete):
    """Raises on setting an unknown public attribute, and names the nearest one.

    Classes declare attributes by a default or an annotation; users' subclasses are exempt.
    """

    _complete = False
    #: Whether instances keep their constructor arguments, to be copied and pickled.
    keeps_arguments = False

    def __setattr__(self, name, value):
        if self._complete and not name.startswith('_') and not _has(self, name):
            class_name = type(self).__name__
            hint = nearest(name, [n for n in dir(self) if not n.startswith('_')])
            hint = hint or f'; see dir() of the {class_name}'
            raise AttributeError(f'{class_name} has no attribute {name!r}{hint}')
        super().__setattr__(name, value)


def _has(owner, name) -> bool:
    is_ours = type(owner).__module__.partition('.')[0].startswith('pvibr')
    if not is_ours or name in owner.__dict__ or hasattr(type(owner), name):
        return True
    return any(name in get_annotations(c) for c in type(owner).__mro__)
