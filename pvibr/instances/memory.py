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
        raise ValueError(f'PVIBR_GPU_MEMORY is {given!r}; it must be a number of MiB, at least 0')
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
        raise ValueError(f'gpu_memory is {mib!r}; it must be None or a number of MiB, at least 0')
    return mib * 2**20 / max(meshes, 1)


def tiles(largest):
    """Yield the largest size of tiles and its halves, as long as images of them serve."""
    while largest >= _SMALLEST_TILE:
        yield largest
        largest //= 2


def bytes_of(views, tile) -> int:
    """Return the bytes of an atlas on the GPU: two images with mip levels."""
    return (views * tile) ** 2 * 12
