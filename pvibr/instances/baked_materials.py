"""Materials of baked meshes, and whether they have changed since the bake."""

from __future__ import annotations

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.things.content_key import images_of

_LIGHT = (
    *('Ambient', 'Diffuse', 'Specular', 'SpecularPower', 'Lighting', 'Metallic', 'Roughness'),
    *('AmbientColor', 'DiffuseColor', 'SpecularColor', 'Opacity'),
)
_BAKED = (
    *('Interpolation', 'Representation', 'EdgeVisibility', 'Opacity', 'BackfaceCulling'),
    *('FrontfaceCulling', 'ShowTexturesOnBackface'),
)
#: Why a mesh has no images once its material has changed.
MATERIAL_CHANGED = 'its material has changed since the bake; bake() makes images again'


class BakedMaterial:
    """The materials of a mesh's parts at the time of its bake."""

    def __init__(self, parts):
        self.parts = parts
        self._get_times = [method(part.actor, 'GetMTime') for part in parts]
        self._actor_times: list = []
        self._images: list = []  # as of these times
        #: Model whose images do not match the current materials.
        self.stale_model = None
        self._baked_look, self._shape = self._look(), self._shape_now()
        self._times = self._times_now()

    def time_getters(self) -> list:
        """Return what returns the times of the actors, materials and textures."""
        return [*self._get_times, *(image.GetMTime for image in self._images)]

    def changed(self) -> bool:
        """Return True if a material was modified since the last call."""
        actor_times = [get_time() for get_time in self._get_times]
        if actor_times == self._actor_times and not self._images:  # most have none
            return False
        previous_times, self._times = self._times, self._times_now()
        return self._times != previous_times

    def compared(self) -> tuple:
        """Return whether images can show the materials, and the new colour if it changed."""
        (colors, other_settings), (baked_colors, baked_settings) = self._look(), self._baked_look
        if other_settings != baked_settings:
            return False, None
        if colors == baked_colors:
            return True, None
        return (True, colors[0]) if has_one_color(self.parts) else (False, None)

    def reshaped(self) -> bool:
        """Return True if actors and shaders must be rebuilt."""
        previous_shape, self._shape = self._shape, self._shape_now()
        return self._shape != previous_shape

    def _times_now(self):
        actor_times = [get_time() for get_time in self._get_times]
        if actor_times != self._actor_times:  # those of materials and textures included
            self._actor_times = actor_times
            self._images = [image for part in self.parts for image in images_of(part.actor)]
        return [*actor_times, *[image.GetMTime() for image in self._images]]

    def _props(self):
        return [part.actor.GetProperty() for part in self.parts]

    def _shape_now(self):
        return [(_vtk.address(p), p.GetSpecular() > 0, p.GetLighting()) for p in self._props()]

    def _look(self) -> tuple:
        """Return what images bake of the materials: colours, and all else."""
        settings = [[getattr(prop, f'Get{name}')() for name in _BAKED] for prop in self._props()]
        images = [(i, i.GetMTime()) for part in self.parts for i in images_of(part.actor)]
        return [p.GetDiffuseColor() for p in self._props()], [*settings, images]


def has_one_color(parts) -> bool:
    """Return True if the material's colour is the only one of a mesh."""
    if len(parts) > 1:
        return False
    actor = parts[0].actor
    textured = actor.GetTexture() is not None or actor.GetProperty().GetNumberOfTextures()
    back = actor.GetBackfaceProperty() is not None
    return not (textured or back or actor.GetMapper().GetScalarVisibility())


def copy_light(target, source):
    """Copy the lighting and the colours of a material to another."""
    for name in _LIGHT:
        getattr(target, f'Set{name}')(getattr(source, f'Get{name}')())
