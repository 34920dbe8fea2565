"""Effects that are actors: they draw in the scene, and PyVista's plotters list them."""

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
from pvibr.textures.material_textures import copy_property
from pvibr.things.appearance import read_only
from pvibr.things.clipping_range import is_within_clipping_range, reset_clipping_range
from pvibr.things.placing import (
    MOVES,
    move_method,
    user_matrix_property,
    vector_property,
)
from pvibr.things.scalar_bars import Bar, ThingMapper, share_range
from pvibr.things.shared_material import SharedMaterial

_DIRECT = 2  # VTK_COLOR_MODE_DIRECT_SCALARS
#: Suffixes of the arrays that PyVista derives, component numbers aside.
_DERIVED = 'normed', 'digitized', 'real'


def _box_mesh():
    """Return a mesh that has bounds and draws nothing."""
    mesh, points, cells = _vtk.vtkPolyData(), _vtk.vtkPoints(), _vtk.vtkCellArray()
    points.SetDataTypeToDouble()
    points.SetNumberOfPoints(2)
    cells.InsertNextCell(3, (0, 1, 1))  # VTK computes bounds from cells
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    return mesh


class _Visibility(Param):
    """An actor's visibility as a setting."""

    def __get__(self, owner, cls=None):
        return self if owner is None else bool(owner.GetVisibility())

    def __set__(self, owner, value):
        owner.SetVisibility(self.check(value, type(owner).__name__))


def joined_bounds(boxes) -> tuple[float, ...]:
    """Return the union of bounding boxes, empty ones ignored."""
    valid_boxes = np.array([b for b in boxes if b and b[0] <= b[1]]).reshape(-1, 6)
    if not len(valid_boxes):
        return (1.0, -1.0) * 3
    low_high = np.stack([valid_boxes[:, ::2].min(0), valid_boxes[:, 1::2].max(0)], 1)
    return tuple(low_high.ravel().tolist())


#: Quality from which effects read the depth of surfaces, below it that of cards' planes: writing
#: depth takes fragments that are hidden as long as those that are seen.
_OWN_DEPTH_FROM = 0.3


class Thing(Effect, pv.Actor):
    """An effect that draws in the scene, and the actor that represents it there.

    The actor itself draws nothing, unless it is among its `actors`: it carries the name,
    visibility, material and bounds of the whole. A subclass overrides the hooks it needs.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    FOR_USERS: tuple[str, ...] = (
        *('actors', 'pick', 'pickable', 'visibility', 'prop', 'bounds', 'center', 'position'),
        *('orientation', 'scale', 'origin', 'user_matrix', 'matrix', 'mapper', 'label'),
    )

    visibility = _Visibility(True, 'Whether it is drawn.')
    #: Remedy in errors about clipping planes.
    clipped_by = 'hide items by its visible mask'
    #: Remedy in errors about setting its transform; None if it has one.
    moved_by: str | None = 'its items have their own positions, set those'

    # -- hooks: drawing ----------------------------------------------------------------------

    def actors(self) -> list:
        """Return the actors that draw it, including invisible ones."""
        raise NotImplementedError

    def shader_actors(self) -> list:
        """Return the actors with shader text of its own."""
        return self.actors()

    def drawn(self) -> list:
        """Return the actors that draw it in the frame it was prepared for."""
        return [actor for actor in self.actors() if actor.GetVisibility()]

    def picked(self) -> list:
        """Return the actors that VTK's pickers find in its place."""
        return []

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors that draw it, or only its depth, in a frame of another view."""
        self.prepare(frame)
        return self.depths() if depth else self.drawn()

    @property
    def blends(self) -> bool:
        """Whether its items are depth-sorted with other translucent props."""
        return False

    def _depth_is_read(self, frame) -> bool:
        """Return True if VTK or an effect reads the depth of the drawn frame."""
        if not frame.own or frame.quality < _OWN_DEPTH_FROM:
            return False
        if not frame.reads_depth:
            get = object.__getattribute__  # PyVista's lookup is in Python
            has_pass = get(frame.renderer, 'GetPass')() is not None
            read_by_vtk = has_pass or bool(get(frame.renderer, 'GetUseSSAO')())
            effects = self.pipeline.image_effects
            frame.reads_depth.append(
                read_by_vtk or any(e.enabled and e.reads_depth for e in effects)
            )
        return frame.reads_depth[0]

    def depths(self) -> list:
        """Return the actors that draw its depth, as lights see it."""
        return self.drawn()

    def solids(self) -> list:
        """Return the actors whose meshes cast shadow volumes; None stands for what has no mesh."""
        return [None]

    def dataset(self) -> pv.DataSet | None:
        """Return what PyVista treats as its mesh, such as item positions, or None."""
        return None

    def set_clipping_planes(self, planes):
        """Clip it by a vtkPlaneCollection."""
        raise AttributeError(f'{self.name} cannot be clipped: {self.clipped_by}')

    def begin_frame(self):
        """Follow changes before any effect of a frame, also of a picker's; it must not raise."""

    def end_frame(self):
        """Do what the time between frames needs, after all effects of a frame."""

    # -- hooks: state -----------------------------------------------------------------------

    @property
    def cast_bounds(self) -> np.ndarray:
        """World bounds of what casts shadows, shape (6,)."""
        return np.array(self.bounds)

    def content_key(self) -> tuple:
        """Return a value that changes with the drawn content, but not with the camera."""
        raise NotImplementedError

    def stands_for(self) -> list:
        """Return the user's visible actors that it replaces."""
        return []

    def needed(self, frame) -> bool | str:
        """Return True if it is visible."""
        return self.visibility or 'not visible'

    def _now(self) -> float:
        """Return the time of its subplot, 0 outside one."""
        return 0.0 if self.pipeline is None else self.pipeline.time

    def follow(self):
        """Adopt the pipeline's new time."""

    @classmethod
    def follow_all(cls, things):
        """Let all things of this class in a pipeline adopt its new time."""
        for thing in things:
            thing.follow()

    def scalar_mapper(self):
        """Return the actor's mapper with the lookup table of the scalars, or None."""
        return

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return self._scalar_name

    #: Whether the scalars are categories; the bar then shows no numbers.
    has_names = False

    def set_scalar_range(self, clim):
        """Change the scalar range, keeping the lookup table."""

    def has_bar(self) -> bool:
        """Return True if the theme's default scalar bar applies to it."""
        return True

    # -- the actor that represents it -------------------------------------------------------

    keeps_arguments = False  # those of instances are large

    # PyVista's attribute check runs in Python on each access, too slow for every frame.
    __getattribute__ = object.__getattribute__

    #: Whether its bounds count toward those of the scene.
    counts_bounds = True
    _has_extent = True
    _label: str | None = None
    _pickable = True
    _listed: str | None = None
    _scalar_name = ''
    #: Pairs of a draw-order key, which begins with a `Stage`, and an actor; replaced, not mutated.
    order: tuple = ()
    #: The scalar bar requested when it was added, or None.
    bar: Bar | None = None
    #: Actors that share its material.
    _dressed: tuple = ()
    #: Propagates changes of its material to those of several meshes.
    _material: Any = None

    #: Count of changes, and bounds, of the last frame or when it was added.
    _framed: tuple = (-1, (1.0, -1.0) * 3)

    position = vector_property('position', 'Translation, world units.')
    orientation = vector_property(
        'orientation', 'Degrees about x, y and z, applied in the order z, x, y.'
    )
    scale = vector_property('scale', 'Scale factors along x, y and z, or one for all.')
    origin = vector_property('origin', 'Centre of rotation and scale, in model space.')
    user_matrix = user_matrix_property()

    def __init__(self, **settings):
        mapper = ThingMapper()
        mapper.follow(self)
        mapper.SetNumberOfSubPieces(0)  # draws nothing in any representation
        mapper.SetInputData(_vtk.vtkPolyData())
        pv.Actor.__init__(self, mapper)
        pv.Actor.SetPickable(self, False)  # stand-ins of its items are picked instead
        self.ForceOpaqueOn()  # a translucent prop would be sorted
        self.SetUseBounds(self.counts_bounds)
        super().__init__(**settings)
        _ADD_ACTOR.need(self)

    @property
    def matrix(self) -> np.ndarray:
        """World from model, the whole transform, shape (4, 4)."""
        return read_only(pv.array_from_vtkmatrix(self.GetMatrix()))

    def _set_bounds(self, bounds):
        """Set the bounds, in the actor's space."""
        # PyVista does not recognise empty bounds.
        if self._has_extent != (bounds[0] <= bounds[1]):
            self._has_extent = not self._has_extent
            self.SetUseBounds(self._has_extent and self.counts_bounds)
        mapper = self.GetMapper()
        if not self._has_extent:
            mapper.SetInputData(_vtk.vtkPolyData())
            return
        bounds_mesh = mapper.GetInput()
        if not bounds_mesh.GetNumberOfPoints():
            bounds_mesh = _box_mesh()
            mapper.SetInputData(bounds_mesh)
        points = bounds_mesh.GetPoints()
        bounds = [float(b) for b in bounds]
        points.SetPoint(0, *bounds[::2])
        points.SetPoint(1, *bounds[1::2])
        points.Modified()

    @property
    def name(self) -> str:
        """Name in ``plotter.actors``, reports and the state; the class name by default."""
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
        """Return `pickable`; PyVista calls this."""
        return self._pickable

    def SetPickable(self, pickable):
        """Set `pickable`; PyVista calls this."""
        self._pickable = bool(pickable)

    @property
    def prop(self):
        """Material of the whole; where meshes have several, a change applies to all of them."""
        return self.GetProperty()

    @prop.setter
    def prop(self, prop):
        with naming('prop', prop):
            for actor in (self, *self._dressed):
                actor.SetProperty(prop)
        if self._material is not None:
            self._material.wear(prop)

    def _share_material(self):
        """Copy the first mesh's material, then propagate changes to all."""
        for first_material in self._materials_of_all()[:1]:
            copy_property(self.prop, first_material)
        self._lead_materials()

    def _lead_materials(self):
        """Propagate changes of the material to those of all meshes."""
        if self._material is not None:
            self._material.stop()
        self._material = SharedMaterial(self.prop, self._materials_of_all)

    def _materials_of_all(self) -> list:
        """Return the properties of the meshes that draw it."""
        return []

    @property
    def label(self) -> str | None:
        """Text in the plotter's legend, None for no entry."""
        return self._label

    @label.setter
    def label(self, label):
        if not isinstance(label, (str, type(None))):
            raise TypeError(f'label must be a str or None, got {label!r}')
        self._label = label
        if self.pipeline is not None:
            set_legend_label(self.pipeline.renderer, self, label, self.scalar_mapper() is not None)

    @property
    def center(self) -> tuple[float, float, float]:
        """Centre of the bounds, world units."""
        x, y, z = np.reshape(self.bounds, (3, 2)).mean(1).tolist()
        return x, y, z

    def copy(self, deep=True):
        """Raise an error: the copy would draw nothing."""
        raise TypeError(f'{self.name} cannot be copied or pickled: create another and add it')

    def __reduce_ex__(self, _protocol):
        return self.copy()

    def __deepcopy__(self, _memo):
        return self.copy()

    def __dir__(self) -> list[str]:
        """Return the public names, without hooks and undeclared attributes."""
        declared_names = {*dir(type(self)), *get_annotations(type(self))}
        return [name for name in super().__dir__() if name in declared_names]

    def __repr__(self) -> str:
        return Effect.__repr__(self)

    __str__ = __repr__

    def _state(self) -> str:
        return ('' if self.visibility else 'hidden, ') + super()._state()

    # -- in the scene ------------------------------------------------------------------------

    @property
    def props(self) -> tuple:
        """The actor that represents it."""
        return (self,)

    def is_gone(self, renderer) -> bool:
        """Return True if its actor was removed from the scene directly."""
        return not renderer.HasViewProp(self)

    def attach(self, pipeline):
        """Add its props to the scene."""
        super().attach(pipeline)
        renderer = pipeline.renderer
        if isinstance(renderer, pv.Renderer):
            user_name = self._name
            self._listed = None if user_name else _free_name(self.name, renderer.actors)
            renderer.add_actor(self, name=self.name, render=False, pickable=self.pickable)
            self._name = user_name
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
            if self.bar is not None:  # even if no longer in the scene
                self.bar.leave(self)
        else:
            renderer.RemoveViewProp(self)
        self._listed = None
        super().detach()

    def _stay_whole(self, changes):
        """Reset the clipping range if changed content left it, unless it cut the bounds before."""
        last_changes, last_bounds = self._framed
        if last_changes == changes:
            return
        renderer, bounds = self.pipeline.renderer, self.GetBounds()
        self._framed = changes, bounds
        if is_within_clipping_range(renderer, bounds):
            return
        if is_within_clipping_range(renderer, last_bounds):
            reset_clipping_range(renderer)

    def _put_in(self, renderer):
        for actor in self._inner():
            put_inner(renderer, actor)

    def _take_out(self, renderer):
        for actor in self._inner():
            renderer.RemoveViewProp(actor)

    def _inner(self) -> list:
        return [actor for actor in self.actors() if actor is not self]

    def _show_bar(self):
        """Update the scalar bar to the current scalars."""
        if self.bar is not None:
            self.bar.show(self)
        elif self.pipeline is not None:
            share_range(self)

    def _with_table(self, table, scalar_range):
        """Return the actor's mapper with a lookup table: plotters find its scalar bar by it."""
        mapper = self.GetMapper()
        mapper.SetLookupTable(table)
        mapper.SetScalarRange(scalar_range)
        return mapper

    def _with_table_of(self, parts):
        """Return the actor's mapper with the first lookup table of a mesh's parts, or None."""
        colored_part = next(_colored_by_table(parts), None)
        if colored_part is None:
            return None
        self._scalar_name = _array_of(colored_part)
        self.has_names, mapper = colored_part.scalars[1], colored_part.actor.mapper
        return self._with_table(mapper.lookup_table, mapper.scalar_range)

    def _set_range_of(self, parts, clim) -> bool:
        """Set the range of the scalar bar's array in a mesh's parts; return True on a change."""
        has_changed = False
        for part in _colored_by_table(parts):
            mapper = part.actor.mapper
            if _array_of(part) == self._scalar_name and mapper.scalar_range != clim:
                mapper.scalar_range, has_changed = clim, True
                mapper.lookup_table.SetTableRange(clim)  # a mapper sets it only when it draws
        return has_changed


for _name in MOVES:
    setattr(Thing, _name, move_method(_name))
_ADD_ACTOR = MethodHook(pv.Renderer, 'add_actor', adding_by_component(Thing))


def _colored_by_table(parts):
    """Yield the parts that colour scalars by a lookup table."""
    for part in parts:
        mapper = part.actor.mapper
        if mapper.GetScalarVisibility() and mapper.GetColorMode() != _DIRECT:
            yield part


def _array_of(part) -> str:
    """Return the name of the array that a part shows."""
    # PyVista derives arrays of its own from strings, complex numbers and vectors.
    mapper = part.actor.mapper
    array_name = mapper.GetArrayName() or mapper.dataset.active_scalars_name or ''
    requested_name = part.scalars[0]
    if not requested_name:  # from a user's actor
        requested_name, _, suffix = array_name.rpartition('-')
        return requested_name if suffix in _DERIVED else array_name
    return requested_name if array_name.startswith(f'{requested_name}-') else array_name


def _free_name(name, used_names) -> str:
    """Return an unused name: 'Spheres', 'Spheres 2' and so on."""
    candidates = (f'{name} {k}' if k > 1 else name for k in count(1))
    return next(n for n in candidates if n not in used_names)
