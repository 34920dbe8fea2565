"""Doubles of actors that draw the same depth with a minimal shader."""

from __future__ import annotations

import re

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl.feature import replacements

_SURFACE = 2  # VTK_SURFACE
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper')
_ASSIGNED = re.compile(r'\bgl_Position\b[.\w]*\s*[-+*/]?=(?!=)|#define vertexMC\b')


class Doubles:
    """Actors that draw the depth of others."""

    def __init__(self):
        self._made: dict = {}

    def of(self, actor, faces='both'):
        """Return the double of an actor, or the actor if no double draws the same depth."""
        data = _plain_surface(actor)
        if data is None:
            return actor
        key = address(actor)
        if key not in self._made:
            self._made[key] = actor, _double()
        double = self._made[key][1]
        mapper = double.GetMapper()
        if mapper.GetInput() is not data:
            mapper.SetInputData(data)
        planes = actor.GetMapper().GetClippingPlanes()
        if planes is None:
            mapper.RemoveAllClippingPlanes()
        else:
            mapper.SetClippingPlanes(planes)
        double.SetUserMatrix(actor.GetMatrix())
        ours, theirs = double.GetProperty(), actor.GetProperty()
        ours.SetBackfaceCulling(theirs.GetBackfaceCulling())
        ours.SetFrontfaceCulling(theirs.GetFrontfaceCulling() or faces == 'back')
        return double

    def keep(self, actors, window):
        """Forget the doubles of all other actors."""
        wanted = {address(actor) for actor in actors}
        for key in self._made.keys() - wanted:
            _, double = self._made.pop(key)
            double.GetMapper().ReleaseGraphicsResources(window)
            double.ReleaseGraphicsResources(window)

    def release(self, window):
        """Free the GPU's memory; the context must be alive."""
        self.keep((), window)


def _plain_surface(actor):
    """Return the polygons that an actor draws and nothing else, or None."""
    mapper, prop = actor.GetMapper(), actor.GetProperty()
    if (
        mapper.GetClassName() not in _MAPPERS
        or prop.GetRepresentation() != _SURFACE
        or _moves_vertices(actor)
        or is_cut_out(actor)
    ):
        return None
    data = mapper.GetInput()
    if data is None or not data.IsA('vtkPolyData') or data.GetNumberOfPolys() == 0:
        return None
    lines = data.GetNumberOfVerts() + data.GetNumberOfLines() + data.GetNumberOfStrips()
    return None if lines or actor.HasTranslucentPolygonalGeometry() else data


def is_cut_out(actor) -> bool:
    """Return whether a texture may cut out parts, which VTK draws as opaque geometry."""
    textures = [actor.GetTexture(), actor.GetProperty().GetTexture('albedoTex')]
    images = [t.GetInput() for t in textures if t is not None]
    return any(i is not None and i.GetNumberOfScalarComponents() in (2, 4) for i in images)


def _moves_vertices(actor) -> bool:
    """Return whether a shader replacement may move vertices."""
    shader = actor.GetShaderProperty()
    if shader.HasVertexShaderCode():
        return True
    return any(
        stage != 'Fragment' and (tag not in text or _ASSIGNED.search(text))
        for (stage, tag), text in replacements(shader).items()
    )


def _double():
    actor = _vtk.vtkActor()
    mapper = _vtk.vtkPolyDataMapper()
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    return actor
