"""Bakes as files that another process reads; their results go through the cache."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.files import replacing
from pvibr.instances.cache import AtlasCache, pack, unpack
from pvibr.instances.levels import BakePlan, atlas_key, content_key
from pvibr.meshes import stored_parts

_GRID = 'views', 'tile', 'half'


def write_job(plan: BakePlan, path: Path):
    """Write a bake to a file."""
    arrays, parts = stored_parts.to_arrays(plan.parts)
    cache = plan.cache and str(plan.cache.path)
    meta = {'parts': parts, 'key': plan.key, 'cache': cache, **plan.grid}
    with replacing(path) as part, part.open('wb') as stream:
        stream.writelines(pack(arrays, meta))


def do_job(path: Path, progress) -> Path:
    """Bake what a file asks for; return the folder of the cache with the result."""
    job = unpack(np.fromfile(path, np.uint8))
    grid = {name: job.meta[name] for name in _GRID}
    parts = stored_parts.from_arrays(job, job.meta['parts'])
    if atlas_key(content_key(parts), *grid.values()) != job.meta['key']:
        raise ValueError('its mesh or material has changed, or cannot be stored')
    spare_cache = AtlasCache(path.parent)
    folder = job.meta['cache']
    caches = [AtlasCache(str(folder)), spare_cache] if folder else [spare_cache]
    model = BakePlan(parts, grid, caches[0], job.meta['key']).bake(progress)
    if model.why_unbaked:
        raise ValueError(model.why_unbaked)
    for cache in caches:
        if job.meta['key'] in cache or cache.put(job.meta['key'], model.to_arrays()):
            return cache.path
    raise OSError(f'neither {caches[0].path} nor {spare_cache.path} can be written')
