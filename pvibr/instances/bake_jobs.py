"""Bakes as files that another process reads; their results go through the cache."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np

from pvibr.instances import stored_levels
from pvibr.instances.cache import AtlasCache, pack, unpack, write_whole
from pvibr.instances.levels import BakePlan, atlas_key, content_key
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.meshes import stored_parts

_GRID = 'views', 'tile', 'half'
_LEVELS_FILE = 'levels'  # beside a job's file


def write_job(plan: BakePlan, path: Path):
    """Write a bake to a file."""
    write_whole(path, packed_job(plan))


def packed_job(plan: BakePlan) -> list[bytes | memoryview]:
    """Return a bake as the chunks of a file."""
    arrays, parts = stored_parts.to_arrays(plan.parts)
    cache = plan.cache and str(plan.cache.path)
    return pack(arrays, {'parts': parts, 'key': plan.key, 'cache': cache, **plan.grid})


def do_job(path: Path, progress, on_levels=None) -> Path:
    """Bake what a file asks for; return the folder of the cache with the result."""
    # `on_levels` is called with the file of the lighter meshes as soon as these are there.
    job = unpack(np.fromfile(path, np.uint8))
    key = str(job.meta['key'])

    def keep_levels(levels):
        levels_path = path.with_name(_LEVELS_FILE)
        with contextlib.suppress(OSError):  # drafts do without
            write_whole(levels_path, pack(stored_levels.to_arrays(levels), {}))
            on_levels(levels_path)

    grid = {name: job.meta[name] for name in _GRID}
    parts = stored_parts.from_arrays(job, job.meta['parts'])
    if atlas_key(content_key(parts), *grid.values()) != key:
        raise ValueError('its mesh or material has changed, or cannot be stored')
    spare_cache = AtlasCache(path.parent)
    folder = job.meta['cache']
    caches = [AtlasCache(str(folder)), spare_cache] if folder else [spare_cache]
    model = BakePlan(parts, grid, caches[0], key).bake(progress, on_levels and keep_levels)
    if model.why_unbaked:
        raise ValueError(model.why_unbaked)
    for cache in caches:
        if key in cache or cache.put(key, model.to_arrays()):
            return cache.path
    raise OSError(f'neither {caches[0].path} nor {spare_cache.path} can be written')


def read_levels(path: Path, parts) -> list[MeshLevel] | None:
    """Return the levels of a mesh from the file of a job, None if it cannot be read."""
    try:
        return stored_levels.from_arrays(parts, unpack(np.fromfile(path, np.uint8)))
    except (OSError, ValueError, KeyError):
        return None
