"""Colours of the photographs of a surface: exposures and seams levelled."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from pvibr.maths.draping import sample
from pvibr.photos.photo_choice import distinct
from pvibr.visibility.surface_samples import edges_of


class Pairs:
    """All (vertex, photograph) pairs of a choice."""

    def __init__(self, choice):
        self._count = len(choice.points)
        face, slot = np.nonzero(choice.photos >= 0)
        photo_index = choice.photos[face, slot].astype(np.int64)
        photo_count = int(photo_index.max(initial=0)) + 1
        keys = choice.faces[face] * photo_count + photo_index[:, None]
        self.keys = distinct(keys)
        pairs = np.searchsorted(self.keys, keys)
        self.vertices, self.photos = self.keys // photo_count, self.keys % photo_count
        self.edges = edges_of(pairs)
        lower_pair, upper_pair = self.edges.min(1), self.edges.max(1)
        self.edges = np.stack(
            np.divmod(distinct(lower_pair * len(self.keys) + upper_pair), len(self.keys)), 1
        )
        #: The pair of each corner and photograph, (f, 3, 4); -1 for none.
        self.of_corners = np.full(choice.weights.shape, -1)
        self.of_corners[face, :, slot] = pairs

    def colors(self, points, pictures) -> np.ndarray:
        """Return the colour of each pair in the small pictures, (n, 3)."""
        pair_colors = np.full((len(self.keys), 3), np.nan)
        for photo_index in distinct(self.photos):
            pairs = np.flatnonzero(self.photos == photo_index)
            uv, _ = pictures[photo_index].camera.project(points[self.vertices[pairs]])
            pair_colors[pairs] = sample(pictures[photo_index].small, np.clip(uv, 0, 1))[:, :3]
        return pair_colors

    def corrections(self, colors) -> np.ndarray:
        """Return the offsets that make the colours of each vertex equal, (n, 3)."""
        return levelled(self.vertices, np.nan_to_num(colors), self.edges)

    def means(self, colors) -> np.ndarray:
        """Return the mean colour of each vertex, NaN without photographs, (points, 3)."""
        pair_counts = np.bincount(self.vertices, minlength=self._count)
        sums = [np.bincount(self.vertices, c, self._count) for c in colors[: len(self.keys)].T]
        with np.errstate(invalid='ignore'):
            return np.stack(sums, 1) / pair_counts[:, None]


def unique_corners(vertices, numbers, weights):
    """Return the first index of each group of equal corners, and the group of each corner."""
    rng = np.random.default_rng(0)
    hash_keys = vertices.astype(np.int64) * int(rng.integers(1 << 62) | 1)
    for values in (numbers, np.rint(weights * 4096).astype(np.int64)):
        for column in values.T:
            hash_keys = (hash_keys ^ (hash_keys >> 29)) * int(rng.integers(1 << 62) | 1) + column
    return np.unique(hash_keys, return_index=True, return_inverse=True)[1:]


#: Weight of smooth corrections over equal colours.
SMOOTH = 4.0
_SMALL = 0.02  # weight of keeping the mean colour of a vertex
_MOST = 64.0  # larger differences are occluders, not light
_ROUNDS = 60


def levelled(vertices, colors, edges, smooth=SMOOTH):
    """Return corrections (n, c) that give the photographs of each vertex one colour.

    Row i is the colour of vertex `vertices[i]` in one photograph; `edges` (m, 2) join such rows.
    """
    vertices, colors = np.asarray(vertices), np.asarray(colors, float)
    edges = np.asarray(edges, int).reshape(-1, 2)
    row_count = len(vertices)
    row_index = np.arange(row_count)
    has_color = np.bincount(vertices, minlength=1) > 0
    vertex_row = (np.cumsum(has_color) - 1)[vertices]
    gather = sparse.csr_array((np.ones(row_count), (vertex_row, row_index)))
    mean = sparse.diags_array(1 / gather.sum(1)) @ gather
    deviation = sparse.eye_array(row_count, format='csr') - gather.T @ mean
    ends = np.repeat(np.arange(len(edges)), 2)
    signs = np.tile([1.0, -1.0], len(edges))
    steps = sparse.csr_array((signs, (ends, edges.ravel())), shape=(len(edges), row_count))
    normal = (deviation + smooth * (steps.T @ steps) + _SMALL * (gather.T @ mean)).tocsr()
    right = -(deviation @ np.clip(deviation @ colors, -_MOST, _MOST))
    inverse = sparse.diags_array(1 / normal.diagonal())
    if not right.size:
        return np.zeros_like(colors)
    normal, inverse, right = (m.astype(np.float32) for m in (normal, inverse, right))
    with ThreadPoolExecutor(right.shape[1]) as pool:  # SciPy's products release the GIL
        solve = partial(cg, normal, rtol=1e-3, maxiter=_ROUNDS, M=inverse)
        solutions = list(pool.map(solve, right.T))
    return np.stack([values for values, _ in solutions], 1).astype(float)
