"""The one surface of what a large mesh is made of, with the look of its materials."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv

from pvibr.io.trimesh_meshes import as_dataset, is_trimesh
from pvibr.large.joined_meshes import joined
from pvibr.large.material_atlas import common_look, with_atlas
from pvibr.meshes.materials import merged_look
from pvibr.meshes.mesh_files import has_graph, read_mesh, scene_instances
from pvibr.meshes.surfaces import moved, triangles_of


def given_mesh(mesh, look) -> tuple[pv.DataSet, dict]:
    """Return the dataset of a mesh, a path or a scene, and a look with that of its materials."""
    surfaces = _surfaces(mesh, look.get('pbr'))
    look = {name: value for name, value in look.items() if value is not None}
    opacity = look.pop('opacity', 1.0)
    looks = [merged_look(own, look) for _, own in surfaces]
    if len(surfaces) == 1:
        (dataset, _), own_look = surfaces[0], looks[0]
    elif any(own for _, own in surfaces) and not {'color', 'scalars', 'texture'} & {*look}:
        meshes = [triangles_of(dataset) for dataset, _ in surfaces]
        dataset, own_look = with_atlas(list(zip(meshes, looks, strict=True)))
    else:
        dataset, own_look = joined([dataset for dataset, _ in surfaces]), common_look(looks) | look
    if isinstance(opacity, float | int):  # not of each point
        opacity *= own_look.get('opacity', 1.0)
    return dataset, own_look | {'opacity': opacity}


def _surfaces(mesh, pbr) -> list[tuple[pv.DataSet, dict]]:
    """Return the datasets of a mesh, a path or a scene, where they are, with their own looks."""
    if isinstance(mesh, str | Path) and not has_graph(mesh):
        mesh = read_mesh(mesh)
    if has_graph(mesh):
        return _surfaces_of_scene(mesh, pbr)
    if is_trimesh(mesh, 'Trimesh'):
        return [as_dataset(mesh, pbr)]
    if isinstance(mesh, pv.MultiBlock):
        blocks = mesh.recursive_iterator(skip_none=True, skip_empty=True)
        surfaces: list = [(block, {}) for block in blocks if isinstance(block, pv.DataSet)]
        if not surfaces:
            raise ValueError('mesh must have points, got no block with any')
        return surfaces
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(
            'mesh must be a PyVista dataset, a trimesh mesh or scene, or a path, got '
            f'{type(mesh).__name__}'
        )
    return [(mesh, {})]


def _surfaces_of_scene(scene, pbr) -> list[tuple[pv.DataSet, dict]]:
    meshes, index, matrices = scene_instances(scene, pbr)
    textures: dict = {}
    own = [getattr(m, 'surfaces', None) or [as_dataset(m, pbr, textures)] for m in meshes]
    surfaces = [
        (moved(dataset, matrix), own_look)
        for k, matrix in zip(index, matrices, strict=True)
        for dataset, own_look in own[k]
    ]
    return [(d, own_look) for d, own_look in surfaces if d.GetNumberOfPolys()] or surfaces[:1]
