"""Hierarchies in the cache, and in files of their own."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core.arguments import naming
from pvibr.core.errors import PvibrError
from pvibr.core.files import existing
from pvibr.core.progress import baking
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.large.build import build_hierarchy
from pvibr.large.checked_file import open_checked
from pvibr.large.hierarchy import Hierarchy
from pvibr.large.sources import Source
from pvibr.large.workers import worker_count

SUFFIX = '.pvl'
#: Raise it whenever another hierarchy is built of the same mesh.
VERSION = 2
_KIND = 'large mesh'
_SCALARS = 'scalars:'
# What reading raises where a file holds other than it should, checksum or not.
_WRONG = (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError)


def cache_of(cache) -> AtlasCache | None:
    """Return the cache that an argument asks for: True, False or a folder."""
    if cache is False:
        return None
    with naming('cache', cache):
        return AtlasCache(None if cache is True else cache)


def hierarchy_key(mesh) -> str:
    """Return the key of the hierarchy of a mesh: a digest of its content."""
    normals = np.zeros(0) if mesh.normals is None else mesh.normals
    return key_of(_KIND, VERSION, mesh.points, mesh.faces, mesh.mesh_cells, normals)


def built(mesh, cache, progress=None) -> Hierarchy:
    """Return the hierarchy of a mesh, from the cache if it is there."""
    with baking(progress, 'Building the hierarchy of a large mesh') as advance:
        if cache is None:
            return build_hierarchy(mesh, advance, worker_count(None))
        key = hierarchy_key(mesh)
        found = cache.load(key, Hierarchy.of_arrays)
        if found is not None:
            return found
        with cache.locked(key):
            found = cache.load(key, Hierarchy.of_arrays)
            if found is None:
                found = build_hierarchy(mesh, advance, worker_count(None))
                cache.put(key, found.to_arrays())
        return found


def arrays_of(source) -> dict[str, Any]:
    """Return the arrays of a source by their names in a file."""
    arrays = {_SCALARS + name: values for name, values in source.arrays.items()}
    return arrays if source.points is None else arrays | {'source_points': source.points}


def meta_of(source) -> dict[str, Any]:
    """Return what a file says of a source."""
    return {
        'kind': _KIND,
        'version': VERSION,
        'active': source.active,
        'of_cells': list(source.of_cells),
        'point_count': source.point_count,
    }


def load(path) -> tuple[Hierarchy, Source]:
    """Return what a file holds, mapped into memory, once its checksums were verified."""
    path = existing(path, f'{SUFFIX} file')
    try:
        entry = open_checked(path)
        if entry.meta.get('kind') != _KIND or entry.meta.get('version') != VERSION:
            raise ValueError('it is not a large mesh of this version of pvibr')
        hierarchy = Hierarchy.of_arrays(entry)
        source = _stored_source(entry)
        _check(source, len(hierarchy.vertex_of_point))
    except _WRONG as error:
        reason = error if isinstance(error, ValueError) else f'its content is wrong ({error!r})'
        raise PvibrError(f'cannot open {str(path)!r}: {reason}; build it again') from error
    return hierarchy, source


def _check(source, count):
    """Raise a ValueError unless the arrays of a source are of so many points."""
    points = np.arange(count) if source.points is None else source.points
    by_point = [*source.arrays.values(), points]
    is_whole = (
        all(len(values) == count for values in by_point)
        and points.dtype.kind == 'i'
        and 0 <= points.min() <= points.max() < source.point_count
        and source.active in (None, *source.arrays, *source.of_cells)
    )
    if not is_whole:
        raise ValueError('its arrays do not belong together')


def _stored_source(entry) -> Source:
    meta: dict[str, Any] = entry.meta
    arrays = {
        name.removeprefix(_SCALARS): values
        for name, values in entry.items()
        if name.startswith(_SCALARS)
    }
    of_cells, point_count = tuple(meta['of_cells']), int(meta['point_count'])
    return Source(None, arrays, meta['active'], of_cells, point_count, entry.get('source_points'))
