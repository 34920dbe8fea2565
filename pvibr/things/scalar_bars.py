"""Scalar bars of things: they show the table and the range of the colours that are drawn."""

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
    """The mapper of a thing, as PyVista uses it: it draws nothing."""

    def follow(self, thing):
        """Tell a thing of another range."""
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
        """Table of the scalars."""
        return self.GetLookupTable()

    @property
    def dataset(self):
        """What the thing shows, as PyVista lists it in ``plotter.meshes``: often a copy."""
        thing = self._thing()
        return None if thing is None else thing.dataset()

    def GetDataSetInput(self):
        """Return `dataset`, also to PyVista's pickers and ``plotter.meshes``."""
        return self.dataset

    GetInputAsDataSet = GetDataSetInput

    @property
    def clipping_planes(self):
        """Planes that clip the thing, None without."""
        return self.GetClippingPlanes()

    @clipping_planes.setter
    def clipping_planes(self, planes):
        self.SetClippingPlanes(planes)

    def SetClippingPlanes(self, planes):
        """Clip the thing by a vtkPlaneCollection or vtkPlanes."""
        found = _vtk.vtkPolyDataMapper()
        found.SetClippingPlanes(planes)
        self._clip(found.GetClippingPlanes())

    def AddClippingPlane(self, plane):
        """Clip the thing by one more plane."""
        found = _vtk.vtkPlaneCollection()
        for known in self.GetClippingPlanes() or ():
            found.AddItem(known)
        found.AddItem(plane)
        self._clip(found)

    def RemoveClippingPlane(self, plane):
        """Clip the thing by one plane less."""
        found = _vtk.vtkPlaneCollection()
        for known in self.GetClippingPlanes() or ():
            if known is not plane:
                found.AddItem(known)
        self._clip(found)

    def RemoveAllClippingPlanes(self):
        """Clip the thing no more."""
        self._clip(None)

    def _clip(self, planes):
        thing = self._thing()
        if thing is not None:
            thing.set_clipping_planes(planes)
        super().RemoveAllClippingPlanes()
        if planes is not None:
            super().SetClippingPlanes(planes)


class Bar:
    """The scalar bar that was asked for with a thing, whether or not it has scalars yet."""

    def __init__(self, wanted=None, options=None):
        self._wanted = checked_flag('show_scalar_bar', wanted, optional=True)
        if not isinstance(options, (Mapping, type(None))):
            raise TypeError(
                f'scalar_bar_args = {options!r}: must be a dict of options of add_scalar_bar'
            )
        self._options = dict(options or {})
        self._title: str | None = None

    def check(self, plotter, thing):
        """Raise what adding the bar would raise."""
        if not hasattr(plotter, 'scalar_bars'):
            return
        mapper = thing.scalar_mapper()
        added = mapper is not None and self._is_wanted(plotter, thing)
        if self._options or (added and not bar_places(plotter)):
            title = self._title_of(thing) if added else self._options.get('title', '')
            check_bar(plotter, mapper or pv.DataSetMapper(), self._options | {'title': title})

    def _is_wanted(self, plotter, thing) -> bool:
        if self._wanted is not None:
            return self._wanted
        return plotter.theme.show_scalar_bar and thing.has_bar()

    def _title_of(self, thing):
        return self._options.get('title', thing.scalar_title())

    def show(self, thing):
        """Have the bar of the scalars that the thing shows now, or none."""
        plotter = plotter_of(thing)
        if plotter is None:
            return
        mapper = thing.scalar_mapper()
        title = None if mapper is None else self._title_of(thing)
        if title != self._title:
            self.leave(thing, plotter)
            if title is not None and self._is_wanted(plotter, thing):
                self._add(plotter, thing, mapper, title)
            self._title = title
        if mapper is not None:
            plotter.mapper = mapper  # that of update_scalar_bar_range without a name
        share_range(thing)

    def _add(self, plotter, thing, mapper, title):
        names = {'n_labels': 0} if thing.has_names else {}  # as add_mesh
        options = names | self._options | {'title': title, 'render': False}
        with in_subplot(plotter, thing.pipeline.renderer):
            plotter.add_scalar_bar(mapper=mapper, **options)

    def leave(self, thing, plotter=None):
        """Take the thing from the bars, which go with the last one."""
        plotter = plotter or plotter_of(thing)
        if plotter is None:
            return
        remove_from_bars(plotter, thing)
        title, self._title = self._title, None
        if title is not None and not bar_mappers(plotter).get(title, [thing]):
            # PyVista keeps those that were given a position.
            plotter.remove_scalar_bar(title, render=False)


def plotter_of(thing):
    """Return the plotter whose scalar bars may show a thing, None without one."""
    renderer = None if thing.pipeline is None else thing.pipeline.renderer
    plotter = getattr(renderer, 'parent', None)
    try:
        return plotter if hasattr(plotter, 'scalar_bars') else None
    except ReferenceError:  # PyVista's proxy of a plotter that is no more
        return None


def show_table(thing, always=False):
    """Let the bars of a thing show its table; by default those that show one of nothing."""
    plotter, mapper = plotter_of(thing), thing.GetMapper()
    if plotter is None:
        return
    table = mapper.GetLookupTable()
    for title, mappers in bar_mappers(plotter).items():
        bar = plotter.scalar_bars[title]
        known = any(m.GetLookupTable() is bar.GetLookupTable() for m in mappers)
        if mapper in mappers and (always or not known):
            bar.SetLookupTable(table)
            bar.SetMaximumNumberOfColors(table.GetNumberOfTableValues())


def share_range(thing):
    """Let the bars of a thing, and all else that they show, have its table and its range."""
    plotter, mapper = plotter_of(thing), thing.scalar_mapper()
    if plotter is None or mapper is None:
        return
    for title, mappers in bar_mappers(plotter).items():
        if mapper in mappers:
            for other in mappers:
                if other is not mapper:
                    other.scalar_range = mapper.GetScalarRange()
            set_bar_range(plotter, title, mapper.GetScalarRange())
    show_table(thing, always=True)


def name_of(values) -> str:
    """Return the name of a column or of a whole array of a dataset, empty without one."""
    name = getattr(values, 'name', None)
    if isinstance(name, str):
        return name
    held = getattr(values, 'VTKObject', None)
    if held is None or not isinstance(values, np.ndarray):
        return ''
    whole = _vtk.vtk_to_numpy(held)
    same = whole.shape == values.shape and whole.ctypes.data == values.ctypes.data
    return (held.GetName() or '') if same else ''
