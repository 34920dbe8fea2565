"""Files and scenes as meshes, or as meshes with poses of instances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.files import existing, naming_file
from pvibr.io.cities import is_city, read_city
from pvibr.io.legacy_vtk import check_legacy
from pvibr.io.ply_headers import check_ply
from pvibr.io.trimesh_meshes import (
    has_materials,
    is_trimesh,
    read_trimesh,
    trimesh_instances,
)

_GLTF = ('.gltf', '.glb')
#: What VTK's readers do not check, and crash by.
_CHECKS = {'.ply': check_ply, '.vtk': check_legacy}


def has_graph(mesh) -> bool:
    """Return True for a trimesh scene and the path of a glTF file."""
    return is_trimesh(mesh, 'Scene') or (isinstance(mesh, str | Path) and _is_gltf(mesh))


def read_mesh(path):
    """Read a mesh, or a trimesh scene, from a file other than glTF."""
    path = existing(path, 'mesh file')
    if is_city(path):
        return _city_blocks(path)
    check = _CHECKS.get(path.suffix.lower())
    if check is not None:
        with naming_file(path):
            check(path)
    reasons = []
    readers = [_read_pyvista, read_trimesh]
    if path.suffix.lower() == '.obj' and has_materials(path):
        readers.reverse()  # VTK leaves out its materials
    for reader in readers:
        # After any exception of a third-party reader, try the next one.
        try:
            return reader(path)
        except Exception as error:
            reasons.append(f'{reader.__name__.lstrip("_").removeprefix("read_")}: {error}')
    raise ValueError(f'{path}: not a readable mesh ({"; ".join(reasons)})')


def scene_instances(scene, pbr=False):
    """Return the meshes of a scene or file, and mesh index and matrix of each instance."""
    if not isinstance(scene, str | Path):
        return trimesh_instances(scene)
    path = existing(scene, 'mesh file')
    if is_city(path):
        return read_city(path)
    if _is_gltf(path):
        from pvibr.meshes.gltf_as_meshes import (
            gltf_instances,  # a heavy import that few files need
        )

        with naming_file(path):
            return gltf_instances(path, pbr)
    return trimesh_instances(read_trimesh(path))


def _is_gltf(path):
    return Path(path).suffix.lower() in _GLTF


def _read_pyvista(path):
    mesh = pv.read(path)
    if not isinstance(mesh, pv.MultiBlock) and not mesh.n_points:
        raise ValueError('it has no points')
    for block in mesh.recursive_iterator() if isinstance(mesh, pv.MultiBlock) else [mesh]:
        if isinstance(block, pv.PolyData | pv.UnstructuredGrid):
            _check_cells(block)
    return mesh


def _check_cells(mesh):
    """Raise a ValueError unless cells are of the points of a mesh, and arrays are as long."""
    if isinstance(mesh, pv.PolyData):
        arrays = [mesh.GetVerts(), mesh.GetLines(), mesh.GetPolys(), mesh.GetStrips()]
    else:
        arrays = [mesh.GetCells()]
    for cells in arrays:
        ids, starts = (
            _vtk.vtk_to_numpy(a) for a in (cells.GetConnectivityArray(), cells.GetOffsetsArray())
        )
        if len(ids) and not 0 <= ids.min() <= ids.max() < mesh.n_points:
            raise ValueError(f'its cells must be of its {mesh.n_points} points, got others')
        if len(starts) and ((np.diff(starts) < 0).any() or starts[0] or starts[-1] > len(ids)):
            raise ValueError('its cells do not follow each other')
    for data, count in ((mesh.GetPointData(), mesh.n_points), (mesh.GetCellData(), mesh.n_cells)):
        for k in range(data.GetNumberOfArrays()):
            array = data.GetAbstractArray(k)
            if array.GetNumberOfTuples() != count:
                raise ValueError(f'its array {array.GetName()!r} must have {count} values')


def _city_blocks(path):
    meshes, index, matrices = read_city(path)
    placed = zip(index, matrices, strict=True)
    return pv.MultiBlock([meshes[k].transform(pose, inplace=False) for k, pose in placed])
