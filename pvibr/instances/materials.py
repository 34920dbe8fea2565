"""Materials of meshes that were baked, and whether they have changed since."""

from __future__ import annotations

from pvibr.core import _vtk
from pvibr.scene.content_key import images_of

_LIGHT = (
    *('Ambient', 'Diffuse', 'Specular', 'SpecularPower', 'Lighting', 'Metallic', 'Roughness'),
    *('AmbientColor', 'DiffuseColor', 'SpecularColor', 'Opacity'),
)
_BAKED = (
    *('Interpolation', 'Representation', 'EdgeVisibility', 'Opacity', 'BackfaceCulling'),
    *('FrontfaceCulling', 'ShowTexturesOnBackface'),
)
#: Why a mesh is drawn as it is once its material has changed.
MATERIAL_CHANGED = 'its material was changed since; bake() shows images again'


class Material:
    """The materials of the parts of a mesh, as they were when it was baked."""

    def __init__(self, parts):
        self.parts = parts
        #: Pictures that do not show the materials as they are now.
        self.baked = None
        self._was, self._shape = self._look(), self._form()
        self._times = self._now()

    def changed(self) -> bool:
        """Return True if a material was modified since the last call."""
        before, self._times = self._times, self._now()
        return self._times != before

    def compared(self) -> tuple:
        """Return whether pictures can show the materials, and by which colour if by another."""
        (colors, rest), (old_colors, old_rest) = self._look(), self._was
        if rest != old_rest or (colors != old_colors and not has_one_color(self.parts)):
            return False, None
        return True, colors[0] if colors != old_colors else None

    def reshaped(self) -> bool:
        """Return True if actors and shaders must be made again."""
        before, self._shape = self._shape, self._form()
        return self._shape != before

    def _now(self):
        actors = [part.actor for part in self.parts]
        return [thing.GetMTime() for a in actors for thing in (a, *images_of(a))]

    def _props(self):
        return [part.actor.GetProperty() for part in self.parts]

    def _form(self):
        return [(_vtk.address(p), p.GetSpecular() > 0, p.GetLighting()) for p in self._props()]

    def _look(self) -> tuple:
        """Return what pictures hold of the materials: colours, and all else."""
        others = [[getattr(prop, f'Get{name}')() for name in _BAKED] for prop in self._props()]
        images = [(i, i.GetMTime()) for part in self.parts for i in images_of(part.actor)]
        return [p.GetDiffuseColor() for p in self._props()], [*others, images]


def has_one_color(parts) -> bool:
    """Return True if the colour of its material is the only one of a mesh."""
    if len(parts) > 1:
        return False
    actor = parts[0].actor
    textured = actor.GetTexture() is not None or actor.GetProperty().GetNumberOfTextures()
    back = actor.GetBackfaceProperty() is not None
    return not (textured or back or actor.GetMapper().GetScalarVisibility())


def copy_light(to, of):
    """Give a material the response to light and the colours of another."""
    for name in _LIGHT:
        getattr(to, f'Set{name}')(getattr(of, f'Get{name}')())
