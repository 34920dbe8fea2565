"""Space divided into boxes of about equally many points: a k-d tree."""

from __future__ import annotations

import numpy as np


def divided(points, count) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the points in each of `count` boxes, and the boxes, (2, 3), which fill all space.

    Fewer are returned where there are fewer points. A box has its lower faces, not its upper ones.
    """
    everywhere = np.array([[-np.inf] * 3, [np.inf] * 3])
    shards = [(np.arange(len(points)), everywhere, count)]
    while any(parts > 1 for *_, parts in shards):
        shards = [half for shard in shards for half in _halves(points, *shard)]
    return [(ids, box) for ids, box, _ in shards]


def _halves(points, ids, box, parts) -> list:
    if parts == 1 or len(ids) < 2:
        return [(ids, box, 1)]
    axis = int(np.ptp(points[ids], axis=0).argmax())
    first = len(ids) * (parts // 2) // parts
    ids = ids[np.argsort(points[ids, axis], kind='stable')]
    lower, upper = box.copy(), box.copy()
    lower[1, axis] = upper[0, axis] = points[ids[first], axis]
    return [
        (np.sort(ids[:first]), lower, parts // 2),
        (np.sort(ids[first:]), upper, parts - parts // 2),
    ]


def inside(points, box) -> np.ndarray:
    """Return which points are in a box."""
    return ((points >= box[0]) & (points < box[1])).all(1)
