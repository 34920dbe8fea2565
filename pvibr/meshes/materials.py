"""Materials: what those of files bring along as keywords of ``add_mesh``, copies of properties."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.maths.arguments import naming

#: What a colour, scalars or a texture of the user replace in the look of a material.
_COLORING = (
    *('color', 'scalars', 'rgb', 'preference', 'texture', 'alpha_cutoff'),
    *('pbr_textures', 'emissive_factor'),
)

#: Names of VTK's textures of physically based shading; VTK has no call that lists them.
PROPERTY_TEXTURES = (
    'albedoTex',
    'materialTex',
    'normalTex',
    'emissiveTex',
    'anisotropyTex',
    'coatNormalTex',
)
#: Those of colours: VTK refuses them unless they are in sRGB, as pictures are.
_COLORS = ('albedoTex', 'emissiveTex')
#: Settings of a VTK texture, by the names of their methods.
TEXTURE_MODES = (
    *('Interpolate', 'Mipmap', 'Wrap', 'ColorMode', 'BlendingMode', 'PremultipliedAlpha'),
    *('UseSRGBColorSpace', 'RestrictPowerOf2ImageSmaller'),
)

_CELL, _CELL_FIELD, _MAPPED = 2, 4, 1  # of scalars: VTK's modes, and colours by a table


def cell_scalars(mapper, mesh) -> str:
    """Return the name of the array of cells that a table colours, empty if it colours none."""
    data = mesh.cell_data
    names = {_CELL: data.active_scalars_name, _CELL_FIELD: mapper.GetArrayName()}
    name = names.get(mapper.GetScalarMode()) or ''
    if not mapper.GetScalarVisibility() or name not in data:
        return ''
    direct = mapper.GetColorMode() != _MAPPED and data[name].dtype == np.uint8
    return '' if direct else name


def follow_scalars(mapper, mesh):
    """Have the mapper of a mesh colour another by its points, if these have the cells' scalars."""
    name = cell_scalars(mapper, pv.wrap(mapper.GetInput()))
    if name and name not in mesh.cell_data:
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(name)
        mapper.InterpolateScalarsBeforeMappingOn()


def merged_look(own, look):
    """Let the user's arguments override the material; any colouring replaces all of its own."""
    if any(look.get(name) is not None for name in ('color', 'scalars', 'texture')):
        kept = {'alpha_cutoff'} if look.get('texture') is not None else set()
        own = {key: own[key] for key in own if key in kept or key not in _COLORING}
    return own | {name: value for name, value in look.items() if value is not None}


def look_key(look):
    """Return a key that equal looks share."""
    flat = look | look.get('pbr_textures', {})
    flat.pop('pbr_textures', None)
    return tuple(
        (name, id(value) if isinstance(value, _vtk.vtkObject) else value)
        for name, value in flat.items()
    )


def copy_property(copy, prop):
    """Copy a property, sharing its textures."""
    copy.DeepCopy(prop)
    if hasattr(copy, '_color_set'):  # or PyVista draws wireframes in the theme's colour
        copy._color_set = getattr(prop, '_color_set', True)  # noqa: SLF001
    for name in PROPERTY_TEXTURES:
        texture = copy.GetTexture(name)
        if texture is not None:
            texture.Register(copy)  # VTK 9.7 forgets this, but unregisters with the copy


def copied_property(prop):
    """Return a copy of a property."""
    copy = pv.Property()
    copy_property(copy, prop)
    return copy


def culled_faces(prop) -> tuple:
    """Return whether a property culls back and front faces."""
    return bool(prop.GetBackfaceCulling()), bool(prop.GetFrontfaceCulling())


def lighting_of(prop):
    """Return what a material has but its colours."""
    lights = prop.GetAmbient(), prop.GetDiffuse(), prop.GetSpecular(), prop.GetSpecularPower()
    return (*lights, prop.GetOpacity(), prop.GetInterpolation())


def set_textures(prop, textures):
    """Set textures of physically based shading by their names; colours are taken as sRGB."""
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


def checked_data(dataset, keyword, values):
    """Return scalars or opacity of a mesh: values, or names of arrays or transfer functions."""
    with naming(keyword, values):
        if isinstance(values, str) and values not in dataset.array_names:
            if keyword != 'opacity':
                raise ValueError(f'the mesh has no array of this name, but {dataset.array_names}')
            pv.opacity_transfer_function(values, 2)
        lengths = dataset.n_points, dataset.n_cells
        if np.ndim(values) and np.size(values) < 2 and np.size(values) not in lengths:
            raise ValueError(f'must have a value for each point or cell, not {np.size(values)}')
    return values
