"""Values of a hierarchy's vertices, and of the triangles of the full mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Values:
    """Scalars, float32, or colours, uint8, of vertices and of triangles of the full mesh."""

    name: str
    by_vertex: np.ndarray
    #: Values of the triangles of the full mesh in the order of patches, None for those of points.
    by_triangle: np.ndarray | None = None


def vertex_values(hierarchy, scalars) -> Values:
    """Return the values of a hierarchy's vertices: means by area, or what most of it has."""
    values = scalars.values.reshape(len(scalars.values), -1)
    if not scalars.on_cells:
        vertices = hierarchy.vertex_of_point
        weights = hierarchy.areas[vertices]
    else:
        values = values[hierarchy.mesh_cells]
        vertices = full_triangles(hierarchy).ravel()
        weights = np.repeat(_areas(hierarchy), 3)
    spread = values if not scalars.on_cells else np.repeat(values, 3, axis=0)
    if scalars.are_categories:
        means = _most(hierarchy, vertices, spread[:, 0], weights)[:, None]
    else:
        means = hierarchy.means(vertices, spread, weights)
    by_triangle = _as_drawn(values, scalars) if scalars.on_cells else None
    return Values(scalars.name, _as_drawn(means, scalars), by_triangle)


def _as_drawn(values, scalars) -> np.ndarray:
    if scalars.are_colors:
        return np.rint(np.nan_to_num(values)).astype(np.uint8)
    return values[:, 0].astype(np.float32)


def full_triangles(hierarchy) -> np.ndarray:
    """Return the vertices of the triangles of the full mesh in the order of patches, (t, 3)."""
    count = hierarchy.n_triangles
    patches = hierarchy.full_patches
    places = hierarchy.triangles[:count].astype(np.int64)
    places += np.repeat(hierarchy.vertex_starts[patches], hierarchy.triangle_counts[patches])[
        :, None
    ]
    return hierarchy.vertices[places]


def _areas(hierarchy) -> np.ndarray:
    """Return the areas of the triangles of the full mesh; a small one for those without."""
    points, triangles = hierarchy.points, full_triangles(hierarchy)
    start = points[triangles[:, 0]]
    crosses = np.cross(points[triangles[:, 1]] - start, points[triangles[:, 2]] - start)
    areas = np.sqrt(np.einsum('ij,ij->i', crosses, crosses, dtype=np.float64))
    return np.maximum(areas, 1e-12 * max(areas.max(), 1e-300))


def _most(hierarchy, vertices, values, weights) -> np.ndarray:
    """Return the value that has the largest weight at each vertex, NaN where there is none.

    A vertex of other levels has the one that most of those merged into it have.
    """
    is_known = np.isfinite(values)
    kinds, numbers = np.unique(values[is_known], return_inverse=True)
    winners = np.full(len(hierarchy.points), len(kinds))
    shares = np.zeros(len(winners))
    known_weights = weights[is_known].astype(np.float64)
    _elect(winners, shares, vertices[is_known], numbers, known_weights)
    for _, _, children in hierarchy.merges():
        children = children[winners[children] < len(kinds)]
        parents = hierarchy.parents[children]
        _elect(winners, shares, parents, winners[children], shares[children])
    return np.append(kinds, np.nan).astype(np.float32)[winners]


def _elect(winners, shares, places, numbers, weights):
    """Set the number that has the largest sum of weights at each place, and the sum."""
    count = int(numbers.max(initial=0)) + 1
    keys, groups = np.unique(places.astype(np.int64) * count + numbers, return_inverse=True)
    sums = np.bincount(groups, weights, len(keys))
    order = np.argsort(sums, kind='stable')  # the last one written is the largest
    places, numbers = np.divmod(keys[order], count)
    winners[places], shares[places] = numbers, sums[order]
