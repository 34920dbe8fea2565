"""Triangles cut at the middles of edges, without gaps, and places in them."""

from __future__ import annotations

import numpy as np

#: Corners of a triangle and the middles of its edges, in barycentric coordinates.
_PLACES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])


def _ways():
    """Return the pieces by which edges are cut (bits), as rows of `_PLACES`, and how many."""
    parts, counts = np.zeros((8, 4, 3), int), np.ones(8, int)
    parts[0, 0] = 0, 1, 2
    for k in range(3):
        a, b, c = k, (k + 1) % 3, (k + 2) % 3
        p, q = 3 + a, 3 + b
        parts[1 << a, :2] = [(a, p, c), (p, b, c)]
        parts[1 << a | 1 << b, :3] = [(p, b, q), (a, p, q), (a, q, c)]
        counts[[1 << a, 1 << a | 1 << b]] = 2, 3
    parts[7], counts[7] = [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)], 4
    return parts, counts


_PARTS, _COUNTS = _ways()
_INVERSE = np.array(
    [
        [np.linalg.inv(_PLACES[part] if k < count else np.eye(3)) for k, part in enumerate(way)]
        for way, count in zip(_PARTS, _COUNTS, strict=True)
    ]
)


def edges_of(faces, count):
    """Return the edges of triangles of so many points, (n, 2), and those of each, (f, 3)."""
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    _, first, of_face = np.unique(ends @ [count, 1], return_index=True, return_inverse=True)
    return ends[first], of_face.reshape(-1, 3)


def cut_at(points, faces, wanted):
    """Cut triangles at the edges of each that are wanted, (f, 3); return all points, and a Cut.

    Triangles that share an edge share its middle, if both want it.
    """
    ends, of_face = edges_of(faces, len(points))
    new = np.zeros(len(ends), bool)
    new[of_face[wanted]] = True
    number = len(points) + np.cumsum(new) - 1
    cut = Cut(faces, np.where(wanted, number[of_face], -1))
    return np.concatenate([points, points[ends[new]].mean(1)]), cut


class Cut:
    """Triangles cut at some of their edges: `middles` (f, 3) are new points, -1 for no cut."""

    def __init__(self, faces, middles):
        self._way = ((middles >= 0) << np.arange(3)).sum(1)
        counts = _COUNTS[self._way]
        self._first = np.cumsum(counts) - counts
        #: The triangle that each piece was cut from.
        self.parent = np.repeat(np.arange(len(faces)), counts)
        place = np.arange(len(self.parent)) - self._first[self.parent]
        corners = np.concatenate([faces, middles], 1)[self.parent]
        parts = _PARTS[self._way[self.parent], place]
        #: The pieces, (n, 3).
        self.faces = np.take_along_axis(corners, parts, 1)

    def at(self, face, share):
        """Return the pieces that barycentric places of triangles are in, and places in them."""
        found, share = self._first[face], share.copy()
        rows = np.flatnonzero(self._way[face])
        way = self._way[face[rows]]
        places = np.einsum('nk,npkc->npc', share[rows], _INVERSE[way])
        depth = places.min(2)
        depth[np.arange(4) >= _COUNTS[way][:, None]] = -np.inf
        best = depth.argmax(1)
        found[rows] += best
        share[rows] = np.clip(places[np.arange(len(rows)), best], 0, 1)
        return found, share
