"""The limit on GPU memory for images of meshes."""

from __future__ import annotations

import os
import weakref

LIMIT_MIB = 2048
_MOST_MIB = 2**40  # more than any GPU has, and no float overflows
_SMALLEST_TILE = 16  # texels of the smallest useful images
_held: weakref.WeakValueDictionary = weakref.WeakValueDictionary()


def limit_bytes() -> float:
    """Return the limit for all sets in bytes: ``PVIBR_GPU_MEMORY`` in MiB, or the default."""
    setting = os.environ.get('PVIBR_GPU_MEMORY') or LIMIT_MIB
    try:
        mib = float(setting)
    except ValueError:
        mib = -1.0
    if not mib >= 0:
        raise ValueError(f'PVIBR_GPU_MEMORY must be a number of MiB, at least 0, got {setting!r}')
    return mib * 2**20


def hold(atlas):
    """Count an atlas for as long as it is in use."""
    _held[id(atlas)] = atlas


def available_bytes(share=None) -> float:
    """Return the bytes available for one more atlas, at most `share`."""
    free_bytes = limit_bytes() - sum(atlas.nbytes for atlas in _held.values())
    return max(free_bytes if share is None else min(free_bytes, share), 0.0)


def checked_share(mib, meshes) -> float | None:
    """Return the bytes for each mesh of a set with its own limit in MiB."""
    if mib is None:
        return None
    if not isinstance(mib, int | float) or not mib >= 0:
        raise ValueError(
            f'gpu_memory must be None or a number of MiB, at least 0, got {mib!r:.80}'
        )
    return min(mib, _MOST_MIB) * 2**20 / max(meshes, 1)


def tiles(largest):
    """Yield the largest size of tiles and its halves down to the smallest useful one."""
    while largest >= _SMALLEST_TILE:
        yield largest
        largest //= 2


def bytes_of(views, tile) -> int:
    """Return the GPU memory of an atlas in bytes: two images with mip levels."""
    return (views * tile) ** 2 * 12
