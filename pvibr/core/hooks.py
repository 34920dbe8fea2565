"""Attributes of PyVista's objects that are replaced for as long as pvibr needs it."""

from __future__ import annotations

import weakref
from collections.abc import Callable

_ABSENT = object()


class Hooks:
    """Attributes of one object, replaced until they are taken off."""

    def __init__(self, owner):
        self._owner = weakref.ref(owner)
        self._replaced: dict[str, tuple] = {}

    def __bool__(self) -> bool:
        return bool(self._replaced)

    def put(self, attributes):
        """Replace attributes by name; what the class of the object has stays reachable there."""
        owner = self._owner()
        for name, value in attributes.items():
            self._replaced[name] = value, vars(owner).get(name, _ABSENT)
            vars(owner)[name] = value

    def take_off(self):
        """Give the object back what it had, except for what others have replaced since."""
        owner, replaced = self._owner(), self._replaced
        self._replaced = {}
        for name, (value, before) in replaced.items():
            if owner is None or vars(owner).get(name) is not value:
                continue
            if before is _ABSENT:
                del vars(owner)[name]
            else:
                vars(owner)[name] = before


class MethodHook:
    """A method of a class, replaced while instances of another class exist."""

    def __init__(self, owner: type, name: str, wrap: Callable):
        self._owner, self._name, self._wrap = owner, name, wrap
        self._method = self._wrapped = None
        self._instances, self._replaced = 0, False

    def need(self, instance):
        """Replace the method until this instance, and all others, are gone."""
        if not self._replaced:
            self._replaced = True
            self._method = getattr(self._owner, self._name)
            self._wrapped = self._wrap(self._method)
            setattr(self._owner, self._name, self._wrapped)
        self._instances += 1
        weakref.finalize(instance, self._forget).atexit = False

    def _forget(self):
        self._instances -= 1
        # A wrapper that others have put around it since passes calls on.
        if not self._instances and getattr(self._owner, self._name) is self._wrapped:
            setattr(self._owner, self._name, self._method)
            self._replaced = False
