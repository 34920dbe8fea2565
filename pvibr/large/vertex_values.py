"""Values of a hierarchy's vertices, and of the triangles of the full mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # whose modules load when they are first used


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
    vertices = hierarchy.vertex_of_point
    if scalars.on_cells:
        values = values[hierarchy.mesh_cells]
        vertices, weights = hierarchy.full_triangles, hierarchy.triangle_areas
    else:
        weights = hierarchy.areas[vertices]
    if scalars.are_categories:
        means = _most(hierarchy, vertices, values[:, 0], weights)[:, None]
    else:
        means = hierarchy.means(vertices, values, weights)
    by_triangle = _as_drawn(values, scalars) if scalars.on_cells else None
    return Values(scalars.name, _as_drawn(means, scalars), by_triangle)


def _as_drawn(values, scalars) -> np.ndarray:
    if scalars.are_colors:
        return np.rint(np.nan_to_num(values)).astype(np.uint8)
    return values[:, 0].astype(np.float32)


def _most(hierarchy, vertices, values, weights) -> np.ndarray:
    """Return the value that has the largest weight at each vertex, NaN where there is none.

    A vertex of other levels has the one that most of those merged into it have.
    """
    is_known = np.isfinite(values)
    kinds, numbers = np.unique(values[is_known], return_inverse=True)
    winners = np.full(len(hierarchy.points), len(kinds))
    shares = np.zeros(len(winners))
    vertices = vertices[is_known].reshape(len(numbers), -1)
    _elect(winners, shares, (0, len(hierarchy.areas)), vertices, numbers, weights[is_known])
    for first, last, children in hierarchy.merges():
        children = children[winners[children] < len(kinds)]
        parents = hierarchy.parents[children][:, None]
        _elect(winners, shares, (first, last), parents, winners[children], shares[children])
    return np.append(kinds, np.nan).astype(np.float32)[winners]


def _elect(winners, shares, span, places, numbers, weights):
    """Set the number that has the largest sum of weights at each place of a span, and the sum."""
    first, last = span
    corner_count = places.shape[1]
    rows, columns = (places - first).ravel(), np.repeat(numbers, corner_count)
    shape = last - first, int(numbers.max(initial=0)) + 1
    own_weights = np.repeat(weights, corner_count).astype(np.float64)
    sums = scipy.sparse.coo_array((own_weights, (rows, columns)), shape).tocsr()
    used = np.flatnonzero(np.diff(sums.indptr))
    if not len(used):
        return
    largest = np.maximum.reduceat(sums.data, sums.indptr[used])
    is_largest = sums.data == np.repeat(largest, np.diff(sums.indptr)[used])
    owners = np.repeat(used, np.diff(sums.indptr)[used])[is_largest]
    winners[first + owners] = sums.indices[is_largest]
    shares[first + used] = largest
