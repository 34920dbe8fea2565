"""Files and scenes as meshes, or as meshes with poses of instances."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv

from pvibr.core.files import existing
from pvibr.io.cities import is_city, read_city
from pvibr.io.trimesh_meshes import is_trimesh, read_trimesh, trimesh_instances

_GLTF = ('.gltf', '.glb')


def has_graph(mesh) -> bool:
    """Return True for a trimesh scene and the path of a glTF file."""
    return is_trimesh(mesh, 'Scene') or (isinstance(mesh, str | Path) and _is_gltf(mesh))


def read_mesh(path):
    """Read a mesh, or a trimesh scene, from a file other than glTF."""
    path = existing(path, 'mesh file')
    if is_city(path):
        return _city_blocks(path)
    reasons = []
    for reader in (_read_pyvista, read_trimesh):
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

        return gltf_instances(path, pbr)
    return trimesh_instances(read_trimesh(path))


def _is_gltf(path):
    return Path(path).suffix.lower() in _GLTF


def _read_pyvista(path):
    mesh = pv.read(path)
    if not isinstance(mesh, pv.MultiBlock) and not mesh.n_points:
        raise ValueError('it has no points')
    return mesh


def _city_blocks(path):
    meshes, index, matrices = read_city(path)
    placed = zip(index, matrices, strict=True)
    return pv.MultiBlock([meshes[k].transform(pose, inplace=False) for k, pose in placed])
