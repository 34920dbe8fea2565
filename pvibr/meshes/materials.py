"""Materials: what those of files bring along as keywords of ``add_mesh``, copies of properties."""

from __future__ import annotations

from pvibr.core import _vtk

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
    for name in PROPERTY_TEXTURES:
        texture = copy.GetTexture(name)
        if texture is not None:
            texture.Register(copy)  # VTK 9.7 forgets this, but unregisters with the copy
