"""Intersections of rays with spheres, ellipsoids and cylinders: the float64 twin of the shaders.

Directions of rays may have any length; distances are counted in it. All arrays are broadcast
against each other: many rays meet one item, or one ray many items.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.maths.vectors import unit_vectors

CAPS = ('flat', 'round', None)


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
            ahead = self.hits & (self.distances >= near)
        inside = ~ahead[0]
        distance = np.where(inside, self.distances[1], self.distances[0])
        normal = np.where(inside[..., None], -self.normals[1], self.normals[0])
        return np.where(ahead.any(0), distance, np.inf), normal, inside


def meet_spheres(starts, ways, centers, radii) -> Meeting:
    """Intersect rays with spheres."""
    radii = np.asarray(radii, float)[..., None]
    return meet_ellipsoids(starts, ways, centers, radii[..., None] * np.eye(3))


def meet_ellipsoids(starts, ways, centers, axes) -> Meeting:
    """Intersect rays with ellipsoids; half axes, not zero, are the columns of `axes`."""
    ways, axes = np.asarray(ways, float), np.asarray(axes, float)
    # Columns over their squared lengths: what takes the ellipsoid to the unit sphere.
    scaled = axes / (axes**2).sum(-2, keepdims=True)
    foot, off = _foot(ways, np.subtract(starts, centers))
    start, way = _to_local(scaled, off), _to_local(scaled, ways)
    square = _dot(way, way)
    along = -_dot(start, way) / square
    nearest = start + along[..., None] * way
    rest = 1 - _dot(nearest, nearest)
    half = np.sqrt(np.maximum(rest, 0) / square)
    t = np.stack([along - half, along + half])
    local = start + t[..., None] * way
    normals = np.einsum('...ij,...j->...i', scaled, local)
    return Meeting(np.stack([rest > 0] * 2), t + foot, unit_vectors(normals))


def meet_cylinders(starts, ways, middles, halves, radii, caps='flat') -> Meeting:
    """Intersect rays with cylinders; `halves` reach from the middles to an end."""
    ways, halves, radii = (np.asarray(a, float) for a in (ways, halves, radii))
    length = np.linalg.norm(halves, axis=-1)
    some = length > 0
    units = np.where(some[..., None], halves / np.where(some, length, 1)[..., None], [0, 0, 1.0])
    foot, off = _foot(ways, np.subtract(starts, middles))
    up, rise = _dot(off, units), _dot(ways, units)
    start, way = off - up[..., None] * units, ways - rise[..., None] * units
    square = np.maximum(_dot(way, way), 1e-30 * _dot(ways, ways))
    along = -_dot(start, way) / square
    nearest = start + along[..., None] * way
    rest = radii**2 - _dot(nearest, nearest)
    half = np.sqrt(np.maximum(rest, 0) / square)
    t = np.stack([along - half, along + half])
    heights = up + t * rise
    walls = unit_vectors(start + t[..., None] * way)
    within = rest >= 0
    if caps == 'flat':
        found = _flat(t, walls, within & some, up, rise, length, units)
    elif caps == 'round':
        found = _round(t, walls, within, heights, off, ways, length, units, radii)
    else:
        found = Meeting(within & (np.abs(heights) <= length) & some, t, walls)
    return found._replace(distances=found.distances + foot)


def _flat(t, walls, within, up, rise, length, units):
    """Clip the part of a ray within an infinite cylinder by the planes of both ends."""
    steep = np.broadcast_to(np.where(np.abs(rise) < 1e-30, 1e-30, rise), t[0].shape)
    planes = np.sort(np.stack([(-length - up) / steep, (length - up) / steep]), 0)
    capped = np.stack([planes[0] > t[0], planes[1] < t[1]])
    distances = np.where(capped, planes, t)
    facing = np.stack([-np.sign(steep), np.sign(steep)])[..., None] * units
    hits = np.stack([within & (distances[0] <= distances[1])] * 2)
    return Meeting(hits, distances, np.where(capped[..., None], facing, walls))


def _round(t, walls, within, heights, off, ways, length, units, radii):
    """Extend the part of a ray within an infinite cylinder by hemispherical caps."""
    side = np.where(heights < 0, -1.0, 1.0)
    beyond = np.abs(heights) > length
    away = off - (side * length)[..., None] * units
    square = _dot(ways, ways)
    along = -_dot(away, ways) / square
    nearest = away + along[..., None] * ways
    rest = radii**2 - _dot(nearest, nearest)
    half = np.sqrt(np.maximum(rest, 0) / square)
    ball = along + np.stack([-half[0], half[1]])
    normals = unit_vectors(away + ball[..., None] * ways)
    hits = within & (~beyond | (rest >= 0))
    return Meeting(hits, np.where(beyond, ball, t), np.where(beyond[..., None], normals, walls))


def _foot(ways, off):
    """Return the ray parameter nearest to a point, and the offset from the point."""
    along = -_dot(off, ways) / _dot(ways, ways)
    return along, off + along[..., None] * ways


def _to_local(columns, vectors):
    return np.einsum('...ij,...i->...j', columns, vectors)


def _dot(a, b):
    return np.einsum('...i,...i->...', a, b)


def cast(frame, meet, *things):
    """Return item (plus n for its inside, -1 for none), depth and normal per pixel, top row first.

    `meet` is a function above, `items` its arguments after the rays; normals are in view space.
    """
    starts, ways = _rays(frame)
    turn = frame.view_from_world[:3, :3]
    starts, ways = (starts - frame.view_from_world[:3, 3]) @ turn, ways @ turn
    ids = np.full(ways.shape[:2], -1)
    depth = np.full(ways.shape[:2], np.inf)
    normals = np.zeros_like(ways)
    count = len(things[0])
    for i, thing in enumerate(zip(*things, strict=True)):
        near = np.nonzero(_may_meet(starts, ways, *thing))
        t, normal, inside = meet(starts[near], ways[near], *thing).first(frame.near)
        hit = (t < depth[near]) & (t <= frame.far)
        found = tuple(k[hit] for k in near)
        ids[found], depth[found], normals[found] = (i + count * inside)[hit], t[hit], normal[hit]
    return ids, depth, normals @ turn.T


def _may_meet(starts, ways, center, *extents):
    """Return which rays meet a sphere around an item."""
    reach = sum(np.linalg.norm(extent) for extent in extents)
    off = np.subtract(starts, center)
    nearest = _foot(ways, off)[1]
    return _dot(nearest, nearest) <= (1.001 * reach + 1e-12 * np.abs(off).max()) ** 2


def _rays(frame):
    """Return the origin of the ray of each pixel, and its direction per unit of depth."""
    width, height = frame.size
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    slopes = (np.stack(np.meshgrid(x, y), -1) - offset) / [m[0, 0], m[1, 1]]
    starts, ways = np.zeros((2, height, width, 3))
    (starts if frame.parallel else ways)[..., :2] = slopes
    ways[..., 2] = -1
    return starts, ways


def inner(ids) -> np.ndarray:
    """Return the pixels whose four neighbours show the same surface; False at the border."""
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            same &= np.roll(ids, step, axis) == ids
    same[[0, -1]] = same[:, [0, -1]] = False
    return same
