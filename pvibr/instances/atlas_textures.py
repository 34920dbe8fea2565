"""Textures of atlases, shared within a window."""

from __future__ import annotations

import weakref

import numpy as np

from pvibr.gl import Texture
from pvibr.gl.texture import release
from pvibr.instances.atlas import pyramid

_NAMES = ('ibr_geometry', 'ibr_albedo')
# Textures by window, then by the id of their atlas, which they keep alive.
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
        # Of sets whose instances have no looks.
        self.views['ibr_looks'] = Texture(window).upload(np.zeros((1, 1, 4), np.uint8))
        turns = atlas.turntable
        pictures = () if turns is None else (turns.geometry, turns.albedo)
        self.turned: dict[str, Texture] = {
            name: Texture(window, **linear).upload(pyramid(picture, turns.tile))
            for name, picture in zip(_NAMES, pictures, strict=False)
        }

    @classmethod
    def of(cls, atlas, window) -> AtlasTextures:
        """Return the textures of an atlas, to release after use; the context is current."""
        by_atlas = _shared.setdefault(window, {})
        if id(atlas) not in by_atlas:
            by_atlas[id(atlas)] = cls(atlas, window)
        textures = by_atlas[id(atlas)]
        textures.users += 1
        return textures

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(t.nbytes for t in (*self.views.values(), *self.turned.values()))

    def give_back(self):
        """Free the GPU memory unless others use it; the context is current."""
        self.users -= 1
        if not self.users:
            del _shared[self._window][id(self.atlas)]
            release(*self.views.values(), *self.turned.values())
