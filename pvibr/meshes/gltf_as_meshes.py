"""Meshes of glTF files at rest, with the looks of their materials, and their instances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import pyvista as pv

from pvibr.animation.figure import Figure
from pvibr.animation.read_gltf import read_scene
from pvibr.io.gltf_file import GltfError

_ONE = np.eye(4)[None]


@dataclass(frozen=True)
class GltfMesh:
    """The primitives of a glTF mesh, each with keywords of ``add_mesh``."""

    surfaces: tuple[tuple[pv.PolyData, dict], ...]


def gltf_instances(path, pbr=False):
    """Return the meshes of a file, and mesh index and matrix of each instance."""
    figure, copies = read_scene(path, pbr)
    world = figure.world()
    mesh_numbers: dict[tuple, int] = {}
    meshes: list[GltfMesh] = []
    index, matrices = [], []
    for (node, skinned), group in groupby(figure.meshes, lambda m: (m.node, m.skin is not None)):
        # The skin of a mesh replaces the transform of its node.
        poses = _ONE if skinned else world[node] @ copies.get(node, _ONE)
        poses = poses[np.linalg.det(poses[:, :3, :3]) != 0]  # a scale of 0 hides
        if not len(poses):
            continue
        mesh = GltfMesh(tuple((_at_rest(m, figure.skeleton), m.look) for m in group))
        key = tuple(id(dataset) for dataset, _ in mesh.surfaces)
        if key not in mesh_numbers:
            mesh_numbers[key] = len(meshes)
            meshes.append(mesh)
        matrices.append(poses)
        index.append(np.full(len(poses), mesh_numbers[key]))
    if not meshes:
        raise GltfError(f'{path}: no triangle mesh in its scene')
    return meshes, np.concatenate(index), np.concatenate(matrices)


def _at_rest(mesh, skeleton):
    """Return a mesh morphed and skinned at rest, in node space, or world space if skinned.

    Nodes share a mesh without deformation.
    """
    if mesh.skin is not None:
        return Figure([mesh], skeleton).mesh()
    if mesh.morphs is not None and mesh.morphs.weights.any():
        return Figure([replace(mesh, node=-1)]).mesh()
    return mesh.mesh
