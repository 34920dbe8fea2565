"""Copies of props for another window: they share data, not mappers."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.meshes.materials import copy_property


def copied(prop, plotter):
    """Return a copy of a prop for another window, None if the plotter has an equal one."""
    if prop.IsA('vtkCubeAxesActor'):
        return _axes(prop, plotter)
    if prop.IsA('vtkActor') and prop.GetMapper() is not None:
        return _actor(prop)
    if prop.IsA('vtkVolume') and prop.GetMapper() is not None:
        return _volume(prop)
    return _like(prop)


def _axes(prop, plotter):
    """Show the same axes in a plotter."""
    if hasattr(plotter, 'show_bounds') and not plotter.renderer.cube_axes_actor:
        plotter.show_bounds(
            bounds=prop.GetBounds(),
            color=prop.GetTitleTextProperty(0).GetColor(),
            grid='back' if prop.GetDrawXGridlines() else None,
            render=False,
            location='outer' if prop.GetDrawXGridlines() else 'closest',
            show_xaxis=bool(prop.GetXAxisVisibility()),
            show_yaxis=bool(prop.GetYAxisVisibility()),
            show_zaxis=bool(prop.GetZAxisVisibility()),
            show_xlabels=bool(prop.GetXAxisLabelVisibility()),
            show_ylabels=bool(prop.GetYAxisLabelVisibility()),
            show_zlabels=bool(prop.GetZAxisLabelVisibility()),
        )


def _like(prop):
    copy = prop.NewInstance()
    copy.ShallowCopy(prop)
    if prop.IsA('vtkCornerAnnotation'):
        copy.CopyAllTextsFrom(prop)
        copy.SetTextProperty(prop.GetTextProperty())
        copy.SetMaximumFontSize(prop.GetMaximumFontSize())
        copy.SetLinearFontScaleFactor(prop.GetLinearFontScaleFactor())
        copy.SetNonlinearFontScaleFactor(prop.GetNonlinearFontScaleFactor())
    if prop.IsA('vtkScalarBarActor'):
        copy.SetUnconstrainedFontSize(prop.GetUnconstrainedFontSize())
        table = prop.GetLookupTable().NewInstance()
        table.DeepCopy(prop.GetLookupTable())
        copy.SetLookupTable(table)
    return copy


def range_teller(bar):
    """Return an actor that draws nothing: vtk.js reads the range of a table from its mapper."""
    speck = pv.PolyData.from_regular_faces(np.zeros((3, 3)), [[0, 1, 2]])
    speck['range'] = np.resize(bar.GetLookupTable().GetRange(), 3)
    mapper = pv.DataSetMapper(speck)
    mapper.SetLookupTable(bar.GetLookupTable())
    mapper.scalar_range = bar.GetLookupTable().GetRange()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray('range')
    actor = pv.Actor(mapper=mapper)
    actor.UseBoundsOff()
    return actor


def _actor(prop):
    copy = pv.Actor()
    copy.ShallowCopy(prop)
    copy.SetMapper(_mapper(prop.GetMapper()))
    look = pv.Property()
    copy_property(look, prop.GetProperty())
    copy.SetProperty(look)
    copy.SetShaderProperty(_vtk.vtkShaderProperty())  # without pvibr's shader replacements
    if prop.GetUserMatrix() is not None:
        copy.user_matrix = pv.array_from_vtkmatrix(prop.GetUserMatrix())
    return copy


def _mapper(mapper):
    plain = mapper.IsA('vtkDataSetMapper') or mapper.IsA('vtkPolyDataMapper')
    if plain and not mapper.IsA('vtkCompositePolyDataMapper'):
        return _dataset_mapper(mapper)
    copy = mapper.NewInstance()
    copy.ShallowCopy(mapper)
    return copy


def _dataset_mapper(mapper):
    mapper.Update()
    copy = pv.DataSetMapper()
    copy.ShallowCopy(mapper)
    copy.SetStatic(False)
    data = mapper.GetInputDataObject(0, 0)
    if data is not None:
        copy.dataset = pv.wrap(data).copy(deep=False)
    return copy


def _volume(prop):
    copy = _like(prop)
    source = prop.GetMapper()
    mapper = source.NewInstance()
    mapper.SetInputDataObject(source.GetInputDataObject(0, 0))
    mapper.SetBlendMode(source.GetBlendMode())
    copy.SetMapper(mapper)
    return copy
