"""Colours of the photographs of a surface: exposures and seams levelled."""

from __future__ import annotations

import numpy as np

from pvibr.maths.draping import sample
from pvibr.maths.levelling import levelled
from pvibr.projection.photo_choice import distinct


class Pairs:
    """The vertices of a choice, each with each of its photographs."""

    def __init__(self, choice):
        self._count = len(choice.points)
        face, place = np.nonzero(choice.photos >= 0)
        photo = choice.photos[face, place].astype(np.int64)
        count = int(photo.max(initial=0)) + 1
        keys = choice.faces[face] * count + photo[:, None]
        self.keys = distinct(keys)
        rows = np.searchsorted(self.keys, keys)
        self.vertices, self.photos = self.keys // count, self.keys % count
        self.edges = np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]])
        low, high = self.edges.min(1), self.edges.max(1)
        self.edges = np.stack(np.divmod(distinct(low * len(self.keys) + high), len(self.keys)), 1)
        #: Of corners and their photographs, (f, 3, 4); -1 where there is none.
        self.of_corners = np.full(choice.weights.shape, -1)
        self.of_corners[face, :, place] = rows

    def colors(self, points, pictures) -> np.ndarray:
        """Return what the small versions of the pictures show there, (n, 3)."""
        found = np.full((len(self.keys), 3), np.nan)
        for number in distinct(self.photos):
            rows = np.flatnonzero(self.photos == number)
            uv, _ = pictures[number].camera.project(points[self.vertices[rows]])
            found[rows] = sample(pictures[number].small, np.clip(uv, 0, 1))[:, :3]
        return found

    def corrections(self, colors) -> np.ndarray:
        """Return what is added to colours so that those of each vertex are alike, (n, 3)."""
        return levelled(self.vertices, np.nan_to_num(colors), self.edges)

    def means(self, colors) -> np.ndarray:
        """Return the mean of the colours of each vertex, NaN where there are none, (points, 3)."""
        count = np.bincount(self.vertices, minlength=self._count)
        sums = [np.bincount(self.vertices, c, self._count) for c in colors[: len(self.keys)].T]
        with np.errstate(invalid='ignore'):
            return np.stack(sums, 1) / count[:, None]


def alike_corners(vertices, numbers, weights):
    """Return one row of each group of equal corners, and the group of each corner."""
    rng = np.random.default_rng(0)
    keys = vertices.astype(np.int64) * int(rng.integers(1 << 62) | 1)
    for values in (numbers, np.rint(weights * 4096).astype(np.int64)):
        for column in values.T:
            keys = (keys ^ (keys >> 29)) * int(rng.integers(1 << 62) | 1) + column
    return np.unique(keys, return_index=True, return_inverse=True)[1:]
