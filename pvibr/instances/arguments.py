"""Checked arguments of instances: meshes, poses and indices."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pvibr.core.params import checked_flag
from pvibr.formats.trimesh_meshes import is_trimesh
from pvibr.maths.arguments import as_array
from pvibr.maths.transforms import trs
from pvibr.meshes.files import scene_instances
from pvibr.meshes.glyphs import Glyphs
from pvibr.meshes.parts import are_parts
from pvibr.meshes.posed import Source, names_in, posed_source, source_of
from pvibr.meshes.poses import as_poses


@dataclass(frozen=True)
class Placed:
    """What is placed where: meshes, poses, the mesh of each, and scalars."""

    meshes: list
    poses: np.ndarray
    index: np.ndarray | None
    scalars: object


def placed(mesh, poses, index, scalars, pbr=False, plain=False, **how) -> Placed:
    """Return meshes, checked poses, index and scalars; plain ones have colours of their own."""
    if isinstance(mesh, Glyphs) and poses is None:
        shown = mesh.scalars if scalars is None and not plain else scalars
        source = Source(as_poses(mesh.poses), mesh.arrays)
        return Placed(mesh.meshes, source.poses, mesh.index, _scalars_of(source, shown))
    meshes, poses, index = _meshes_and_poses(mesh, poses, index, pbr)
    names = [n for n in (scalars, how.get('orient'), how.get('scale')) if isinstance(n, str)]
    source = source_of(poses, *names, *names_in(how.get('orient')))
    return Placed(meshes, posed_source(source, **how), index, _scalars_of(source, scalars))


def _scalars_of(source, scalars):
    """Return scalars, those of the points if they name an array of these."""
    named = isinstance(scalars, str) and scalars in (source.arrays or {})
    return source.scalars(scalars) if named else scalars


def _meshes_and_poses(mesh, poses, index, pbr=False):
    """Return a list of meshes, poses and index; without poses, those of the scene graph."""
    if poses is None:
        if is_trimesh(mesh, 'Scene') or isinstance(mesh, str | Path):
            meshes, index, matrices = scene_instances(mesh, pbr)
            return meshes, matrices, index
        raise TypeError('poses is missing: give (n, 3) points or (n, 4, 4) matrices')
    several = isinstance(mesh, list | tuple) and not are_parts(mesh)
    return (list(mesh) if several else [mesh]), poses, index


def checked_index(index, n, meshes):
    """Return the mesh of each instance, in turn by default."""
    if index is None:
        return np.arange(n) % meshes if meshes > 1 else np.zeros(n, int)
    index = as_array('index', index)
    if index.shape != (n,) or index.dtype.kind not in 'iu':
        raise ValueError(
            f'index has shape {index.shape}, dtype {index.dtype}; it must be ({n},) integers'
        )
    wrong = np.flatnonzero((index < 0) | (index >= meshes))
    if len(wrong):
        i = wrong[0]
        raise ValueError(
            f'index[{i}] is {index[i]}; there are {meshes} meshes: it must be 0 to {meshes - 1}'
        )
    return index


def index_of_phase(phase, meshes):
    """Return the meshes that phases, modulo 1, show."""
    phase = as_array('phase', phase)
    if phase.dtype.kind not in 'fiu' or not np.isfinite(phase).all():
        raise ValueError(f'phase has dtype {phase.dtype}; it must be finite numbers')
    if phase.ndim > 1:
        raise ValueError(f'phase has shape {phase.shape}; it must be a number, or one for each')
    return np.minimum((phase % 1.0 * meshes).astype(int), meshes - 1)


def index_for(count, before, meshes):
    """Return the meshes of so many instances that show what they did before."""
    if count == len(before):
        return before
    if meshes == 1:
        return np.zeros(count, int)
    if np.array_equal(before, np.arange(len(before)) % meshes):
        return np.arange(count) % meshes
    raise ValueError(
        f'poses has {count} rows, index has {len(before)}: give both, '
        'as in update(poses=..., index=...)'
    )


def checked_ids(ids, count):
    """Return the indices of some of so many instances."""
    if isinstance(ids, slice):
        return np.arange(*ids.indices(count))
    ids = np.atleast_1d(np.asarray(ids))
    if ids.dtype == bool and ids.shape == (count,):
        return np.flatnonzero(ids)
    if ids.size == 0:
        return np.zeros(0, int)
    if ids.ndim != 1 or ids.dtype.kind not in 'iu':
        raise IndexError(f'ids has shape {ids.shape}, dtype {ids.dtype}; it must be (k,) integers')
    wrong = ids[(ids < -count) | (ids >= count)]
    if len(wrong):
        raise IndexError(f'ids has {wrong[0]}; there are {count} instances')
    return ids % count


def repeated(name, values, count):
    """Return one value for each of so many instances; a single one is that of all."""
    values = as_array(name, values)
    rows = values[None] if values.ndim == 0 else values
    if len(rows) not in (1, count):
        raise ValueError(
            f'{name} has {len(rows)} rows; it must be one, or one for each of {count} instances'
        )
    return np.broadcast_to(rows, (count, *rows.shape[1:]))


def same_kind(poses, others):
    """Return points and matrices both as matrices, two of a kind as they are."""
    if poses.ndim == others.ndim:
        return poses, others
    return tuple(trs(a) if a.ndim == 2 else a for a in (poses, others))


def checked_blend(blend):
    """Return how colours of instances combine with those of the mesh."""
    if not isinstance(blend, str) or blend not in ('replace', 'multiply'):
        raise ValueError(f"blend is {blend!r}; it must be 'replace' or 'multiply'")
    return blend


def checked_cache(cache):
    """Return a flag, or the path of a folder."""
    if isinstance(cache, str | os.PathLike) and cache != '':
        return cache
    return checked_flag('cache', cache)


def checked_views(views):
    """Return True if a mesh is baked from the upper hemisphere only."""
    if not isinstance(views, str) or views not in ('full', 'half'):
        raise ValueError(f"views is {views!r}; it must be 'full' or 'half'")
    return views == 'half'
