"""Hierarchies in the cache, and in files of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pvibr.core.arguments import naming
from pvibr.core.errors import PvibrError
from pvibr.core.files import existing, naming_file
from pvibr.core.progress import baking
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.large.build import build_hierarchy
from pvibr.large.checked_file import map_arrays, open_checked
from pvibr.large.given_mesh import given_mesh
from pvibr.large.hierarchy import Hierarchy
from pvibr.large.sources import Source, source_of
from pvibr.large.workers import worker_count
from pvibr.meshes.materials import merged_look

SUFFIX = '.pvl'
#: Raise it whenever another hierarchy is built of the same mesh.
VERSION = 6
_KIND = 'large mesh'
#: Prefixes of the names of arrays of points and of cells.
_SCALARS, _OF_CELLS = 'scalars:', 'cells:'
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
    optional = mesh.normals, mesh.texture_coordinates, mesh.edge_flags
    extras = [np.zeros(0) if array is None else array for array in optional]
    return key_of(_KIND, VERSION, mesh.points, mesh.faces, mesh.mesh_cells, *extras)


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
    arrays |= {_OF_CELLS + name: values for name, values in source.cell_arrays.items()}
    optional = {'source_points': source.points, 'image': source.image}
    return arrays | {name: values for name, values in optional.items() if values is not None}


def meta_of(source) -> dict[str, Any]:
    """Return what a file says of a source."""
    return {
        'kind': _KIND,
        'version': VERSION,
        'active': source.active,
        'cell_count': source.cell_count,
        'point_count': source.point_count,
    }


def opened(mesh, look) -> tuple[Hierarchy | None, Source, dict[str, Any]]:
    """Return the hierarchy of a mesh if it is a file of one; its triangles, and its look."""
    if isinstance(mesh, str | Path) and Path(mesh).suffix.lower() == SUFFIX:
        hierarchy, source = load(mesh)
        given = {name: value for name, value in look.items() if value is not None}
        return hierarchy, source, merged_look(source.look(), given)
    with naming_file(mesh):
        dataset, look = given_mesh(mesh, look)
        return None, source_of(dataset), look


def load(path) -> tuple[Hierarchy, Source]:
    """Return what a file holds, mapped into memory, once its checksums were verified."""
    path = existing(path, f'{SUFFIX} file')
    try:
        entry = open_checked(path)
        if entry.meta.get('kind') != _KIND or entry.meta.get('version') != VERSION:
            raise ValueError('it is not a large mesh of this version of pvibr')
        _check(_stored_source(entry), Hierarchy.of_arrays(entry))
        # Anew: what was looked at to be checked does not stay in memory.
        entry = map_arrays(path)
    except _WRONG as error:
        reason = error if isinstance(error, ValueError) else f'its content is wrong ({error!r})'
        raise PvibrError(f'cannot open {str(path)!r}: {reason}; build it again') from error
    return Hierarchy.of_checked(entry), _stored_source(entry)


def _check(source, hierarchy):
    """Raise a ValueError unless the arrays of a source are of the mesh of a hierarchy."""
    count, cells = len(hierarchy.vertex_of_point), hierarchy.mesh_cells
    is_whole = (
        all(len(values) == count for values in source.arrays.values())
        and _are_numbers_of(source.points, source.point_count, count)
        and all(len(values) == source.cell_count for values in source.cell_arrays.values())
        and 0 <= cells.min() <= cells.max() < source.cell_count
        and source.active in (None, *source.arrays, *source.cell_arrays)
        and _is_image(source.image)
    )
    if not is_whole:
        raise ValueError('its arrays do not belong together')


def _is_image(image) -> bool:
    """Return True for an image, or None."""
    return image is None or (image.dtype == np.uint8 and image.shape[2:] in ((3,), (4,)))


def _are_numbers_of(points, point_count, count) -> bool:
    """Return True if these are numbers of the user's points, None for all of them."""
    if points is None:
        return point_count == count
    is_kind = len(points) == count and points.dtype.kind == 'i'
    return is_kind and 0 <= points.min() <= points.max() < point_count


def _stored_source(entry) -> Source:
    meta: dict[str, Any] = entry.meta
    counts = int(meta['cell_count']), int(meta['point_count'])
    return Source(
        None,
        _arrays(entry, _SCALARS),
        meta['active'],
        _arrays(entry, _OF_CELLS),
        *counts,
        entry.get('source_points'),
        entry.get('image'),
    )


def _arrays(entry, prefix) -> dict[str, np.ndarray]:
    """Return the arrays whose names begin with a prefix, without it."""
    names = [name for name in entry if name.startswith(prefix)]
    return {name.removeprefix(prefix): entry[name] for name in names}
