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
        links = coo_array((np.ones(neighbours.shape[1], bool), tuple(neighbours)), shape=(m, m))
        corners = self.points[self.triangles] / self.unit
        volumes = np.einsum('ij,ij->i', corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        return bool((np.bincount(connected_components(links)[1], volumes) > 0).all())


def edge_table(points, triangles):
    """Prepare a mesh, (n, 3) and (m, 3): weld it, compute its planes and group its edges.

    Points of equal coordinates become one; degenerate triangles are omitted.
    """
    points, triangles = _checked(points, triangles)
    welded, triangles = _welded(points, triangles)
    a, b, c = triangles.T
    sources = np.flatnonzero((a != b) & (b != c) & (c != a))
    triangles = triangles[sources]
    groups = _groups(triangles, len(welded[0]))
    placed = _placed(points, triangles, welded)
    return Edges(triangles=triangles, sources=sources, groups=groups, welded=welded, **placed)


def moved_table(edges, points):
    """Return the table of a mesh after its points moved; None if welded points separate."""
    points = np.asarray(points, np.float64)
    rows, used, which = edges.welded
    if used.size and used.max() >= len(points):
        return None
    if (points[used] != points[rows][which]).any():  # numbers that are none among them
        return None
    placed = _placed(points, edges.triangles, edges.welded)
    if not np.isfinite(placed['half_box']).all():
        return None
    return replace(edges, **placed)


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
        good = light.shape == (4,) and np.isfinite(light).all() and light[3] >= 0 and light.any()
        if not good:
            raise ValueError(
                f'light is {light.tolist()}; it must be a finite (x, y, z, 1) for a position or '
                '(x, y, z, 0) for a direction that is not zero.'
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
        front = self.facing.view(np.int8)
        outside = (np.abs(light[:3]) > light[3] * edges.half_box).any()
        if outside:
            return front if edges.closed else 2 * front - 1
        turns = 2 * front - 1
        # A triangle with the light at a corner hides nothing; its corner has no way to infinity.
        corners = np.flatnonzero(light[3] * edges.points[:, 0] == light[0])
        corners = corners[(light[3] * edges.points[corners] == light[:3]).all(axis=1)]
        if len(corners):
            turns[np.isin(edges.triangles, corners).any(axis=1)] = 0
        return turns

    @cached_property
    def silhouette(self):
        """The edges (k, 2) that bound the shadow, and their multiplicities (k,), positive.

        First, second, second at infinity run counterclockwise as seen from outside the shadow.
        """
        # Reversed, a triangle runs along its edges the other way: look up m + i for that.
        table = np.concatenate([self.weights, -self.weights])
        ends, multiplicities = [np.zeros((0, 2), np.intp)], [np.zeros(0, np.intp)]
        for pairs, halves in self._edges.groups:
            small = np.int8 if len(halves) < 128 else np.intp
            total = table.take(halves[0]).astype(small, copy=False)
            for half in halves[1:]:
                total += table.take(half)
            found = np.flatnonzero(total != 0)
            total = total[found].astype(np.intp)
            pairs = pairs[found]
            # A prism's side runs along its edge against its triangle.
            ends.append(np.where(total[:, None] > 0, pairs[:, ::-1], pairs))
            multiplicities.append(np.abs(total))
        return np.concatenate(ends), np.concatenate(multiplicities)

    def volume_triangles(self, caps=True):
        """Return the shadow volume as indices (q, 3), counterclockwise from outside.

        n + i is point i at infinity, n that of all for a direction; multiplicity k repeats a side.
        """
        triangles, prisms = self._edges.triangles, self.weights
        ends, multiplicities = self.silhouette
        first, second = np.repeat(ends, multiplicities, axis=0).T
        n, positional = len(self._edges.points), self._light[3] > 0
        if positional:
            sides = [[first, second, n + second], [first, n + second, n + first]]
        else:
            sides = [[first, second, np.full_like(first, n)]]
        parts = [np.transpose(side) for side in sides]
        if caps:
            near = triangles[prisms > 0], triangles[prisms < 0, ::-1]
            parts += [*near, *(n + cap[:, ::-1] for cap in near if positional)]
        return np.concatenate(parts)

    def volume(self, caps=True):
        """Return homogeneous vertices (v, 4), relative to `Edges.origin`, and triangles.

        A point is in shadow if a path from the light enters the surface more often than it leaves.
        """
        triangles = self.volume_triangles(caps)
        points, light = self._edges.points, self._light
        n = len(points)
        used = np.zeros(2 * n + 1, bool)
        used[triangles] = True
        near, far = np.flatnonzero(used[:n]), np.flatnonzero(used[n:])
        # For a direction the only far vertex is no point: its weight is zero.
        away = light[3] * points[far % max(n, 1)] - light[:3]
        away /= np.abs(away).max(axis=1, keepdims=True)  # squares stay in range
        length = np.linalg.norm(away, axis=1, keepdims=True)
        vertices = np.zeros((len(near) + len(far), 4))
        vertices[: len(near), :3] = points[near]
        vertices[: len(near), 3] = 1
        vertices[len(near) :, :3] = away / length
        return vertices, (np.cumsum(used) - 1)[triangles]


def _checked(points, triangles):
    points, triangles = np.asarray(points, np.float64), np.asarray(triangles)
    for name, array in (('points', points), ('triangles', triangles)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f'{name} has the shape {array.shape}; it must be (n, 3).')
    triangles = triangles.astype(np.intp, copy=False)
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(points)):
        raise ValueError(
            f'triangles has indices from {triangles.min()} to {triangles.max()}; '
            f'they must be from 0 to {len(points) - 1}.'
        )
    return points, triangles


def _welded(points, triangles):
    """Return `Edges.welded`, and the triangles of welded points."""
    # Points that no triangle uses would move the origin.
    used = np.zeros(len(points), bool)
    used[triangles] = True
    kept = np.flatnonzero(used)
    bad = kept[~np.isfinite(points[kept]).all(axis=1)]
    if bad.size:
        raise ValueError(f'points[{bad[0]}] is {points[bad[0]].tolist()}; it must be finite.')
    points = points[kept] + 0.0  # no negative zero
    order = np.lexsort(points.T)
    new = np.ones(len(points), bool)
    new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    # The first of equal points stands for all, and the order stays: neighbours stay near.
    first = np.minimum.reduceat(order, np.flatnonzero(new)) if len(points) else order
    stands = np.empty(len(points), np.intp)
    stands[order] = first[np.cumsum(new) - 1]
    alone = stands == np.arange(len(points))
    index = np.empty(len(used), np.intp)
    index[kept] = (np.cumsum(alone) - 1)[stands]
    return (kept[alone], kept, index[kept]), index[triangles]


def _planes(points, triangles):
    a, b, c = (points[corner] for corner in triangles.T)
    normals = np.cross(b - a, c - a)
    return np.column_stack([normals, -np.einsum('ij,ij->i', normals, a)])


def _groups(triangles, n):
    m = len(triangles)
    start, end = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    low, backward = np.minimum(start, end), start > end
    keys = low * n + np.where(backward, start, end)
    order = np.argsort(keys, kind='stable')
    keys = keys[order]
    firsts = np.flatnonzero(np.diff(keys, prepend=-1))
    counts = np.diff(firsts, append=len(keys))
    groups = []
    for k in np.unique(counts):
        chosen = firsts[counts == k]
        halves = order[chosen + np.arange(k)[:, None]]
        by_triangle = np.argsort(halves[0] % m)  # gathers are faster in order
        halves = halves[:, by_triangle]
        ends = np.stack([low[halves[0]], keys[chosen[by_triangle]] % n], axis=1)
        groups.append((ends, halves % m + m * backward[halves]))
    return tuple(groups)
