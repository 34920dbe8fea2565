"""Distances between triangle meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.core import _vtk

_GRID = 48  # cells along a side, by which points are ordered
_SAMPLES = 4000  # random samples of a surface, and as many of its points at most


@dataclass
class Surface:
    """Triangles in float64, with a locator of the nearest one."""

    points: np.ndarray
    faces: np.ndarray
    _samples: dict = field(default_factory=dict, init=False)

    @cached_property
    def corners(self):
        """Corners of the triangles, shape (m, 3, 3)."""
        return np.asarray(self.points, float)[self.faces]

    @cached_property
    def _locator(self):
        locator = _vtk.vtkStaticCellLocator()
        locator.SetDataSet(
            pv.PolyData.from_regular_faces(np.asarray(self.points, float), self.faces)
        )
        locator.SetNumberOfCellsPerNode(2)  # a fifth faster than the default of 10
        locator.BuildLocator()
        return locator

    def nearest(self, places):
        """Return the nearest triangle, barycentric weights and distance of each point."""
        cell, sub_id, squared = (_vtk.reference(v) for v in (0, 0, 0.0))
        cells: list[int] = []
        coordinates: list[float] = []  # a list, which grows faster than rows of an array are set
        closest = [0.0, 0.0, 0.0]
        find = self._locator.FindClosestPoint
        order = _neighbours_together(places)
        for place in np.asarray(places, float)[order].tolist():
            find(place, closest, cell, sub_id, squared)
            cells.append(cell.get())
            coordinates += closest
        triangles, closest_points = np.zeros(len(order), int), np.zeros((len(order), 3))
        triangles[order], closest_points[order] = cells, np.reshape(coordinates, (-1, 3))
        distances = np.linalg.norm(closest_points - places, axis=1)
        return triangles, weights_of(closest_points, self.corners[triangles]), distances

    def samples(self, count=_SAMPLES):
        """Return points and random samples by area of the surface."""
        if count not in self._samples:
            self._samples[count] = self._drawn_samples(count)
        return self._samples[count]

    def _drawn_samples(self, count):
        points = np.asarray(self.points, float)[np.unique(self.faces)]
        a, b, c = self.corners.transpose(1, 0, 2)
        area = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
        rng = np.random.default_rng(0)
        k = np.minimum(np.searchsorted(area, rng.random(count) * area[-1]), len(area) - 1)
        u, v = rng.random((2, count, 1))
        u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
        inner = a[k] + u * (b - a)[k] + v * (c - a)[k]
        return np.concatenate([points[:: -(-len(points) // count)], inner])


def hausdorff(first, second, count=_SAMPLES) -> float:
    """Return the symmetric Hausdorff distance of two surfaces, from `count` samples each."""
    pairs = ((first, second), (second, first))
    return float(max(a.nearest(b.samples(count))[2].max() for a, b in pairs))


def _neighbours_together(places):
    """Return the order of points, (n,), in which near ones follow one another."""
    # The locator then finds its cells in the processor's cache.
    if not len(places):
        return np.zeros(0, int)
    low, extent = np.min(places, axis=0), np.ptp(places, axis=0).max() or 1.0
    cells = ((places - low) * (_GRID / extent)).astype(int)
    return np.argsort(cells @ [_GRID**2, _GRID, 1], kind='stable')


def weights_of(places, corners):
    """Return the barycentric weights of points on triangles."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    weights_by_corner = [
        np.einsum('ij,ij->i', np.cross(q - p, places - p), normal)
        for p, q in ((b, c), (c, a), (a, b))
    ]
    weights = np.maximum(np.stack(weights_by_corner, 1), 0.0)
    total = weights.sum(1, keepdims=True)
    is_degenerate = total[:, 0] <= 0
    weights[is_degenerate], total[is_degenerate] = 1.0, 3.0
    return weights / total
