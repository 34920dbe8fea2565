"""Values of a hierarchy's vertices, and of the triangles of the full mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # whose modules load when they are first used

from pvibr.large.scalars import range_of

#: Largest value that is kept in single precision, and least range of values relative to it: of
#: large ones, such as times and map coordinates, it would leave steps.
_LARGEST_SINGLE, _LEAST_EXTENT = 1e38, 1e-3


@dataclass(frozen=True, eq=False)
class Values:
    """Scalars, floats, or colours, uint8, of vertices and of triangles of the full mesh."""

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
    elif not scalars.are_colors and _needs_double(values):
        return _precise_values(hierarchy, scalars, vertices, values.astype(float), weights)
    else:
        means = hierarchy.means(vertices, values, weights)
    by_triangle = _as_drawn(values, scalars) if scalars.on_cells else None
    return Values(scalars.name, _as_drawn(means, scalars), by_triangle)


def _needs_double(values) -> bool:
    """Return True for scalars that single precision does not hold, or hardly tells apart."""
    low, high = range_of(values) or (0.0, 0.0)
    largest = max(abs(low), abs(high))
    return largest > _LARGEST_SINGLE or 0 < high - low < _LEAST_EXTENT * largest


def _precise_values(hierarchy, scalars, vertices, values, weights) -> Values:
    """Return values in double precision, with means of their places in their range."""
    low, high = range_of(values)
    unit = high - low or 1.0
    means = hierarchy.means(vertices, (values - low) / unit, weights)
    by_vertex = means[:, 0].astype(float) * unit + low
    return Values(scalars.name, by_vertex, values[:, 0] if scalars.on_cells else None)


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
    winners = hierarchy.with_neighbours(winners, winners == len(kinds))
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
