"""Intersections of rays with spheres, ellipsoids and cylinders: the float64 twin of the shaders.

Directions of rays may have any length; distances are counted in it. All arrays are broadcast
against each other: many rays meet one item, or one ray many items.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.maths.vectors import unit_vectors

CAPS = 'flat', 'round', None


class Meeting(NamedTuple):
    """Entries and exits of rays: hits and distances (2, ...), outward normals (2, ..., 3)."""

    hits: np.ndarray
    distances: np.ndarray
    normals: np.ndarray

    def first(self, near=0.0):
        """Return the first surface beyond `near`: distances, normals, and whether it is an inside.

        Distances are infinite for none; normals point toward the start.
        """
        with np.errstate(invalid='ignore'):
            is_ahead = self.hits & (self.distances >= near)
        is_inside = ~is_ahead[0]
        distance = np.where(is_inside, self.distances[1], self.distances[0])
        normal = np.where(is_inside[..., None], -self.normals[1], self.normals[0])
        return np.where(is_ahead.any(0), distance, np.inf), normal, is_inside


def meet_spheres(starts, directions, centers, radii) -> Meeting:
    """Intersect rays with spheres."""
    radii = np.asarray(radii, float)[..., None]
    return meet_ellipsoids(starts, directions, centers, radii[..., None] * np.eye(3))


def meet_ellipsoids(starts, directions, centers, axes) -> Meeting:
    """Intersect rays with ellipsoids; half axes, not zero, are the columns of `axes`."""
    directions, axes = np.asarray(directions, float), np.asarray(axes, float)
    # Columns over their squared lengths take the ellipsoid to the unit sphere.
    scaled = axes / (axes**2).sum(-2, keepdims=True)
    foot, foot_offset = _foot(directions, np.subtract(starts, centers))
    start = _to_local(scaled, foot_offset)
    direction = _to_local(scaled, directions)
    t, clearance = _chord(start, direction, _dot(direction, direction), 1.0)
    local_points = start + t[..., None] * direction
    normals = np.einsum('...ij,...j->...i', scaled, local_points)
    return Meeting(np.stack([clearance > 0] * 2), t + foot, unit_vectors(normals))


def meet_cylinders(starts, directions, middles, halves, radii, caps='flat') -> Meeting:
    """Intersect rays with cylinders; `halves` reach from the middles to an end."""
    directions, halves, radii = (np.asarray(a, float) for a in (directions, halves, radii))
    length = np.linalg.norm(halves, axis=-1)
    long = length > 0
    units = np.where(long[..., None], halves / np.where(long, length, 1)[..., None], [0, 0, 1.0])
    foot, offset = _foot(directions, np.subtract(starts, middles))
    up, rise = _dot(offset, units), _dot(directions, units)
    start = offset - up[..., None] * units
    direction = directions - rise[..., None] * units
    square = np.maximum(_dot(direction, direction), 1e-30 * _dot(directions, directions))
    t, clearance = _chord(start, direction, square, radii)
    heights = up + t * rise
    walls = unit_vectors(start + t[..., None] * direction)
    in_wall = clearance >= 0
    if caps == 'flat':
        meeting = _flat(t, walls, in_wall & long, up, rise, length, units)
    elif caps == 'round':
        meeting = _round(t, walls, in_wall, heights, offset, directions, length, units, radii)
    else:
        meeting = Meeting(in_wall & (np.abs(heights) <= length) & long, t, walls)
    return meeting._replace(distances=meeting.distances + foot)


def _flat(t, walls, in_wall, up, rise, length, units):
    """Clip the part of a ray within an infinite cylinder by the planes of both ends."""
    steep = np.broadcast_to(np.where(np.abs(rise) < 1e-30, 1e-30, rise), t[0].shape)
    planes = np.sort(np.stack([(-length - up) / steep, (length - up) / steep]), 0)
    capped = np.stack([planes[0] > t[0], planes[1] < t[1]])
    distances = np.where(capped, planes, t)
    cap_normals = np.stack([-np.sign(steep), np.sign(steep)])[..., None] * units
    hits = np.stack([in_wall & (distances[0] <= distances[1])] * 2)
    return Meeting(hits, distances, np.where(capped[..., None], cap_normals, walls))


def _round(t, walls, in_wall, heights, offset, directions, length, units, radii):
    """Extend the part of a ray within an infinite cylinder by hemispherical caps."""
    cap_side = np.where(heights < 0, -1.0, 1.0)
    beyond = np.abs(heights) > length
    from_cap = offset - (cap_side * length)[..., None] * units
    ends, clearance = _chord(from_cap, directions, _dot(directions, directions), radii)
    ball = np.stack([ends[0, 0], ends[1, 1]])
    normals = unit_vectors(from_cap + ball[..., None] * directions)
    hits = in_wall & (~beyond | (clearance >= 0))
    return Meeting(hits, np.where(beyond, ball, t), np.where(beyond[..., None], normals, walls))


def _chord(start, direction, square, radius):
    """Return where rays enter and leave a sphere about the origin, and their squared clearance."""
    middle = -_dot(start, direction) / square
    nearest = start + middle[..., None] * direction
    clearance = radius**2 - _dot(nearest, nearest)
    half = np.sqrt(np.maximum(clearance, 0) / square)
    return np.stack([middle - half, middle + half]), clearance


def _foot(directions, offset):
    """Return the ray parameter nearest to a point, and the offset from the point."""
    parameter = -_dot(offset, directions) / _dot(directions, directions)
    return parameter, offset + parameter[..., None] * directions


def _to_local(columns, vectors):
    return np.einsum('...ij,...i->...j', columns, vectors)


def _dot(a, b):
    return np.einsum('...i,...i->...', a, b)


def cast(frame, meet, *items):
    """Return item (plus n for its inside, -1 for none), depth and normal per pixel, top row first.

    `meet` is a function above, `items` its arguments after the rays; normals are in view space.
    """
    starts, directions = _rays(frame)
    turn = frame.view_from_world[:3, :3]
    starts = (starts - frame.view_from_world[:3, 3]) @ turn
    directions = directions @ turn
    ids = np.full(directions.shape[:2], -1)
    depth = np.full(directions.shape[:2], np.inf)
    normals = np.zeros_like(directions)
    count = len(items[0])
    for number, item in enumerate(zip(*items, strict=True)):
        near = np.nonzero(_may_meet(starts, directions, *item))
        t, normal, is_inside = meet(starts[near], directions[near], *item).first(frame.near)
        is_nearer = (t < depth[near]) & (t <= frame.far)
        hit = tuple(k[is_nearer] for k in near)
        ids[hit] = (number + count * is_inside)[is_nearer]
        depth[hit] = t[is_nearer]
        normals[hit] = normal[is_nearer]
    return ids, depth, normals @ turn.T


def _may_meet(starts, directions, center, *extents):
    """Return which rays meet a sphere around an item."""
    reach = sum(np.linalg.norm(extent) for extent in extents)
    offset = np.subtract(starts, center)
    nearest = _foot(directions, offset)[1]
    return _dot(nearest, nearest) <= (1.001 * reach + 1e-12 * np.abs(offset).max()) ** 2


def _rays(frame):
    """Return the origin of the ray of each pixel, and its direction per unit of depth."""
    width, height = frame.size
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    slopes = (np.stack(np.meshgrid(x, y), -1) - offset) / [m[0, 0], m[1, 1]]
    slopes[..., 0] -= m[0, 1] / m[0, 0] * slopes[..., 1]
    starts, directions = np.zeros((2, height, width, 3))
    (starts if frame.parallel else directions)[..., :2] = slopes
    directions[..., 2] = -1
    return starts, directions


def inner(ids) -> np.ndarray:
    """Return the pixels whose four neighbours show the same surface; False at the border."""
    is_inner = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            is_inner &= np.roll(ids, step, axis) == ids
    is_inner[[0, -1]] = is_inner[:, [0, -1]] = False
    return is_inner
