"""Methods ``plotter.ibr.add_*``: signature and docstring are those of what is made."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Generic, TypeVar

from pvibr.core.signatures import arguments_of, docstring_of, keywords_of, method_signature
from pvibr.things.keywords import check_keywords, check_values

Made = TypeVar('Made')
_OF_SCALARS = ('show_scalar_bar', 'scalar_bar_args', 'label')


class AddMethod(Generic[Made]):
    """A method that makes a thing and adds it; what makes it is imported at the first look-up."""

    def __init__(self, home: str, add: Callable):
        self._home, self._add = home, add

    def __set_name__(self, owner, name):
        self._owner, self._name = owner, name

    def __get__(self, instance, owner=None) -> Callable[..., Made]:
        module, _, name = self._home.rpartition('.')
        method = self._method(getattr(import_module(module), name))
        setattr(self._owner, self._name, method)  # from now on a function like any other
        return method if instance is None else method.__get__(instance)

    def _method(self, make):
        add, own = self._add, arguments_of(make)
        shown = keywords_of(add, () if 'scalars' in own else _OF_SCALARS)
        arguments = own | shown

        def method(self, *args, **kwargs):
            check_keywords(make, kwargs, arguments)
            check_values(kwargs)
            options = {name: kwargs.pop(name) for name in shown if name in kwargs}
            return add(self, make, args, kwargs, **options)

        returns = f'Returns\n-------\npvibr.{make.__name__}\n    What was added.'
        method.__doc__ = docstring_of(make, arguments, returns if isinstance(make, type) else '')
        method.__name__, method.__module__ = self._name, self._owner.__module__
        method.__qualname__ = f'{self._owner.__qualname__}.{self._name}'
        vars(method)['__signature__'] = method_signature(arguments)
        return method
