"""The wedges of a block with texture coordinates: corners that share a vertex and these."""

from __future__ import annotations

import numpy as np

from pvibr.large.merging import as_drawn, merged_rows
from pvibr.large.textured_cell import CellTexture

#: Length of a unit of texture coordinates relative to that of the whole mesh, at most.
_STRETCH = 8.0
#: Area in the image of a mesh that has one colour everywhere, at most.
_NO_AREA = 1e-12


class Wedges:
    """Corners of triangles that share a vertex and texture coordinates."""

    def __init__(self, faces, coordinates):
        rows = np.empty((faces.size, 3), np.uint32)
        rows[:, 0] = faces.ravel()
        drawn = coordinates.reshape(-1, 2)
        rows[:, 1:] = drawn.view(np.uint32)
        first, places = merged_rows(rows)
        #: Wedge of each corner, (m, 3).
        self.of_corners = places.reshape(-1, 3).astype(np.int32)
        #: Vertex of each wedge, and its texture coordinates, (w, 2).
        self.vertices = faces.ravel()[first]
        self.coordinates = drawn[first].astype(float)

    def samples(self, points, faces, unit) -> tuple[np.ndarray, np.ndarray]:
        """Return a face at each vertex, and its coordinates with their metric, (n, 5)."""
        # The symmetric matrix of the squared length, three numbers; that of the mesh is `unit`.
        # One of each vertex: at a pole there may be hundreds.
        _, used = np.unique(self.vertices, return_index=True)
        owners = np.empty(len(self.vertices), np.int32)
        owners[self.of_corners.ravel()] = np.repeat(np.arange(len(faces), dtype=np.int32), 3)
        squares, areas = _squared_lengths(points[faces], self.coordinates[self.of_corners])
        sums = [
            np.bincount(self.of_corners.ravel(), np.repeat(v, 3), len(self.vertices))[used]
            for v in (*squares, areas)
        ]
        is_known = sums[3] > 0
        metric = np.stack(sums[:3], 1) / np.where(is_known, sums[3], 1)[:, None]
        metric[~is_known] = unit**2 * np.array([1, 0, 1])
        excess = (metric[:, 0] + metric[:, 2]) / (_STRETCH * unit) ** 2
        metric /= np.maximum(excess, 1)[:, None]
        return owners[used], np.c_[self.coordinates[used], metric]

    def cell(self, ids, samples) -> tuple[np.ndarray, CellTexture]:
        """Return the wedges of a cell's faces, and their texture coordinates."""
        own, places = np.unique(self.of_corners[ids], return_inverse=True)
        return own, CellTexture(places.reshape(-1, 3), self.coordinates[own], samples)

    def simplified(self, own, texture, is_new) -> np.ndarray:
        """Return the texture coordinates of the corners of a simplified cell, (n, 3, 2)."""
        # Where a point stays they do, to the bit.
        kept = self.coordinates[own[texture.continued]]
        coordinates = np.where(is_new[texture.points, None], texture.coordinates, kept)
        return as_drawn(coordinates)[texture.wedges]


def _squared_lengths(corners, coordinates):
    """Return the squared lengths of units of texture coordinates, times the squared area there."""
    # So a triangle that has no area there does not count.
    sides, own_sides = (c[:, 1:] - c[:, :1] for c in (corners.astype(float), coordinates))
    (a, b), (c, d) = own_sides[:, 0].T, own_sides[:, 1].T
    rows = np.stack([np.stack([d, -b], 1), np.stack([-c, a], 1)], 1) @ sides
    squares = [(rows[:, i] * rows[:, j]).sum(1) for i, j in ((0, 0), (0, 1), (1, 1))]
    return squares, (a * d - b * c) ** 2


def areas_of(corners, coordinates) -> np.ndarray:
    """Return the sums of the areas of triangles on the surface, and in the image."""
    sides, own_sides = (c[:, 1:] - c[:, :1] for c in (corners.astype(float), coordinates))
    (a, b), (c, d) = own_sides[:, 0].T, own_sides[:, 1].T
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.array([areas.sum(), np.abs(a * d - b * c).sum()])


def unit_length(areas, bounds) -> float:
    """Return the length of a unit of texture coordinates, on the whole mesh."""
    if areas[1] > _NO_AREA:
        return float(np.sqrt(areas[0] / areas[1]))
    return float(np.linalg.norm(bounds[1] - bounds[0]))
