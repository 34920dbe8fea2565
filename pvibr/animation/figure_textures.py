"""Textures in pickles and copies of figures; VTK has none."""

from __future__ import annotations

from weakref import WeakValueDictionary

import pyvista as pv

from pvibr.core._vtk import address

# By the address of the texture; what pickles keeps them alive meanwhile.
_stored: WeakValueDictionary[str, StoredTexture] = WeakValueDictionary()


class StoredTexture:
    """Stands for a texture in the state of its owner; becomes one when that is restored."""

    def __init__(self, texture):
        image = pv.wrap(texture.GetInput())
        sampling = texture.interpolate, texture.mipmap, texture.wrap.name
        self._parts = image, *sampling, texture.GetUseSRGBColorSpace()

    def __reduce__(self):
        return _restored, self._parts


def storable(look):
    """Return the look of a mesh as it is pickled; textures that are shared stay so."""
    return {name: _storable(value) for name, value in look.items()}


def _storable(value):
    if isinstance(value, dict):
        return storable(value)
    if not isinstance(value, pv.Texture):
        return value
    return _stored.setdefault(address(value), StoredTexture(value))


def _restored(image, interpolate, mipmap, wrap, srgb):
    texture = pv.Texture(image)
    texture.interpolate, texture.mipmap = interpolate, mipmap
    texture.wrap = pv.Texture.WrapType[wrap]
    texture.SetUseSRGBColorSpace(srgb)
    return texture
