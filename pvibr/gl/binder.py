"""Texture units of a window, shared by any number of owners."""

from __future__ import annotations

import weakref

from pvibr.gl.texture import SPARE_UNIT

# Of the binders of a window, one has bound textures. Shaders can sample 16 to 32 textures: scenes
# of many things have more, and VTK's own passes need units, too.
#: Textures that stay bound from draw to draw of a binder.
_MOST = 8


def _no_binder():
    return None


class Binder:
    """Keeps the textures of the last draw in a window bound."""

    def __init__(self):
        self.textures: dict = {}
        self.units: dict[str, int] = {}
        self._unit_of: dict = {}

    def bind(self, textures) -> dict[str, int]:
        """Bind textures and return their units; of others only some stay bound.

        The units are the same dict for as long as the textures are.
        """
        if self.textures != textures:
            if not self._unit_of:
                self._take_over(next(iter(textures.values())).window)
            if len(self._unit_of.keys() | textures.values()) > _MOST:
                for texture in self._unit_of.keys() - textures.values():
                    texture.object.Deactivate()
                    del self._unit_of[texture]
            for texture in textures.values():
                if texture not in self._unit_of:
                    texture.object.Activate()
                    self._unit_of[texture] = texture.object.GetTextureUnit()
            texture.window.GetState().vtkglActiveTexture(SPARE_UNIT)
            self.textures = dict(textures)
            self.units = {name: self._unit_of[texture] for name, texture in textures.items()}
        return self.units

    def _take_over(self, window):
        """Release the units of the window's other binder."""
        # VTK keeps an object's attributes while its C++ lives.
        previous_binder = getattr(window, 'ibr_binder', _no_binder)()
        if previous_binder is not None:
            previous_binder.unbind()
        window.ibr_binder = weakref.ref(self)

    def unbind(self):
        """Release all units; call it when the renderer has drawn."""
        for texture in self._unit_of:
            texture.object.Deactivate()
        for texture in self.textures.values():
            vars(texture.window).pop('ibr_binder', None)
            break
        self.textures, self._unit_of = {}, {}
