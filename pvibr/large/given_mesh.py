"""The one surface of what a large mesh is made of, with the look of its material."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv

from pvibr.io.trimesh_meshes import as_dataset, is_trimesh
from pvibr.meshes.materials import merged_look
from pvibr.meshes.mesh_files import has_graph, read_mesh, scene_instances
from pvibr.meshes.surfaces import moved

_REMEDY = (
    'pass one of its meshes, or merge them first, as mesh.combine() or trimesh.util.concatenate'
)


def given_mesh(mesh, look) -> tuple[pv.DataSet, dict]:
    """Return the dataset of a mesh, a path or a scene, and a look with that of its material."""
    if isinstance(mesh, str | Path) and not has_graph(mesh):
        mesh = read_mesh(mesh)
    if has_graph(mesh):
        mesh, own_look = _only_surface(mesh, look.get('pbr'))
    elif is_trimesh(mesh, 'Trimesh'):
        mesh, own_look = as_dataset(mesh, look.get('pbr'))
    else:
        own_look = {}
    if isinstance(mesh, pv.MultiBlock):
        raise TypeError(f'mesh must be one mesh, got {len(mesh)} blocks: {_REMEDY}')
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(
            f'mesh must be a PyVista dataset, a trimesh mesh or a path, got {type(mesh).__name__}'
        )
    return mesh, merged_look(own_look, {k: v for k, v in look.items() if v is not None})


def _only_surface(scene, pbr) -> tuple[pv.DataSet, dict]:
    """Return the surface of a scene that has one, where it is, and the look of its material."""
    meshes, index, matrices = scene_instances(scene, pbr)
    surfaces = [
        (*surface, matrix)
        for k, matrix in zip(index, matrices, strict=True)
        for surface in getattr(meshes[k], 'surfaces', None) or [as_dataset(meshes[k], pbr)]
    ]
    if len(surfaces) != 1:
        raise TypeError(
            f'mesh must be one mesh with one material, got a scene of {len(surfaces)}: add each, '
            'as in: for part in trimesh.load_scene(path).dump(): pl.ibr.add_large_mesh(part)'
        )
    dataset, own_look, matrix = surfaces[0]
    return moved(dataset, matrix), own_look
