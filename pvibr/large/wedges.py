"""The wedges of a mesh with texture coordinates, level by level."""

from __future__ import annotations

import numpy as np

from pvibr.large.merging import merged_rows
from pvibr.large.textured_cell import CellTexture

#: Length of a unit of texture coordinates relative to that of the whole mesh, at most.
_STRETCH = 8.0
#: Area in the image of a mesh that has one colour everywhere, at most.
_NO_AREA = 1e-12


class Wedges:
    """Corners of triangles that share a vertex and texture coordinates."""

    def __init__(self, coordinates, vertex_of_point):
        rows = np.empty((len(coordinates), 3), np.uint32)
        rows[:, 0] = vertex_of_point
        drawn = np.ascontiguousarray(np.nan_to_num(coordinates), np.float32) + np.float32(0)
        rows[:, 1:] = drawn.view(np.uint32)
        first, self.of_point = merged_rows(rows)
        #: Vertex of each wedge, and its texture coordinates, (w, 2).
        self.vertices = vertex_of_point[first]
        self.coordinates = drawn[first].astype(float)
        self._new: list[tuple[np.ndarray, np.ndarray]] = []
        self._count = len(first)

    def samples(self, used, points, faces, corner_wedges) -> np.ndarray:
        """Return texture coordinates of wedges, and the lengths of their units, (n, 5).

        As the symmetric matrix of the squared length, three numbers.
        """
        corners, own = points[faces], self.coordinates[corner_wedges]
        sides, own_sides = (c[:, 1:] - c[:, :1] for c in (corners, own))
        (a, b), (c, d) = own_sides[:, 0].T, own_sides[:, 1].T
        determinants = a * d - b * c
        rows = np.stack([np.stack([d, -b], 1), np.stack([-c, a], 1)], 1) @ sides
        # Times the squared area in the image: a triangle that has none there does not count.
        squares = [(rows[:, i] * rows[:, j]).sum(1) for i, j in ((0, 0), (0, 1), (1, 1))]
        count = len(self.vertices)
        sums = [
            np.bincount(corner_wedges.ravel(), np.repeat(v, 3), count)[used]
            for v in (*squares, determinants**2)
        ]
        total = np.abs(determinants).sum()
        unit = np.linalg.norm(np.ptp(points, axis=0))
        if total > _NO_AREA:
            unit = np.sqrt(np.linalg.norm(np.cross(*sides.swapaxes(0, 1)), axis=1).sum() / total)
        is_known = sums[3] > 0
        metric = np.stack(sums[:3], 1) / np.where(is_known, sums[3], 1)[:, None]
        metric[~is_known] = unit**2 * np.array([1, 0, 1])
        excess = (metric[:, 0] + metric[:, 2]) / (_STRETCH * unit) ** 2
        metric /= np.maximum(excess, 1)[:, None]
        return np.c_[self.coordinates[used], metric]

    def cell(self, corner_wedges, samples) -> tuple[np.ndarray, CellTexture]:
        """Return the wedges of a cell's faces, and their texture coordinates."""
        own, places = np.unique(corner_wedges, return_inverse=True)
        return own, CellTexture(places.reshape(-1, 3), self.coordinates[own], samples)

    def added(self, own, simplified, numbers, is_new) -> np.ndarray:
        """Add the new wedges of a simplified cell; return those of the corners of its faces.

        `numbers` are the vertices of its points, of which `is_new` tells the new ones.
        """
        wedge_numbers = own[simplified.continued]
        new = np.flatnonzero(is_new[simplified.points])
        wedge_numbers[new] = self._count + np.arange(len(new))
        self._count += len(new)
        self._new.append((numbers[simplified.points[new]], simplified.coordinates[new]))
        return wedge_numbers[simplified.wedges].astype(np.int32)

    def end_level(self):
        """Let the wedges of a new level be there."""
        if self._new:
            vertices, coordinates = map(np.concatenate, zip(*self._new, strict=True))
            self.vertices = np.append(self.vertices, vertices)
            self.coordinates = np.concatenate([self.coordinates, coordinates])
            self._new = []
