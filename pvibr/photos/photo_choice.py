"""Which photographs paint each triangle of a mesh, with their weights at its corners.

A vertex ranks the photographs that see every triangle around it by their foreshortened pixel
density; if there are none, those that see some of them. A triangle blends the photographs of its
corners with weights linear between them: where the sets differ, a photograph fades out within one
triangle and no border shows. Triangles that no photograph sees whole are subdivided.

Visibility, fades and colour levels are computed at vertices, so triangles that are large in a
photograph are subdivided first.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from pvibr.core.errors import warn
from pvibr.maths.camera_views import view_of
from pvibr.maths.draping import border, exposure_gains, sample
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.cutting import cut_at
from pvibr.photos.photo_cut import sixteenths
from pvibr.photos.photo_sources import threads
from pvibr.visibility.depth_maps import depth_scene
from pvibr.visibility.depth_test import seen as seen_in_depth
from pvibr.visibility.embree_rays import Rays, ray_method
from pvibr.visibility.surface_samples import bounds_of, edges_of, normals_and_areas

_NOTHING_VISIBLE = (
    'no photograph sees the front of any triangle, so the mesh stays bare: check the cameras; if '
    'the triangles face away from them, use mesh.flip_faces()'
)
_SEEN_FROM_BEHIND = (
    '{:.0%} of the surface in view of photographs is bare, as they see its back: use '
    'mesh.flip_faces(), or, if only some triangles face inwards, '
    'mesh.compute_normals(auto_orient_normals=True)'
)
#: Bare share of the surface that warrants a warning; number of triangles sampled to estimate it.
_WARN_SHARE, _SAMPLED_FACES = 0.05, 4000
#: Most photographs blended at a vertex, and in a triangle.
VERTEX_PHOTOS, FACE_PHOTOS = 4, 4
_VERTEX_CANDIDATES = 7  # compared at a vertex: content that most of them lack has moved
#: Difference from the median colour, 0 to 255, that costs a photograph 63 % of its score.
_COLOR_TOLERANCE = 14.0
_AGREEMENT_ROUNDS = 3  # that smooth agreement: jumps in weight would show as steps
_GAIN_VERTICES = 4000  # on which exposures are compared
#: Width of the fade at the edge of what a photograph sees, as a fraction of its longer side.
_FADE_WIDTH = 0.025
_PARTIAL_SCORE = 1e-5  # factor for a photograph that sees only some triangles around a vertex
_NORMAL_ROUNDS = 6  # that smooth the normals used for ranking: noise must not switch photographs
#: Barycentric points of a triangle that must be visible, besides its corners.
_INNER_SHARES = np.array([[1, 1, 1], [3, 1, 1], [1, 3, 1], [1, 1, 3]]) / [[3], [5], [5], [5]]
_MAP_RESOLUTION = 2048  # texels along a side of the depth map when no rays are cast
_MIN_COSINE = 0.02
_MIN_SHARE = 0.08  # smaller shares are dropped: each photograph of a triangle costs time


@dataclass(frozen=True, eq=False)
class Choice:
    """Photographs of triangles: indices (f, 4), -1 for none, and weights at corners (f, 3, 4)."""

    points: np.ndarray
    faces: np.ndarray
    #: The successive `Cut`s of the mesh's triangles.
    cuts: tuple
    photos: np.ndarray
    weights: np.ndarray
    #: RGB factors of each photograph that match exposures in overlaps, (n, 3).
    gains: np.ndarray
    #: For each photograph: the points whose surroundings it sees, and their fade, 0 to 255.
    coverage: tuple

    @property
    def origin(self):
        """The original mesh triangle of each, (f,)."""
        origin = np.arange(len(self.faces))
        for cut in self.cuts[::-1]:
            origin = cut.parent[origin]
        return origin

    def at(self, cell, barycentric):
        """Return triangles and barycentric coordinates of points given on the original mesh."""
        for cut in self.cuts:
            cell, barycentric = cut.at(cell, barycentric)
        return cell, barycentric


def mask_at(indices, shape):
    """Return a mask that is True at indices."""
    mask = np.zeros(shape, bool)
    mask[indices] = True
    return mask


def distinct(values):
    """Return the sorted unique values of an array, ten times faster than `numpy.unique`."""
    values = np.sort(values, axis=None)
    return values[np.concatenate([values[:1] == values[:1], values[1:] != values[:-1]])]


class Surface:
    """Triangles, subdivided by `cuts`, with their adjacency."""

    def __init__(self, points, faces, cuts=()):
        self.points, self.faces, self.cuts = np.asarray(points, float), faces, cuts
        corners = self.points[faces]
        self.normals, self.areas = normals_and_areas(corners)
        self.middles = corners.mean(1)
        self.offsets = np.einsum('ij,ij->i', self.normals, self.middles)
        #: An even sample of the triangles.
        self.sampled_faces = np.arange(0, len(faces), max(len(faces) // _SAMPLED_FACES, 1))
        directed_edges = edges_of(faces)
        directed_edges = np.concatenate([directed_edges, directed_edges[:, ::-1]])
        point_count = len(self.points)
        self.edges = distinct(directed_edges[:, 0] * point_count + directed_edges[:, 1])
        self.edges = np.stack([self.edges // point_count, self.edges % point_count], 1)
        self.connected_points = distinct(self.edges[:, 0])
        self._starts = np.searchsorted(self.edges[:, 0], self.connected_points)
        self._counts = np.bincount(self.edges[:, 0], minlength=point_count)
        self._first = np.cumsum(self._counts) - self._counts
        edge_vectors = self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]]
        self._lengths = np.linalg.norm(edge_vectors, axis=1).astype(np.float32)
        normals = np.zeros_like(self.points)
        np.add.at(normals, faces.T, self.normals * self.areas[:, None])
        self.outward = unit_vectors(normals)
        for _ in range(_NORMAL_ROUNDS):
            normals[self.connected_points] += self._neighbour_sums(normals)
        self.smooth = unit_vectors(normals)

    def distances(self, is_source, max_distance):
        """Return the distance of vertices from sources along edges, clamped to a maximum, (n,)."""
        distance = np.where(is_source, 0, max_distance).astype(np.float32)
        front = np.flatnonzero(is_source)
        while len(front):
            degrees = self._counts[front]
            edges = np.repeat(self._first[front] + degrees - np.cumsum(degrees), degrees)
            edges += np.arange(len(edges))
            neighbours = self.edges[edges, 1]
            via_edge = np.repeat(distance[front], degrees) + self._lengths[edges]
            nearer = via_edge < distance[neighbours]
            neighbours = neighbours[nearer]
            np.minimum.at(distance, neighbours, via_edge[nearer])
            front = distinct(neighbours)
        return distance

    def mean_around(self, values):
        """Return the mean of the values of each vertex and its neighbours."""
        means, neighbour_counts = values.copy(), np.diff(self._starts, append=len(self.edges))
        means[self.connected_points] += self._neighbour_sums(values)
        means[self.connected_points] /= neighbour_counts + 1
        return means

    def _neighbour_sums(self, values):
        return np.add.reduceat(values[self.edges[:, 1]], self._starts)


class Visibility:
    """Which points of a surface a camera sees."""

    def __init__(self, surfaces, method='auto'):
        self.surfaces = surfaces
        self._rays = Rays(surfaces) if ray_method(method) else None
        self._scene: Any = None
        self._stack = ExitStack()

    def __enter__(self):
        if self._rays is None:
            self._scene = self._stack.enter_context(depth_scene(self.surfaces))
            self._last: tuple = (None, None, None)
        return self

    def __exit__(self, *error):
        self._stack.close()

    def each(self, function, items):
        """Map a function over items, in threads if rays are cast."""
        if self._rays is None:
            return map(function, items)
        return self._stack.enter_context(threads()).map(function, items)

    def free(self, camera, points, normals):
        """Return whether points are unoccluded from a camera, (n,) bool."""
        toward = camera.toward(points)
        cosine = np.einsum('ij,ij->i', normals, toward)
        toward_eye = np.where(cosine[:, None] < 0, -normals, normals)
        if self._rays is not None:
            ray_length = np.full(len(points), np.inf)
            if not isinstance(camera, Orthographic):
                ray_length = np.linalg.norm(camera.position - points, axis=1)
            return self._rays.free(points, toward_eye, toward, ray_length)
        if self._last[0] is not camera:
            view = view_of(camera, bounds_of(self.surfaces), _MAP_RESOLUTION)
            depth = None if view is None else self._scene.depth(view, _MAP_RESOLUTION)
            self._last = camera, view, depth
        _, view, depth = self._last
        if view is None:
            return np.zeros(len(points), bool)
        return seen_in_depth(view, depth, points, toward_eye, 0.25) > 0.5


def choose(surface, pictures, visibility, max_angle=85.0, sharp=4.0) -> Choice:
    """Choose the photographs of all triangles from `PhotoSource`s with small versions loaded."""
    min_cosine = max(float(np.cos(np.radians(max_angle))), _MIN_COSINE)
    vertex_scores = _Best(len(surface.points), _VERTEX_CANDIDATES)
    face_scores = _Best(len(surface.faces), 1)
    touched, seen_from_behind = np.zeros((2, len(surface.faces)), bool)
    photo_coverage, face_bits = [], []
    looks = visibility.each(lambda p: _Look(surface, p, visibility, min_cosine), pictures)
    for photo_index, look in enumerate(looks):
        vertex_scores.add(photo_index, look.rows, look.scores)
        face_scores.add(photo_index, *look.face_scores)
        touched |= look.touched
        seen_from_behind[look.seen_from_behind] = True
        photo_coverage.append(look.coverage)
        face_bits.append((np.packbits(look.facing), np.packbits(look.covered)))
    gains = _agreed(vertex_scores, surface, pictures)
    photos, weights = _mixed(surface.faces, vertex_scores, sharp)
    _drop_hidden(surface, pictures, visibility, photos, weights, face_bits)
    bare = np.flatnonzero(photos[:, 0] < 0)
    photos[bare, 0], weights[bare, :, 0] = face_scores.numbers[bare, 0], 1.0
    _drop_hidden(surface, pictures, visibility, photos, weights, face_bits, bare)
    geometry = surface.points, surface.faces, surface.cuts
    choice = Choice(*geometry, photos, weights, gains, tuple(photo_coverage))
    bare = np.flatnonzero(touched & (photos[:, 0] < 0))
    choice = _cut(choice, bare, pictures, visibility, min_cosine) if len(bare) else choice
    _warn_of_bare(surface, choice, seen_from_behind)
    return choice


def _warn_of_bare(surface, choice, seen_from_behind):
    """Warn if the surface stays bare, or if photographs see much of it only from behind."""
    origin = replace(choice, cuts=choice.cuts[len(surface.cuts) :]).origin
    painted = mask_at(origin[choice.photos[:, 0] >= 0], len(surface.faces))
    if not painted.any():
        warn(_NOTHING_VISIBLE)
        return
    sampled = surface.sampled_faces
    areas, painted, behind = surface.areas[sampled], painted[sampled], seen_from_behind[sampled]
    bare_area = areas[behind & ~painted].sum()
    bare_share = bare_area / max(bare_area + areas[painted].sum(), 1e-300)
    if bare_share >= _WARN_SHARE:
        warn(_SEEN_FROM_BEHIND.format(bare_share))


class _Look:
    """What one picture sees: scores of vertices, and of triangles that it sees whole."""

    def __init__(self, surface, picture, visibility, min_cosine):
        camera, faces = picture.camera, surface.faces
        cosine = _cosines(camera, surface)
        self.facing = facing = cosine > min_cosine
        vertices = np.flatnonzero(mask_at(faces[facing], len(surface.points)))
        uv, within = _within(picture, surface.points[vertices])
        vertices, uv = vertices[within], uv[within]
        is_free = visibility.free(camera, surface.points[vertices], surface.outward[vertices])
        vertices, uv = vertices[is_free], uv[is_free]
        is_visible = mask_at(vertices, len(surface.points))
        visible_corners = is_visible[faces]
        self.covered = covered = facing & visible_corners.all(1)
        self.touched = facing & visible_corners.any(1)
        texel = camera.texel(surface.points)
        density = np.zeros(len(is_visible))
        density[vertices] = picture.sharpness / texel[vertices] ** 2
        back_faces = surface.sampled_faces[cosine[surface.sampled_faces] < -min_cosine]
        back_faces = back_faces[_within(picture, surface.middles[back_faces])[1]]
        is_free = visibility.free(camera, surface.middles[back_faces], surface.normals[back_faces])
        self.seen_from_behind = back_faces[is_free]
        whole_faces = np.flatnonzero(covered)
        face_density = density[faces[whole_faces]].mean(1)
        self.face_scores = whole_faces, cosine[whole_faces] * face_density
        width = _FADE_WIDTH * max(camera.size) * texel
        fade_sources = ~is_visible | mask_at(faces[~covered], len(is_visible))
        fade = surface.distances(fade_sources, width)[vertices] / width[vertices]
        touches_covered = mask_at(faces[covered], len(is_visible))
        toward = camera.toward(surface.points[vertices])
        angle_weight = np.einsum('ij,ij->i', toward, surface.smooth[vertices])
        near_edge = 1e-3 + border(uv, 0.05)
        scores = np.maximum(angle_weight, min_cosine) * density[vertices] * near_edge
        # A vertex that no photograph sees all around falls back on those that see part of it.
        scores *= np.maximum(fade, _PARTIAL_SCORE * touches_covered[vertices])
        positive = scores > 0
        self.rows, self.scores = vertices[positive], scores[positive]
        fade_rows = fade > 0
        coverage = np.rint(255 * np.minimum(fade * near_edge, 1)[fade_rows]).astype(np.uint8)
        self.coverage = vertices[fade_rows].astype(np.int32), coverage


def _cosines(camera, surface):
    """Return the cosines between triangle normals and directions to a camera."""
    if isinstance(camera, Orthographic):
        return surface.normals @ camera.toward(np.zeros((1, 3)))[0]
    toward = camera.position - surface.middles
    distance = np.sqrt(np.einsum('ij,ij->i', toward, toward))
    plane_distance = surface.normals @ camera.position - surface.offsets
    return plane_distance / np.maximum(distance, 1e-300)


def _within(picture, points):
    """Return the image coordinates of points, and whether they are in the image and its mask."""
    uv, _ = picture.camera.project(points)
    with np.errstate(invalid='ignore'):
        within = ((uv >= 0) & (uv <= 1)).all(1)
    if picture.survey_mask is not None:
        inside_image = np.flatnonzero(within)
        within[inside_image] = sample(picture.survey_mask, uv[inside_image], 'nearest')[:, 0] > 0
    return uv, within


class _Best:
    """The photographs of highest score for each item, in descending order."""

    def __init__(self, count, per_item):
        self.scores = np.zeros((count, per_item), np.float32)
        self.numbers = np.full((count, per_item), -1, np.int32)

    def add(self, photo_index, items, scores):
        """Merge the scores of another photograph."""
        higher = scores > self.scores[items, -1]
        items = items[higher]
        self.scores[items, -1], self.numbers[items, -1] = scores[higher], photo_index
        self.sort(items)

    def sort(self, items):
        """Sort the scores of items in descending order."""
        order = np.argsort(-self.scores[items], axis=1, kind='stable')
        for values in (self.scores, self.numbers):
            values[items] = np.take_along_axis(values[items], order, 1)


def _agreed(best, surface, pictures):
    """Lower the scores of photographs that differ from the others; return all gains, (n, 3)."""
    colors = np.full((*best.numbers.shape, 3), np.nan, np.float32)
    for photo_index, picture in enumerate(pictures):
        vertex, slot = np.nonzero(best.numbers == photo_index)
        uv, _ = picture.camera.project(surface.points[vertex])
        colors[vertex, slot] = sample(picture.small, np.clip(uv, 0, 1))[:, :3]
    gains = _gains(best.numbers, colors, len(pictures))
    colors *= gains.astype(np.float32)[best.numbers]
    overlapping = np.flatnonzero(best.numbers[:, 2] >= 0)
    if len(overlapping):
        median_color = np.nanmedian(colors[overlapping], axis=1, keepdims=True)
        difference = np.abs(colors[overlapping] - median_color).max(2) / _COLOR_TOLERANCE
        agreement = np.ones(best.scores.shape, np.float32)
        agreement[overlapping] = np.nan_to_num(np.exp(-(difference**2))).clip(1e-6)
        best.scores *= _smoothed(agreement, best.numbers, surface.edges)
        best.sort(overlapping)
    return gains


def _smoothed(values, numbers, edges):
    """Return values per vertex and photograph averaged over neighbouring vertices."""
    points, photo_count = len(values), int(numbers.max()) + 1
    vertex, slot = np.nonzero(numbers >= 0)
    photo_index = numbers[vertex, slot]
    order = np.argsort(vertex * photo_count + photo_index)
    vertex, slot, photo_index = vertex[order], slot[order], photo_index[order]
    near = np.ones(len(edges), np.float32), (edges[:, 0], edges[:, 1])
    near = sparse.csr_array(near, shape=(points, points)) + sparse.eye_array(points, format='csr')
    row_starts = np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=points))])

    def around(values_at):
        table = (values_at, photo_index, row_starts)
        return (near @ sparse.csr_array(table, shape=(points, photo_count)))[vertex, photo_index]

    averages = values[vertex, slot]
    total = around(np.ones_like(averages))
    for _ in range(_AGREEMENT_ROUNDS):
        averages = around(averages) / total
    values[vertex, slot] = averages
    return values


def _gains(numbers, colors, photo_count):
    """Return the RGB factors that match exposures of photographs in overlaps, (n, 3)."""
    overlapping = np.flatnonzero(numbers[:, 1] >= 0)
    overlapping = overlapping[:: max(len(overlapping) // _GAIN_VERTICES, 1)]
    color_table = np.full((photo_count, max(len(overlapping), 1), 3), np.nan)
    vertex, slot = np.nonzero(numbers[overlapping] >= 0)
    color_table[numbers[overlapping][vertex, slot], vertex] = colors[overlapping[vertex], slot]
    return exposure_gains(color_table)


def _mixed(faces, best, sharpness):
    """Return the photographs of triangles and their weights at corners."""
    # Subtract the score of the first one excluded, so that it enters with weight 0.
    first = np.maximum(best.scores[:, :1], 1e-37)
    vertex_share = (best.scores / first) ** sharpness
    excluded = vertex_share[:, VERTEX_PHOTOS : VERTEX_PHOTOS + 1]
    vertex_share = np.maximum(vertex_share[:, :VERTEX_PHOTOS] - excluded, 0.0)
    vertex_share = np.maximum(_normalized(vertex_share) - _MIN_SHARE, 0)
    numbers = best.numbers[:, :VERTEX_PHOTOS]
    corner_photos = numbers[faces].reshape(len(faces), -1)
    corner_shares = vertex_share[faces].reshape(len(faces), -1)
    same_photo = corner_photos[:, :, None] == corner_photos[:, None, :]
    sums = np.einsum('fij,fj->fi', same_photo, corner_shares)
    is_duplicate = np.tril(same_photo, -1).any(2)
    sums[is_duplicate | (corner_photos < 0)] = 0
    order = np.argsort(-sums, axis=1, kind='stable')[:, :FACE_PHOTOS]
    photos = np.take_along_axis(corner_photos, order, 1)
    photos[np.take_along_axis(sums, order, 1) <= 0] = -1
    shows_photo = numbers[faces][..., None] == photos[:, None, None, :]
    weights = np.einsum('fcm,fcmk->fck', vertex_share[faces], shows_photo)
    weights *= photos[:, None, :] >= 0
    return photos, _balanced(weights)


def _balanced(weights):
    """Return weights that sum to 1 at each corner of the triangles that have any."""
    corner_sums, face_sums = weights.sum(2, keepdims=True), weights.sum(1, keepdims=True)
    return _normalized(np.where(corner_sums > 1e-6, weights, face_sums)).astype(np.float32)


def _normalized(weights):
    """Return weights that sum to 1 along the last axis, or stay 0."""
    total = weights.sum(-1, keepdims=True)
    return np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)


def _drop_hidden(surface, pictures, visibility, photos, weights, face_bits, face_rows=slice(None)):
    """Drop photographs from triangles that are partly hidden from them."""
    faces = np.arange(len(photos))[face_rows]

    def free(photo_index, face, inner_shares):
        corners = surface.points[surface.faces[face]]
        points = np.einsum('ik,fkd->fid', inner_shares, corners).reshape(-1, 3)
        normals = np.repeat(surface.normals[face], len(inner_shares), 0)
        is_free = _within(pictures[photo_index], points)[1]
        is_free &= visibility.free(pictures[photo_index].camera, points, normals)
        return is_free.reshape(-1, len(inner_shares)).all(1)

    def hidden(photo_index):
        face, slot = np.nonzero(photos[face_rows] == photo_index)
        face = faces[face]
        bits = face_bits[photo_index]
        facing, covered = (np.unpackbits(b, count=len(photos))[face] for b in bits)
        is_free = free(photo_index, face, _INNER_SHARES) & (facing > 0)
        partly_covered = np.flatnonzero(is_free & (covered == 0))
        is_free[partly_covered] = free(photo_index, face[partly_covered], _INSIDE)
        return face[~is_free], slot[~is_free]

    candidates = photos[face_rows]
    for face, slot in list(visibility.each(hidden, np.unique(candidates[candidates >= 0]))):
        photos[face, slot] = -1
        weights[face, :, slot] = 0
    order = np.argsort(photos < 0, axis=1, kind='stable')
    photos[:] = np.take_along_axis(photos, order, 1)
    weights[:] = _balanced(np.take_along_axis(weights, order[:, None, :], 2))


def _cut(choice, bare_faces, pictures, visibility, min_cosine) -> Choice:
    """Return a choice with bare triangles split in sixteen, each painted by what sees it whole."""
    part_corners, parts = sixteenths()
    corners = choice.points[choice.faces[bare_faces]]
    points = np.einsum('ik,fkd->fid', part_corners, corners)
    normals, _ = normals_and_areas(corners)
    best = _Best(len(bare_faces) * len(parts), 1)
    for photo_index, picture in enumerate(pictures):
        _paint_parts(picture, photo_index, points, normals, parts, visibility, min_cosine, best)
    is_painted = (best.numbers[:, 0].reshape(-1, len(parts)) >= 0).any(1)
    part_photos = best.numbers.reshape(-1, len(parts))[is_painted].ravel()
    cut_edges = mask_at(bare_faces[is_painted], choice.faces.shape)
    points, once = cut_at(choice.points, choice.faces, cut_edges)
    points, twice = cut_at(points, once.faces, cut_edges[once.parent])
    parent = once.parent[twice.parent]
    photos, weights = choice.photos[parent], choice.weights[parent]
    part_rows = np.flatnonzero(cut_edges[parent, 0])
    photos[part_rows], weights[part_rows] = -1, 0
    photos[part_rows, 0] = part_photos
    weights[part_rows[part_photos >= 0], :, 0] = 1
    geometry = {'points': points, 'faces': twice.faces, 'cuts': (*choice.cuts, once, twice)}
    return replace(choice, photos=photos, weights=weights, **geometry)


def _paint_parts(picture, photo_index, points, normals, parts, visibility, min_cosine, best):
    """Score the parts of triangles that a picture sees."""
    camera, count = picture.camera, points.shape[1]
    part_middles = points[:, parts].mean(2)
    face_middles = part_middles.mean(1)
    cosine = np.einsum('ij,ij->i', normals, camera.toward(face_middles))
    facing = np.flatnonzero(cosine > min_cosine)
    facing = facing[_within(picture, points[facing].reshape(-1, 3))[1].reshape(-1, count).any(1)]
    if not len(facing):
        return
    places = part_middles[facing].reshape(-1, 3)
    is_visible = _within(picture, places)[1]
    is_visible &= visibility.free(camera, places, np.repeat(normals[facing], len(parts), 0))
    is_visible = is_visible.reshape(len(facing), -1)
    scores = cosine[facing] / camera.texel(face_middles[facing]) ** 2
    scores = scores[:, None] * is_visible * (1 + is_visible.sum(1, keepdims=True))
    part_rows = (facing[:, None] * len(parts) + np.arange(len(parts))).ravel()
    best.add(photo_index, part_rows, scores.ravel())


#: Likewise for a triangle whose corners are not all visible: points nearly at its border.
_INSIDE = 0.97 * sixteenths()[0] + 0.01
