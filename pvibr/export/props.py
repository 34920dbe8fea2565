"""Copies of props for another window: they share data, not mappers."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.textures.material_textures import copied_property

#: What a shallow copy of a scalar bar lacks.
_BAR_SETTINGS = (
    *('UnconstrainedFontSize', 'DrawBelowRangeSwatch', 'DrawAboveRangeSwatch'),
    *('BelowRangeAnnotation', 'AboveRangeAnnotation', 'DrawNanAnnotation', 'NanAnnotation'),
)
#: What a deep copy of a table lacks.
_TABLE_SETTINGS = 'BelowRangeColor', 'UseBelowRangeColor', 'AboveRangeColor', 'UseAboveRangeColor'


def copied(prop, plotter):
    """Return a copy of a prop for another window, None if the plotter added an equal one."""
    if prop.IsA('vtkCubeAxesActor'):
        return _axes(prop, plotter)
    if prop.IsA('vtkActor') and prop.GetMapper() is not None:
        return _actor(prop)
    if prop.IsA('vtkVolume') and prop.GetMapper() is not None:
        return _volume(prop)
    return _like(prop)


def _axes(prop, plotter):
    """Show the same axes in a plotter."""

    def axis_value(axis, part):
        return getattr(prop, f'Get{axis.upper()}Axis{part}Visibility')()

    if hasattr(plotter, 'show_bounds') and not plotter.renderer.cube_axes_actor:
        plotter.show_bounds(
            bounds=prop.GetBounds(),
            color=prop.GetTitleTextProperty(0).GetColor(),
            grid='back' if prop.GetDrawXGridlines() else None,
            render=False,
            location='outer' if prop.GetDrawXGridlines() else 'closest',
            **{f'show_{x}axis': bool(axis_value(x, '')) for x in 'xyz'},
            **{f'show_{x}labels': bool(axis_value(x, 'Label')) for x in 'xyz'},
        )


def _like(prop):
    prop_copy = prop.NewInstance()
    prop_copy.ShallowCopy(prop)
    if prop.IsA('vtkCornerAnnotation'):
        prop_copy.CopyAllTextsFrom(prop)
        prop_copy.SetTextProperty(prop.GetTextProperty())
        prop_copy.SetMaximumFontSize(prop.GetMaximumFontSize())
        prop_copy.SetLinearFontScaleFactor(prop.GetLinearFontScaleFactor())
        prop_copy.SetNonlinearFontScaleFactor(prop.GetNonlinearFontScaleFactor())
    if prop.IsA('vtkScalarBarActor'):
        _copy_settings(prop_copy, prop, _BAR_SETTINGS)
        table = prop.GetLookupTable().NewInstance()
        table.DeepCopy(prop.GetLookupTable())
        if table.IsA('vtkLookupTable'):
            _copy_settings(table, prop.GetLookupTable(), _TABLE_SETTINGS)
        prop_copy.SetLookupTable(table)
    if prop.IsA('vtkAxisActor2D'):
        for name in ('GetPositionCoordinate', 'GetPosition2Coordinate'):
            place, new_place = getattr(prop, name)(), getattr(prop_copy, name)()
            _copy_settings(new_place, place, ('CoordinateSystem', 'ReferenceCoordinate', 'Value'))
    return prop_copy


def _copy_settings(copy, original, names):
    for name in names:
        getattr(copy, f'Set{name}')(getattr(original, f'Get{name}')())


def range_teller(scalar_bar):
    """Return an invisible actor from whose mapper vtk.js reads the range of a scalar bar."""
    tiny_triangle = pv.PolyData.from_regular_faces(np.zeros((3, 3)), [[0, 1, 2]])
    tiny_triangle['range'] = np.resize(scalar_bar.GetLookupTable().GetRange(), 3)
    mapper = pv.DataSetMapper(tiny_triangle)
    mapper.SetLookupTable(scalar_bar.GetLookupTable())
    mapper.scalar_range = scalar_bar.GetLookupTable().GetRange()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray('range')
    actor = pv.Actor(mapper=mapper)
    actor.UseBoundsOff()
    actor.SetObjectName('pvibr: range of a scalar bar')
    return actor


def _actor(prop):
    actor_copy = pv.Actor()
    actor_copy.ShallowCopy(prop)
    actor_copy.SetMapper(_mapper(prop.GetMapper()))
    actor_copy.SetProperty(copied_property(prop.GetProperty()))
    actor_copy.SetShaderProperty(_vtk.vtkShaderProperty())  # without pvibr's shader replacements
    if prop.GetUserMatrix() is not None:
        actor_copy.user_matrix = pv.array_from_vtkmatrix(prop.GetUserMatrix())
    return actor_copy


def _mapper(mapper):
    is_plain = mapper.IsA('vtkDataSetMapper') or mapper.IsA('vtkPolyDataMapper')
    if is_plain and not mapper.IsA('vtkCompositePolyDataMapper'):
        return _dataset_mapper(mapper)
    mapper_copy = mapper.NewInstance()
    mapper_copy.ShallowCopy(mapper)
    return mapper_copy


def _dataset_mapper(mapper):
    mapper.Update()
    mapper_copy = pv.DataSetMapper()
    mapper_copy.ShallowCopy(mapper)
    mapper_copy.SetStatic(False)
    mesh_data = mapper.GetInputDataObject(0, 0)
    if mesh_data is not None:
        mapper_copy.SetInputDataObject(pv.wrap(mesh_data).copy(deep=False))
    return mapper_copy


def _volume(prop):
    volume_copy = _like(prop)
    old_mapper = prop.GetMapper()
    new_mapper = old_mapper.NewInstance()
    new_mapper.SetInputDataObject(old_mapper.GetInputDataObject(0, 0))
    new_mapper.SetBlendMode(old_mapper.GetBlendMode())
    volume_copy.SetMapper(new_mapper)
    return volume_copy
