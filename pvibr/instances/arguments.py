"""Checked arguments of instances: meshes, poses and indices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.formats.trimesh_meshes import is_trimesh
from pvibr.meshes.files import scene_instances
from pvibr.meshes.parts import are_parts
from pvibr.meshes.pose_files import read_poses_and


def poses_and_scalars(poses, scalars):
    """Return poses and scalars, read from a file if `poses` names one."""
    if not isinstance(poses, str | Path):
        return poses, scalars
    poses, values = read_poses_and(poses, scalars if isinstance(scalars, str) else None)
    if values is None:
        return poses, scalars
    if values.dtype.kind != 'f':
        msg = f'scalars is {scalars!r}, a column of text; name one of numbers'
        raise ValueError(msg)
    return poses, values


def meshes_and_poses(mesh, poses, index, pbr=False):
    """Return a list of meshes, poses and index; without poses, those of the scene graph."""
    if poses is None:
        if is_trimesh(mesh, 'Scene') or isinstance(mesh, str | Path):
            meshes, index, matrices = scene_instances(mesh, pbr)
            return meshes, matrices, index
        msg = 'poses is missing: give (n, 3) points or (n, 4, 4) matrices'
        raise TypeError(msg)
    several = isinstance(mesh, list | tuple) and not are_parts(mesh)
    return (list(mesh) if several else [mesh]), poses, index


def checked_index(index, n, meshes):
    """Return the mesh of each instance, in turn by default."""
    if index is None:
        return np.arange(n) % meshes if meshes > 1 else np.zeros(n, int)
    index = np.asarray(index)
    if index.shape != (n,) or index.dtype.kind not in 'iu':
        msg = f'index has shape {index.shape}, dtype {index.dtype}; it must be ({n},) integers'
        raise ValueError(msg)
    wrong = np.flatnonzero((index < 0) | (index >= meshes))
    if len(wrong):
        i = wrong[0]
        msg = f'index[{i}] is {index[i]}; there are {meshes} meshes: it must be 0 to {meshes - 1}'
        raise ValueError(msg)
    return index


def checked_blend(blend):
    """Return how colours of instances combine with those of the mesh."""
    if blend not in ('replace', 'multiply'):
        msg = f"blend is {blend!r}; it must be 'replace' or 'multiply'"
        raise ValueError(msg)
    return blend


def checked_views(views):
    """Return True if a mesh is baked from the upper hemisphere only."""
    if views not in ('full', 'half'):
        msg = f"views is {views!r}; it must be 'full' or 'half'"
        raise ValueError(msg)
    return views == 'half'
