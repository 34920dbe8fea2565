"""Shadow volumes on the CPU: the silhouette edges that a light sees, and their extrusion.

Every triangle casts a prism of shadow from itself to infinity. The sides of adjacent prisms
cancel, and an edge keeps an integer, its multiplicity: 0 inside a sheet, 1 at its border, 2 at
the silhouette of a closed body (Bergeron, "A General Version of Crow's Shadow Volumes", IEEE CG&A
6(9), 1986; non-manifold meshes as in Kim et al., "Shadow Volumes for Non-Manifold Meshes", 2008).
A closed body lit from outside needs the triangles that face the light only.

Volumes are closed whatever the sign of a triangle that is seen edge-on. Lights are homogeneous:
(x, y, z, 1) is a position, (x, y, z, 0) a direction toward the light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True, eq=False)
class Edges:
    """A mesh prepared for the silhouettes of any light; made by `edge_table`."""

    origin: np.ndarray  # (3,), centre of the bounding box, world units
    half_box: np.ndarray  # (3,)
    points: np.ndarray  # (n, 3), the distinct points that triangles use, relative to `origin`
    triangles: np.ndarray  # (m, 3), of distinct points
    sources: np.ndarray  # (m,), their indices in the mesh
    planes: np.ndarray  # (m, 4), positive on the counterclockwise side, in units of `unit`
    unit: float  # a power of two near the half size of the mesh, world units
    # Per number k of triangles at an edge: ends (e, 2), and triangles (k, e), plus m for one that
    # runs from the second end to the first.
    groups: tuple[tuple[np.ndarray, np.ndarray], ...]
    # Sources (n,) of `points`; the source points that triangles use, and their indices, (u,) each.
    welded: tuple[np.ndarray, np.ndarray, np.ndarray]

    @cached_property
    def closed(self) -> bool:
        """Whether this is one or more closed bodies, each wound outward."""
        if not self.groups:
            return False
        m = len(self.triangles)
        if any(len(halves) != 2 for _, halves in self.groups):
            return False
        ((_, halves),) = self.groups
        if ((halves < m).sum(axis=0) != 1).any():
            return False
        neighbours = halves % m
        graph = coo_array((np.ones(neighbours.shape[1], bool), tuple(neighbours)), shape=(m, m))
        corners = self.points[self.triangles] / self.unit
        volumes = np.einsum('ij,ij->i', corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        return bool((np.bincount(connected_components(graph)[1], volumes) > 0).all())


def edge_table(points, triangles):
    """Prepare a mesh, (n, 3) and (m, 3): weld it, compute its planes and group its edges.

    Points of equal coordinates become one; degenerate triangles are omitted.
    """
    points, triangles = _checked(points, triangles)
    welded, triangles = _welded(points, triangles)
    first, second, third = triangles.T
    sources = np.flatnonzero((first != second) & (second != third) & (third != first))
    triangles = triangles[sources]
    groups = _groups(triangles, len(welded[0]))
    placed = _placed(points, triangles, welded)
    return Edges(triangles=triangles, sources=sources, groups=groups, welded=welded, **placed)


def moved_table(edges, points):
    """Return the table of a mesh after its points moved; None if welded points separate."""
    points = np.asarray(points, np.float64)
    point_sources, used_points, welded_index = edges.welded
    if used_points.size and used_points.max() >= len(points):
        return None
    if (
        points[used_points] != points[point_sources][welded_index]
    ).any():  # NaN differs from itself
        return None
    placed_fields = _placed(points, edges.triangles, edges.welded)
    if not np.isfinite(placed_fields['half_box']).all():
        return None
    return replace(edges, **placed_fields)


def _placed(points, triangles, welded):
    """Return the fields of a table that depend on the positions of its points."""
    points = points[welded[0]] + 0.0  # no negative zero
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else np.zeros((2, 3))
    origin = low + 0.5 * (high - low)
    points = points - origin
    half_box = np.abs(points).max(axis=0, initial=0.0)
    # A power of two rounds nothing, and squares of very small or large meshes stay in range.
    unit = float(2.0 ** np.frexp(half_box.max() or 1.0)[1])
    planes = _planes(points / unit, triangles)
    names = 'origin', 'half_box', 'points', 'planes', 'unit'
    return dict(zip(names, (origin, half_box, points, planes, unit), strict=True))


class LitMesh:
    """The front faces, the silhouette and the shadow volume of a mesh and a light.

    The light is a position (x, y, z, 1) or a direction toward it (x, y, z, 0), world space.
    """

    def __init__(self, edges, light):
        light = np.asarray(light, np.float64)
        valid = light.shape == (4,) and np.isfinite(light).all() and light[3] >= 0 and light.any()
        if not valid:
            raise ValueError(
                'light must be a finite position (x, y, z, 1) or nonzero direction (x, y, z, 0), '
                f'got {light.tolist()}'
            )
        self._edges = edges
        self._light = np.append(light[:3] - light[3] * edges.origin, light[3])

    @cached_property
    def facing(self):
        """Whether each triangle's counterclockwise side faces the light, (m,); False edge-on."""
        return self._edges.planes @ (self._light * [1, 1, 1, self._edges.unit]) > 0

    @cached_property
    def weights(self):
        """Signs of the triangles' prisms, (m,) int8: 1 as wound, -1 reversed, 0 omitted.

        Omitted are back faces of closed bodies lit from outside, and triangles touching the light.
        """
        edges, light = self._edges, self._light
        front_facing = self.facing.view(np.int8)
        is_outside = (np.abs(light[:3]) > light[3] * edges.half_box).any()
        if is_outside:
            return front_facing if edges.closed else 2 * front_facing - 1
        prism_signs = 2 * front_facing - 1
        # A triangle with the light at a corner hides nothing: the corner has no way to infinity.
        at_light = np.flatnonzero(light[3] * edges.points[:, 0] == light[0])
        at_light = at_light[(light[3] * edges.points[at_light] == light[:3]).all(axis=1)]
        if len(at_light):
            prism_signs[np.isin(edges.triangles, at_light).any(axis=1)] = 0
        return prism_signs

    @cached_property
    def silhouette(self):
        """The edges (k, 2) that bound the shadow, and their multiplicities (k,), positive.

        First, second, second at infinity run counterclockwise as seen from outside the shadow.
        """
        # Reversed, a triangle runs along its edges the other way: look up m + i for that.
        signs_by_half = np.concatenate([self.weights, -self.weights])
        ends, multiplicities = [np.zeros((0, 2), np.intp)], [np.zeros(0, np.intp)]
        for pairs, halves in self._edges.groups:
            sum_type = np.int8 if len(halves) < 128 else np.intp
            edge_sums = signs_by_half.take(halves[0]).astype(sum_type, copy=False)
            for half in halves[1:]:
                edge_sums += signs_by_half.take(half)
            is_silhouette = np.flatnonzero(edge_sums != 0)
            edge_sums = edge_sums[is_silhouette].astype(np.intp)
            pairs = pairs[is_silhouette]
            # A prism's side runs along its edge against its triangle.
            ends.append(np.where(edge_sums[:, None] > 0, pairs[:, ::-1], pairs))
            multiplicities.append(np.abs(edge_sums))
        return np.concatenate(ends), np.concatenate(multiplicities)

    def volume_triangles(self, caps=True):
        """Return the shadow volume as indices (q, 3), counterclockwise from outside.

        n + i is point i at infinity, n that of all for a direction; multiplicity k repeats a side.
        """
        triangles, prism_signs = self._edges.triangles, self.weights
        ends, multiplicities = self.silhouette
        first, second = np.repeat(ends, multiplicities, axis=0).T
        n, positional = len(self._edges.points), self._light[3] > 0
        if positional:
            sides = [[first, second, n + second], [first, n + second, n + first]]
        else:
            sides = [[first, second, np.full_like(first, n)]]
        parts = [np.transpose(side) for side in sides]
        if caps:
            near = triangles[prism_signs > 0], triangles[prism_signs < 0, ::-1]
            parts += [*near, *(n + cap[:, ::-1] for cap in near if positional)]
        return np.concatenate(parts)

    def volume(self, caps=True):
        """Return homogeneous vertices (v, 4), relative to `Edges.origin`, and triangles.

        A point is in shadow if a path from the light enters the surface more often than it leaves.
        """
        triangles = self.volume_triangles(caps)
        points, light = self._edges.points, self._light
        point_count = len(points)
        is_used = np.zeros(2 * point_count + 1, bool)
        is_used[triangles] = True
        near_points = np.flatnonzero(is_used[:point_count])
        far_points = np.flatnonzero(is_used[point_count:])
        # For a direction, the only far vertex is not a point: its weight is zero.
        away = light[3] * points[far_points % max(point_count, 1)] - light[:3]
        away /= np.abs(away).max(axis=1, keepdims=True)  # squares stay in range
        lengths = np.linalg.norm(away, axis=1, keepdims=True)
        vertices = np.zeros((len(near_points) + len(far_points), 4))
        vertices[: len(near_points), :3] = points[near_points]
        vertices[: len(near_points), 3] = 1
        vertices[len(near_points) :, :3] = away / lengths
        return vertices, (np.cumsum(is_used) - 1)[triangles]


def _checked(points, triangles):
    points, triangles = np.asarray(points, np.float64), np.asarray(triangles)
    for name, array in (('points', points), ('triangles', triangles)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f'{name} must have shape (n, 3), got {array.shape}')
    triangles = triangles.astype(np.intp, copy=False)
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(points)):
        raise ValueError(
            f'triangles must have indices from 0 to {len(points) - 1}, '
            f'got {triangles.min()} to {triangles.max()}'
        )
    return points, triangles


def _welded(points, triangles):
    """Return `Edges.welded`, and the triangles of welded points."""
    # Unused points would move the origin.
    in_use = np.zeros(len(points), bool)
    in_use[triangles] = True
    used_points = np.flatnonzero(in_use)
    invalid_points = used_points[~np.isfinite(points[used_points]).all(axis=1)]
    if invalid_points.size:
        raise ValueError(
            f'points[{invalid_points[0]}] must be finite, got {points[invalid_points[0]].tolist()}'
        )
    points = points[used_points] + 0.0  # no negative zero
    order = np.lexsort(points.T)
    is_new = np.ones(len(points), bool)
    is_new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    # The first of equal points represents all, in order: neighbours stay close in memory.
    first_equal = np.minimum.reduceat(order, np.flatnonzero(is_new)) if len(points) else order
    representatives = np.empty(len(points), np.intp)
    representatives[order] = first_equal[np.cumsum(is_new) - 1]
    stays = representatives == np.arange(len(points))
    index = np.empty(len(in_use), np.intp)
    index[used_points] = (np.cumsum(stays) - 1)[representatives]
    return (used_points[stays], used_points, index[used_points]), index[triangles]


def _planes(points, triangles):
    a, b, c = (points[corner] for corner in triangles.T)
    normals = np.cross(b - a, c - a)
    return np.column_stack([normals, -np.einsum('ij,ij->i', normals, a)])


def _groups(triangles, n):
    triangle_count = len(triangles)
    start_points, end_points = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    low_ends, is_backward = np.minimum(start_points, end_points), start_points > end_points
    keys = low_ends * n + np.where(is_backward, start_points, end_points)
    key_order = np.argsort(keys, kind='stable')
    keys = keys[key_order]
    edge_starts = np.flatnonzero(np.diff(keys, prepend=-1))
    counts = np.diff(edge_starts, append=len(keys))
    groups = []
    for half_count in np.unique(counts):
        chosen = edge_starts[counts == half_count]
        halves = key_order[chosen + np.arange(half_count)[:, None]]
        by_triangle = np.argsort(halves[0] % triangle_count)  # gathers are faster in order
        halves = halves[:, by_triangle]
        ends = np.stack([low_ends[halves[0]], keys[chosen[by_triangle]] % n], axis=1)
        groups.append((ends, halves % triangle_count + triangle_count * is_backward[halves]))
    return tuple(groups)
