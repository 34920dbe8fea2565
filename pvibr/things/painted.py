"""Colours, scalars and visibility of a thing's items, as in ``add_mesh``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyvista as pv

from pvibr.things import appearance as look
from pvibr.things.keywords import check_keywords
from pvibr.things.scalar_bars import name_of
from pvibr.things.thing import Thing

if TYPE_CHECKING:
    from pyvista.plotting.themes import Theme

#: Arguments of ``add_mesh`` that configure the lookup table.
TABLE_OPTIONS = (
    *('cmap', 'clim', 'n_colors', 'nan_color', 'below_color', 'above_color'),
    *('log_scale', 'flip_scalars', 'categories', 'annotations'),
)


class Painted(Thing):
    """A thing whose items have a colour each, set directly or mapped from scalars.

    A subclass has a length, calls :meth:`_begin_looks` and defines ``_repaint()``, which is called
    after each change.
    """

    #: Lookup table of the scalars, or None.
    table: pv.LookupTable | None = None
    #: Category names, if the scalars are strings or booleans.
    _names: tuple[str, ...] = ()
    #: Defaults of the lookup table.
    _theme: Theme | None = None

    def __len__(self) -> int:
        raise NotImplementedError

    def _repaint(self):
        """Draw the current looks."""
        raise NotImplementedError

    def _begin_looks(self, options, scalars=None, colors=None, visible=None, theme=None):
        """Adopt the constructor's arguments; nothing is drawn yet."""
        check_keywords(type(self), [name for name in options if name not in TABLE_OPTIONS])
        self._theme = theme
        self._table_options = {k: v for k, v in options.items() if v is not None}
        self._scalars = self._colors = self._visible = self.table = None
        if scalars is not None:
            self._map(scalars)
        elif colors is not None:
            self._colors = self._as_colors(colors)
        if visible is not None:
            self._visible = look.as_mask(visible, len(self))

    def _map(self, scalars):
        values = self._as_scalars(scalars)
        categories = look.numbered(values)[1]
        reusable_table = self.table if categories == self._names else None
        table = reusable_table or self._table_for(values, self._table_options)
        self._scalars, self.table, self._names = values, table, categories
        self._scalar_name = name_of(scalars)
        self._colors = look.map_scalars(table, values)

    def _table_for(self, scalars, options):
        return look.color_table(scalars, theme=self._theme, **options)

    def _as_scalars(self, scalars):
        """Return validated scalars; override it for several per item."""
        return look.as_scalars(scalars, len(self))

    def _as_colors(self, colors):
        """Return validated colours; override it for several per item."""
        return look.as_colors(colors, len(self))

    @property
    def scalars(self):
        """Numbers, booleans or strings of the items, shape (n,), read-only, or None.

        Setting them bakes nothing. Booleans and strings are categories, as in ``add_mesh``.
        """
        return None if self._scalars is None else look.read_only(self._scalars)

    @scalars.setter
    def scalars(self, scalars):
        self._set_scalars(scalars, name_of(scalars))

    def _set_scalars(self, scalars, name):
        """Show scalars under a scalar-bar title."""
        if scalars is None:
            self._scalars = self._colors = self.table = None
        else:
            self._map(scalars)
        self._scalar_name = name
        self._repaint()
        self._show_bar()

    def map(self, cmap=None, clim=None, **options):
        """Recolour the scalars by another map or range; nothing is baked.

        Parameters
        ----------
        cmap, clim : optional
            As in ``add_mesh``; None keeps the current one.
        **options
            ``n_colors``, ``nan_color``, ``below_color``, ``above_color``, ``log_scale``,
            ``flip_scalars``, ``categories``, ``annotations``.

        Raises
        ------
        ValueError
            If there are no scalars.
        """
        new_options = {k: v for k, v in {'cmap': cmap, 'clim': clim}.items() if v is not None}
        if self._scalars is None:
            option_names = ', '.join([*new_options, *options]) or 'map'
            raise ValueError(f'{option_names} requires scalars; set scalars first')
        check_keywords(type(self), options, TABLE_OPTIONS)
        all_options = self._table_options | new_options | options
        self.table = self._table_for(self._scalars, all_options)
        self._table_options = all_options
        self._colors = look.map_scalars(self.table, self._scalars)
        self._repaint()
        self._show_bar()

    @property
    def clim(self) -> tuple[float, float] | None:
        """Range of the scalars in their colour map, or None without scalars."""
        return None if self.table is None else self.table.scalar_range

    @clim.setter
    def clim(self, clim):
        self.map(clim=clim)

    def set_scalar_range(self, clim):
        """Change the scalar range, keeping the lookup table."""
        if self.table is None or tuple(self.table.scalar_range) == clim:
            return
        self.table.scalar_range = self._table_options['clim'] = clim
        if self._scalars is not None:
            self._colors = look.map_scalars(self.table, self._scalars)
            self._repaint()

    @property
    def colors(self):
        """Colours of the items, uint8, read-only, or None; shape (n, 4) if any is translucent."""
        return None if self._colors is None else look.read_only(self._colors)

    @colors.setter
    def colors(self, colors):
        new_colors = None if colors is None else self._as_colors(colors)
        self._scalars = self.table = None
        self._colors = new_colors
        self._repaint()
        self._show_bar()

    @property
    def visible(self) -> np.ndarray:
        """Which items are drawn, shape (n,) bool, read-only."""
        mask = self._visible
        return look.read_only(np.ones(len(self), bool) if mask is None else mask)

    @visible.setter
    def visible(self, visible):
        self._visible = look.as_mask(visible, len(self))
        self._repaint()

    def scalar_mapper(self):
        """Return the actor's mapper with the lookup table of the scalars, or None."""
        if self.table is None or self._scalars is None:
            return None
        self.has_names = bool(self._names)
        return self._with_table(self.table, self.table.scalar_range)

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return self._scalar_name or ('' if self.table is None else self._name or 'scalars')
