"""View-dependent weights that favour photographs taken from near the eye.

They add parallax that the mesh lacks, and gloss. Buehler et al., "Unstructured Lumigraph
Rendering", SIGGRAPH 2001, section 4: weights fall with the angle between the rays of the eye and
of a photograph, to 0 for the first one excluded, so that nothing jumps as the eye moves.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.photos.photo_choice import mask_at
from pvibr.photos.photo_pages import halvings, in_view

#: Most photographs blended per view.
VIEWS = 4
#: Angles, radians: where a photograph weighs as much as the mesh's choice, and below which equal.
_HALF_ANGLE, _MIN_ANGLE = 0.35, 0.02
#: Most vertices sampled to rank photographs.
_RANKED_POINTS = 4000
#: Colour difference, 0 to 255, that costs a photograph of moved content 63 % of its weight.
_COLOR_TOLERANCE = 50.0
#: Nearest photographs compared to detect moved content, and rounds that smooth the result.
_NEIGHBOURS, _AGREEMENT_ROUNDS = 4, 4
_CACHED_PHOTOS = 16  # photographs whose coverage is cached


class PhotoViews:
    """Selects the photographs of a view, and their shares at each point.

    `colors` (points, 3), 0 to 255, are those of the choice, NaN where it has none.
    """

    def __init__(self, surface, choice, sources, gains, colors):
        self.surface, self.choice, self.sources = surface, choice, sources
        self._gains, self._colors = gains, colors
        connected, count = surface.connected_points, len(surface.points)
        ranked = connected[:: max(len(connected) // _RANKED_POINTS, 1)]
        self._places, self._normals = surface.points[ranked], surface.smooth[ranked]
        self._seen = np.array([mask_at(points, count)[ranked] for points, _ in choice.coverage])
        self._toward = np.array([s.camera.toward(self._places) for s in sources], np.float32)
        self._texels = np.array([s.camera.texel(self._places) for s in sources], np.float32)
        self._coverages: dict[int, tuple] = {}  # least recently used first

    def of(self, frame, world_from_mesh) -> tuple[dict, np.ndarray]:
        """Return photographs with their allowed halvings, and shares at points, (points, 4)."""
        eye = np.linalg.inv(frame.view_from_world @ world_from_mesh)
        eye = eye[:, 2] if frame.parallel else eye[:, 3]
        view_halvings, photo_worth = self._nearest(frame, world_from_mesh, eye)
        points = self.choice.points
        eye_directions = _toward(eye, points)
        weights, coverages = np.zeros((2, VIEWS, len(points)), np.float32)
        for k, (photo_index, worth) in enumerate(zip(view_halvings, photo_worth, strict=True)):
            ray_difference = eye_directions - self.sources[photo_index].camera.toward(points)
            squared_angle = np.einsum('ij,ij->i', ray_difference, ray_difference)
            weights[k] = worth * _HALF_ANGLE**2 / (squared_angle + _MIN_ANGLE**2)
            covered_points, coverage = self._coverage(photo_index)
            coverages[k, covered_points] = coverage
        return view_halvings, photo_shares(weights, coverages).T

    def _nearest(self, frame, world_from_mesh, eye):
        """Return the photographs nearest in angle with their allowed halvings, and weights."""
        points, pixels = in_view(frame, world_from_mesh, self._places, self._normals)
        if not len(points):
            return {}, []
        texels, toward_eye = self._texels[:, points], _toward(eye, self._places[points])
        cosine = np.einsum('pij,ij->pi', self._toward[:, points], toward_eye)
        ray_angles = np.arccos(np.clip(cosine, -1, 1))
        angle = np.where(self._seen[:, points], ray_angles, np.pi / 2).mean(1)
        order = np.argsort(angle, kind='stable')[: VIEWS + 1]
        limit_angle = angle[order[VIEWS]] if len(order) > VIEWS else np.pi / 2
        order = order[:VIEWS]
        photo_worth = 1 - np.minimum(angle[order] / max(limit_angle, 1e-9), 1) ** 4
        # A photograph that would be magnified yields to those taken from nearer.
        photo_worth /= np.maximum(np.median(texels[order] / pixels, axis=1), 1) ** 2
        order, photo_worth = order[photo_worth > 0], photo_worth[photo_worth > 0]
        return {int(k): halvings(pixels, texels[k]) for k in order}, photo_worth

    def _coverage(self, photo_index):
        """Return the points that a photograph may show, and its coverage there, 0 to 1."""
        coverage = self._coverages.pop(photo_index, None)
        if coverage is None:
            points, fade = self.choice.coverage[photo_index]
            coverage = points, fade / np.float32(255) * self._agreement(photo_index, points)
        self._coverages[photo_index] = coverage
        while len(self._coverages) > _CACHED_PHOTOS:
            del self._coverages[next(iter(self._coverages))]
        return coverage

    def _agreement(self, photo_index, points):
        """Return 1 to 0 at points, 0 where neither mesh nor neighbouring photographs agree."""
        photo_colors = self._colors_at(photo_index, points)
        difference = np.abs(photo_colors - self._colors[points]).max(1)
        cosine = np.einsum('pij,ij->pi', self._toward, self._toward[photo_index])
        seen_jointly = self._seen & self._seen[photo_index]
        mean_cosines = np.where(seen_jointly, cosine, -1).mean(1)
        mean_cosines[photo_index] = -np.inf
        nearest = np.argsort(-mean_cosines, kind='stable')
        for neighbour in nearest[: min(_NEIGHBOURS, len(nearest) - 1)]:
            unlike_neighbour = np.abs(photo_colors - self._colors_at(neighbour, points)).max(1)
            difference = np.fmin(difference, unlike_neighbour)
        agreement = np.ones(len(self.surface.points), np.float32)
        agreement[points] = np.exp(-((np.nan_to_num(difference) / _COLOR_TOLERANCE) ** 4))
        for _ in range(_AGREEMENT_ROUNDS):
            agreement = self.surface.mean_around(agreement)
        return np.maximum(agreement[points] - 0.05, 0) / 0.95

    def _colors_at(self, photo_index, points):
        """Return the colours of a photograph at points, NaN outside it."""
        source = self.sources[photo_index]
        uv, _ = source.camera.project(self.surface.points[points])
        return sample(source.small, uv)[:, :3] * self._gains[photo_index]


def photo_shares(weights, coverages):
    """Return the probability that a weighted draw ends with each photograph, (k, n)."""
    # Photographs are drawn by weight until one covers the point (probability `coverages`), or the
    # mesh's choice, of weight 1, comes up: shares stay as smooth as coverages for any weights.
    shares, count = np.zeros_like(weights), len(weights)
    reached: dict = defaultdict(float, {0: np.ones_like(weights[0])})
    for drawn_set in range(1 << count):
        remaining = [k for k in range(count) if not drawn_set >> k & 1]
        probability = reached.pop(drawn_set) / (1 + sum(weights[k] for k in remaining))
        for k in remaining:
            draw_probability = probability * weights[k]
            shares[k] += draw_probability * coverages[k]
            reached[drawn_set | 1 << k] += draw_probability * (1 - coverages[k])
    return shares


def _toward(eye, places):
    """Return unit vectors to a homogeneous eye, whose w is 0 for a direction."""
    return unit_vectors(eye[:3] - eye[3] * places)
