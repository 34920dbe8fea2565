"""Effects that are actors: what draws in a scene, as PyVista's plotters list it."""

from __future__ import annotations

from inspect import get_annotations
from itertools import count
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import naming
from pvibr.core.effect import Effect
from pvibr.core.hooks import MethodHook
from pvibr.core.params import Param, checked_flag, checked_name
from pvibr.core.plotters import adding_by_component, put_inner, set_legend_label
from pvibr.meshes.materials import copy_property
from pvibr.things.appearance import read_only
from pvibr.things.scalar_bars import Bar, ThingMapper, share_range
from pvibr.things.shared_material import SharedMaterial

_DIRECT = 2  # VTK_COLOR_MODE_DIRECT_SCALARS
#: What PyVista appends to the names of arrays that it derives, but for numbers of components.
_DERIVED = 'normed', 'digitized', 'real'
#: Methods of actors that change their place.
MOVES = (
    *('SetPosition', 'AddPosition', 'SetOrigin', 'SetOrientation', 'AddOrientation', 'SetScale'),
    *('RotateX', 'RotateY', 'RotateZ', 'RotateWXYZ', 'SetUserMatrix', 'SetUserTransform'),
)


def _box_mesh():
    """Return a mesh of two points that has bounds and draws nothing."""
    mesh, points, cells = _vtk.vtkPolyData(), _vtk.vtkPoints(), _vtk.vtkCellArray()
    points.SetDataTypeToDouble()
    points.SetNumberOfPoints(2)
    cells.InsertNextCell(3, (0, 1, 1))  # VTK takes the bounds of cells
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    return mesh


class _Visibility(Param):
    """The visibility of an actor as a setting."""

    def __get__(self, owner, cls=None):
        return self if owner is None else bool(owner.GetVisibility())

    def __set__(self, owner, value):
        owner.SetVisibility(self.check(value, type(owner).__name__))


def _unplaced(name):
    """Return a property of an actor that can be read only."""

    def refuse(thing, _value):
        raise AttributeError(f'{thing.name}.{name} cannot be set: {thing.moved_by}')

    def value(thing):
        found = getattr(pv.Actor, name).fget(thing)
        return read_only(found) if isinstance(found, np.ndarray) else found

    return property(value, refuse, doc=getattr(pv.Actor, name).__doc__)


def _unmoved(name):
    """Return a method of actors that raises an error."""

    def refuse(thing, *_args):
        if name != 'SetScale':  # plotters scale all that they list, also what it stands for
            raise AttributeError(f'{thing.name}.{name} is of no use: {thing.moved_by}')

    refuse.__doc__ = 'Raise an error: its place cannot be set.'
    return refuse


def joined_bounds(boxes) -> tuple[float, ...]:
    """Return the bounds of all of some boxes, empty ones left out."""
    found = np.array([b for b in boxes if b and b[0] <= b[1]]).reshape(-1, 6)
    if not len(found):
        return (1.0, -1.0) * 3
    ends = np.stack([found[:, ::2].min(0), found[:, 1::2].max(0)], 1)
    return tuple(ends.ravel().tolist())


class Thing(Effect, pv.Actor):
    """An effect that draws in the scene: the actor that stands for all that it draws with.

    The actor itself draws nothing, unless it is among its `actors`: it has the name, visibility,
    material and bounds of the whole.
    A subclass overrides the hooks it needs.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    FOR_USERS: tuple[str, ...] = (
        *('actors', 'pick', 'pickable', 'visibility', 'prop', 'bounds', 'center', 'position'),
        *('orientation', 'scale', 'origin', 'user_matrix', 'mapper', 'label'),
    )

    visibility = _Visibility(True, 'Draw it.')
    #: What errors say of clipping planes.
    clipped_by = 'leave items out by its visible mask'
    #: What errors say of setting its place.
    moved_by = 'its items have places of their own, set these'

    # -- hooks: what draws it ----------------------------------------------------------------

    def actors(self) -> list:
        """Return the actors that draw it, invisible ones included."""
        raise NotImplementedError

    def drawn(self) -> list:
        """Return the actors that draw it in the frame that it was prepared for."""
        return [actor for actor in self.actors() if actor.GetVisibility()]

    def picked(self) -> list:
        """Return the actors that pickers of VTK find in its place."""
        return []

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors that draw it in a frame that is not its own, or its depth alone."""
        self.prepare(frame)
        return self.depths() if depth else self.drawn()

    @property
    def blends(self) -> bool:
        """Whether its items are sorted among other translucent props."""
        return False

    def _depth_is_read(self, frame) -> bool:
        """Return True if an effect reads the depth of the frame after it is drawn."""
        renderer = frame.renderer
        own = renderer.GetPass() is not None or bool(renderer.GetUseSSAO())
        effects = self.pipeline.effects
        return frame.own and (own or any(e.is_image_effect and e.enabled for e in effects))

    def depths(self) -> list:
        """Return the actors that draw its depth, as lights see it."""
        return self.drawn()

    def solids(self) -> list:
        """Return the actors whose meshes cast its shadow volumes, None for what has no mesh."""
        return [None]

    def dataset(self) -> pv.DataSet | None:
        """Return what PyVista takes for its mesh, such as its items' places; None for nothing."""
        return None

    def set_clipping_planes(self, planes):
        """Cut it off by a vtkPlaneCollection."""
        raise AttributeError(f'{self.name} cannot be clipped: {self.clipped_by}')

    # -- hooks: what is known of it ----------------------------------------------------------

    @property
    def cast_bounds(self) -> np.ndarray:
        """World bounds of what casts shadows, shape (6,)."""
        return np.array(self.bounds)

    def content_key(self) -> tuple:
        """Return a value that changes whenever the drawn content does, the camera left out."""
        raise NotImplementedError

    def stands_for(self) -> list:
        """Return the visible actors of the user that it is drawn in place of."""
        return []

    def needed(self, frame) -> bool | str:
        """Return True if it is visible."""
        return self.visibility or 'not visible'

    def _now(self) -> float:
        """Return the time of its subplot, 0 in none."""
        return 0.0 if self.pipeline is None else self.pipeline.time

    def follow(self):
        """Take over a new time of the pipeline."""

    @classmethod
    def follow_all(cls, things):
        """Have all things of this class in a pipeline take over its new time."""
        for thing in things:
            thing.follow()

    def scalar_mapper(self):
        """Return the actor's mapper with the table of the shown scalars, None without scalars."""
        return

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return self._scalar_name

    #: Whether the values of the shown scalars are names: the bar has no numbers then.
    has_names = False

    def set_scalar_range(self, clim):
        """Show the scalars by another range, in the same table."""

    def has_bar(self) -> bool:
        """Return True if it gets a scalar bar where none was asked for, as the theme says."""
        return True

    # -- the actor that stands for it --------------------------------------------------------

    keeps_arguments = False  # of instances these are large

    # PyVista checks each access in Python for VTK's own names, which frames cannot afford.
    __getattribute__ = object.__getattribute__

    #: Whether the bounds of the scene take in its own.
    counts_bounds = True
    _has_extent = True
    _label: str | None = None
    _pickable = True
    _listed: str | None = None
    _scalar_name = ''
    #: Pairs of a key, which begins with a `Stage`, and an actor that has its place in the order
    #: of drawing by it; replaced wherever it changes.
    order: tuple = ()
    #: The scalar bar asked for with it, None if it was added without.
    bar: Bar | None = None
    #: Actors with its material.
    _dressed: tuple = ()
    #: What keeps the materials of several meshes like its own.
    _material: Any = None

    position = _unplaced('position')
    orientation = _unplaced('orientation')
    scale = _unplaced('scale')
    origin = _unplaced('origin')
    user_matrix = _unplaced('user_matrix')

    def __init__(self, **settings):
        mapper = ThingMapper()
        mapper.follow(self)
        mapper.SetNumberOfSubPieces(0)  # nothing is drawn, in any representation
        mapper.SetInputData(_vtk.vtkPolyData())
        pv.Actor.__init__(self, mapper)
        pv.Actor.SetPickable(self, False)  # what stands for its items is picked instead
        self.ForceOpaqueOn()  # a translucent prop takes part in the order of drawing
        self.SetUseBounds(self.counts_bounds)
        super().__init__(**settings)
        _ADD_ACTOR.need(self)

    def _set_bounds(self, bounds):
        """Have bounds, in the space of the actor."""
        # PyVista takes empty bounds for real ones.
        if self._has_extent != (bounds[0] <= bounds[1]):
            self._has_extent = not self._has_extent
            self.SetUseBounds(self._has_extent and self.counts_bounds)
        mapper = self.GetMapper()
        if not self._has_extent:
            mapper.SetInputData(_vtk.vtkPolyData())
            return
        mesh = mapper.GetInput()
        if not mesh.GetNumberOfPoints():
            mesh = _box_mesh()
            mapper.SetInputData(mesh)
        points = mesh.GetPoints()
        bounds = [float(b) for b in bounds]
        points.SetPoint(0, *bounds[::2])
        points.SetPoint(1, *bounds[1::2])
        points.Modified()

    @property
    def name(self) -> str:
        """Name in ``plotter.actors``, reports and the state; its class's by default."""
        return self._name or self._listed or type(self).__name__

    @name.setter
    def name(self, name):
        self._name = checked_name(name)

    @property
    def pickable(self) -> bool:
        """Whether `pick` finds it."""
        return self._pickable

    @pickable.setter
    def pickable(self, pickable):
        self._pickable = bool(checked_flag('pickable', pickable))

    def GetPickable(self) -> bool:
        """Return `pickable`, also to PyVista."""
        return self._pickable

    def SetPickable(self, pickable):
        """Set `pickable`, as PyVista does."""
        self._pickable = bool(pickable)

    @property
    def prop(self):
        """Material of all of it; where meshes have several, what changes in it does in all."""
        return self.GetProperty()

    @prop.setter
    def prop(self, prop):
        with naming('prop', prop):
            for actor in (self, *self._dressed):
                actor.SetProperty(prop)
        if self._material is not None:
            self._material.wear(prop)

    def _share_material(self):
        """Have the first of the materials, and have what changes in it change in all."""
        for first in self._materials_of_all()[:1]:
            copy_property(self.prop, first)
        self._lead_materials()

    def _lead_materials(self):
        """Have what changes in the material change in those of all."""
        if self._material is not None:
            self._material.stop()
        self._material = SharedMaterial(self.prop, self._materials_of_all)

    def _materials_of_all(self) -> list:
        """Return the properties of what draws it."""
        return []

    @property
    def label(self) -> str | None:
        """Text in the legend of the plotter, None for no entry."""
        return self._label

    @label.setter
    def label(self, label):
        if not isinstance(label, (str, type(None))):
            raise TypeError(f'label = {label!r}: must be a str or None')
        self._label = label
        if self.pipeline is not None:
            set_legend_label(self.pipeline.renderer, self, label, self.scalar_mapper() is not None)

    @property
    def center(self) -> tuple[float, float, float]:
        """Middle of the bounds, world units."""
        x, y, z = np.reshape(self.bounds, (3, 2)).mean(1).tolist()
        return x, y, z

    def copy(self, deep=True):
        """Raise an error: the copy would draw nothing."""
        raise TypeError(f'{self.name} cannot be copied or pickled: make one more and add it')

    def __reduce_ex__(self, _protocol):
        return self.copy()

    def __deepcopy__(self, _memo):
        return self.copy()

    def __dir__(self) -> list[str]:
        """Return the names that users use: hooks and undeclared attributes are left out."""
        declared = {*dir(type(self)), *get_annotations(type(self))}
        return [name for name in super().__dir__() if name in declared]

    def __repr__(self) -> str:
        return Effect.__repr__(self)

    __str__ = __repr__

    def _state(self) -> str:
        return ('' if self.visibility else 'hidden, ') + super()._state()

    # -- its place in the scene --------------------------------------------------------------

    @property
    def props(self) -> tuple:
        """The actor that stands for it."""
        return (self,)

    def is_gone(self, renderer) -> bool:
        """Return True if its actor was removed from the scene by other means."""
        return not renderer.HasViewProp(self)

    def attach(self, pipeline):
        """Add its props to the scene."""
        super().attach(pipeline)
        renderer = pipeline.renderer
        if isinstance(renderer, pv.Renderer):
            given = self._name
            self._listed = None if given else _free_name(self.name, renderer.actors)
            renderer.add_actor(self, name=self.name, render=False, pickable=self.pickable)
            self._name = given
        else:
            renderer.AddViewProp(self)
        if self._label:
            set_legend_label(renderer, self, self._label, self.scalar_mapper() is not None)
        self._put_in(renderer)

    def detach(self):
        """Remove its props from the scene."""
        renderer = self.pipeline.renderer
        self._take_out(renderer)
        if isinstance(renderer, pv.Renderer):
            renderer.remove_actor(self, render=False)
            if self.bar is not None:  # also where it is no more in the scene
                self.bar.leave(self)
        else:
            renderer.RemoveViewProp(self)
        self._listed = None
        super().detach()

    def _put_in(self, renderer):
        for actor in self._inner():
            put_inner(renderer, actor)

    def _take_out(self, renderer):
        for actor in self._inner():
            renderer.RemoveViewProp(actor)

    def _inner(self) -> list:
        return [actor for actor in self.actors() if actor is not self]

    def _show_bar(self):
        """Have the scalar bar show the scalars as they are now."""
        if self.bar is not None:
            self.bar.show(self)
        elif self.pipeline is not None:
            share_range(self)

    def _with_table(self, table, scalar_range):
        """Return the actor's mapper with a table: plotters remove its scalar bar with it."""
        mapper = self.GetMapper()
        mapper.SetLookupTable(table)
        mapper.SetScalarRange(scalar_range)
        return mapper

    def _with_table_of(self, parts):
        """Return the actor's mapper with the first table that colours parts of a mesh, or None."""
        first = next(_mapping(parts), None)
        if first is None:
            return None
        self._scalar_name = _array_of(first)
        self.has_names, mapper = first.scalars[1], first.actor.mapper
        return self._with_table(mapper.lookup_table, mapper.scalar_range)

    def _set_range_of(self, parts, clim) -> bool:
        """Set the range of the scalar bar's array in parts of a mesh; return True on a change."""
        shown = [p.actor.mapper for p in _mapping(parts) if _array_of(p) == self._scalar_name]
        stale = [m for m in shown if m.scalar_range != clim]
        for mapper in stale:
            mapper.scalar_range = clim
            mapper.lookup_table.SetTableRange(clim)  # nothing may draw with it
        return bool(stale)


for _name in MOVES:
    setattr(Thing, _name, _unmoved(_name))
_ADD_ACTOR = MethodHook(pv.Renderer, 'add_actor', adding_by_component(Thing))


def _mapping(parts):
    """Yield the parts that colour scalars by a table."""
    for part in parts:
        mapper = part.actor.mapper
        if mapper.GetScalarVisibility() and mapper.GetColorMode() != _DIRECT:
            yield part


def _array_of(part) -> str:
    """Return the name of the array that a part shows."""
    # PyVista derives an array of its own from words, complex numbers and vectors.
    mapper = part.actor.mapper
    name = mapper.GetArrayName() or mapper.dataset.active_scalars_name or ''
    asked = part.scalars[0]
    if not asked:  # of an actor, which does not know
        asked, _, suffix = name.rpartition('-')
        return asked if suffix in _DERIVED else name
    return asked if name.startswith(f'{asked}-') else name


def _free_name(name, taken) -> str:
    """Return a name that nothing has: 'Spheres', 'Spheres 2' and so on."""
    names = (f'{name} {k}' if k > 1 else name for k in count(1))
    return next(n for n in names if n not in taken)
