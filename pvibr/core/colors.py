"""Colours, in any form that PyVista accepts."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import as_array
from pvibr.core.params import Param

#: Allowed values in error messages.
ALLOWED = 'a color: a name such as "red", a hex code, or 3 floats from 0 to 1 or ints to 255'


def as_rgb(name, color) -> tuple[float, float, float]:
    """Return red, green and blue from 0 to 1 of any PyVista colour; floats up to 1 are kept."""
    try:
        if _is_floats(color):
            red, green, blue = map(float, color)
            return red, green, blue
        is_text = not isinstance(color, str) and np.asarray(color).dtype.kind in 'US'
        if color is not None and np.size(color) and not is_text:
            return pv.Color(color).float_rgb
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f'{name} must be {ALLOWED}, got {color!r}')


def _is_floats(color) -> bool:
    if not isinstance(color, (tuple, list, np.ndarray)) or np.shape(color) != (3,):
        return False
    return np.asarray(color).dtype.kind in 'iuf' and 0 <= min(color) <= max(color) <= 1


def color_rows(name, colors):
    """Return named colours as bytes, (n, 3), or (3,) for one; numbers are returned as is."""
    if isinstance(colors, (str, pv.Color, dict)):
        return _bytes(name, colors)
    array = as_array(name, colors) if hasattr(colors, '__len__') else colors
    kind = getattr(getattr(array, 'dtype', None), 'kind', '')
    if kind in 'UO' and kind and np.ndim(array) >= 1:
        color_bytes = [_bytes(f'{name}[{k}]', color) for k, color in enumerate(colors)]
        return np.array(color_bytes, np.uint8).reshape(-1, 3)
    return colors


def _bytes(name, color):
    return np.rint(255 * np.array(as_rgb(name, color))).astype(np.uint8)


class Color(Param):
    """A colour setting: accepts any PyVista colour and stores three floats from 0 to 1.

    None is allowed if it is the default.
    """

    def __init__(self, default, doc):
        color = None if default is None else as_rgb('default', default)
        super().__init__(color, doc, range='[0, 1]', kind=tuple, length=3)

    def allowed(self) -> str:
        """Return the allowed values in words."""
        return ALLOWED

    def check(self, value, owner=''):
        """Return a colour as three floats."""
        if value is None and self.default is None:
            return None
        return as_rgb(f'{owner}.{self.name}', value)
