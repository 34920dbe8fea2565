"""Thin slabs that contain points, and covers of triangles by few slabs."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from pvibr.maths.vectors import unit_vectors

_STEP, _ROUNDS = 0.3, 5  # radians that a slab is turned by at first, and how often that is halved
_SPREAD = 0.15  # radians between directions in which points lie farthest
_HOPELESS = 3.0  # times too thick is a slab that turning will not mend


def hemisphere(step) -> np.ndarray:
    """Return unit vectors over a hemisphere, about `step` radians apart: Fibonacci's spiral."""
    count = int(np.ceil(2 * np.pi / step**2))
    z = (np.arange(count) + 0.5) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    across = np.sqrt(1 - z * z)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def turned(normal, step) -> np.ndarray:
    """Return 25 unit vectors around a normal, up to `step` radians along either axis."""
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    turns = step / 2 * np.arange(-2, 3)
    a, b = np.meshgrid(turns, turns)
    found = normal + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    return unit_vectors(found)


def thinnest(points, starts, enough):
    """Return the normal, middle offset and thickness of a thin slab that contains points.

    Searched near `starts` and the direction of least spread, until it is thin `enough`.
    """
    middle = points - points.mean(0)
    least = np.linalg.eigh(middle.T @ middle)[1][:, 0]
    best, width = least, float(np.ptp(points @ least))
    for start in () if width > _HOPELESS * enough else (least, *starts):
        best, width = _turned_thinner(points, start, _STEP, best, width)
    before = np.inf
    while enough < width < min(before, _HOPELESS * enough):  # by steps that start finer
        before = width
        best, width = _turned_thinner(points, best, _STEP / 4, best, width)
    along = points @ best
    return best, float(along.min() + along.max()) / 2, width


def _turned_thinner(points, normal, step, best, width):
    """Return the best normal and its width after turning one by ever smaller steps."""
    for _ in range(_ROUNDS):
        around = turned(normal, step)
        widths = np.ptp(points @ around.T, axis=0)
        normal = around[widths.argmin()]
        if widths.min() < width:
            best, width = normal, float(widths.min())
        step /= 2
    return best, width


class Cover:
    """Triangles, and slabs of half thickness `bound` that together contain them."""

    def __init__(self, points, faces, areas, normals, offsets, bound):
        self.points, self.faces, self.areas, self.bound = points, faces, areas, bound
        self.normals, self.offsets = normals.copy(), offsets.copy()
        self.holds = np.stack([self._held(k) for k in range(len(offsets))], 1)
        self._names = list(range(len(offsets)))
        self._failed: set = set()  # pairs of names

    def _held(self, k):
        away = np.abs(self.points @ self.normals[k] - self.offsets[k])
        return away[self.faces].max(1) <= self.bound

    def merged(self):
        """Return the normals and offsets of fewer slabs, each pair merged if one slab suffices."""
        while self._merge():
            pass
        return self.normals, self.offsets

    def _merge(self) -> bool:
        """Merge the first possible pair, the least needed first; remember failed pairs."""
        times = self.holds.sum(1)
        alone = self.holds & (times == 1)[:, None]
        cores = [self._extremes(alone[:, k]) for k in range(len(self.offsets))]
        for pair in combinations(np.argsort(self.areas @ alone).tolist(), 2):
            key = frozenset(self._names[k] for k in pair)
            if key in self._failed:
                continue
            found = self._of_two(pair, np.concatenate([cores[k] for k in pair]), times)
            if found is not None:
                self._replace(pair, *found)
                return True
            self._failed.add(key)
        return False

    def _extremes(self, chosen):
        """Return the extreme points of triangles: a slab of them contains all."""
        points = self.points[np.unique(self.faces[chosen])]
        directions = hemisphere(_SPREAD)
        if len(points) <= len(directions):
            return points
        along = points @ directions.T
        return points[np.unique(np.concatenate([along.argmin(0), along.argmax(0)]))]

    def _of_two(self, pair, core, times):
        """Return a slab that contains what only two slabs contain, or None."""
        thick = 2 * self.bound
        if len(core) and thinnest(core, self.normals[list(pair)], thick)[2] > thick:
            return None
        alone = times == self.holds[:, pair].sum(1)
        if not alone.any():
            return None
        normal, offset, _ = thinnest(self._extremes(alone), self.normals[list(pair)], thick)
        away = np.abs(self.points[np.unique(self.faces[alone])] @ normal - offset)
        return (normal, offset) if away.max() <= self.bound else None

    def _replace(self, pair, normal, offset):
        kept, gone = pair
        self.normals[kept], self.offsets[kept] = normal, offset
        self.holds[:, kept] = self._held(kept)
        self.normals, self.offsets = (
            np.delete(self.normals, gone, 0),
            np.delete(self.offsets, gone),
        )
        self.holds = np.delete(self.holds, gone, 1)
        self._names[kept] = max(self._names) + 1
        del self._names[gone]
