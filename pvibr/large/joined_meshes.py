"""Several meshes as one, with the arrays of all of them."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.meshes.surfaces import set_active

_NORMALS, _COORDINATES = 'Normals', 'Texture Coordinates'


def joined(meshes) -> pv.DataSet:
    """Return meshes as one, whose points and cells follow each other; none are merged.

    An array that a mesh does not have is NaN there, white or empty.
    """
    meshes = [mesh.copy(deep=False) for mesh in meshes]
    active = {mesh.active_scalars_info.name: mesh.active_scalars_info for mesh in meshes}
    _rename(meshes, 'active_normals', _NORMALS)
    _rename(meshes, 'active_texture_coordinates', _COORDINATES)
    _align([(mesh.point_data, mesh.n_points) for mesh in meshes])
    _align([(mesh.cell_data, mesh.n_cells) for mesh in meshes])
    if all(map(is_triangles, meshes)):
        mesh = meshes[0].append_polydata(*meshes[1:])
    else:
        mesh = pv.MultiBlock(meshes).combine(merge_points=False)
    mesh.set_active_scalars(None)
    if len(active) == 1:  # as add_mesh colours blocks
        set_active(mesh, *active.values())
    for attribute, name in (('normals', _NORMALS), ('texture_coordinates', _COORDINATES)):
        if name in mesh.point_data:
            setattr(mesh.point_data, f'active_{attribute}_name', name)
    return mesh


def is_triangles(mesh) -> bool:
    """Return True for a surface of triangles and nothing else."""
    has_strokes = isinstance(mesh, pv.PolyData) and mesh.n_verts + mesh.n_lines + mesh.n_strips
    return isinstance(mesh, pv.PolyData) and not has_strokes and mesh.is_all_triangles


def _rename(meshes, attribute, name):
    """Give an attribute of the points of all meshes one name, and drop it if not all have it."""
    arrays = [getattr(mesh.point_data, attribute) for mesh in meshes]
    has_all = all(array is not None for array in arrays)
    for mesh, array in zip(meshes, arrays, strict=True):
        if array is not None:
            values = np.asarray(array, np.float32)
            mesh.point_data.remove(getattr(mesh.point_data, f'{attribute}_name'))
        if has_all:
            mesh.point_data.set_array(values, name)


def _align(datas):
    """Give meshes the same arrays, of one type: VTK leaves out all others."""
    for name in dict.fromkeys(name for data, _ in datas for name in data):
        own = [np.asarray(data[name]) if name in data else None for data, _ in datas]
        known = [values for values in own if values is not None]
        filling = _filling([values.dtype for values in known], own)
        is_alike = len({values.shape[1:] for values in known}) == 1 and filling is not None
        for (data, count), values in zip(datas, own, strict=True):
            if name in data:
                data.remove(name)
            if is_alike:
                shape = count, *known[0].shape[1:]
                values = np.broadcast_to(filling, shape) if values is None else values
                data.set_array(values.astype(filling.dtype), name)


def _filling(kinds, own):
    """Return what stands for values that are not there, of the type that holds all; or None."""
    is_whole = all(values is not None for values in own)
    if all(kind.kind in 'US' for kind in kinds):
        return np.array('', np.result_type(*kinds))
    if any(kind.kind not in 'biuf' for kind in kinds):
        return None
    kind = np.result_type(*kinds)
    if is_whole or kind == np.uint8:  # colours
        return np.array(255 if kind == np.uint8 else 0, kind)
    return np.array(np.nan, np.result_type(kind, np.float32))
