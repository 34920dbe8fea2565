"""Intersections of rays with spheres, ellipsoids and cylinders: the float64 reference of shaders.

Directions of rays may have any length; distances are counted in it. All arrays are broadcast
against each other: many rays meet one thing, or one ray many things.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.maths.vectors import unit_vectors

CAPS = ('flat', 'round', None)


class Meeting(NamedTuple):
    """Entries and exits of rays.

    Attributes
    ----------
    hits, distances : numpy.ndarray, shape (2, ...)
        Whether there is a surface at entry and exit, and the distances along the ray.
    normals : numpy.ndarray, shape (2, ..., 3)
        Outward unit vectors.
    """

    hits: np.ndarray
    distances: np.ndarray
    normals: np.ndarray

    def first(self, near=0.0):
        """Return the first visible surface.

        Parameters
        ----------
        near : float
            Distance up to which surfaces are clipped.

        Returns
        -------
        tuple of 3 numpy.ndarray, shape (...), (..., 3) and (...)
            Distances, infinite for none; normals toward the start; whether the inside is seen.
        """
        with np.errstate(invalid='ignore'):
            ahead = self.hits & (self.distances >= near)
        inside = ~ahead[0]
        distance = np.where(inside, self.distances[1], self.distances[0])
        normal = np.where(inside[..., None], -self.normals[1], self.normals[0])
        return np.where(ahead.any(0), distance, np.inf), normal, inside


def meet_spheres(starts, ways, centers, radii) -> Meeting:
    """Intersect rays with spheres.

    Parameters
    ----------
    starts, ways : array_like, shape (..., 3)
        Starts and directions of rays, world units.
    centers, radii : array_like, shape (..., 3) and (...)
        World units.

    Returns
    -------
    Meeting
        Entry and exit of each ray.

    Examples
    --------
    >>> from pvibr.maths.quadric_rays import meet_spheres
    >>> meet_spheres([0, 0, 5], [0, 0, -1], [0, 0, 0], 2.0).distances.tolist()
    [3.0, 7.0]
    """
    radii = np.asarray(radii, float)[..., None]
    return meet_ellipsoids(starts, ways, centers, radii[..., None] * np.eye(3))


def meet_ellipsoids(starts, ways, centers, axes) -> Meeting:
    """Intersect rays with ellipsoids.

    Parameters
    ----------
    starts, ways : array_like, shape (..., 3)
        Starts and directions of rays, world units.
    centers, axes : array_like, shape (..., 3) and (..., 3, 3)
        Centres, and perpendicular half axes in columns, not zero, world units.

    Returns
    -------
    Meeting
        Entry and exit of each ray.

    Examples
    --------
    >>> from pvibr.maths.quadric_rays import meet_ellipsoids
    >>> meet_ellipsoids([0, 0, 5], [0, 0, -1], [0, 0, 0], np.diag([1, 1, 2])).distances.tolist()
    [3.0, 7.0]
    """
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
    """Intersect rays with cylinders.

    Parameters
    ----------
    starts, ways : array_like, shape (..., 3)
        Starts and directions of rays, world units.
    middles, halves : array_like, shape (..., 3)
        Middles, and vectors from there to an end, world units.
    radii : array_like, shape (...)
        World units.
    caps : {'flat', 'round', None}
        Flat, half a sphere, or open.

    Returns
    -------
    Meeting
        Entry and exit of each ray.

    Examples
    --------
    >>> from pvibr.maths.quadric_rays import meet_cylinders
    >>> for caps in ('flat', 'round'):
    ...     met = meet_cylinders([0, 0, 5], [0, 0, -1], [0, 0, 0], [0, 0, 2], 1.0, caps)
    ...     print(met.distances.tolist())
    [3.0, 7.0]
    [2.0, 8.0]
    """
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
    """Return the surfaces that are visible at the centre of each pixel.

    Parameters
    ----------
    frame : pvibr.core.frame.Frame
        Camera and size.
    meet : callable
        One of the functions above.
    *things : numpy.ndarray, shape (n, ...)
        Its arguments after the rays, world units.

    Returns
    -------
    ids, depth : numpy.ndarray, shape (h, w), top row first
        Nearest surface (plus n for its inside, -1 for none), and its distance along the view's
        axis, infinite for none.
    normals : numpy.ndarray, shape (h, w, 3)
        View space, toward the eye.

    Examples
    --------
    >>> from pvibr.core.frame import Frame
    >>> from pvibr.maths.quadric_rays import cast, meet_spheres
    >>> from pvibr.maths.views import View
    >>> view = View(np.eye(4), np.diag([1.0, 1, -1, 1]), near=0.0, far=10.0, parallel=True)
    >>> frame = Frame(None, None, (3, 3), (0, 0), view)
    >>> ids, depth, _ = cast(frame, meet_spheres, [[0, 0, -3]], [0.5])
    >>> ids.tolist(), float(depth[1, 1])
    ([[-1, -1, -1], [-1, 0, -1], [-1, -1, -1]], 2.5)
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
    """Return which rays meet a sphere around a thing."""
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
    """Return the pixels whose four neighbours show the same surface.

    Parameters
    ----------
    ids : numpy.ndarray, shape (h, w)
        Surfaces, see :func:`cast`.

    Returns
    -------
    numpy.ndarray of bool, shape (h, w)
        False at the border.

    Examples
    --------
    >>> from pvibr.maths.quadric_rays import inner
    >>> inner(np.array([[1, 1, 1, 2]] * 3)).tolist()[1]
    [False, True, False, False]
    """
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            same &= np.roll(ids, step, axis) == ids
    same[[0, -1]] = same[:, [0, -1]] = False
    return same
