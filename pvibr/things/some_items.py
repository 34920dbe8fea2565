"""Looks of some items of a set changed among those of all."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.colors import color_rows
from pvibr.things import appearance as look


def checked_ids(ids, item_count):
    """Return the non-negative indices that `ids` selects of `item_count`."""
    if isinstance(ids, slice):
        return np.arange(*ids.indices(item_count))
    ids = np.atleast_1d(np.asarray(ids))
    if ids.dtype == bool and ids.shape == (item_count,):
        return np.flatnonzero(ids)
    if ids.size == 0:
        return np.zeros(0, int)
    if ids.ndim != 1 or ids.dtype.kind not in 'iu':
        raise IndexError(f'ids has shape {ids.shape}, dtype {ids.dtype}; it must be (k,) integers')
    invalid = ids[(ids < -item_count) | (ids >= item_count)]
    if len(invalid):
        raise IndexError(f'ids must be below {item_count}, the number of items, got {invalid[0]}')
    return ids % item_count


def with_looks(self, ids, scalars, colors, visible) -> dict:
    """Return all looks with those of `ids` changed."""
    looks: dict = {}
    if scalars is not None:
        looks['scalars'] = _with_scalars(self, ids, as_array('scalars', scalars))
    if colors is not None:
        color_values = np.atleast_2d(np.asarray(color_rows('colors', colors)))
        new_colors = self._as_colors(color_values, len(color_values))
        looks['colors'] = all_colors = _all_colors(self, new_colors)
        new_colors = look.with_alpha(new_colors, all_colors.shape[-1])
        are_of_items = new_colors.ndim < all_colors.ndim
        all_colors[ids] = new_colors[:, None] if are_of_items else new_colors
    if visible is not None:
        mask = look.as_mask(visible, len(ids))
        looks['visible'] = self.visible.copy()
        looks['visible'][ids] = True if mask is None else mask
    return looks


def _with_scalars(self, ids, new_scalars):
    """Return all scalars with those of `ids` changed, numbers or words."""
    are_words, previous = new_scalars.dtype.kind in 'UO', self._scalars
    if previous is None:
        previous = np.full(len(self), '' if are_words else np.nan)
    elif are_words != (previous.dtype.kind == 'U'):
        raise ValueError(
            f'scalars must be of dtype {previous.dtype} as the others, got {new_scalars.dtype}'
        )
    changed = previous.astype(np.result_type(previous, new_scalars))
    changed[ids] = new_scalars
    return changed


def _all_colors(self, new_colors) -> np.ndarray:
    """Return a copy of the colours, with alpha, or of both ends, if they or new ones have it."""
    colors = self._base_colors() if self._colors is None else self._colors
    if new_colors.ndim > colors.ndim:
        colors = np.repeat(colors[:, None], new_colors.shape[1], 1)
    return look.with_alpha(colors, max(new_colors.shape[-1], colors.shape[-1]))
