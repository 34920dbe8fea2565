"""Triangles of a mesh cut for photographs."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pvibr.maths.orthographic import Orthographic
from pvibr.meshes.cutting import cut_at
from pvibr.projection.samples import normals_and_areas

#: Longest edge that is not cut, in longer sides of a photograph, and how many triangles are made.
_LARGE, _MOST = 0.06, 500_000
#: Rounds: an edge is at most so often halved.
_ROUNDS = 12
#: Edges that are cut with the longest one, in its lengths.
_ALIKE = 0.6


def sixteen():
    """Return the barycentric corners of sixteen parts of a triangle, (15, 3), and the parts."""
    places, once = cut_at(np.eye(3), np.arange(3)[None], np.ones((1, 3), bool))
    places, twice = cut_at(places, once.faces, np.ones((4, 3), bool))
    return places, twice.faces


def finer(points, faces, cameras):
    """Return points, triangles and cuts of a mesh in which none is large in a photograph."""
    points, eyes, cuts = np.asarray(points, float), [_Eye(c) for c in cameras], []
    for _ in range(_ROUNDS):
        corners = points[faces]
        sides = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
        longest = sides.max(1, keepdims=True)
        wanted = sides > _ALIKE * longest
        wanted[~_large(corners, longest[:, 0], eyes)] = False
        if not wanted.any():
            break
        more, cut = cut_at(points, faces, wanted)
        if len(cut.faces) > max(_MOST, len(faces)):
            break
        points, faces = more, cut.faces
        cuts.append(cut)
    return points, faces, tuple(cuts)


def _large(corners, longest, eyes):
    """Return which triangles are large in a photograph that may see them, (f,)."""
    middles = corners.mean(1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(1)
    found = np.zeros(len(corners), bool)
    rows = _candidates(middles, radius, longest, eyes)
    normals, _ = normals_and_areas(corners[rows])
    for eye in eyes:
        left = np.flatnonzero(~found[rows])
        mine = rows[left]
        seen = eye.sees(middles[mine], radius[mine], normals[left])
        found[mine] = seen & (longest[mine] > eye.limit(middles[mine], radius[mine]))
    return found


def _candidates(middles, radius, longest, eyes):
    """Return the triangles that would be large in the widest lens at the nearest place."""
    places = [eye.place for eye in eyes if not eye.parallel]
    limit = np.full(len(middles), np.inf)
    if places:
        away = cKDTree(places).query(middles)[0]
        limit = min(e.share for e in eyes if not e.parallel) * np.maximum(away - radius, 0)
    flat = [eye.share for eye in eyes if eye.parallel]
    return np.flatnonzero(longest > np.minimum(limit, min(flat, default=np.inf)))


class _Eye:
    """A camera as a cone, or as a cylinder if its rays are parallel."""

    def __init__(self, camera):
        self.parallel = isinstance(camera, Orthographic)
        steps = np.linspace(0, 1, 9)
        border = [np.c_[steps, 0 * steps + k] for k in (0, 1)]
        uv = np.concatenate([[(0.5, 0.5)], *border, *(b[:, ::-1] for b in border)])
        origins, ahead = camera.rays(uv)
        self.place, self.axis = origins[0], ahead[0]
        self.share = _LARGE * max(camera.size)
        if self.parallel:
            self.share *= camera.texel(origins[:1])[0]
            self.reach = np.linalg.norm(origins - origins[0], axis=1).max()
        else:
            self.share *= camera.texel(camera.position + camera.R[2:])[0]
            cosines = np.clip(ahead @ self.axis, -1, 1)
            self.reach = np.nanmax(np.arccos(cosines), initial=0.1)

    def sees(self, middles, radius, normals):
        """Return whether spheres are within the view, and planes turned to it."""
        out = middles - self.place
        along = out @ self.axis
        across = np.linalg.norm(out - along[:, None] * self.axis, axis=1)
        if self.parallel:
            return (across - radius < self.reach) & (normals @ self.axis < 0)
        away = np.linalg.norm(out, axis=1)
        half = np.arcsin(np.clip(radius / np.maximum(away, 1e-300), 0, 1))
        within = np.arctan2(across, along) - half < self.reach
        return (within | (away < radius)) & (np.einsum('ij,ij->i', normals, out) < 0)

    def limit(self, middles, radius):
        """Return the longest edges that are not large at the nearest places of spheres."""
        if self.parallel:
            return np.full(len(middles), self.share)
        return self.share * np.maximum(np.linalg.norm(middles - self.place, axis=1) - radius, 0)
