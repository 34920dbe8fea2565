"""Texture units of a window, shared by any number of owners."""

from __future__ import annotations

import weakref

# By window, who keeps textures bound. A shader can sample sixteen to some thirty: scenes of many
# things have more, and VTK's own passes need some as well.
_bound: weakref.WeakKeyDictionary[object, weakref.ref[Binder]] = weakref.WeakKeyDictionary()


class Binder:
    """Keeps one set of textures bound: that of the last draw in their window."""

    def __init__(self):
        self.owner, self.textures, self.units = None, {}, {}

    def bind(self, owner, textures) -> dict[str, int]:
        """Bind textures and return their units, after giving back those of another owner."""
        if self.owner is not owner:
            self.unbind()
            window = next(iter(textures.values())).window
            other = _bound.get(window, lambda: None)()
            if other is not None:
                other.unbind()
            _bound[window] = weakref.ref(self)
            self.owner, self.textures = owner, textures
            self.units = {name: t.activate() for name, t in textures.items()}
        return self.units

    def unbind(self):
        """Give every unit back; to be called when the renderer has drawn."""
        for texture in self.textures.values():
            texture.deactivate()
        self.owner, self.textures = None, {}
