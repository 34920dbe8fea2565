"""Sets of many items drawn by a few actors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyvista as pv

from pvibr.core.arguments import naming
from pvibr.core.determinism import is_deterministic
from pvibr.core.nan_rows import NanRows
from pvibr.things import appearance as look
from pvibr.things.appearance import TABLE_OPTIONS
from pvibr.things.clipping import ClippingPlanes
from pvibr.things.keywords import check_keywords
from pvibr.things.placing import is_similar
from pvibr.things.scalar_bars import name_of
from pvibr.things.stand_ins import StandIns
from pvibr.things.thing import Thing

if TYPE_CHECKING:
    from pyvista.plotting.themes import Theme

    from pvibr.things.frame import Frame


class _Still(NamedTuple):
    """What a set was last prepared for."""

    choice_key: tuple | None = None
    flags: tuple = ()
    getters: list = []
    state: tuple = ()


class ItemSet(Thing):
    """Items with positions and looks of their own, and a transform of the whole.

    A subclass has a length, calls :meth:`_begin_looks`, and defines ``_repaint()`` and ``_put()``,
    which are called after each change of looks, or of the transform.
    """

    FOR_USERS: tuple[str, ...] = (
        *('scalars', 'colors', 'visible', 'clim', 'map', 'table', 'blends', 'instance_of'),
    )
    moved_by = None
    #: Also drawn in picking frames.
    picks = True
    #: Lookup table of the scalars, or None.
    table: pv.LookupTable | None = None
    #: Category names, if the scalars are strings or booleans.
    _names: tuple[str, ...] = ()
    #: Defaults of the lookup table.
    _theme: Theme | None = None
    #: World from item space, None for the identity.
    _world: np.ndarray | None = None
    _matrix_data: tuple = tuple(np.eye(4).ravel().tolist())
    _stand_ins: Any = None
    _noun = 'items'
    _changes = 0
    _content_key: tuple | None = None
    _still = _Still()
    #: A frame in which only the view differs from that of the last choice.
    _unchanged_in: Frame | None = None
    #: Clipping planes that the shaders of its items apply.
    clipping = ClippingPlanes()
    #: Which items have NaN among their positions and sizes, and are hidden.
    _nan_rows = NanRows()

    def __len__(self) -> int:
        raise NotImplementedError

    def _contents(self) -> str:
        return f'{len(self):,} {self._noun}'

    # -- looks, as in add_mesh ----------------------------------------------------------------

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
        self._colors = self._mapped(table, values)
        self._scalars, self.table, self._names = values, table, categories
        self._scalar_name = name_of(scalars)

    def _mapped(self, table, scalars):
        """Return the colours of scalars; override it where some alphas cannot be drawn."""
        return look.map_scalars(table, scalars)

    def _table_for(self, scalars, options):
        return look.color_table(scalars, theme=self._theme, **options)

    def _as_scalars(self, scalars):
        """Return validated scalars; override it for several per item."""
        return look.as_scalars(scalars, len(self))

    def _as_colors(self, colors, count=None):
        """Return validated colours; override it for several per item."""
        return look.as_colors(colors, len(self) if count is None else count)

    def _base_colors(self) -> np.ndarray:
        """Return the colours that items have without their own, shape (n, 3)."""
        material_color = np.rint(255 * np.array(self.prop.GetColor()))
        return np.tile(material_color.astype(np.uint8), (len(self), 1))

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
            ``n_colors``, ``nan_color``, ``nan_opacity``, ``below_color``, ``above_color``,
            ``log_scale``, ``flip_scalars``, ``categories``, ``annotations``.

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
        table = self._table_for(self._scalars, all_options)
        self._colors = self._mapped(table, self._scalars)
        self.table, self._table_options = table, all_options
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
            self._colors = self._mapped(self.table, self._scalars)
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
        """Which items are to be drawn, shape (n,) bool, read-only."""
        mask = self._visible
        return look.read_only(np.ones(len(self), bool) if mask is None else mask)

    @visible.setter
    def visible(self, visible):
        self._visible = look.as_mask(visible, len(self))
        self._repaint()

    def drawn_items(self) -> np.ndarray:
        """Return which items are drawn, shape (n,): visible, not quite clear, without NaN."""
        drawn = np.ones(len(self), bool) if self._visible is None else self._visible.copy()
        nan_mask = self._nan_rows.mask
        if nan_mask is not None:
            drawn &= ~nan_mask
        alphas = look.alphas_of(self._colors)
        return drawn if alphas is None else drawn & (alphas > 0)

    def scalar_mapper(self):
        """Return the actor's mapper with the lookup table of the scalars, or None."""
        if self.table is None or self._scalars is None:
            return None
        self.has_names = bool(self._names)
        return self._with_table(self.table, self.table.scalar_range)

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return self._scalar_name or ('' if self.table is None else self._name or 'scalars')

    # -- the transform of the whole -----------------------------------------------------------

    def _put(self):
        """Move the items after `_world` changed."""
        raise NotImplementedError

    @np.errstate(over='ignore', invalid='ignore')
    def _check_linear(self, linear):
        """Raise a ValueError unless a linear map, (3, 3), has an inverse."""
        axis_lengths = np.linalg.norm(linear, axis=0)
        if not np.abs(np.linalg.det(linear)) > 1e-12 * axis_lengths.prod():
            raise ValueError(f'scale or user_matrix of {self.name} must be invertible')

    def _check_similar(self, linear, why):
        """Raise a ValueError unless a linear map, (3, 3), scales uniformly."""
        if not is_similar(linear):
            raise ValueError(f'scale or user_matrix of {self.name} must be uniform: {why}')

    def follow(self):
        """Adopt a transform set in the meantime."""
        matrix_data = self.GetMatrix().GetData()
        if matrix_data != self._matrix_data:
            matrix = np.reshape(matrix_data, (4, 4))
            self._check_linear(matrix[:3, :3])
            self._matrix_data = matrix_data
            self._world = None if (matrix == np.eye(4)).all() else matrix
            self._put()

    def _set_checked(self, name, args):
        old_transform = self.GetScale(), self.GetUserMatrix()
        with naming('scale' if name == 'SetScale' else 'user_matrix', args):
            getattr(pv.Actor, name)(self, *args)
        try:
            self._check_linear(np.reshape(self.GetMatrix().GetData(), (4, 4))[:3, :3])
        except ValueError:
            pv.Actor.SetScale(self, old_transform[0])
            pv.Actor.SetUserMatrix(self, old_transform[1])
            raise

    def SetScale(self, *scale):
        """Set scale factors along x, y and z, or one for all."""
        self._set_checked('SetScale', scale)

    def SetUserMatrix(self, *matrix):
        """Set the vtkMatrix4x4 that is applied last, or None."""
        self._set_checked('SetUserMatrix', matrix)

    def SetUserTransform(self, *transform):
        """Set the vtkLinearTransform that is applied last, or None."""
        self._set_checked('SetUserTransform', transform)

    # -- single items -------------------------------------------------------------------------

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the items' bounding spheres, world units."""
        raise NotImplementedError

    def item_mesh(self, index) -> pv.PolyData:
        """Return an item's mesh in world units, for VTK's pickers."""
        raise NotImplementedError

    def picked(self) -> list:
        """Return the actors that VTK's pickers find in its place."""
        return [] if self._stand_ins is None else self._stand_ins.actors()

    def instance_of(self, actor) -> int | None:
        """Return the index of the item that a picked actor represents, or None.

        Parameters
        ----------
        actor : vtkActor
            Actor returned by one of PyVista's pickers.
        """
        return None if self._stand_ins is None else self._stand_ins.index_of(actor)

    def _is_drawn_for_picker(self, frame) -> bool:
        """In a picking frame show meshes instead, and return True."""
        if frame.picking and frame.own:
            self.deactivate()
            if self.pickable:
                self._stand_ins.draw(frame)
        return frame.picking and frame.own

    def _places(self) -> np.ndarray:
        """Return the item positions, shape (n, 3), world units."""
        raise NotImplementedError

    def dataset(self) -> pv.PolyData:
        """Return the item positions as points, with the items' attributes as arrays."""
        self.follow()
        mesh = pv.PolyData(np.array(self._places(), float).reshape(-1, 3))
        mesh['visible'] = self.visible
        item_arrays = {'colors': self.colors, self.scalar_title() or 'scalars': self.scalars}
        for name, values in item_arrays.items():
            if values is not None:
                mesh[name] = values
        return mesh

    def _can_pick(self) -> bool:
        return self.pickable and self.pipeline is not None and self.needed(None) is True

    # -- the life of an effect ----------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a value that changes with the content, but not with the camera."""
        self.follow()
        state = self._changes, self.revision, self.visibility
        return *state, self.blends, self.clipping.key()

    def needed(self, frame) -> bool | str:
        """Return True if there is anything to draw, else the reason."""
        if frame is not None and self._unchanged_in is frame:
            return True
        self.follow()
        if not self.visibility:
            return super().needed(frame)
        return bool(len(self)) or f'no {self._noun}'

    def prepare(self, frame):
        """Choose which items are drawn, and how, if the view or anything else has changed."""
        if self._is_drawn_for_picker(frame):
            return
        is_unchanged, self._unchanged_in = self._unchanged_in is frame, None
        if not is_unchanged:
            self._upload(frame)
        other_depths: list[float] = []
        if self.blends and frame.own and not frame.casting:
            other_depths = self.pipeline.order.others(frame, self, self.pipeline.things)
        choice_key = frame.once(view_key), other_depths, *self._choice_key(frame)
        if choice_key != self._content_key:
            self._choose(frame, other_depths)
            self._content_key = choice_key
        still = self._still
        getters = still.getters if is_unchanged else self._time_getters()
        if getters is not None and not self.blends:
            flags = frame.once(_flags), self._depth_is_read(frame)
            state = still.state if is_unchanged else self._content_state(getters)
            self._still = _Still(self._content_key, flags, getters, state)

    def is_prepared(self, frame) -> bool:
        """Return True if view, settings, transform, and what has times are as they were."""
        still, self._unchanged_in = self._still, None
        is_chosen = still.choice_key is not None and still.choice_key is self._content_key
        if not is_chosen or still.state != self._content_state(still.getters):
            return False
        if still.flags == (frame.once(_flags), self._depth_is_read(frame)):
            return True
        self._unchanged_in = frame
        return False

    def _content_state(self, getters) -> tuple:
        """Return what changes with all that a choice depends on, but not with the view."""
        times = [get() for get in getters]
        return self._changes, self.revision, self.GetVisibility(), is_deterministic(), times

    def _time_getters(self) -> list | None:
        """Return functions whose values tell all that `prepare` follows; None if none can."""
        return None

    def _upload(self, frame):
        """Upload what has changed; the context is current."""
        raise NotImplementedError

    def _choice_key(self, frame) -> tuple:
        """Return what determines the choice of items in a frame, besides the camera."""
        return self.blends, self._changes, self.revision, self.clipping.key()

    def _choose(self, frame, other_depths):
        """Show the items in view; blending ones between the depths of other translucent props."""
        raise NotImplementedError

    def set_clipping_planes(self, planes):
        """Clip it by a vtkPlaneCollection."""
        clipping = ClippingPlanes(planes)
        is_toggled = bool(clipping) != bool(self.clipping)
        self.clipping = clipping
        if is_toggled:
            self._switch_clipping()
        if self._stand_ins is not None:
            self._stand_ins.clip(planes)
        self._touch()

    def _switch_clipping(self):
        """Use shaders with, or without, clipping."""
        raise NotImplementedError

    def deactivate(self):
        """Hide all actors."""
        for actor in self.actors():
            actor.VisibilityOff()
        self._content_key = None

    def attach(self, pipeline):
        """Add its props to the scene."""
        self._framed = self._changes, self.GetBounds()
        super().attach(pipeline)

    def _put_in(self, renderer):
        super()._put_in(renderer)
        self._stand_ins = self._stand_ins or StandIns(self)
        self._stand_ins.put_in(renderer)

    def begin_frame(self):
        """Follow the transform, and let no picker's meshes be drawn."""
        self._stand_ins.begin_frame()
        try:  # noqa: SIM105, a context manager takes longer
            self.follow()
        except ValueError:  # the pipeline raises it: VTK swallows errors here
            pass
        self._stay_whole(self._changes)

    def end_frame(self):
        """Let pickers find items between frames."""
        self._stand_ins.end_frame()

    def _take_out(self, renderer):
        self.deactivate()
        self._stand_ins.take_out()
        super()._take_out(renderer)

    def _touch(self):
        """Choose the items again in the next frame."""
        self._content_key = None
        self._changes += 1


def _flags(frame) -> tuple:
    """Return what of a frame determines all choices; equal views are the same object."""
    flags = frame.own, frame.picking, frame.casting, frame.depth_map
    return frame.view, frame.size, frame.quality, *flags


def view_key(frame) -> tuple:
    """Return what of a frame's view determines the choice of items."""
    return frame.view.key(), frame.size, frame.casting
