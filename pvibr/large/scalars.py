"""What colours a large mesh: values of its points or cells, numbers, colours or categories."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pvibr.core.arguments import checked_whole

#: PyVista's name of scalars that have none; their bar has no title.
_UNNAMED = 'Data'
#: Suffixes of names of arrays that hold colours, as in PyVista.
_COLORS = '_rgb', '_rgba'
_PREFERENCES = 'point', 'cell'


@dataclass(frozen=True)
class Scalars:
    """Scalars of a mesh's points or cells."""

    name: str
    #: Numbers, (n,), or colours, (n, 3 or 4) uint8.
    values: np.ndarray
    on_cells: bool = False
    #: Whether means make no sense: numbers of categories.
    are_categories: bool = False
    #: Words of the categories, which `values` count.
    words: tuple[str, ...] = ()
    #: Title of their bar: the name of the mesh's array.
    title: str = ''

    @property
    def are_colors(self) -> bool:
        """Whether the values are colours."""
        return self.values.ndim == 2

    def blended(self, table, opacities) -> Scalars:
        """Return colours with opacities, by a table from values unless they are colours."""
        colors = self.values / 255 if self.are_colors else table(self.values.astype(float))
        alpha = opacities[:, None] if colors.shape[1] == 3 else colors[:, 3:] * opacities[:, None]
        colors = np.rint(255 * np.concatenate([colors[:, :3], alpha], 1)).astype(np.uint8)
        return Scalars(self.name, colors, self.on_cells, title=self.title)

    def look(self, look) -> dict[str, Any]:
        """Return the look of `add_mesh` with the range and the colours of these scalars."""
        if self.are_colors:
            return look | {'rgb': True}
        if self.words:
            count = len(self.words)
            look = look | {'annotations': dict(enumerate(self.words)), 'n_colors': count}
            return look | {'clim': [-0.5, count - 0.5], 'rgb': False}
        if look.get('categories') is True:
            finite = self.values[np.isfinite(self.values)]
            look = look | {'categories': max(len(np.unique(finite)), 1)}
        if look.get('clim') is None:
            look = look | {'clim': range_of(self.values)}
        return look | {'rgb': False}


def scalars_of(source, scalars, look) -> Scalars | None:
    """Return the scalars of a mesh that arguments of `add_mesh` ask for, or None.

    `look` has `color`, `texture`, `rgb`, `preference`, `component` and `categories`.
    """
    is_plain = look.get('color') is None and look.get('texture') is None
    if scalars is None and (is_plain or look.get('rgb')):
        scalars = source.active
    if scalars is None:
        if look.get('rgb'):
            raise ValueError('rgb must be with scalars: colours of points or cells')
        return None
    name, values, on_cells = _found(source, scalars, _checked_preference(look))
    argument = f'scalars {name!r}' if name else 'scalars'
    title, rgb, name = name, look.get('rgb'), name or _UNNAMED
    if rgb is None and name.endswith(_COLORS):
        rgb = True
    if rgb:
        return Scalars(name, _checked_colors(argument, values), on_cells)
    if values.dtype.kind in 'bUS':
        return replace(_categories(argument, name, values, on_cells), title=title)
    values = _checked_numbers(argument, values, look.get('component'))
    return Scalars(name, values, on_cells, bool(look.get('categories')), title=title)


def opacities_of(source, scalars, opacity) -> np.ndarray | None:
    """Return an opacity for each of some scalars, None for a number or a transfer function."""
    is_name = isinstance(opacity, str)
    if np.ndim(opacity) == 0 and not is_name:
        return None
    if scalars is None:
        raise ValueError('opacity must be a number from 0 to 1 without scalars')
    arrays, others = source.arrays, source.cell_arrays
    if scalars.on_cells:
        arrays, others = others, arrays
    if is_name and opacity not in arrays:
        if opacity in others:
            kind = 'cells' if scalars.on_cells else 'points'
            raise ValueError(f'opacity must be of {kind}, as the scalars are, got {opacity!r}')
        return None
    values = np.asarray(arrays[opacity] if is_name else opacity)
    if not is_name and not scalars.on_cells and len(values) == source.point_count:
        values = values if source.points is None else values[source.points]
    if len(values) != len(scalars.values):
        return None
    if values.ndim != 1 or values.dtype.kind not in 'biuf':
        raise ValueError(f'opacity must be one number each, got {values.dtype} {values.shape}')
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError('opacity must be from 0 to 1 everywhere')
    return values.astype(float)


def _checked_preference(look) -> str:
    preference = look.get('preference') or 'point'
    if preference not in _PREFERENCES:
        raise ValueError(f"preference must be 'point' or 'cell', got {preference!r}")
    return preference


def _found(source, scalars, preference) -> tuple[str, np.ndarray, bool]:
    """Return the name and the values of scalars, and whether they are of cells."""
    arrays = source.arrays, source.cell_arrays
    prefers_cells = preference == 'cell'
    if isinstance(scalars, str):
        homes = [on_cells for on_cells in (False, True) if scalars in arrays[on_cells]]
        if not homes:
            names = ', '.join(map(repr, {**arrays[0], **arrays[1]})) or 'none'
            raise KeyError(
                f'scalars: the mesh has no array {scalars!r}; it has: {names}; pass the values of '
                'one that was added since'
            )
        on_cells = prefers_cells if prefers_cells in homes else homes[0]
        return scalars, np.asarray(arrays[on_cells][scalars]), on_cells
    values = np.atleast_1d(scalars)
    counts = source.point_count, source.cell_count
    if len(values) not in counts:
        raise ValueError(
            f'scalars must be one value per point ({counts[0]}) or per cell ({counts[1]}), got '
            f'shape {values.shape}'
        )
    on_cells = prefers_cells if counts[0] == counts[1] else len(values) == counts[1]
    if not on_cells and source.points is not None:
        values = values[source.points]
    return '', values, on_cells


def _checked_colors(argument, values) -> np.ndarray:
    """Return colours as bytes."""
    if values.ndim != 2 or values.shape[1] not in (3, 4) or values.dtype.kind not in 'uif':
        raise ValueError(
            f'{argument} must be colours of shape (n, 3) or (n, 4) with rgb=True, got '
            f'{values.dtype} of shape {values.shape}'
        )
    if values.dtype == np.uint8:
        return values
    if not (np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1):
        raise ValueError(f'{argument} must be uint8, or numbers from 0 to 1, with rgb=True')
    return np.rint(255 * values).astype(np.uint8)


def _categories(argument, name, values, on_cells) -> Scalars:
    """Return words or truth values as numbers of categories."""
    if values.ndim != 1:
        raise ValueError(f'{argument} must be one word each, got shape {values.shape}')
    if values.dtype.kind == 'b':
        return Scalars(name, values.astype(np.float32), on_cells, True, ('False', 'True'))
    kinds, numbers = np.unique(values, return_inverse=True)
    words = tuple(w.decode() if isinstance(w, bytes) else str(w) for w in kinds)
    return Scalars(name, numbers.astype(np.float32), on_cells, True, words)


def _checked_numbers(argument, values, component) -> np.ndarray:
    """Return one number each: of vectors a component, or the norm."""
    if values.dtype.kind not in 'iuf' or values.ndim > 2:
        raise ValueError(
            f'{argument} must be numbers, words or colours, got {values.dtype} of shape '
            f'{values.shape}'
        )
    if values.ndim == 1:
        return values
    if component is None:
        return np.linalg.norm(values, axis=1)
    component = checked_whole('component', component, 0, values.shape[1] - 1)
    return values[:, component]


def range_of(values):
    """Return the range of finite values, None if there are none."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
