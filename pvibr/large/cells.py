"""Cells of neighbouring triangles, whose borders differ from level to level."""

from __future__ import annotations

import numpy as np

#: Triangles of a cell: smaller ones cost more of what is locked, larger ones adapt less.
CELL_TRIANGLES = 4096
#: Cells relative to the target up to which none is divided.
_LARGEST = 1.4


def kd_cells(centers, rng, target=CELL_TRIANGLES) -> list[np.ndarray]:
    """Return the triangles of each cell, from their centres."""
    pending, cells = [np.arange(len(centers), dtype=np.int32)], []
    while pending:
        ids = pending.pop()
        if len(ids) <= _LARGEST * target:
            cells.append(ids)
            continue
        # Jittered: what is locked at the border of a cell is inside one at the next level.
        own_centers = centers[ids]
        axis = int(np.argmax(np.ptp(own_centers, axis=0) * rng.uniform(0.75, 1.0, 3)))
        part_count = max(2, round(len(ids) / target))
        left_count = round(part_count * rng.uniform(0.36, 0.64))
        left_count = min(max(left_count, 1), part_count - 1)
        split = len(ids) * left_count // part_count
        order = np.argpartition(own_centers[:, axis], split)
        pending += [ids[order[:split]], ids[order[split:]]]
    return cells
