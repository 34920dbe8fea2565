"""Checked arguments of instances: meshes, poses and indices."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.params import checked_flag
from pvibr.io.trimesh_meshes import is_trimesh
from pvibr.maths.transforms import trs
from pvibr.meshes.glyphs import Glyphs
from pvibr.meshes.mesh_files import scene_instances
from pvibr.meshes.parts import are_parts
from pvibr.meshes.posed import Source, array_names, posed_source, source_of
from pvibr.meshes.poses import as_poses
from pvibr.things.appearance import TABLE_OPTIONS
from pvibr.things.keywords import OF_MESH_SCALARS


def placed(mesh, poses, index, phase, scalars, **options) -> tuple:
    """Return meshes, checked poses, index and scalars; `plain` ignores the scalars of glyphs."""
    meshes, poses, index, scalars = _placed(mesh, poses, index, scalars, **options)
    if phase is not None:
        index = index_of_phase(repeated('phase', phase, len(poses)), len(meshes))
    return meshes, poses, checked_index(index, len(poses), len(meshes)), scalars


def _placed(mesh, poses, index, scalars, nan_rows, pbr=False, plain=False, **placing) -> tuple:
    if isinstance(mesh, Glyphs) and poses is None:
        shown_scalars = mesh.scalars if scalars is None and not plain else scalars
        source = Source(as_poses(mesh.poses, nan_rows), mesh.arrays)
        return mesh.meshes, source.poses, mesh.index, _scalars_of(source, shown_scalars)
    meshes, poses, index = _meshes_and_poses(mesh, poses, index, pbr)
    names = array_names(poses, placing.get('orient'), placing.get('scale'), scalars)
    source = source_of(poses, *names, nan_rows=nan_rows)
    poses = posed_source(source, nan_rows=nan_rows, **placing)
    return meshes, poses, index, _scalars_of(source, scalars)


def _scalars_of(source, scalars):
    """Return scalars, or the array of the points that they name."""
    is_array_name = isinstance(scalars, str) and scalars in (source.arrays or {})
    return source.scalars(scalars) if is_array_name else scalars


def _meshes_and_poses(mesh, poses, index, pbr=False):
    """Return meshes, poses and index; poses default to those of the scene graph."""
    if poses is None:
        if is_trimesh(mesh, 'Scene') or isinstance(mesh, str | Path):
            meshes, index, matrices = scene_instances(mesh, pbr)
            return meshes, matrices, index
        raise TypeError('poses must be (n, 3) points or (n, 4, 4) matrices, got None')
    several = isinstance(mesh, list | tuple) and not are_parts(mesh)
    return (list(mesh) if several else [mesh]), poses, index


def checked_index(index, n_instances, n_meshes):
    """Return the mesh of each instance, in turn by default."""
    if index is None:
        return np.arange(n_instances) % max(n_meshes, 1)
    index = as_array('index', index)
    if index.shape != (n_instances,) or index.dtype.kind not in 'iu':
        raise ValueError(
            f'index must be ({n_instances},) integers, got shape {index.shape}, {index.dtype}'
        )
    invalid = np.flatnonzero((index < 0) | (index >= n_meshes))
    if len(invalid):
        first = invalid[0]
        raise ValueError(f'index[{first}] must be 0 to {n_meshes - 1}, got {index[first]}')
    return index


def index_of_phase(phase, n_meshes):
    """Return the mesh at each phase, modulo 1."""
    phase = as_array('phase', phase)
    if phase.dtype.kind not in 'fiu' or not np.isfinite(phase).all():
        raise ValueError(f'phase must be finite numbers, got {phase!r:.80}')
    if phase.ndim > 1:
        raise ValueError(f'phase must be one number or one per instance, got shape {phase.shape}')
    return np.minimum((phase % 1.0 * n_meshes).astype(int), n_meshes - 1)


def index_for(n_instances, previous, n_meshes):
    """Return the mesh of each of `n_instances`, as before if that is well defined."""
    if n_instances == len(previous):
        return previous
    if n_meshes == 1:
        return np.zeros(n_instances, int)
    if np.array_equal(previous, np.arange(len(previous)) % n_meshes):
        return np.arange(n_instances) % n_meshes
    raise ValueError(
        f'index must have {n_instances} values, one per pose, got {len(previous)}; give both: '
        'update(poses=..., index=...)'
    )


def repeated(name, values, n_instances):
    """Return one value per instance; a single one is repeated."""
    values = as_array(name, values)
    per_instance = values[None] if values.ndim == 0 else values
    if len(per_instance) not in (1, n_instances):
        raise ValueError(
            f'{name} must be one value or {n_instances}, one per instance, got {len(per_instance)}'
        )
    return np.broadcast_to(per_instance, (n_instances, *per_instance.shape[1:]))


def same_kind(poses, new_poses):
    """Return both sets of poses as matrices unless they are of one kind."""
    if poses.ndim == new_poses.ndim:
        return poses, new_poses
    return tuple(trs(a) if a.ndim == 2 else a for a in (poses, new_poses))


def checked_cache(cache):
    """Return a flag or the path of a folder."""
    if isinstance(cache, str | os.PathLike) and cache != '':
        return cache
    return checked_flag('cache', cache)


def mesh_looks(scalars, mesh_options) -> dict:
    """Return the ``add_mesh`` keywords of the mesh beside the scalars of instances, or a name."""
    if scalars is None or isinstance(scalars, str):
        return {'scalars': scalars, **mesh_options}
    for name in OF_MESH_SCALARS.keys() & mesh_options.keys():
        reason = OF_MESH_SCALARS[name]
        raise ValueError(
            f'{name} must be left out with scalars per instance; it is for scalars of a '
            f'mesh: {reason}'
        )
    return {k: v for k, v in mesh_options.items() if k not in TABLE_OPTIONS}
