"""Texture units of a window, shared by any number of owners."""

from __future__ import annotations

import weakref

# The binder with bound textures, by window. Shaders can sample 16 to 32 textures: scenes of many
# things have more, and VTK's own passes need units, too.
_bound: weakref.WeakKeyDictionary[object, weakref.ref[Binder]] = weakref.WeakKeyDictionary()


class Binder:
    """Keeps the textures of the last draw in a window bound."""

    def __init__(self):
        self.owner, self.textures, self.units = None, {}, {}

    def bind(self, owner, textures) -> dict[str, int]:
        """Bind textures and return their units; another owner's are unbound."""
        if self.owner is not owner:
            self.unbind()
            window = next(iter(textures.values())).window
            previous_binder = _bound.get(window, lambda: None)()
            if previous_binder is not None:
                previous_binder.unbind()
            _bound[window] = weakref.ref(self)
            self.owner, self.textures = owner, textures
            self.units = {name: t.activate() for name, t in textures.items()}
        return self.units

    def unbind(self):
        """Release all units; call it when the renderer has drawn."""
        for texture in self.textures.values():
            texture.deactivate()
        self.owner, self.textures = None, {}
