"""Positions, sizes and looks of items at points, adopted together and replaced together."""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from pvibr.core.arguments import naming
from pvibr.core.nan_rows import NanRows
from pvibr.points.point_arguments import as_floats, checked_opacity, points_and_scalars
from pvibr.things import appearance as look
from pvibr.things.keywords import check_keywords
from pvibr.things.scalar_bars import name_of
from pvibr.things.some_items import checked_ids, with_looks

_LOOKS = 'scalars', 'colors', 'visible', 'opacity'
# What an update replaces, restored if a check fails.
_REPLACED = (
    *('_given', '_nan_rows', '_arranged', 'table', '_names', '_scalar_name'),
    *('_scalars', '_colors', '_visible', '_opacity'),
)


def adopt(self, nan, given, looks) -> dict:
    """Check the items' positions and sizes; return their looks with named scalars as values."""
    self._nan_rows, self._given = NanRows(nan), {}
    return _place(self, given, looks)


def _place(self, values, looks) -> dict:
    """Check values by name, those given before included; return the looks."""
    values, scalars = dict(values), looks.get('scalars')
    positions = next(iter(values), '')
    if positions in values:
        values[positions], scalars = points_and_scalars(positions, values[positions], scalars)
    given = self._given | {name: _copied(value) for name, value in values.items()}
    nan_rows = self._nan_rows.anew()
    self._arranged = self._arranged_from(given, nan_rows)
    self._given, self._nan_rows = given, nan_rows
    return looks | ({} if scalars is None else {'scalars': scalars})


def _copied(value):
    return np.array(value) if isinstance(value, np.ndarray) else deepcopy(value)


def update(self, ids=None, **values):
    """Change positions, sizes and looks of all items, or of the given ones, at once.

    Parameters
    ----------
    ids : array_like of int or bool, or slice, optional
        Items to change; by default all are replaced, by any number of new ones.
    **values
        Arguments of the constructor by name: positions, sizes, turns, ``scalars``, ``colors``,
        ``visible`` and ``opacity``. If the number of items changes, omitted looks of single items
        are reset, and other arguments with a value per item must be among those given.

    Raises
    ------
    IndexError
        If an item does not exist.
    TypeError, ValueError
        If a value is invalid, or missing; nothing has changed then.
    """
    check_keywords(type(self), values, (*self._given, *_LOOKS))
    if ids is not None:
        values = _with_some(self, checked_ids(ids, len(self)), values)
    looks = {name: values.pop(name) for name in _LOOKS if name in values}
    previous = {name: getattr(self, name) for name in _REPLACED}
    count = len(self)
    try:
        if values:
            looks = _place(self, values, looks)
        if len(self) != count:
            _reset_looks(self)
        _adopt_looks(self, looks)
    except BaseException:
        vars(self).update(previous)
        raise
    if values:
        self._moved()
    self._share_opacity()
    self._repaint()
    self._show_bar()


def _with_some(self, ids, values) -> dict:
    """Return the values of all items, with those of `ids` changed."""
    looks = with_looks(self, ids, *(values.pop(name, None) for name in _LOOKS[:3]))
    rows = {}
    for name, value in values.items():
        all_values = np.asarray(getattr(self, name, self._given.get(name)), float)
        if len(all_values.shape) == 0 or len(all_values) != len(self):  # one for all
            all_values = np.broadcast_to(all_values, (len(self), *all_values.shape[1:]))
        rows[name] = np.array(all_values)
        with naming(name, value):
            rows[name][ids] = as_floats(name, getattr(value, 'points', value))
    return rows | looks


def _reset_looks(self):
    """Forget the looks of single items."""
    self._scalars = self._colors = self._visible = self.table = None
    if np.ndim(self._opacity):
        self._opacity = np.array(1.0)


def _adopt_looks(self, looks):
    """Check and adopt looks, which are not drawn yet."""
    if 'opacity' in looks:
        self._opacity = checked_opacity(looks['opacity'], len(self), self.is_cut_out)
    if 'visible' in looks:
        self._visible = look.as_mask(looks['visible'], len(self))
    if looks.get('scalars') is not None:
        self._map(looks['scalars'])
    elif 'scalars' in looks or 'colors' in looks:
        colors = looks.get('colors')
        self._scalars = self.table = None
        self._colors = None if colors is None else self._as_colors(colors)
    self._scalar_name = name_of(looks['scalars']) if 'scalars' in looks else self._scalar_name


def item_property(name, doc):
    """Return an argument that has a row per item as a property, which changes no number."""

    def set_values(self, values):
        self.update(**{name: values})

    def values_of(self):
        values, mask = self._arranged_values(name), self._nan_rows.by_name.get(name)
        if mask is not None:
            values = values.copy()
            values[mask] = np.nan
        return look.read_only(values)

    return property(values_of, set_values, doc=doc)


def opacity_property():
    """Return the opacity of items as a property."""

    def opacity_of(self):
        is_shared = np.ndim(self._opacity) == 0
        return self.prop.GetOpacity() if is_shared else look.read_only(self._opacity)

    def set_opacity(self, opacity):
        self.update(opacity=opacity)

    doc = 'Opacity of all items, a number, or of each, shape (n,).'
    return property(opacity_of, set_opacity, doc=doc)
