"""Settings of effects, each declared once: default, range, unit, meaning."""

from __future__ import annotations

import math
import numbers
import sys

import numpy as np

_KINDS = {bool: (bool, np.bool_), int: (numbers.Integral,), float: (numbers.Real,), str: (str,)}


class Interval:
    """A range of numbers in interval notation."""

    def __init__(self, text):
        self.text = text
        try:
            low, high = text[1:-1].split(',')
            self.low, self.high = float(low), float(high)
            is_valid = text[0] in '[(' and text[-1] in '])' and self.low <= self.high
        except (ValueError, IndexError):
            is_valid = False
        if not is_valid:
            raise ValueError(
                f'range must be two ordered bounds in brackets, such as [0, inf), got {text!r}'
            )

    def __contains__(self, value) -> bool:
        above = value >= self.low if self.text[0] == '[' else value > self.low
        below = value <= self.high if self.text[-1] == ']' else value < self.high
        # Whole numbers may be beyond all floats.
        is_float = not isinstance(value, int) or abs(value) <= sys.float_info.max
        return above and below and is_float

    def __str__(self) -> str:
        return self.text


class Param:
    """A setting that validates assigned values and counts changes in its owner.

    Its type is that of the default: bool, int, float, str, or a tuple of floats.

    Parameters
    ----------
    default : bool, int, float, str, tuple of float or None
        Default value; None requires `kind`.
    doc : str
        What the setting does and when to use it; the help text of control panels.
    range : str, optional
        Range of numbers, such as ``'[0, 1]'`` or ``'(0, inf)'``.
    choices : sequence, optional
        Allowed values.
    unit : str, optional
        Unit, such as ``'px'``, ``'world'`` or ``'s'``.
    optional : bool, optional
        Whether None, "derived from the scene", is allowed; default: if None is the default.
    kind : type, optional
        Type of the value, required if the default is None.
    length : int, optional
        Number of values of a tuple; that of a non-empty default by default.

    Raises
    ------
    TypeError, ValueError
        On assignment, if a value is of another type, not finite or out of range.

    Examples
    --------
    >>> class Lamp:
    ...     power = Param(1.0, 'Radiant power.', range='[0, inf)', unit='W')
    >>> lamp = Lamp()
    >>> lamp.power = 3
    >>> lamp.power
    3.0
    >>> lamp.power = -1
    Traceback (most recent call last):
    ValueError: Lamp.power must be a float in [0, inf) W, got -1
    """

    def __init__(
        self,
        default,
        doc,
        *,
        range=None,
        choices=None,
        unit='',
        optional=None,
        kind=None,
        length=None,
    ):
        self.default, self.doc, self.unit = default, doc, unit
        self.range = None if range is None else Interval(range)
        self.choices = None if choices is None else tuple(choices)
        self.optional = default is None if optional is None else optional
        self.kind = type(default) if kind is None else kind
        self.length = length or (len(default) if self.kind is tuple and default else 0)
        self.name = ''
        if self.kind not in (*_KINDS, tuple):
            raise TypeError(
                f'default must be a bool, number, str, tuple, or None with kind=, got {default!r}'
            )
        self.__doc__ = self.describe()

    def __set_name__(self, owner, name):
        self.name = name
        if self.default is not None:
            self.default = self.check(self.default, owner.__name__)

    def __get__(self, owner, cls=None):
        if owner is None:
            return self
        return owner.__dict__.get(self.name, self.default)

    def __set__(self, owner, value):
        value = self.check(value, type(owner).__name__)
        if value != self.__get__(owner):
            owner.__dict__[self.name] = value
            # Caches compare this with the revision that they were computed at.
            owner.__dict__['revision'] = owner.__dict__.get('revision', 0) + 1

    def allowed(self) -> str:
        """Return the allowed values in words, such as ``'a float in [0, 1] px'``."""
        if self.choices is not None:
            value_text = 'one of ' + ', '.join(map(repr, self.choices))
        elif self.kind is tuple:
            value_text = f'{self.length} finite floats' if self.length else 'finite floats'
        else:
            value_text = f'{"an" if self.kind is int else "a"} {self.kind.__name__}'
        value_text += f' in {self.range}' if self.range else ''
        value_text += f' {self.unit}' if self.unit else ''
        return value_text + (' or None (derived from the scene)' if self.optional else '')

    def describe(self) -> str:
        """Return meaning, default and allowed values in one line."""
        return f'{self.doc} Default {self.default!r}; {self.allowed()}.'

    def check(self, value, owner=''):
        """Return a value, validated and converted to the setting's type.

        Parameters
        ----------
        value : object
            Value to check.
        owner : str, optional
            Name of the owner in errors.

        Raises
        ------
        TypeError, ValueError
            If the value is not allowed.
        """
        if value is None and self.optional:
            return None
        msg = f'{owner}.{self.name} must be {self.allowed()}, got {value!r}'
        if not self._is_kind(value):
            raise TypeError(msg)
        try:
            checked_value = tuple(map(float, value)) if self.kind is tuple else self.kind(value)
        except OverflowError:  # an integer above the largest float
            raise ValueError(msg) from None
        if not self._is_allowed(checked_value):
            raise ValueError(msg)
        return checked_value

    def _is_kind(self, value) -> bool:
        if self.kind is tuple:
            is_row = isinstance(value, (tuple, list)) or getattr(value, 'ndim', 0) == 1
            return is_row and all(_is_number(v, float) for v in value)
        return _is_number(value, self.kind)

    def _is_allowed(self, checked_value) -> bool:
        if self.choices is not None and checked_value not in self.choices:
            return False
        if self.length and len(checked_value) != self.length:
            return False
        for number in checked_value if self.kind is tuple else (checked_value,):
            if isinstance(number, float) and not math.isfinite(number):
                return False
            if self.range is not None and number not in self.range:
                return False
        return True


def _is_number(value, kind) -> bool:
    """Return True if a value is of a kind; booleans do not count as numbers."""
    if kind is not bool and isinstance(value, (bool, np.bool_)):
        return False
    return isinstance(value, _KINDS[kind])


def checked_flag(name, value, *, optional=False) -> bool | None:
    """Return a boolean argument, also given as 0 or 1, or None if `optional`."""
    if value is None and optional:
        return None
    if isinstance(value, (bool, np.bool_)) or (isinstance(value, int) and value in (0, 1)):
        return bool(value)
    allowed = 'True, False or None' if optional else 'True or False'
    raise TypeError(f'{name} must be {allowed}, got {value!r}')


def checked_name(name) -> str | None:
    """Return a name, or None for the class name."""
    if name is None or isinstance(name, str):
        return name
    raise TypeError(f'name must be a str or None, got {name!r}')


def params_of(owner) -> dict[str, Param]:
    """Return the settings of a class by name, those of its bases first."""
    params = {}
    for base in reversed(owner.__mro__):
        params.update({n: p for n, p in vars(base).items() if isinstance(p, Param)})
    return params
