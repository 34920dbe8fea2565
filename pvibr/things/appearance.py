"""Colours and visibility of single items."""

from __future__ import annotations

import sys

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import as_array, checked_number
from pvibr.core.colors import as_rgb, color_rows
from pvibr.core.params import checked_flag

#: Arguments of ``add_mesh`` that configure the lookup table.
TABLE_OPTIONS = (
    *('cmap', 'clim', 'n_colors', 'nan_color', 'nan_opacity', 'below_color', 'above_color'),
    *('log_scale', 'flip_scalars', 'categories', 'annotations'),
)
HIDDEN, PLAIN, COLORED = 0, 128, 255
#: Looks encode the alpha of a colour from here (transparent) to COLORED (opaque).
_CLEAR = PLAIN + 1


def as_colors(colors, n) -> np.ndarray:
    """Return colours of n items as bytes, shape (n, 3)."""
    color_bytes = as_rgba(colors, n)
    if color_bytes.shape[1] == 4:
        first_translucent = int(np.argmin(color_bytes[:, 3]))
        raise ValueError(f'colors[{first_translucent}] must be opaque; set opacity for all items')
    return color_bytes


def as_rgba(colors, n) -> np.ndarray:
    """Return colours of n items as bytes, shape (n, 3), or (n, 4) if any is translucent."""
    array = _color_bytes(colors, n)
    is_opaque = array.shape[1] == 3 or (array[:, 3] == 255).all()
    return array[:, :3] if is_opaque else array


def _color_bytes(colors, n) -> np.ndarray:
    array = np.asarray(color_rows('colors', colors))
    if array.shape == (3,) and isinstance(colors, (str, pv.Color, dict)):
        array = np.broadcast_to(array, (n, 3))  # one colour for all items
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] not in (3, 4):
        raise ValueError(f'colors must be of shape ({n}, 3) or ({n}, 4), got {array.shape}')
    if array.dtype.kind == 'f':
        if not ((array >= 0) & (array <= 1)).all():
            raise ValueError('colors must be floats from 0 to 1 or uint8')
        return np.rint(array * 255).astype(np.uint8)
    if array.dtype.kind not in 'ui' or (array < 0).any() or (array > 255).any():
        raise ValueError(f'colors must be floats from 0 to 1 or uint8, got dtype {array.dtype}')
    return array.astype(np.uint8)


def with_alpha(colors, width) -> np.ndarray:
    """Return a copy of colours, with an alpha channel if `width` is 4."""
    alpha_column = np.full((*colors.shape[:-1], width - colors.shape[-1]), 255, np.uint8)
    return np.concatenate([colors, alpha_column], -1)


def read_only(array):
    """Return a read-only view: changes in place would go unnoticed."""
    view = array.view()
    view.flags.writeable = False
    return view


def as_scalars(scalars, n):
    """Return scalars of n items as floats, booleans or strings."""
    array = as_array('scalars', scalars)
    if array.dtype.kind == 'O' and all(map(_is_word, array.flat)):
        strings = [value if isinstance(value, str) else '' for value in array.flat]
        array = np.array(strings, str).reshape(array.shape)
    if array.dtype.kind not in 'fiubU' or array.shape != (n,):
        raise ValueError(
            f'scalars must be ({n},) numbers or words, '
            f'got shape {array.shape}, dtype {array.dtype}'
        )
    return array.copy() if array.dtype.kind in 'bU' else array.astype(float)


def _is_word(value) -> bool:
    """Return True for a string or a missing one: None, or NaN in a pandas column."""
    return isinstance(value, str | None) or (isinstance(value, float) and np.isnan(value))


def numbered(scalars) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return scalars as numbers, and the category names if they are booleans or strings."""
    if scalars.dtype.kind == 'b':
        return scalars.astype(float), ('False', 'True')
    if scalars.dtype.kind != 'U':
        return scalars, ()
    categories, codes = np.unique(scalars, return_inverse=True)
    return codes.reshape(scalars.shape).astype(float), tuple(categories.tolist())


def as_mask(visible, n):
    """Return which of n items are visible, or None for all."""
    mask = as_array('visible', visible)
    is_boolean = mask.dtype == bool or (mask.dtype.kind in 'iuf' and np.isin(mask, (0, 1)).all())
    if not is_boolean or mask.shape not in ((), (n,)):
        raise ValueError(
            f'visible must be bool, a single one or of shape ({n},), '
            f'got shape {mask.shape}, dtype {mask.dtype}'
        )
    mask = mask.astype(bool)
    return None if mask.all() else np.broadcast_to(mask, (n,)).copy()


def color_table(scalars, cmap=None, clim=None, theme=None, **options):
    """Return the lookup table with which ``add_mesh`` would colour scalars."""
    theme = theme or pv.global_theme
    options = {name: value for name, value in options.items() if value is not None}
    _check_options(options)
    scalars, categories = numbered(scalars)
    if categories:  # a colour per category, as in add_mesh
        clim, options['n_colors'] = (-0.5, len(categories) - 0.5), len(categories)
        options = {'annotations': dict(enumerate(categories))} | options
    finite_values = scalars[np.isfinite(scalars)]
    if clim is None:
        clim = (finite_values.min(), finite_values.max()) if len(finite_values) else (0.0, 1.0)
    value_range = _checked_clim(clim)
    if isinstance(cmap, pv.LookupTable):
        return cmap
    if options.get('log_scale') and value_range[0] <= 0:
        value_range = sys.float_info.min, max(value_range[1], sys.float_info.min)
    table = pv.LookupTable(values=None, scalar_range=value_range)
    category_option = options.pop('categories', False)
    count = len(np.unique(finite_values)) if category_option is True else int(category_option)
    n_colors = options.pop('n_colors', 256)
    table.apply_cmap(
        theme.cmap if cmap is None else cmap, max(count, 1) if category_option else n_colors
    )
    if options.pop('flip_scalars', False):
        table.values[:] = table.values[::-1].copy()
    table_names = {'below_color': 'below_range_color', 'above_color': 'above_range_color'}
    for name, value in ({'nan_color': theme.nan_color} | options).items():
        setattr(table, table_names.get(name, name), value)
    table.BuildSpecialColors()
    return table


def _checked_clim(clim) -> tuple[float, float]:
    try:
        low, high = (-clim, clim) if np.ndim(clim) == 0 else map(float, clim)
        if np.isfinite(low) and np.isfinite(high) and low <= high:
            return float(low), float(high)
    except (TypeError, ValueError):
        pass
    raise ValueError(f'clim must be two finite numbers in ascending order, got {clim!r}')


def _check_options(options):
    """Validate the options of a lookup table."""
    for name, value in options.items():
        if name.endswith('_color'):
            as_rgb(name, value)
        elif name == 'nan_opacity':
            checked_number(name, value, 0.0, 1.0)
        elif name in ('flip_scalars', 'log_scale'):
            checked_flag(name, value)
        elif name == 'annotations' and not isinstance(value, dict):
            raise TypeError(f'annotations must be a dict of numbers to str, got {value!r}')
        elif name in ('n_colors', 'categories') and not _is_valid_count(name, value):
            raise ValueError(f'{name} must be an int of at least 1, got {value!r}')


def _is_valid_count(name, value) -> bool:
    if isinstance(value, (bool, np.bool_)):
        return name == 'categories'
    return isinstance(value, (int, np.integer)) and int(value) > 0


def map_scalars(table, scalars):
    """Return the colours of scalars, uint8, with a last axis of 3, or 4 if any is translucent."""
    numbers = numbered(scalars)[0]
    if not numbers.size:
        return np.zeros((*numbers.shape, 3), np.uint8)
    mapped_colors = table.MapScalars(_vtk.numpy_to_vtk(numbers.ravel()), 1, 0)
    color_bytes = _vtk.vtk_to_numpy(mapped_colors)
    width = 3 if (color_bytes[:, 3:] == 255).all() else 4
    return color_bytes[:, :width].copy().reshape(*numbers.shape, width)


def alphas_of(colors) -> np.ndarray | None:
    """Return the alpha of each item, uint8, the least of its colours; None if all are opaque."""
    if colors is None or colors.shape[-1] == 3:
        return None
    return colors[..., 3].reshape(len(colors), -1).min(1)


def blend(colors) -> bool:
    """Return True if any item is neither opaque nor fully transparent, which hides it."""
    alphas = alphas_of(colors)
    return alphas is not None and bool(((alphas > 0) & (alphas < COLORED)).any())


def is_clear(looks):
    """Return which looks for the GPU are translucent colours."""
    return (looks[:, 3] > PLAIN) & (looks[:, 3] < COLORED)


def merge(n, colors, visible):
    """Return looks for the GPU, shape (n, 4), or None where all items are plain and visible."""
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
