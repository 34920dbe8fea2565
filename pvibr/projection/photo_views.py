"""Photographs that were taken from near the eye, in front of what a surface shows from anywhere.

They show it as the eye sees it, with what its shape lacks and with its gloss. Buehler et al.,
"Unstructured Lumigraph Rendering", SIGGRAPH 2001, section 4: weights fall with the angle between
the rays of the eye and of a photograph, and are nothing for the first one that is left out, so
that nothing jumps as the eye moves.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.projection.photo_pages import halvings, in_view

#: Photographs of a view.
VIEWS = 4
#: Angle at which a photograph has as much weight as the surface's choice, and one that is none.
_APART, _SAME = 0.35, 0.02
#: Vertices by which photographs are ranked.
_ASKED = 4000
#: Difference of colours by which a photograph of what has moved loses 63 % of its weight.
_UNLIKE = 50.0
#: Photographs beside one that tell whether something has moved, and rounds that even this.
_BESIDE, _EVEN = 4, 4
_KEPT = 16  # photographs of which it is kept where they may be shown


class PhotoViews:
    """Which photographs show most of what an eye sees, and how much of it.

    `colors` (points, 3), 0 to 255, are those of the surface's choice, NaN where it has none.
    """

    def __init__(self, surface, choice, sources, gains, colors):
        self.surface, self.choice, self.sources = surface, choice, sources
        self._gains, self._colors = gains, colors
        rows = surface.used[:: max(len(surface.used) // _ASKED, 1)]
        self._places, self._normals = surface.points[rows], surface.smooth[rows]
        self._seen = np.array([_among(seen, len(surface.points))[rows] for seen, _ in choice.seen])
        self._toward = np.array([s.camera.toward(self._places) for s in sources], np.float32)
        self._texels = np.array([s.camera.texel(self._places) for s in sources], np.float32)
        self._parts: dict[int, tuple] = {}  # the last used one is last

    def of(self, frame, matrix) -> tuple[dict, np.ndarray]:
        """Return photographs, how small they may be, and their shares of points (points, 4)."""
        eye = np.linalg.inv(frame.view_from_world @ matrix)
        eye = eye[:, 2] if frame.parallel else eye[:, 3]
        needs, worth = self._nearest(frame, matrix, eye)
        points = self.choice.points
        toward = _toward(eye, points)
        weights, parts = np.zeros((2, VIEWS, len(points)), np.float32)
        for k, (number, value) in enumerate(zip(needs, worth, strict=True)):
            away = toward - self.sources[number].camera.toward(points)
            apart = np.einsum('ij,ij->i', away, away)
            weights[k] = value * _APART**2 / (apart + _SAME**2)
            rows, part = self._part(number)
            parts[k, rows] = part
        return needs, drawn(weights, parts).T

    def _nearest(self, frame, matrix, eye):
        """Return the photographs nearest in angle, how small they may be, and their worth."""
        rows, pixels = in_view(frame, matrix, self._places, self._normals)
        if not len(rows):
            return {}, []
        places, seen, texels = self._places[rows], self._seen[:, rows], self._texels[:, rows]
        cosine = np.einsum('pij,ij->pi', self._toward[:, rows], _toward(eye, places))
        angle = np.where(seen, np.arccos(np.clip(cosine, -1, 1)), np.pi / 2).mean(1)
        order = np.argsort(angle, kind='stable')[: VIEWS + 1]
        last = angle[order[VIEWS]] if len(order) > VIEWS else np.pi / 2
        order = order[:VIEWS]
        worth = 1 - np.minimum(angle[order] / max(last, 1e-9), 1) ** 4
        # What is enlarged shows less than photographs that were taken from nearer.
        worth /= np.maximum(np.median(texels[order] / pixels, axis=1), 1) ** 2
        order, worth = order[worth > 0], worth[worth > 0]
        return {int(k): halvings(pixels, texels[k]) for k in order}, worth

    def _part(self, number):
        """Return where a photograph may be shown, and how much, 0 to 1."""
        found = self._parts.pop(number, None)
        if found is None:
            rows, part = self.choice.seen[number]
            found = rows, part / np.float32(255) * self._agreement(number, rows)
        self._parts[number] = found
        while len(self._parts) > _KEPT:
            del self._parts[next(iter(self._parts))]
        return found

    def _agreement(self, number, rows):
        """Return 0 to 1: what neither the surface nor photographs beside show has moved."""
        mine = self._shown(number, rows)
        unlike = np.abs(mine - self._colors[rows]).max(1)
        cosine = np.einsum('pij,ij->pi', self._toward, self._toward[number])
        both = self._seen & self._seen[number]
        near = np.where(both, cosine, -1).mean(1)
        near[number] = -np.inf
        for other in np.argsort(-near, kind='stable')[: min(_BESIDE, len(near) - 1)]:
            unlike = np.fmin(unlike, np.abs(mine - self._shown(other, rows)).max(1))
        alike = np.ones(len(self.surface.points), np.float32)
        alike[rows] = np.exp(-((np.nan_to_num(unlike) / _UNLIKE) ** 4))
        for _ in range(_EVEN):
            alike = self.surface.mean_around(alike)
        return np.maximum(alike[rows] - 0.05, 0) / 0.95

    def _shown(self, number, rows):
        """Return the colours that a photograph has at points, NaN outside."""
        source = self.sources[number]
        uv, _ = source.camera.project(self.surface.points[rows])
        return sample(source.small, uv)[:, :3] * self._gains[number]


def drawn(weights, parts):
    """Return how often each photograph is drawn by its weight, (k, n), and shows a point."""
    # Draws end with one that does, with probabilities `parts`, or with the surface's choice, of
    # weight 1: however large weights are, shares are as smooth as parts.
    shares, count = np.zeros_like(weights), len(weights)
    reached: dict = {0: np.ones_like(weights[0])}
    for tried in range(1 << count):
        rest = [k for k in range(count) if not tried >> k & 1]
        left = reached.pop(tried) / (1 + sum(weights[k] for k in rest))
        for k in rest:
            now = left * weights[k]
            shares[k] += now * parts[k]
            reached[tried | 1 << k] = reached.get(tried | 1 << k, 0) + now * (1 - parts[k])
    return shares


def _toward(eye, places):
    """Return unit vectors to an eye, of which the last component is 0 if it is a direction."""
    return unit_vectors(eye[:3] - eye[3] * places)


def _among(rows, count):
    """Return whether each of the rows up to a count is one of some."""
    found = np.zeros(count, bool)
    found[rows] = True
    return found
