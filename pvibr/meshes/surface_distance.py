"""How far one triangle mesh is from another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.core import _vtk

_SAMPLES = 4000  # places on a surface that are looked at, and as many of its points


@dataclass
class Surface:
    """Triangles in float64, with what finds the nearest of them."""

    points: np.ndarray
    faces: np.ndarray

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
        locator.SetNumberOfCellsPerNode(2)  # a fifth faster than with its default of 10
        locator.BuildLocator()
        return locator

    def nearest(self, places):
        """Return the nearest triangle of each place, its corners' weights there, the distance."""
        cell, part, squared = (_vtk.reference(v) for v in (0, 0, 0.0))
        found, at = np.zeros(len(places), int), np.zeros((len(places), 3))
        closest = [0.0, 0.0, 0.0]
        find = self._locator.FindClosestPoint
        for i, place in enumerate(np.asarray(places, float).tolist()):
            find(place, closest, cell, part, squared)
            found[i], at[i] = cell.get(), closest
        away = np.linalg.norm(at - places, axis=1)
        return found, weights_of(at, self.corners[found]), away

    def samples(self, count=_SAMPLES):
        """Return places all over the surface: points, and others by area."""
        points = np.asarray(self.points, float)[np.unique(self.faces)]
        a, b, c = self.corners.transpose(1, 0, 2)
        area = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
        rng = np.random.default_rng(0)
        k = np.minimum(np.searchsorted(area, rng.random(count) * area[-1]), len(area) - 1)
        u, v = rng.random((2, count, 1))
        u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
        inner = a[k] + u * (b - a)[k] + v * (c - a)[k]
        return np.concatenate([points[:: -(-len(points) // count)], inner])


def hausdorff(one, other, count=_SAMPLES) -> float:
    """Return the largest distance between two surfaces, both ways, at so many places."""
    pairs = ((one, other), (other, one))
    return float(max(a.nearest(b.samples(count))[2].max() for a, b in pairs))


def weights_of(places, corners):
    """Return the weights of the corners of triangles at places on them."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    parts = [
        np.einsum('ij,ij->i', np.cross(q - p, places - p), normal)
        for p, q in ((b, c), (c, a), (a, b))
    ]
    weights = np.maximum(np.stack(parts, 1), 0.0)
    total = weights.sum(1, keepdims=True)
    thin = total[:, 0] <= 0
    weights[thin], total[thin] = 1.0, 3.0
    return weights / total
