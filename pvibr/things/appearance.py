"""Colours and visibility of single instances."""

from __future__ import annotations

import sys

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import as_array
from pvibr.core.colors import as_rgb, color_rows
from pvibr.core.params import checked_flag

HIDDEN, PLAIN, COLORED = 0, 128, 255
#: Alphas of looks, by as many steps: from the first, of colours that are transparent, to COLORED.
_CLEAR = PLAIN + 1


def as_colors(colors, n) -> np.ndarray:
    """Return per-instance colours as bytes, shape (n, 3)."""
    rows = as_rgba(colors, n)
    if rows.shape[1] == 4:
        row = int(np.argmin(rows[:, 3]))
        raise ValueError(
            f'colors[{row}] is translucent; these have one alpha for all: give opacity'
        )
    return rows


def as_rgba(colors, n) -> np.ndarray:
    """Return per-instance colours as bytes, shape (n, 3), or (n, 4) if any is translucent."""
    array = _color_bytes(colors, n)
    opaque = array.shape[1] == 3 or (array[:, 3] == 255).all()
    return array[:, :3] if opaque else array


def _color_bytes(colors, n) -> np.ndarray:
    array = np.asarray(color_rows('colors', colors))
    if array.shape == (3,) and isinstance(colors, (str, pv.Color, dict)):
        array = np.broadcast_to(array, (n, 3))  # one of a name is that of all
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] not in (3, 4):
        raise ValueError(
            f'colors has shape {array.shape}; it must be ({n}, 3) or ({n}, 4): one row for each'
        )
    if array.dtype.kind == 'f':
        if not ((array >= 0) & (array <= 1)).all():
            raise ValueError('colors given as floats must be from 0 to 1; give uint8 for 0 to 255')
        return np.rint(array * 255).astype(np.uint8)
    if array.dtype.kind not in 'ui' or (array < 0).any() or (array > 255).any():
        raise ValueError(
            f'colors has dtype {array.dtype}; it must be uint8 (0 to 255) or float (0 to 1)'
        )
    return array.astype(np.uint8)


def with_alpha(colors, width) -> np.ndarray:
    """Return a copy of colours, with an alpha if their width is to be 4."""
    alphas = np.full((len(colors), width - colors.shape[1]), 255, np.uint8)
    return np.concatenate([colors, alphas], 1)


def read_only(array):
    """Return an array that cannot be changed in place: nothing would tell of it."""
    view = array.view()
    view.flags.writeable = False
    return view


def as_scalars(scalars, n):
    """Return per-instance scalars as floats, flags or words."""
    array = as_array('scalars', scalars)
    if array.dtype.kind == 'O' and all(map(_is_word, array.flat)):
        words = [value if isinstance(value, str) else '' for value in array.flat]
        array = np.array(words, str).reshape(array.shape)
    if array.dtype.kind not in 'fiubU' or array.shape != (n,):
        raise ValueError(
            f'scalars must be ({n},) numbers or words, '
            f'got shape {array.shape}, dtype {array.dtype}'
        )
    return array.copy() if array.dtype.kind in 'bU' else array.astype(float)


def _is_word(value) -> bool:
    """Return True for a word, or a missing one: None, and NaN in a column of pandas."""
    return isinstance(value, str | None) or (isinstance(value, float) and np.isnan(value))


def numbered(scalars) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return scalars as numbers, and the names of 0, 1 and so on if they are flags or words."""
    if scalars.dtype.kind == 'b':
        return scalars.astype(float), ('False', 'True')
    if scalars.dtype.kind != 'U':
        return scalars, ()
    names, numbers = np.unique(scalars, return_inverse=True)
    return numbers.reshape(scalars.shape).astype(float), tuple(names.tolist())


def as_mask(visible, n):
    """Return which of n items are visible, None for all."""
    mask = as_array('visible', visible)
    ones = mask.dtype == bool or (mask.dtype.kind in 'iuf' and np.isin(mask, (0, 1)).all())
    if not ones or mask.shape not in ((), (n,)):
        raise ValueError(
            f'visible has shape {mask.shape}, dtype {mask.dtype}; it must be bool, one or ({n},)'
        )
    mask = mask.astype(bool)
    return None if mask.all() else np.broadcast_to(mask, (n,)).copy()


def color_table(scalars, cmap=None, clim=None, theme=None, **options):
    """Return the table that colours scalars as ``add_mesh`` would."""
    theme = theme or pv.global_theme
    options = {name: value for name, value in options.items() if value is not None}
    _check_options(options)
    scalars, names = numbered(scalars)
    if names:  # a colour for each, as add_mesh
        clim, options['n_colors'] = (-0.5, len(names) - 0.5), len(names)
        options = {'annotations': dict(enumerate(names))} | options
    finite = scalars[np.isfinite(scalars)]
    if clim is None:
        clim = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    limits = _checked_clim(clim)
    if isinstance(cmap, pv.LookupTable):
        return cmap
    if options.get('log_scale') and limits[0] <= 0:
        limits = sys.float_info.min, max(limits[1], sys.float_info.min)
    table = pv.LookupTable(values=None, scalar_range=limits)
    categories = options.pop('categories', False)
    count = len(np.unique(finite)) if categories is True else int(categories)
    n_colors = options.pop('n_colors', 256)
    table.apply_cmap(
        theme.cmap if cmap is None else cmap, max(count, 1) if categories else n_colors
    )
    if options.pop('flip_scalars', False):
        table.values[:] = table.values[::-1].copy()
    ranges = {'below_color': 'below_range_color', 'above_color': 'above_range_color'}
    for name, value in ({'nan_color': theme.nan_color} | options).items():
        setattr(table, ranges.get(name, name), value)
    table.BuildSpecialColors()
    return table


def _checked_clim(clim) -> tuple[float, float]:
    try:
        low, high = (-clim, clim) if np.ndim(clim) == 0 else map(float, clim)
        if np.isfinite(low) and np.isfinite(high) and low <= high:
            return float(low), float(high)
    except (TypeError, ValueError):
        pass
    raise ValueError(f'clim is {clim!r}; it must be two finite numbers, the lower one first')


def _check_options(options):
    """Check what a table takes of the arguments of ``add_mesh``."""
    for name, value in options.items():
        if name.endswith('_color'):
            as_rgb(name, value)
        elif name in ('flip_scalars', 'log_scale'):
            checked_flag(name, value)
        elif name == 'annotations' and not isinstance(value, dict):
            raise TypeError(f'annotations = {value!r}: must be a dict of numbers to str')
        elif name in ('n_colors', 'categories') and not _counts(name, value):
            raise ValueError(f'{name} = {value!r}: must be an int of at least 1')


def _counts(name, value) -> bool:
    if isinstance(value, (bool, np.bool_)):
        return name == 'categories'
    return isinstance(value, (int, np.integer)) and int(value) > 0


def map_scalars(table, scalars):
    """Return the colours of scalars, three more numbers for each, uint8."""
    numbers = numbered(scalars)[0]
    if not numbers.size:
        return np.zeros((*numbers.shape, 3), np.uint8)
    mapped = table.MapScalars(_vtk.numpy_to_vtk(numbers.ravel()), 1, 0)
    return _vtk.vtk_to_numpy(mapped)[:, :3].copy().reshape(*numbers.shape, 3)


def is_clear(looks):
    """Return which looks for the GPU are of translucent colours."""
    return (looks[:, 3] > PLAIN) & (looks[:, 3] < COLORED)


def merge(n, colors, visible):
    """Return looks for the GPU, or None where every instance is plain and visible."""
    if colors is None and visible is None:
        return None
    looks = np.empty((n, 4), np.uint8)
    looks[:, :3] = 0 if colors is None else colors[:, :3]
    looks[:, 3] = PLAIN if colors is None else COLORED
    if colors is not None and colors.shape[1] == 4:
        looks[:, 3] = _CLEAR + np.rint(colors[:, 3] / 255 * (COLORED - _CLEAR))
    if visible is not None:
        looks[~visible, 3] = HIDDEN
    return looks
