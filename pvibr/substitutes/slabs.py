"""Thin slabs that contain points, and covers of triangles by few slabs."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from pvibr.maths.vectors import unit_vectors

_STEP, _ROUNDS = 0.3, 5  # first tilt of a slab in radians, and how often it is halved
_SPREAD = 0.15  # radians between directions in which extreme points are sought
_HOPELESS = 3.0  # times too thick: tilting will not help such a slab


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
    tilts = step / 2 * np.arange(-2, 3)
    tilt_u, tilt_v = np.meshgrid(tilts, tilts)
    tilted_normals = normal + tilt_u.reshape(-1, 1) * u + tilt_v.reshape(-1, 1) * v
    return unit_vectors(tilted_normals)


def thinnest(points, starts, enough):
    """Return the normal, middle offset and thickness of a thin slab that contains points.

    Searched near `starts` and the direction of least spread, until it is thin `enough`.
    """
    local_points = points - points.mean(0)
    flattest_normal = np.linalg.eigh(local_points.T @ local_points)[1][:, 0]
    best, width = flattest_normal, float(np.ptp(points @ flattest_normal))
    for start in () if width > _HOPELESS * enough else (flattest_normal, *starts):
        best, width = _turned_thinner(points, start, _STEP, best, width)
    last_thickness = np.inf
    while enough < width < min(last_thickness, _HOPELESS * enough):  # with a finer first step
        last_thickness = width
        best, width = _turned_thinner(points, best, _STEP / 4, best, width)
    offsets = points @ best
    return best, float(offsets.min() + offsets.max()) / 2, width


def _turned_thinner(points, normal, step, best_normal, thickness):
    """Return the best normal and its width after turning one by ever smaller steps."""
    for _ in range(_ROUNDS):
        tilted_normals = turned(normal, step)
        thicknesses = np.ptp(points @ tilted_normals.T, axis=0)
        normal = tilted_normals[thicknesses.argmin()]
        if thicknesses.min() < thickness:
            best_normal, thickness = normal, float(thicknesses.min())
        step /= 2
    return best_normal, thickness


class Cover:
    """Triangles, and slabs of half thickness `bound` that together contain them."""

    def __init__(self, points, faces, areas, normals, offsets, bound):
        self.points, self.faces, self.areas, self.bound = points, faces, areas, bound
        self.normals, self.offsets = normals.copy(), offsets.copy()
        self.holds = np.stack([self._held(k) for k in range(len(offsets))], 1)
        self._names = list(range(len(offsets)))
        self._failed: set = set()  # pairs of names

    def _held(self, slab):
        distances = np.abs(self.points @ self.normals[slab] - self.offsets[slab])
        return distances[self.faces].max(1) <= self.bound

    def merged(self):
        """Return the normals and offsets of fewer slabs, each pair merged if one slab suffices."""
        while self._merge():
            pass
        return self.normals, self.offsets

    def _merge(self) -> bool:
        """Merge the first possible pair, the least needed first; remember failed pairs."""
        hold_counts = self.holds.sum(1)
        held_once = self.holds & (hold_counts == 1)[:, None]
        cores = [self._extremes(held_once[:, k]) for k in range(len(self.offsets))]
        for pair in combinations(np.argsort(self.areas @ held_once).tolist(), 2):
            pair_key = frozenset(self._names[k] for k in pair)
            if pair_key in self._failed:
                continue
            merged_slab = self._of_two(pair, np.concatenate([cores[k] for k in pair]), hold_counts)
            if merged_slab is not None:
                self._replace(pair, *merged_slab)
                return True
            self._failed.add(pair_key)
        return False

    def _extremes(self, chosen):
        """Return the extreme points of triangles: a slab of them contains all."""
        points = self.points[np.unique(self.faces[chosen])]
        directions = hemisphere(_SPREAD)
        if len(points) <= len(directions):
            return points
        offsets = points @ directions.T
        return points[np.unique(np.concatenate([offsets.argmin(0), offsets.argmax(0)]))]

    def _of_two(self, pair, core, hold_counts):
        """Return a slab that contains what only two slabs contain, or None."""
        thickness = 2 * self.bound
        if len(core) and thinnest(core, self.normals[list(pair)], thickness)[2] > thickness:
            return None
        alone = hold_counts == self.holds[:, pair].sum(1)
        if not alone.any():
            return None
        normal, offset, _ = thinnest(self._extremes(alone), self.normals[list(pair)], thickness)
        distances = np.abs(self.points[np.unique(self.faces[alone])] @ normal - offset)
        return (normal, offset) if distances.max() <= self.bound else None

    def _replace(self, pair, normal, offset):
        stays, gone = pair
        self.normals[stays], self.offsets[stays] = normal, offset
        self.holds[:, stays] = self._held(stays)
        self.normals = np.delete(self.normals, gone, 0)
        self.offsets = np.delete(self.offsets, gone)
        self.holds = np.delete(self.holds, gone, 1)
        self._names[stays] = max(self._names) + 1
        del self._names[gone]
