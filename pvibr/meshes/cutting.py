"""Triangles cut at the middles of edges without gaps, and barycentric positions in them."""

from __future__ import annotations

import numpy as np

#: Corners of a triangle and the middles of its edges, in barycentric coordinates.
_PLACES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])


def _patterns():
    """Return the pieces for each set of cut edges (bits), rows of `_PLACES`, and their number."""
    pieces, counts = np.zeros((8, 4, 3), int), np.ones(8, int)
    pieces[0, 0] = 0, 1, 2
    for k in range(3):
        a, b, c = k, (k + 1) % 3, (k + 2) % 3
        p, q = 3 + a, 3 + b
        pieces[1 << a, :2] = [(a, p, c), (p, b, c)]
        pieces[1 << a | 1 << b, :3] = [(p, b, q), (a, p, q), (a, q, c)]
        counts[[1 << a, 1 << a | 1 << b]] = 2, 3
    pieces[7], counts[7] = [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)], 4
    return pieces, counts


_PARTS, _COUNTS = _patterns()
_INVERSE = np.array(
    [
        [np.linalg.inv(_PLACES[part] if k < count else np.eye(3)) for k, part in enumerate(pieces)]
        for pieces, count in zip(_PARTS, _COUNTS, strict=True)
    ]
)


def edges_of(faces, count):
    """Return the edges of triangles of `count` points, (n, 2), and those of each, (f, 3)."""
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    _, first, of_face = np.unique(ends @ [count, 1], return_index=True, return_inverse=True)
    return ends[first], of_face.reshape(-1, 3)


def cut_at(points, faces, cut_edges):
    """Cut triangles at edges, a mask (f, 3); return all points, and a Cut.

    Triangles that both cut their common edge share its middle.
    """
    ends, of_face = edges_of(faces, len(points))
    is_cut = np.zeros(len(ends), bool)
    is_cut[of_face[cut_edges]] = True
    middle_ids = len(points) + np.cumsum(is_cut) - 1
    cut = Cut(faces, np.where(cut_edges, middle_ids[of_face], -1))
    return np.concatenate([points, points[ends[is_cut]].mean(1)]), cut


class Cut:
    """Triangles cut at edges: `middles`, (f, 3), are the new points, -1 for no cut."""

    def __init__(self, faces, middles):
        self._pattern = ((middles >= 0) << np.arange(3)).sum(1)
        counts = _COUNTS[self._pattern]
        self._first = np.cumsum(counts) - counts
        #: The triangle that each piece was cut from.
        self.parent = np.repeat(np.arange(len(faces)), counts)
        piece = np.arange(len(self.parent)) - self._first[self.parent]
        corners = np.concatenate([faces, middles], 1)[self.parent]
        piece_corners = _PARTS[self._pattern[self.parent], piece]
        #: The pieces, (n, 3).
        self.faces = np.take_along_axis(corners, piece_corners, 1)

    def at(self, face, weights):
        """Return the piece that holds each barycentric position, and the coordinates in it."""
        pieces, weights = self._first[face], weights.copy()
        cut_faces = np.flatnonzero(self._pattern[face])
        patterns = self._pattern[face[cut_faces]]
        piece_weights = np.einsum('nk,npkc->npc', weights[cut_faces], _INVERSE[patterns])
        depth = piece_weights.min(2)
        depth[np.arange(4) >= _COUNTS[patterns][:, None]] = -np.inf
        best = depth.argmax(1)
        pieces[cut_faces] += best
        weights[cut_faces] = np.clip(piece_weights[np.arange(len(cut_faces)), best], 0, 1)
        return pieces, weights
