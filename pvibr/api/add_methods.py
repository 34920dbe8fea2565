"""Methods ``plotter.ibr.add_*``: signature and docstring are those of what is made."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Generic, TypeVar

from pvibr.core.params import checked_flag
from pvibr.core.plotters import is_watched, next_theme
from pvibr.core.signatures import (
    accepts,
    arguments_of,
    docstring_of,
    keywords_of,
    method_signature,
)
from pvibr.things.keywords import check_keywords, check_values
from pvibr.things.scalar_bars import Bar

Made = TypeVar('Made')
_OF_SCALARS = ('show_scalar_bar', 'scalar_bar_args', 'label')


def add_thing(
    self,
    make,
    args,
    kwargs,
    *,
    show_scalar_bar=None,
    scalar_bar_args=None,
    label=None,
    reset_camera=None,
    render=False,
):
    """Add a thing to the active subplot, in place of what has its name.

    Parameters
    ----------
    make : callable
        Class or function that makes the thing.
    args : tuple
        Its positional arguments.
    kwargs : dict
        Its keyword arguments.
    show_scalar_bar : bool, optional
        Whether to add a scalar bar; by default as the theme says.
    scalar_bar_args : dict, optional
        Options of :meth:`pyvista.Plotter.add_scalar_bar`.
    label : str, optional
        Entry of the legend that :meth:`pyvista.Plotter.add_legend` adds.
    reset_camera : bool, optional
        Whether to reset the camera; by default only if it was never set.
    render : bool
        Whether to render at once.

    Returns
    -------
    pvibr.Effect
        The thing.
    """
    self._check_open()
    bar = Bar(show_scalar_bar, scalar_bar_args)
    reset_camera = checked_flag('reset_camera', reset_camera, optional=True)
    render = checked_flag('render', render)
    if not isinstance(label, str | None):
        raise TypeError(f'label must be a str or None, got {label!r}')
    if accepts(make, 'theme'):
        if kwargs.get('color') is True:  # PyVista's word for the next one
            kwargs['color'] = None
        kwargs.setdefault('theme', next_theme(self._plotter, kwargs.get('color')))
    if accepts(make, 'wait') and kwargs.get('wait') is None:
        kwargs['wait'] = not is_watched(self._plotter)
    thing = make(*args, **kwargs)
    thing.bar, thing.label = bar, label
    bar.check(self._plotter, thing)
    self.add(thing)
    self._show(reset_camera, render)
    return thing


class AddMethod(Generic[Made]):
    """A method that makes a thing and adds it; what makes it is imported at the first look-up."""

    def __init__(self, home: str):
        self._home = home

    def __set_name__(self, owner, name):
        self._owner, self._name = owner, name

    def __get__(self, instance, owner=None) -> Callable[..., Made]:
        module, _, name = self._home.rpartition('.')
        method = self._method(getattr(import_module(module), name))
        setattr(self._owner, self._name, method)  # from now on a function like any other
        return method if instance is None else method.__get__(instance)

    def _method(self, make):
        own = arguments_of(make)
        shown = keywords_of(add_thing, () if 'scalars' in own else _OF_SCALARS)
        arguments = own | shown

        def method(self, *args, **kwargs):
            check_keywords(make, kwargs, arguments)
            check_values(kwargs)
            options = {name: kwargs.pop(name) for name in shown if name in kwargs}
            return add_thing(self, make, args, kwargs, **options)

        returns = f'Returns\n-------\npvibr.{make.__name__}\n    What was added.'
        method.__doc__ = docstring_of(make, arguments, returns if isinstance(make, type) else '')
        method.__name__, method.__module__ = self._name, self._owner.__module__
        method.__qualname__ = f'{self._owner.__qualname__}.{self._name}'
        vars(method)['__signature__'] = method_signature(arguments)
        return method
