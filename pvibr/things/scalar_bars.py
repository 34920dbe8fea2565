"""Scalar bars of things: they show the lookup table and range in use."""

from __future__ import annotations

import weakref
from collections.abc import Mapping

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.params import checked_flag
from pvibr.core.plotters import (
    bar_mappers,
    bar_places,
    check_bar,
    in_subplot,
    remove_from_bars,
    set_bar_range,
)


class ThingMapper(_vtk.vtkPolyDataMapper):
    """The mapper that PyVista sees of a thing; it draws nothing."""

    def follow(self, thing):
        """Set the thing that range changes are forwarded to."""
        self._thing = weakref.ref(thing)

    @property
    def scalar_range(self) -> tuple[float, float]:
        """Range of the scalars; setting it recolours the thing."""
        return self.GetScalarRange()

    @scalar_range.setter
    def scalar_range(self, clim):
        thing, clim = self._thing(), tuple(map(float, clim))
        self.SetScalarRange(*clim)
        if thing is not None:
            thing.set_scalar_range(clim)
            show_table(thing)

    @property
    def lookup_table(self):
        """Lookup table of the scalars."""
        return self.GetLookupTable()

    @property
    def dataset(self):
        """The thing's data as listed in ``plotter.meshes``, often a copy."""
        thing = self._thing()
        return None if thing is None else thing.dataset()

    def GetDataSetInput(self):
        """Return `dataset`; PyVista's pickers and ``plotter.meshes`` call this."""
        return self.dataset

    GetInputAsDataSet = GetDataSetInput

    @property
    def clipping_planes(self):
        """Planes that clip the thing, or None."""
        return self.GetClippingPlanes()

    @clipping_planes.setter
    def clipping_planes(self, planes):
        self.SetClippingPlanes(planes)

    def SetClippingPlanes(self, planes):
        """Clip the thing by a vtkPlaneCollection or vtkPlanes."""
        plane_holder = _vtk.vtkPolyDataMapper()
        plane_holder.SetClippingPlanes(planes)
        self._clip(plane_holder.GetClippingPlanes())

    def AddClippingPlane(self, plane):
        """Clip the thing by an additional plane."""
        self._clip(_collected([*(self.GetClippingPlanes() or ()), plane]))

    def RemoveClippingPlane(self, plane):
        """Remove one of the planes that clip the thing."""
        self._clip(_collected(p for p in self.GetClippingPlanes() or () if p is not plane))

    def RemoveAllClippingPlanes(self):
        """Stop clipping the thing."""
        self._clip(None)

    def _clip(self, planes):
        thing = self._thing()
        if thing is not None:
            thing.set_clipping_planes(planes)
        super().RemoveAllClippingPlanes()
        if planes is not None:
            super().SetClippingPlanes(planes)


def _collected(planes):
    collection = _vtk.vtkPlaneCollection()
    for plane in planes:
        collection.AddItem(plane)
    return collection


class Bar:
    """The scalar bar requested for a thing, which may not have scalars yet."""

    def __init__(self, show_bar=None, options=None):
        self._show_bar = checked_flag('show_scalar_bar', show_bar, optional=True)
        if not isinstance(options, (Mapping, type(None))):
            raise TypeError(
                f'scalar_bar_args must be a dict of options of add_scalar_bar, got {options!r}'
            )
        self._options = dict(options or {})
        self._title: str | None = None

    def check(self, plotter, thing):
        """Raise the error that adding the bar would raise."""
        if not hasattr(plotter, 'scalar_bars'):
            return
        mapper = thing.scalar_mapper()
        is_added = mapper is not None and self._is_visible(plotter, thing)
        if self._options or (is_added and not bar_places(plotter)):
            bar_title = self._title_of(thing) if is_added else self._options.get('title', '')
            check_bar(plotter, mapper or pv.DataSetMapper(), self._options | {'title': bar_title})

    def _is_visible(self, plotter, thing) -> bool:
        if self._show_bar is not None:
            return self._show_bar
        return plotter.theme.show_scalar_bar and thing.has_bar()

    def _title_of(self, thing):
        return self._options.get('title', thing.scalar_title())

    def show(self, thing):
        """Update the bar to the thing's current scalars."""
        plotter = plotter_of(thing)
        if plotter is None:
            return
        mapper = thing.scalar_mapper()
        title = None if mapper is None else self._title_of(thing)
        if title != self._title:
            self.leave(thing, plotter)
            if title is not None and self._is_visible(plotter, thing):
                self._add(plotter, thing, mapper, title)
            self._title = title
        if mapper is not None:
            plotter.mapper = mapper  # used by update_scalar_bar_range without a name
        share_range(thing)

    def _add(self, plotter, thing, mapper, title):
        defaults = {'n_labels': 0} if thing.has_names else {}  # as in add_mesh
        options = defaults | self._options | {'title': title, 'render': False}
        with in_subplot(plotter, thing.pipeline.renderer):
            plotter.add_scalar_bar(mapper=mapper, **options)

    def leave(self, thing, plotter=None):
        """Remove the thing from its bars; bars without mappers are removed."""
        plotter = plotter or plotter_of(thing)
        if plotter is None:
            return
        remove_from_bars(plotter, thing)
        old_title, self._title = self._title, None
        if old_title is not None and not bar_mappers(plotter).get(old_title, [thing]):
            # PyVista keeps those with an explicit position.
            plotter.remove_scalar_bar(old_title, render=False)


def plotter_of(thing):
    """Return the plotter whose scalar bars may show a thing, or None."""
    renderer = None if thing.pipeline is None else thing.pipeline.renderer
    plotter = getattr(renderer, 'parent', None)
    try:
        return plotter if hasattr(plotter, 'scalar_bars') else None
    except ReferenceError:  # PyVista's proxy of a deleted plotter
        return None


def show_table(thing, force=False):
    """Let the thing's bars show its table; by default only bars whose table no mapper uses."""
    plotter, mapper = plotter_of(thing), thing.GetMapper()
    if plotter is None:
        return
    lookup_table = mapper.GetLookupTable()
    for title, mappers in bar_mappers(plotter).items():
        bar = plotter.scalar_bars[title]
        in_use = any(m.GetLookupTable() is bar.GetLookupTable() for m in mappers)
        if mapper in mappers and (force or not in_use):
            bar.SetLookupTable(lookup_table)
            bar.SetMaximumNumberOfColors(lookup_table.GetNumberOfTableValues())


def share_range(thing):
    """Apply a thing's table and range to its bars and to everything else they show."""
    plotter, mapper = plotter_of(thing), thing.scalar_mapper()
    if plotter is None or mapper is None:
        return
    for title, mappers in bar_mappers(plotter).items():
        if mapper in mappers:
            for other_mapper in mappers:
                if other_mapper is not mapper:
                    other_mapper.scalar_range = mapper.GetScalarRange()
            set_bar_range(plotter, title, mapper.GetScalarRange())
    show_table(thing, force=True)


def name_of(values) -> str:
    """Return the name of a table column or of a whole dataset array, else an empty string."""
    name = getattr(values, 'name', None)
    if isinstance(name, str):
        return name
    vtk_array = getattr(values, 'VTKObject', None)
    if vtk_array is None or not isinstance(values, np.ndarray):
        return ''
    full_array = _vtk.vtk_to_numpy(vtk_array)
    is_whole = full_array.shape == values.shape and full_array.ctypes.data == values.ctypes.data
    return (vtk_array.GetName() or '') if is_whole else ''
