"""Materials as keywords of ``add_mesh``."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import naming

#: Keywords of a material that a colour, scalars or a texture of the user replace.
_COLORING = (
    *('color', 'scalars', 'rgb', 'preference', 'texture', 'alpha_cutoff'),
    *('pbr_textures', 'emissive_factor'),
)

_CELL, _CELL_FIELD, _MAPPED = 2, 4, 1  # of scalars: VTK's modes, and colours by a table


def cell_scalars(mapper, mesh) -> str:
    """Return the name of the cell array that a lookup table colours, empty without one."""
    data = mesh.cell_data
    names = {_CELL: data.active_scalars_name, _CELL_FIELD: mapper.GetArrayName()}
    name = names.get(mapper.GetScalarMode()) or ''
    if not mapper.GetScalarVisibility() or name not in data:
        return ''
    direct = mapper.GetColorMode() != _MAPPED and data[name].dtype == np.uint8
    return '' if direct else name


def follow_scalars(mapper, mesh):
    """Colour `mesh` by points if these have the scalars of the mapper's cells."""
    name = cell_scalars(mapper, pv.wrap(mapper.GetInput()))
    if name and name not in mesh.cell_data:
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(name)
        mapper.InterpolateScalarsBeforeMappingOn()


def merged_look(material_look, look):
    """Return a material's look overridden by the user's; any colouring replaces all of it."""
    if any(look.get(name) is not None for name in ('color', 'scalars', 'texture')):
        overriding = {'alpha_cutoff'} if look.get('texture') is not None else set()
        material_look = {
            key: material_look[key]
            for key in material_look
            if key in overriding or key not in _COLORING
        }
    return material_look | {name: value for name, value in look.items() if value is not None}


def look_key(look):
    """Return a key that equal looks share."""
    flat = look | look.get('pbr_textures', {})
    flat.pop('pbr_textures', None)
    return tuple(
        (name, id(value) if isinstance(value, _vtk.vtkObject) else value)
        for name, value in flat.items()
    )


def culled_faces(prop) -> tuple:
    """Return whether a property culls back and front faces."""
    return bool(prop.GetBackfaceCulling()), bool(prop.GetFrontfaceCulling())


def lighting_of(prop):
    """Return the settings of a material except its colours."""
    lights = prop.GetAmbient(), prop.GetDiffuse(), prop.GetSpecular(), prop.GetSpecularPower()
    return (*lights, prop.GetOpacity(), prop.GetInterpolation())


def checked_data(dataset, keyword, values):
    """Return checked scalars or opacity of a mesh: values, or the name of an array or function."""
    with naming(keyword, values):
        if isinstance(values, str) and values not in dataset.array_names:
            if keyword != 'opacity':
                raise ValueError(f'must be an array of the mesh, one of {dataset.array_names}')
            pv.opacity_transfer_function(values, 2)
        lengths = dataset.n_points, dataset.n_cells
        if np.ndim(values) and np.size(values) < 2 and np.size(values) not in lengths:
            raise ValueError(f'must have one value per point or cell, got {np.size(values)}')
    return values
