"""Textures of the items of a set."""

from __future__ import annotations

from pvibr.gl import Texture, nbytes_of, release
from pvibr.things.shader_draws import pack


class ItemTextures:
    """Textures that shaders read for each item, uploaded again once they are stale."""

    def __init__(self):
        self.by_name: dict[str, Texture] = {}
        #: The window that they belong to, None while nothing is on the GPU.
        self.window = None
        self._stale: set[str] = set()

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self.by_name.values())

    def drop(self, *names):
        """Upload textures again in the next frame."""
        self._stale |= set(names)

    def upload(self, window, texels) -> set[str]:
        """Upload stale textures, of rows, width and channels by name; return their names."""
        if self.window is None:
            self.window, self._stale = window, set(texels)
        stale_names = self._stale
        for name in sorted(stale_names):
            make_rows, width, channels = texels[name]
            texture = self.by_name.setdefault(name, Texture(window))
            texture.upload(pack(make_rows(), width, channels))
        self._stale = set()  # all again where the driver refused one
        return stale_names

    def release(self):
        """Free GPU memory; the context is current."""
        release(*self.by_name.values())
        self.by_name, self.window = {}, None
