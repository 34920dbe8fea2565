"""Colours of the photographs of a surface: exposures and seams levelled."""

from __future__ import annotations

import numpy as np

from pvibr.maths.draping import sample
from pvibr.photos.color_levelling import levelled
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
