"""Actors that draw the depth of others with a minimal shader."""

from __future__ import annotations

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl.feature import moves_vertices

_SURFACE = 2  # VTK_SURFACE
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper')


class Doubles:
    """Actors that draw the depth of others."""

    def __init__(self):
        self._pairs: dict = {}

    def of(self, actor, faces='both'):
        """Return an actor's double, or the actor if no double would draw the same depth."""
        polygons = _plain_surface(actor)
        if polygons is None:
            return actor
        key = address(actor)
        if key not in self._pairs:
            self._pairs[key] = actor, _double()
        double = self._pairs[key][1]
        mapper = double.GetMapper()
        if mapper.GetInput() is not polygons:
            mapper.SetInputData(polygons)
        clip_planes = actor.GetMapper().GetClippingPlanes()
        if clip_planes is None:
            mapper.RemoveAllClippingPlanes()
        else:
            mapper.SetClippingPlanes(clip_planes)
        double.SetUserMatrix(actor.GetMatrix())
        double_property, actor_property = double.GetProperty(), actor.GetProperty()
        double_property.SetBackfaceCulling(actor_property.GetBackfaceCulling())
        culls_front = actor_property.GetFrontfaceCulling() or faces == 'back'
        double_property.SetFrontfaceCulling(culls_front)
        return double

    def keep(self, actors, window):
        """Release the doubles of all other actors."""
        kept_keys = {address(actor) for actor in actors}
        for key in self._pairs.keys() - kept_keys:
            _, double = self._pairs.pop(key)
            double.GetMapper().ReleaseGraphicsResources(window)
            double.ReleaseGraphicsResources(window)

    def release(self, window):
        """Free the GPU's memory; the context must be alive."""
        self.keep((), window)


def _plain_surface(actor):
    """Return the polygons of an actor that draws nothing else, or None."""
    mapper, prop = actor.GetMapper(), actor.GetProperty()
    if (
        mapper.GetClassName() not in _MAPPERS
        or prop.GetRepresentation() != _SURFACE
        or moves_vertices(actor.GetShaderProperty())
        or is_cut_out(actor)
    ):
        return None
    data = mapper.GetInput()
    if data is None or not data.IsA('vtkPolyData') or data.GetNumberOfPolys() == 0:
        return None
    other_cells = data.GetNumberOfVerts() + data.GetNumberOfLines() + data.GetNumberOfStrips()
    return None if other_cells or actor.HasTranslucentPolygonalGeometry() else data


def is_cut_out(actor) -> bool:
    """Return whether a texture may cut out parts; VTK draws those as opaque geometry."""
    textures = [actor.GetTexture(), actor.GetProperty().GetTexture('albedoTex')]
    texture_images = [t.GetInput() for t in textures if t is not None]
    return any(i is not None and i.GetNumberOfScalarComponents() in (2, 4) for i in texture_images)


def _double():
    actor = _vtk.vtkActor()
    mapper = _vtk.vtkPolyDataMapper()
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    return actor
