"""Cells of neighbouring triangles, with other borders at each level, and blocks of cells."""

from __future__ import annotations

import numpy as np

#: Triangles of a cell: smaller ones cost more of what is locked, larger ones adapt less.
CELL_TRIANGLES = 4096
#: Triangles of a block of cells, about: what one process simplifies at once.
BLOCK_TRIANGLES = 32 * CELL_TRIANGLES
#: Cells relative to the target up to which none is divided.
_LARGEST = 1.4


def is_one_cell(count) -> bool:
    """Return True if so many triangles are not divided."""
    return count <= _LARGEST * CELL_TRIANGLES


def kd_cells(centers, rng) -> list[np.ndarray]:
    """Return the triangles of each cell, from their centres."""
    pending, cells = [np.arange(len(centers), dtype=np.int32)], []
    while pending:
        ids = pending.pop()
        if is_one_cell(len(ids)):
            cells.append(np.sort(ids))
            continue
        part_count = max(2, round(len(ids) / CELL_TRIANGLES))
        _, order, split, _ = _halved(centers[ids], part_count, rng)
        pending += [ids[order[:split]], ids[order[split:]]]
    return cells


def kd_planes(centers, count, rng) -> np.ndarray:
    """Return planes that divide some centres into a number of blocks of equal size, (k, 4)."""
    # A row is an axis, a coordinate, and where to go from there below it and above it: to another
    # row, or to block k where it says -1 - k.
    planes: list[list[float]] = []
    pending: list[tuple] = [(np.arange(len(centers)), count, None)]
    block_count = 0
    while pending:
        ids, part_count, slot = pending.pop()
        if part_count < 2 or len(ids) < 2:
            target, block_count = -1 - block_count, block_count + 1
        else:
            target = len(planes)
            axis, order, split, left_count = _halved(centers[ids], part_count, rng)
            planes.append([axis, centers[ids[order[split]], axis], 0, 0])
            pending.append((ids[order[split:]], part_count - left_count, (target, 3)))
            pending.append((ids[order[:split]], left_count, (target, 2)))
        if slot is not None:
            planes[slot[0]][slot[1]] = target
    return np.array(planes).reshape(-1, 4)


def blocks_of(planes, centers) -> np.ndarray:
    """Return the block of each centre."""
    rows = np.zeros(len(centers), np.int32)
    if not len(planes):
        return rows
    axes, targets = planes[:, 0].astype(int), planes[:, 2:].astype(np.int32)
    pending = np.arange(len(centers))
    while len(pending):
        at = rows[pending]
        is_above = centers[pending, axes[at]] >= planes[at, 1]
        rows[pending] = targets[at, is_above.astype(int)]
        pending = pending[rows[pending] >= 0]
    return -1 - rows


def _halved(centers, part_count, rng):
    """Return the axis, the order and the place of a split, and the parts before it."""
    # Jittered: what is locked at the border of a cell is inside one at the next level.
    axis = int(np.argmax(np.ptp(centers, axis=0) * rng.uniform(0.75, 1.0, 3)))
    left_count = round(part_count * rng.uniform(0.36, 0.64))
    left_count = min(max(left_count, 1), part_count - 1)
    split = len(centers) * left_count // part_count
    return axis, np.argpartition(centers[:, axis], split), split, left_count
