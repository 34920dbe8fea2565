"""Copies of props for another window: what they show is shared, what draws it is not."""

from __future__ import annotations

import pyvista as pv

from pvibr import _vtk
from pvibr.actors.parts import copy_property


def copied(prop, plotter):
    """Return a prop that shows the same in another window.

    Parameters
    ----------
    prop : vtkProp
        An actor, a volume or an annotation.
    plotter : pyvista.Plotter
        Where it goes.

    Returns
    -------
    vtkProp or None
        None where there is no such copy.
    """
    if prop.IsA('vtkCubeAxesActor'):
        axes = _like(prop)
        axes.SetCamera(plotter.renderer.GetActiveCamera())
        return axes
    if prop.IsA('vtkActor') and prop.GetMapper() is not None:
        return _actor(prop)
    if prop.IsA('vtkVolume') and prop.GetMapper() is not None:
        return _volume(prop)
    return _like(prop)


def _like(prop):
    copy = prop.NewInstance()
    copy.ShallowCopy(prop)
    if prop.IsA('vtkScalarBarActor'):
        copy.SetUnconstrainedFontSize(prop.GetUnconstrainedFontSize())
    return copy


def _actor(prop):
    copy = pv.Actor()
    copy.ShallowCopy(prop)
    copy.SetMapper(_mapper(prop.GetMapper()))
    look = pv.Property()
    copy_property(look, prop.GetProperty())
    copy.SetProperty(look)
    copy.SetShaderProperty(_vtk.vtkShaderProperty())  # what pvibr put there stays there
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
