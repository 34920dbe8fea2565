"""Equal rows of three numbers of 32 bits, such as points and wedges."""

from __future__ import annotations

import numpy as np

#: Odd factors by which the bits of rows are mixed.
_HASH = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


def as_drawn(numbers) -> np.ndarray:
    """Return numbers in single precision, without negative zeros."""
    return np.ascontiguousarray(numbers, np.float32) + np.float32(0.0)


def row_hashes(rows) -> np.ndarray:
    """Return hashes of rows, (n, 3) uint32, by which equal ones are found."""
    return rows.astype(np.uint64) @ _HASH


def merged_rows(rows) -> tuple[np.ndarray, np.ndarray]:
    """Return the first of equal rows, (n, 3) uint32, and the place of each row among these."""
    _, first, groups = np.unique(row_hashes(rows), return_index=True, return_inverse=True)
    if not np.array_equal(rows, rows[first[groups]]):  # hashes met
        _, first, groups = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, groups.ravel()
