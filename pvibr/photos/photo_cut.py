"""Subdivision of the triangles that are large in a photograph."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pvibr.maths.orthographic import Orthographic
from pvibr.meshes.cutting import cut_at
from pvibr.visibility.surface_samples import normals_and_areas

#: Longest edge kept whole, as a fraction of a photograph's longer side; most triangles created.
_MAX_EDGE, _MAX_FACES = 0.06, 500_000
#: Rounds of cutting; each halves an edge at most once.
_ROUNDS = 12
#: Edges of a triangle longer than this fraction of its longest are cut with it.
_EDGE_SHARE = 0.6


def sixteenths():
    """Return the barycentric points, (15, 3), and faces of a triangle split in sixteen."""
    corner_shares, once = cut_at(np.eye(3), np.arange(3)[None], np.ones((1, 3), bool))
    corner_shares, twice = cut_at(corner_shares, once.faces, np.ones((4, 3), bool))
    return corner_shares, twice.faces


def finer(points, faces, cameras):
    """Subdivide a mesh until no triangle is large in a photograph; return it and its cuts."""
    points, eyes, cuts = np.asarray(points, float), [_Eye(c) for c in cameras], []
    for _ in range(_ROUNDS):
        corners = points[faces]
        edge_lengths = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
        longest = edge_lengths.max(1, keepdims=True)
        cut_edges = edge_lengths > _EDGE_SHARE * longest
        cut_edges[~_large(corners, longest[:, 0], eyes)] = False
        if not cut_edges.any():
            break
        cut_points, cut = cut_at(points, faces, cut_edges)
        if len(cut.faces) > max(_MAX_FACES, len(faces)):
            break
        points, faces = cut_points, cut.faces
        cuts.append(cut)
    return points, faces, tuple(cuts)


def _large(corners, longest, eyes):
    """Return which triangles are large in a photograph that may see them, (f,) bool."""
    middles = corners.mean(1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(1)
    is_large = np.zeros(len(corners), bool)
    candidates = _candidates(middles, radius, longest, eyes)
    normals, _ = normals_and_areas(corners[candidates])
    for eye in eyes:
        undecided = np.flatnonzero(~is_large[candidates])
        faces = candidates[undecided]
        is_seen = eye.sees(middles[faces], radius[faces], normals[undecided])
        is_large[faces] = is_seen & (longest[faces] > eye.limit(middles[faces], radius[faces]))
    return is_large


def _candidates(middles, radius, longest, eyes):
    """Return the triangles that the nearest eye with the longest lens would show as large."""
    eye_positions = [eye.position for eye in eyes if not eye.parallel]
    edge_limit = np.full(len(middles), np.inf)
    if eye_positions:
        eye_distance = cKDTree(eye_positions).query(middles)[0]
        max_edge = min(e.max_edge for e in eyes if not e.parallel)
        edge_limit = max_edge * np.maximum(eye_distance - radius, 0)
    parallel_limits = [eye.max_edge for eye in eyes if eye.parallel]
    return np.flatnonzero(longest > np.minimum(edge_limit, min(parallel_limits, default=np.inf)))


class _Eye:
    """A camera's view as a cone, or as a cylinder if its rays are parallel."""

    def __init__(self, camera):
        self.parallel = isinstance(camera, Orthographic)
        steps = np.linspace(0, 1, 9)
        border = [np.c_[steps, 0 * steps + k] for k in (0, 1)]
        border_uv = np.concatenate([[(0.5, 0.5)], *border, *(b[:, ::-1] for b in border)])
        origins, ray_directions = camera.rays(border_uv)
        self.position, self.axis = origins[0], ray_directions[0]
        self.max_edge = _MAX_EDGE * max(camera.size)
        if self.parallel:
            self.max_edge *= camera.texel(origins[:1])[0]
            self.reach = np.linalg.norm(origins - origins[0], axis=1).max()
        else:
            self.max_edge *= camera.texel(camera.position + camera.R[2:])[0]
            cosines = np.clip(ray_directions @ self.axis, -1, 1)
            self.reach = np.nanmax(np.arccos(cosines), initial=0.1)

    def sees(self, middles, radius, normals):
        """Return whether spheres are in view and normals face the eye."""
        eye_offset = middles - self.position
        along = eye_offset @ self.axis
        across = np.linalg.norm(eye_offset - along[:, None] * self.axis, axis=1)
        if self.parallel:
            return (across - radius < self.reach) & (normals @ self.axis < 0)
        distance = np.linalg.norm(eye_offset, axis=1)
        half_angle = np.arcsin(np.clip(radius / np.maximum(distance, 1e-300), 0, 1))
        within = np.arctan2(across, along) - half_angle < self.reach
        return (within | (distance < radius)) & (np.einsum('ij,ij->i', normals, eye_offset) < 0)

    def limit(self, middles, radius):
        """Return the longest edges that are not large, at the nearest points of spheres."""
        if self.parallel:
            return np.full(len(middles), self.max_edge)
        distance = np.linalg.norm(middles - self.position, axis=1)
        return self.max_edge * np.maximum(distance - radius, 0)
