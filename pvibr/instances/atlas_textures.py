"""Textures of atlases, shared by all that draw them in a window."""

from __future__ import annotations

import weakref

import numpy as np

from pvibr.gl import Texture
from pvibr.gl.texture import release
from pvibr.instances.atlas import pyramid

_NAMES = ('ibr_geometry', 'ibr_albedo')
# By window, what is on its GPU, by the address of the atlas, which the entry keeps alive.
_shared: weakref.WeakKeyDictionary[object, dict[int, AtlasTextures]] = weakref.WeakKeyDictionary()


class AtlasTextures:
    """The images of an atlas on the GPU."""

    def __init__(self, atlas, window):
        self.atlas, self._window, self.users = atlas, window, 0
        linear = {'filter': 'linear'}
        self.views: dict[str, Texture] = {
            name: Texture(window, **linear).upload(picture)
            for name, picture in zip(_NAMES, atlas.textures(), strict=True)
        }
        support = atlas.support.astype(np.float32)
        self.views['ibr_support'] = Texture(window).upload(support)
        if atlas.animated:
            self.views['ibr_bins'] = Texture(window).upload(atlas.bins)
        turns = atlas.turntable
        pictures = () if turns is None else (turns.geometry, turns.albedo)
        self.turned: dict[str, Texture] = {
            name: Texture(window, **linear).upload(pyramid(picture, turns.tile))
            for name, picture in zip(_NAMES, pictures, strict=False)
        }

    @classmethod
    def of(cls, atlas, window) -> AtlasTextures:
        """Return the textures of an atlas, to be given back; the context is current."""
        known = _shared.setdefault(window, {})
        if id(atlas) not in known:
            known[id(atlas)] = cls(atlas, window)
        found = known[id(atlas)]
        found.users += 1
        return found

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(t.nbytes for t in (*self.views.values(), *self.turned.values()))

    def give_back(self):
        """Free the GPU memory if nobody else uses it; the context is current."""
        self.users -= 1
        if not self.users:
            del _shared[self._window][id(self.atlas)]
            release(*self.views.values(), *self.turned.values())
