"""Which photographs paint the triangles of a mesh, and how much at each corner.

A vertex takes the best photographs of those that see all triangles around it, by the pixels that
they have there, seen at that angle; if there are none, of those that see some of them. A triangle
shows those of its corners, each with weights that are linear between them: where sets differ, a
photograph fades to nothing within a triangle, so that no border shows. What no photograph sees as
a whole is cut into smaller triangles.

Triangles that are large in a photograph are cut before all that: what is seen, how much a
photograph fades and how colours are levelled is found at vertices.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from pvibr.core.errors import warn
from pvibr.maths.depth_test import seen as seen_in_depth
from pvibr.maths.draping import border, exposure_gains, sample
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.cutting import cut_at
from pvibr.projection.depth_maps import depth_scene, view_of
from pvibr.projection.photo_cut import sixteen
from pvibr.projection.photo_sources import threads
from pvibr.projection.rays import Rays, ray_method
from pvibr.projection.samples import bounds_of, normals_and_areas

_UNSEEN = (
    'no photograph sees the front of a triangle, so that the mesh stays bare: check the cameras; '
    'triangles that face away from them are turned around by mesh.flip_faces()'
)
_BEHIND = (
    '{:.0%} of the surface that photographs see is bare, as they see it from behind: turn its '
    'triangles around by mesh.flip_faces(), or, if only some face inwards, by '
    'mesh.compute_normals(auto_orient_normals=True)'
)
#: Share of the surface that is reported, and how many triangles it is estimated from.
_REPORTED, _ASKED_OF = 0.05, 4000
#: Photographs that a vertex takes, and that a triangle shows.
KEPT, SHOWN = 4, 4
#: Photographs of a vertex whose colours are compared: what is not there in most has moved.
_ASKED = 7
#: Difference from the median colour, 0 to 255, by which a photograph loses 63 % of its score.
_UNLIKE = 14.0
#: Rounds that average agreement over neighbours: weights that jump are seen as steps.
_EVEN = 3
_GAIN_VERTICES = 4000  # on which exposures are compared
#: Width over which a photograph fades in from where it sees no more, in its longer sides.
_FADE = 0.025
#: Score of a photograph that does not see all triangles around a vertex.
_PARTLY = 1e-5
#: Rounds that smooth the normals by which photographs are judged: noise is no reason to change.
_SMOOTH = 6
#: Inner places of a triangle that a photograph must see, by corners.
_INNER = np.array([[1, 1, 1], [3, 1, 1], [1, 3, 1], [1, 1, 3]]) / [[3], [5], [5], [5]]
_MAP = 2048  # texels along a side of a depth map, where no rays are cast
_LEAST_COSINE = 0.02
_FAINT = 0.08  # shares below are none: each photograph of a triangle takes time


@dataclass(frozen=True, eq=False)
class Choice:
    """Photographs of triangles: numbers (f, 4), -1 for none, and weights at corners (f, 3, 4)."""

    points: np.ndarray
    faces: np.ndarray
    #: Each `Cut` of the mesh's triangles, one after another.
    cuts: tuple
    photos: np.ndarray
    weights: np.ndarray
    #: Factors of red, green and blue of each photograph that make overlaps alike, (n, 3).
    gains: np.ndarray
    #: Of each photograph: points around which it sees everything, and 0 to 255 by how far around.
    seen: tuple

    @property
    def origin(self):
        """The triangle of the mesh that each was cut from, (f,)."""
        origin = np.arange(len(self.faces))
        for cut in self.cuts[::-1]:
            origin = cut.parent[origin]
        return origin

    def at(self, face, share):
        """Return the triangles that places of those of the mesh are in, and places in them."""
        for cut in self.cuts:
            face, share = cut.at(face, share)
        return face, share


def distinct(keys):
    """Return the values of an array in rising order; NumPy's own takes ten times as long."""
    keys = np.sort(keys, axis=None)
    return keys[np.concatenate([keys[:1] == keys[:1], keys[1:] != keys[:-1]])]


class Surface:
    """Triangles with what a choice asks of their neighbourhood; `cuts` have made them."""

    def __init__(self, points, faces, cuts=()):
        self.points, self.faces, self.cuts = np.asarray(points, float), faces, cuts
        corners = self.points[faces]
        self.normals, self.areas = normals_and_areas(corners)
        self.middles = corners.mean(1)
        self.offsets = np.einsum('ij,ij->i', self.normals, self.middles)
        #: Some triangles, evenly spread over their numbers.
        self.some = np.arange(0, len(faces), max(len(faces) // _ASKED_OF, 1))
        pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        pairs = np.concatenate([pairs, pairs[:, ::-1]])
        count = len(self.points)
        self.edges = distinct(pairs[:, 0] * count + pairs[:, 1])
        self.edges = np.stack([self.edges // count, self.edges % count], 1)
        self.used = distinct(self.edges[:, 0])
        self._starts = np.searchsorted(self.edges[:, 0], self.used)
        self._counts = np.bincount(self.edges[:, 0], minlength=count)
        self._first = np.cumsum(self._counts) - self._counts
        across = self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]]
        self._lengths = np.linalg.norm(across, axis=1).astype(np.float32)
        around = np.zeros_like(self.points)
        for k in range(3):
            np.add.at(around, faces[:, k], self.normals * self.areas[:, None])
        self.outward = unit_vectors(around)
        for _ in range(_SMOOTH):
            around[self.used] += np.add.reduceat(around[self.edges[:, 1]], self._starts)
        self.smooth = unit_vectors(around)

    def distances(self, those, reach):
        """Return how far vertices are from some along edges, at most the reach of each, (n,)."""
        found = np.where(those, 0, reach).astype(np.float32)
        rows = np.flatnonzero(those)
        while len(rows):
            count = self._counts[rows]
            edge = np.repeat(self._first[rows] + count - np.cumsum(count), count)
            edge += np.arange(len(edge))
            to, far = self.edges[edge, 1], np.repeat(found[rows], count) + self._lengths[edge]
            nearer = far < found[to]
            to = to[nearer]
            np.minimum.at(found, to, far[nearer])
            rows = distinct(to)
        return found

    def mean_around(self, values):
        """Return the mean of the values of each vertex and its neighbours."""
        found, counts = values.copy(), np.diff(self._starts, append=len(self.edges))
        found[self.used] += np.add.reduceat(values[self.edges[:, 1]], self._starts)
        found[self.used] /= counts + 1
        return found


class Visibility:
    """Which places of a surface a camera sees."""

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
        """Return a function's values; where rays are cast, it runs in threads."""
        if self._rays is None:
            return map(function, items)
        return self._stack.enter_context(threads()).map(function, items)

    def free(self, camera, points, normals):
        """Return whether nothing hides points from a camera, (n,) bool."""
        toward = camera.toward(points)
        turned = np.where(np.einsum('ij,ij->i', normals, toward)[:, None] < 0, -normals, normals)
        if self._rays is not None:
            reach = np.full(len(points), np.inf)
            if not isinstance(camera, Orthographic):
                reach = np.linalg.norm(camera.position - points, axis=1)
            return self._rays.free(points, turned, toward, reach)
        if self._last[0] is not camera:
            view = view_of(camera, bounds_of(self.surfaces), _MAP)
            depth = None if view is None else self._scene.depth(view, _MAP)
            self._last = camera, view, depth
        _, view, depth = self._last
        if view is None:
            return np.zeros(len(points), bool)
        return seen_in_depth(view, depth, points, turned, 0.25) > 0.5


def choose(surface, pictures, visibility, max_angle=85.0, sharp=4.0) -> Choice:
    """Return the photographs of all triangles, of `PhotoSource` with small versions."""
    least = max(float(np.cos(np.radians(max_angle))), _LEAST_COSINE)
    best = _Best(len(surface.points), _ASKED)
    whole = _Best(len(surface.faces), 1)
    anywhere, behind = np.zeros((2, len(surface.faces)), bool)
    seen, bits = [], []
    looks = visibility.each(lambda p: _Look(surface, p, visibility, least), pictures)
    for number, look in enumerate(looks):
        best.take(number, look.rows, look.scores)
        whole.take(number, *look.whole)
        anywhere |= look.touched
        behind[look.behind] = True
        seen.append(look.seen)
        bits.append((np.packbits(look.facing), np.packbits(look.covered)))
    gains = _agreed(best, surface, pictures)
    photos, weights = _mixed(surface.faces, best, sharp)
    _drop_hidden(surface, pictures, visibility, photos, weights, bits)
    bare = np.flatnonzero(photos[:, 0] < 0)
    photos[bare, 0], weights[bare, :, 0] = whole.numbers[bare, 0], 1.0
    _drop_hidden(surface, pictures, visibility, photos, weights, bits, bare)
    made = surface.points, surface.faces, surface.cuts
    choice = Choice(*made, photos, weights, gains, tuple(seen))
    bare = np.flatnonzero(anywhere & (photos[:, 0] < 0))
    choice = _cut(choice, bare, pictures, visibility, least) if len(bare) else choice
    _warn_of_bare(surface, choice, behind)
    return choice


def _warn_of_bare(surface, choice, behind):
    """Warn of a surface that stays bare, or much of which is seen only from behind."""
    painted = np.zeros(len(surface.faces), bool)
    origin = replace(choice, cuts=choice.cuts[len(surface.cuts) :]).origin
    painted[origin[choice.photos[:, 0] >= 0]] = True
    if not painted.any():
        warn(_UNSEEN)
        return
    areas, painted, behind = (v[surface.some] for v in (surface.areas, painted, behind))
    bare = areas[behind & ~painted].sum()
    share = bare / max(bare + areas[painted].sum(), 1e-300)
    if share >= _REPORTED:
        warn(_BEHIND.format(share))


class _Look:
    """What one picture sees: scores of vertices, and of triangles that it sees as a whole."""

    def __init__(self, surface, picture, visibility, least):
        camera, faces = picture.camera, surface.faces
        cosine = _cosines(camera, surface)
        self.facing = facing = cosine > least
        rows = np.zeros(len(surface.points), bool)
        rows[faces[facing]] = True
        rows = np.flatnonzero(rows)
        uv, within = _within(picture, surface.points[rows])
        rows, uv = rows[within], uv[within]
        free = visibility.free(camera, surface.points[rows], surface.outward[rows])
        rows, uv = rows[free], uv[free]
        seen = np.zeros(len(surface.points), bool)
        seen[rows] = True
        corners = seen[faces]
        self.covered = covered = facing & corners.all(1)
        self.touched = facing & corners.any(1)
        density = np.zeros(len(seen))
        density[rows] = picture.sharpness / camera.texel(surface.points[rows]) ** 2
        back = surface.some[cosine[surface.some] < -least]
        back = back[_within(picture, surface.middles[back])[1]]
        free = visibility.free(camera, surface.middles[back], surface.normals[back])
        self.behind = back[free]
        whole = np.flatnonzero(covered)
        self.whole = whole, cosine[whole] * density[faces[whole]].mean(1)
        width = _FADE * max(camera.size) * camera.texel(surface.points)
        unseen = ~seen
        unseen[faces[~covered]] = True
        fade = surface.distances(unseen, width)[rows] / width[rows]
        touching = np.zeros(len(seen), bool)
        touching[faces[covered]] = True
        toward = camera.toward(surface.points[rows])
        angle = np.einsum('ij,ij->i', toward, surface.smooth[rows])
        near_edge = 1e-3 + border(uv, 0.05)
        scores = np.maximum(angle, least) * density[rows] * near_edge
        # Around what no photograph sees all around, those that see a triangle of it.
        scores *= np.maximum(fade, _PARTLY * touching[rows])
        keep = scores > 0
        self.rows, self.scores = rows[keep], scores[keep]
        around = fade > 0
        share = np.rint(255 * np.minimum(fade * near_edge, 1)[around]).astype(np.uint8)
        self.seen = rows[around].astype(np.int32), share


def _cosines(camera, surface):
    """Return the cosines between triangles' normals and the direction to a camera."""
    if isinstance(camera, Orthographic):
        return surface.normals @ camera.toward(np.zeros((1, 3)))[0]
    away = camera.position - surface.middles
    distance = np.sqrt(np.einsum('ij,ij->i', away, away))
    across = surface.normals @ camera.position - surface.offsets
    return across / np.maximum(distance, 1e-300)


def _within(picture, points):
    """Return the places of points in a picture, and whether it may be used there."""
    uv, _ = picture.camera.project(points)
    with np.errstate(invalid='ignore'):
        within = ((uv >= 0) & (uv <= 1)).all(1)
    if picture.survey_mask is not None:
        rows = np.flatnonzero(within)
        within[rows] = sample(picture.survey_mask, uv[rows], 'nearest')[:, 0] > 0
    return uv, within


class _Best:
    """The numbers of the highest scores of each item, in falling order."""

    def __init__(self, count, kept):
        self.scores = np.zeros((count, kept), np.float32)
        self.numbers = np.full((count, kept), -1, np.int32)

    def take(self, number, rows, scores):
        """Take over the scores of one more picture."""
        higher = scores > self.scores[rows, -1]
        rows = rows[higher]
        self.scores[rows, -1], self.numbers[rows, -1] = scores[higher], number
        self.sort(rows)

    def sort(self, rows):
        """Put the scores of items in falling order."""
        order = np.argsort(-self.scores[rows], axis=1, kind='stable')
        for values in (self.scores, self.numbers):
            values[rows] = np.take_along_axis(values[rows], order, 1)


def _agreed(best, surface, pictures):
    """Lower the scores of photographs that show what others do not; return all gains, (n, 3)."""
    colors = np.full((*best.numbers.shape, 3), np.nan, np.float32)
    for number, picture in enumerate(pictures):
        row, place = np.nonzero(best.numbers == number)
        uv, _ = picture.camera.project(surface.points[row])
        colors[row, place] = sample(picture.small, np.clip(uv, 0, 1))[:, :3]
    gains = _gains(best.numbers, colors, len(pictures))
    colors *= gains.astype(np.float32)[best.numbers]
    several = np.flatnonzero(best.numbers[:, 2] >= 0)
    if len(several):
        middle = np.nanmedian(colors[several], axis=1, keepdims=True)
        unlike = np.abs(colors[several] - middle).max(2) / _UNLIKE
        alike = np.ones(best.scores.shape, np.float32)
        alike[several] = np.nan_to_num(np.exp(-(unlike**2))).clip(1e-6)
        best.scores *= _even(alike, best.numbers, surface.edges)
        best.sort(several)
    return gains


def _even(values, numbers, edges):
    """Return values of vertices and their photographs averaged over neighbours."""
    count, columns = len(values), int(numbers.max()) + 1
    row, place = np.nonzero(numbers >= 0)
    column = numbers[row, place]
    order = np.argsort(row * columns + column)
    row, place, column = row[order], place[order], column[order]
    near = np.ones(len(edges), np.float32), (edges[:, 0], edges[:, 1])
    near = sparse.csr_array(near, shape=(count, count)) + sparse.eye_array(count, format='csr')
    start = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=count))])

    def around(v):
        return (near @ sparse.csr_array((v, column, start), shape=(count, columns)))[row, column]

    found = values[row, place]
    total = around(np.ones_like(found))
    for _ in range(_EVEN):
        found = around(found) / total
    values[row, place] = found
    return values


def _gains(numbers, colors, count):
    """Return the factors that make the colours of photographs alike where they overlap."""
    rows = np.flatnonzero(numbers[:, 1] >= 0)
    rows = rows[:: max(len(rows) // _GAIN_VERTICES, 1)]
    shown = np.full((count, max(len(rows), 1), 3), np.nan)
    row, place = np.nonzero(numbers[rows] >= 0)
    shown[numbers[rows][row, place], row] = colors[rows[row], place]
    return exposure_gains(shown)


def _mixed(faces, best, sharp):
    """Return the photographs of triangles, those of their corners, and weights at corners."""
    # Less that of the first that is left out: it takes a place with nothing.
    first = np.maximum(best.scores[:, :1], 1e-37)
    share = (best.scores / first) ** sharp
    share = np.maximum(share[:, :KEPT] - share[:, KEPT : KEPT + 1], 0.0)
    numbers = best.numbers[:, :KEPT]
    given = numbers[faces].reshape(len(faces), -1)
    total = share.sum(1, keepdims=True)
    share = np.divide(share, total, out=np.zeros_like(share), where=total > 0)
    share = np.maximum(share - _FAINT, 0)
    amount = share[faces].reshape(len(faces), -1)
    alike = given[:, :, None] == given[:, None, :]
    sums = np.einsum('fij,fj->fi', alike, amount)
    again = np.tril(alike, -1).any(2)
    sums[again | (given < 0)] = 0
    order = np.argsort(-sums, axis=1, kind='stable')[:, :SHOWN]
    photos = np.where(
        np.take_along_axis(sums, order, 1) > 0, np.take_along_axis(given, order, 1), -1
    )
    weights = np.einsum(
        'fcm,fcmk->fck', share[faces], numbers[faces][..., None] == photos[:, None, None, :]
    )
    weights *= photos[:, None, :] >= 0
    return photos, _balanced(weights)


def _balanced(weights):
    """Return weights whose sums at corners are 1, where there are any in the triangle."""
    total = weights.sum(2, keepdims=True)
    mean = weights.sum(1, keepdims=True)
    weights = np.where(total > 1e-6, weights, mean)
    total = weights.sum(2, keepdims=True)
    return np.divide(weights, total, out=np.zeros_like(weights), where=total > 0).astype(
        np.float32
    )


def _drop_hidden(surface, pictures, visibility, photos, weights, bits, rows=slice(None)):
    """Take photographs off the triangles of which something hides parts."""
    faces = np.arange(len(photos))[rows]

    def free(number, face, inner):
        corners = surface.points[surface.faces[face]]
        points = np.einsum('ik,fkd->fid', inner, corners).reshape(-1, 3)
        normals = np.repeat(surface.normals[face], len(inner), 0)
        found = _within(pictures[number], points)[1]
        found &= visibility.free(pictures[number].camera, points, normals)
        return found.reshape(-1, len(inner)).all(1)

    def hidden(number):
        face, place = np.nonzero(photos[rows] == number)
        face = faces[face]
        facing, covered = (np.unpackbits(b, count=len(photos))[face] for b in bits[number])
        found = free(number, face, _INNER) & (facing > 0)
        partly = np.flatnonzero(found & (covered == 0))
        found[partly] = free(number, face[partly], _INSIDE)
        return face[~found], place[~found]

    shown = photos[rows]
    for face, place in list(visibility.each(hidden, np.unique(shown[shown >= 0]))):
        photos[face, place] = -1
        weights[face, :, place] = 0
    order = np.argsort(photos < 0, axis=1, kind='stable')
    photos[:] = np.take_along_axis(photos, order, 1)
    weights[:] = _balanced(np.take_along_axis(weights, order[:, None, :], 2))


def _cut(choice, bare, pictures, visibility, least) -> Choice:
    """Return a choice with some triangles in sixteen, each painted by what sees it as a whole."""
    places, parts = sixteen()
    corners = choice.points[choice.faces[bare]]
    points = np.einsum('ik,fkd->fid', places, corners)
    normals, _ = normals_and_areas(corners)
    best = _Best(len(bare) * len(parts), 1)
    for number, picture in enumerate(pictures):
        _paint_parts(picture, number, points, normals, parts, visibility, least, best)
    painted = (best.numbers[:, 0].reshape(-1, len(parts)) >= 0).any(1)
    numbers = best.numbers.reshape(-1, len(parts))[painted].ravel()
    wanted = np.zeros(choice.faces.shape, bool)
    wanted[bare[painted]] = True
    points, once = cut_at(choice.points, choice.faces, wanted)
    points, twice = cut_at(points, once.faces, wanted[once.parent])
    parent = once.parent[twice.parent]
    photos, weights = choice.photos[parent], choice.weights[parent]
    rows = np.flatnonzero(wanted[parent, 0])
    photos[rows], weights[rows] = -1, 0
    photos[rows, 0] = numbers
    weights[rows[numbers >= 0], :, 0] = 1
    cuts = (*choice.cuts, once, twice)
    return replace(
        choice, points=points, faces=twice.faces, cuts=cuts, photos=photos, weights=weights
    )


def _paint_parts(picture, number, points, normals, parts, visibility, least, best):
    """Score what a picture sees of the parts of triangles."""
    camera, count = picture.camera, points.shape[1]
    middle = points[:, parts].mean(2)
    middles = middle.mean(1)
    cosine = np.einsum('ij,ij->i', normals, camera.toward(middles))
    rows = np.flatnonzero(cosine > least)
    rows = rows[_within(picture, points[rows].reshape(-1, 3))[1].reshape(-1, count).any(1)]
    if not len(rows):
        return
    places = middle[rows].reshape(-1, 3)
    seen = _within(picture, places)[1]
    seen &= visibility.free(camera, places, np.repeat(normals[rows], len(parts), 0))
    seen = seen.reshape(len(rows), -1)
    scores = cosine[rows] / camera.texel(middles[rows]) ** 2
    scores = scores[:, None] * seen * (1 + seen.sum(1, keepdims=True))
    flat = (rows[:, None] * len(parts) + np.arange(len(parts))).ravel()
    best.take(number, flat, scores.ravel())


#: Likewise of one whose corners it does not all see: nearly up to its border.
_INSIDE = 0.97 * sixteen()[0] + 0.01
