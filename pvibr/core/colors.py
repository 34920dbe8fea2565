"""Colours: whatever PyVista takes as one."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import as_array
from pvibr.core.params import Param

#: What errors say is allowed.
ALLOWED = 'a color: a name such as "red", a hex code, or 3 floats from 0 to 1 or ints to 255'


def as_rgb(name, color) -> tuple[float, float, float]:
    """Return red, green and blue from 0 to 1; numbers up to 1 are such already."""
    try:
        if _is_floats(color):
            red, green, blue = map(float, color)
            return red, green, blue
        letters = not isinstance(color, str) and np.asarray(color).dtype.kind in 'US'
        if color is not None and np.size(color) and not letters:
            return pv.Color(color).float_rgb
    except (TypeError, ValueError):
        pass
    raise ValueError(f'{name} = {color!r}: must be {ALLOWED}')


def _is_floats(color) -> bool:
    numbers = isinstance(color, (tuple, list, np.ndarray)) and np.shape(color) == (3,)
    return numbers and np.asarray(color).dtype.kind in 'iuf' and 0 <= min(color) <= max(color) <= 1


def color_rows(name, colors):
    """Return colours that are not numbers as bytes, (n, 3), one as (3,); numbers as they are."""
    if isinstance(colors, (str, pv.Color, dict)):
        return _bytes(name, colors)
    array = as_array(name, colors) if hasattr(colors, '__len__') else colors
    kind = getattr(getattr(array, 'dtype', None), 'kind', '')
    if kind in 'UO' and kind and np.ndim(array) >= 1:
        rows = [_bytes(f'{name}[{k}]', color) for k, color in enumerate(colors)]
        return np.array(rows, np.uint8).reshape(-1, 3)
    return colors


def _bytes(name, color):
    return np.rint(255 * np.array(as_rgb(name, color))).astype(np.uint8)


class Color(Param):
    """A setting that is a colour: whatever PyVista takes, kept as three floats from 0 to 1.

    It may be None if that is its default.
    """

    def __init__(self, default, doc):
        optional = default is None
        own = {'kind': tuple, 'length': 3} if optional else {}
        super().__init__(
            None if optional else as_rgb('default', default), doc, range='[0, 1]', **own
        )

    def allowed(self) -> str:
        """Return the allowed values in words."""
        return ALLOWED

    def check(self, value, owner=''):
        """Return a colour as three floats."""
        if value is None and self.default is None:
            return None
        return as_rgb(f'{owner}.{self.name}', value)
