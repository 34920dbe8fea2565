"""Validation of arguments: errors name the argument, its value and what is allowed."""

from __future__ import annotations

import re
import sys
from contextlib import contextmanager
from numbers import Real

import numpy as np

_LARGEST = sys.float_info.max  # Python's own: any whole number is compared with it
_LONGEST = 1e18  # shaders square lengths in single precision
_WRONG = TypeError, ValueError, LookupError, AttributeError, ArithmeticError, OSError


@contextmanager
def naming(name, value):
    """Prefix errors about an argument with its name and value, unless they state the name."""
    try:
        yield
    except _WRONG as error:
        if re.search(rf'\b{name}\b', str(error)):
            raise
        error_type: type[Exception] = ValueError
        if isinstance(error, (TypeError, AttributeError)):
            error_type = TypeError
        elif isinstance(error, OSError):
            error_type = type(error)
        raise error_type(f'{name} = {_in_a_line(value)}: {error}') from error


def _in_a_line(value) -> str:
    """Return a value as one line of text: arrays and meshes by their type."""
    text = repr(value)
    return type(value).__name__ if '\n' in text else f'{text:.80}'


def as_array(name, values, dtype=None) -> np.ndarray:
    """Return values as an array; reject ragged, complex, masked and record data."""
    with naming(name, values):
        array = np.asarray(values)
        if array.dtype.kind in 'cmMV' or np.ma.is_masked(values):
            raise TypeError('complex numbers, dates, records and masked values are not allowed')
        return array if dtype is None else array.astype(dtype, copy=False)


def check_finite(name, values: np.ndarray):
    """Raise a ValueError that names the first value that is not finite."""
    finite = np.isfinite(values)
    if not finite.all():
        first_bad = np.argwhere(~finite)[0]
        index_text = f'[{place_of(first_bad)}]' if values.ndim else ''
        raise ValueError(f'{name}{index_text} must be finite, got {values[tuple(first_bad)]}')


def place_of(index) -> str:
    """Return an index as text."""
    return ', '.join(str(int(i)) for i in index)


def checked_numbers(name, values, shape) -> np.ndarray:
    """Return a float64 copy of finite numbers in a given shape."""
    try:
        numbers = as_array(name, values, np.float64).copy()
    except (TypeError, ValueError) as error:
        raise ValueError(
            f'{name} must be numbers of shape {shape}, got {values!r:.200}'
        ) from error
    # OpenCV hands vectors out as columns.
    numbers = numbers.reshape(shape) if numbers.size == np.prod(shape) else numbers
    if numbers.shape != shape:
        raise ValueError(f'{name} must have shape {shape}, got {numbers.shape}')
    check_finite(name, numbers)
    return numbers


def checked_direction(name, vector) -> np.ndarray:
    """Return a vector normalized."""
    vector = checked_numbers(name, vector, (3,))
    max_component = np.abs(vector).max()
    if not max_component:
        raise ValueError(f'{name} must not be zero, got {vector.tolist()}')
    vector = vector / max_component
    return vector / np.linalg.norm(vector)


def check_one_of(name, value, allowed):
    """Raise a ValueError unless a value is one of the choices."""
    allowed = tuple(allowed)
    if np.ndim(value) or value not in allowed:
        raise ValueError(
            f'{name} must be one of {", ".join(map(repr, allowed))}, got {value!r:.80}'
        )


def checked_number(name, value, low=-np.inf, high=np.inf) -> float:
    """Return a finite number within bounds."""
    is_real = isinstance(value, Real) and not isinstance(value, (bool, np.bool_))
    if not is_real or not abs(value) <= _LARGEST or not low <= value <= high:
        bounds = '' if low == -np.inf else f' from {low:g} to {high:g}'
        bounds = f' of at least {low:g}' if bounds and high == np.inf else bounds
        msg = f'{name} must be a finite number{bounds}, got {value!r:.80}'
        is_sequence = isinstance(value, (list, tuple, np.ndarray))
        raise (ValueError if is_real or is_sequence else TypeError)(msg)
    return float(value)


def checked_positive(name, value) -> float:
    """Return a finite number above 0."""
    number = checked_number(name, value)
    if number <= 0:
        raise ValueError(f'{name} must be finite and above 0, got {value!r:.80}')
    return number


def checked_whole(name, value, low, high) -> int:
    """Return a whole number within bounds."""
    number = checked_number(name, value, low, high)
    if number != int(number):
        raise ValueError(f'{name} must be a whole number from {low} to {high}, got {value!r:.80}')
    return int(number)


def checked_lengths(name, lengths: np.ndarray) -> np.ndarray:
    """Return lengths, of any shape, that shaders can square."""
    out_of_range = ~((lengths >= 0) & (lengths <= _LONGEST))
    if out_of_range.any():
        raise ValueError(
            f'{name} must be from 0 to {_LONGEST:g}, got {lengths[out_of_range].flat[0]}'
        )
    return lengths


def checked_each(name, values, is_one, allowed) -> tuple:
    """Return one item, or several, of a kind as a tuple."""
    if is_one(values):
        return (values,)
    if isinstance(values, (str, bytes, dict)) or not hasattr(values, '__iter__'):
        raise TypeError(f'{name} must be {allowed}, got {values!r:.80}')
    if hasattr(values, 'GetClassName'):
        raise TypeError(f'{name} must be {allowed}, got {type(values).__name__}')
    items = tuple(values)
    for item in items:
        if not is_one(item):
            raise TypeError(f'{name} must be {allowed}, got {item!r:.80}')
    return items
