"""Tight bounds of a shape at many poses."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.maths.support import support, table_of

_AT_ONCE = 16_384  # products of rows and corners, which stay in the processor's cache
_MOST = 250_000  # products for one side of the box
_ROUNDING = 1e-12  # of what turns a pose
_SIDE = 65  # of the support table: what it adds is below a thousandth of a ball's radius


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
        places, radii = spheres
        numbers = poses.ravel()
        first = np.multiply(ids, 16, dtype=np.intp) + np.arange(3)[:, None]
        out = np.empty((2, 3))
        for axis in range(3):
            for side, sign in enumerate((-1.0, 1.0)):
                turns = sign, numbers, first + 4 * axis
                out[side, axis] = sign * self._highest(turns, sign * places[axis], radii)
        return out

    @cached_property
    def _support(self) -> np.ndarray:
        return table_of(self._corners.T, _SIDE)

    def _highest(self, turns, along, radii):
        """Return the highest of ``along + row . corner``, where no product is above its radius."""
        sign, numbers, where = turns  # which numbers of all matrices the rows are
        bounds = along + radii
        farthest = bounds.argmax(keepdims=True)
        best = self._reach(sign * numbers[where[:, farthest]], along[farthest])
        left = np.flatnonzero(bounds > best)
        if not len(left):
            return best
        rows, along = sign * numbers.take(where.take(left, 1)), along[left]
        if len(left) * self._corners.shape[1] <= _AT_ONCE:
            return max(best, self._reach(rows, along))
        if np.ptp(rows, axis=1).max() <= _ROUNDING * np.abs(rows[:, 0]).max():
            # Turned about this axis alone, or all the same.
            return self._reach(rows[:, :1], along.max(keepdims=True))
        bounds = along + support(self._support, rows.T)
        farthest = bounds.argmax(keepdims=True)
        best = max(best, self._reach(rows[:, farthest], along[farthest]))
        left = np.flatnonzero(bounds > best)
        left = left[np.argsort(-bounds[left])]
        return self._highest_of(rows[:, left], along[left], bounds[left], best)

    def _highest_of(self, rows, along, bounds, best):
        """Return the highest of poses sorted by upper bounds, or the best if none is higher."""
        count = self._corners.shape[1]
        step = max(1, _AT_ONCE // count)
        for start in range(0, len(along), step):
            if bounds[start] <= best:
                break
            if start * count > _MOST:
                return bounds[start]
            some = slice(start, start + step)
            best = max(best, self._reach(rows[:, some], along[some]))
        return best

    def _reach(self, rows, along):
        """Return how far the farthest of some poses reaches, by rows of matrices, (3, n)."""
        # Not by a matrix product: where its threads wait they take all of the processor.
        products = np.einsum('ji,jk->ik', rows, self._corners)
        return (along + products.max(1)).max()
