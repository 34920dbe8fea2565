"""Copies of materials and their textures."""

from __future__ import annotations

import pyvista as pv

from pvibr.core import _vtk

#: Names of VTK's textures for physically based shading; VTK has no list of them.
PROPERTY_TEXTURES = (
    'albedoTex',
    'materialTex',
    'normalTex',
    'emissiveTex',
    'anisotropyTex',
    'coatNormalTex',
)
#: Textures of colours, which VTK requires in sRGB.
_COLORS = ('albedoTex', 'emissiveTex')
#: Settings of a VTK texture, by the suffix of their methods.
TEXTURE_MODES = (
    *('Interpolate', 'Mipmap', 'Wrap', 'ColorMode', 'BlendingMode', 'PremultipliedAlpha'),
    *('UseSRGBColorSpace', 'RestrictPowerOf2ImageSmaller'),
)


def copy_property(copy, prop):
    """Copy a property, sharing its textures."""
    copy.DeepCopy(prop)
    if hasattr(copy, '_color_set'):  # or PyVista draws wireframes in the theme's colour
        copy._color_set = getattr(prop, '_color_set', True)  # noqa: SLF001
    for name in PROPERTY_TEXTURES:
        texture = copy.GetTexture(name)
        if texture is not None:
            texture.Register(copy)  # VTK 9.7 forgets this, but unregisters it with the copy


def copied_property(prop):
    """Return a copy of a property."""
    copy = pv.Property()
    copy_property(copy, prop)
    return copy


def set_textures(prop, textures):
    """Set textures of physically based shading by name; colour textures are sRGB."""
    for name, texture in textures.items():
        if name in _COLORS and not texture.GetUseSRGBColorSpace():
            texture = copy_texture(texture)
            texture.UseSRGBColorSpaceOn()
        prop.SetTexture(name, texture)


def copy_texture(texture):
    """Return a new texture with the same image, for another window."""
    if texture is None or texture.GetInput() is None:
        return None
    copy = _vtk.vtkTexture()
    copy.SetInputData(texture.GetInput())
    copy.SetLookupTable(texture.GetLookupTable())
    copy.SetTransform(texture.GetTransform())
    copy.SetBorderColor(texture.GetBorderColor())
    for name in TEXTURE_MODES:
        getattr(copy, f'Set{name}')(getattr(texture, f'Get{name}')())
    return copy
