"""The limit on GPU memory for images of meshes."""

from __future__ import annotations

import os
import weakref

LIMIT_MIB = 2048
_SMALLEST_TILE = 16  # texels, of which images serve at all
_held: weakref.WeakValueDictionary = weakref.WeakValueDictionary()


def limit() -> float:
    """Return the limit in bytes for all sets: ``PVIBR_GPU_MEMORY`` in MiB, or the default."""
    given = os.environ.get('PVIBR_GPU_MEMORY') or LIMIT_MIB
    try:
        mib = float(given)
    except ValueError:
        mib = -1.0
    if not mib >= 0:
        msg = f'PVIBR_GPU_MEMORY is {given!r}; it must be a number of MiB, at least 0'
        raise ValueError(msg)
    return mib * 2**20


def hold(atlas):
    """Count an atlas for as long as it is in use."""
    _held[id(atlas)] = atlas


def room(share=None) -> float:
    """Return the bytes left for one more atlas, of a share of a set at most."""
    left = limit() - sum(atlas.nbytes for atlas in _held.values())
    return max(left if share is None else min(left, share), 0.0)


def checked_share(mib, meshes) -> float | None:
    """Return the bytes of each mesh of a set that has a limit of its own in MiB."""
    if mib is None:
        return None
    if not isinstance(mib, int | float) or not mib >= 0:
        msg = f'gpu_memory is {mib!r}; it must be None or a number of MiB, at least 0'
        raise ValueError(msg)
    return mib * 2**20 / max(meshes, 1)


def fitting_tile(views, tile, left) -> int:
    """Return the largest tile whose atlas fits, 0 if none is large enough to serve."""
    while tile >= _SMALLEST_TILE and (views * tile) ** 2 * 12 > left:  # two images, mip levels
        tile //= 2
    return tile if tile >= _SMALLEST_TILE else 0
