"""Tight bounds of a shape at many poses."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.instances.support import support, table_of

_AT_ONCE = 16_384  # products per batch, which stay in the processor's cache
_MOST = 250_000  # products for one side of the box
_ROUNDING = 1e-12  # of a pose's rotation
_SIDE = 65  # of the support table: it adds less than a thousandth of a ball's radius


class PosedShape:
    """A convex shape, in model units, whose bounds at many poses are queried repeatedly.

    Bounding spheres and the support function rule out most poses; the corners decide on the rest.
    """

    def __init__(self, corners, center):
        corners = np.asarray(corners, float)
        self._ends = corners.min(0), corners.max(0)
        self._corners = np.ascontiguousarray((corners - center).T)

    def bounds(self, poses, ids, spheres) -> np.ndarray:
        """Return the bounds (2, 3) of the shape at poses `ids`, (n, 3) points or (n, 4, 4).

        `spheres`, centres (3, m) and radii (m,), hold the posed shape; bounds may exceed by 0.1 %.
        """
        if poses.ndim == 2:
            points, (low, high) = np.ascontiguousarray(poses.take(ids, 0).T), self._ends
            return np.stack([low + points.min(1), high + points.max(1)])
        centers, radii = spheres
        matrix_numbers = poses.ravel()
        row_starts = np.multiply(ids, 16, dtype=np.intp) + np.arange(3)[:, None]
        bounds = np.empty((2, 3))
        for axis in range(3):
            for side, sign in enumerate((-1.0, 1.0)):
                rows = sign, matrix_numbers, row_starts + 4 * axis
                bounds[side, axis] = sign * self._highest(rows, sign * centers[axis], radii)
        return bounds

    @cached_property
    def _support(self) -> np.ndarray:
        return table_of(self._corners.T, _SIDE)

    def _highest(self, source, heights, radii):
        """Return the highest of ``along + row . corner``, where no product is above its radius."""
        sign, numbers, row_index = source  # where the rows are among the numbers of all matrices
        bounds = heights + radii
        farthest = bounds.argmax(keepdims=True)
        best = self._reach(sign * numbers[row_index[:, farthest]], heights[farthest])
        rest = np.flatnonzero(bounds > best)
        if not len(rest):
            return best
        rows = sign * numbers.take(row_index.take(rest, 1))
        heights = heights[rest]
        if len(rest) * self._corners.shape[1] <= _AT_ONCE:
            return max(best, self._reach(rows, heights))
        if np.ptp(rows, axis=1).max() <= _ROUNDING * np.abs(rows[:, 0]).max():
            # Rotated about this axis alone, or all equal.
            return self._reach(rows[:, :1], heights.max(keepdims=True))
        bounds = heights + support(self._support, rows.T)
        farthest = bounds.argmax(keepdims=True)
        best = max(best, self._reach(rows[:, farthest], heights[farthest]))
        rest = np.flatnonzero(bounds > best)
        rest = rest[np.argsort(-bounds[rest])]
        return self._highest_of(rows[:, rest], heights[rest], bounds[rest], best)

    def _highest_of(self, rows, heights, bounds, best):
        """Return the highest of poses sorted by upper bounds, or the best if none is higher."""
        corner_count = self._corners.shape[1]
        batch_size = max(1, _AT_ONCE // corner_count)
        for start in range(0, len(heights), batch_size):
            if bounds[start] <= best:
                break
            if start * corner_count > _MOST:
                return bounds[start]
            batch = slice(start, start + batch_size)
            best = max(best, self._reach(rows[:, batch], heights[batch]))
        return best

    def _reach(self, rows, heights):
        """Return how far the farthest of some poses reaches, by rows of matrices, (3, n)."""
        # Not by a matrix product: BLAS's threads would spin while they wait.
        products = np.einsum('ji,jk->ik', rows, self._corners)
        return (heights + products.max(1)).max()
