"""Blocks of instances along a space-filling curve, and their frustum culling."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

#: Instances that are culled, sorted and chosen together.
BLOCK = 64
_AT_ONCE = 4096  # points whose numbers stay in the processor's cache
_CHILDREN = 64  # blocks that are culled together first
_FEW = 1024  # blocks up to which this does not pay


def morton_order(points):
    """Return the order of points (n, 3) along a Morton (Z-order) curve of 21 bits per axis.

    Bits are interleaved as in Warren, "Hacker's Delight", 2002, section 7-2.
    """
    points = np.asarray(points, float)
    if not len(points):
        return np.zeros(0, np.intp)
    low = points.min(0)
    extent = float((points.max(0) - low).max()) or 1.0
    code = np.empty(len(points), np.uint64)
    for start in range(0, len(points), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        cells = ((points[part] - low).T * ((2**21 - 1) / extent)).astype(np.uint64)
        x, y, z = _spread(cells)
        code[part] = x | y << np.uint64(1) | z << np.uint64(2)
    return np.argsort(code)


def _spread(x):
    """Insert two zero bits between the 21 bits of each number."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x


def frustum_planes(clip_from_view):
    """Return the inward planes (left, right, bottom, top, near, far) of a projection, (6, 4).

    View space; Gribb and Hartmann, "Fast Extraction of Viewing Frustum Planes", 2001.
    """
    m = np.asarray(clip_from_view, float)
    planes = np.concatenate([m[3] + m[:3], m[3] - m[:3]])[[0, 3, 1, 4, 2, 5]]
    return planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)


@dataclass
class Blocks:
    """Groups of m consecutive instances, with the bounds that culling and level choice need.

    Boxes of the instances' centres, world units, and the extremes of their radii.
    """

    centers: np.ndarray  # (m, 3), middle of the instances' centres; origin of their poses
    half_sides: np.ndarray  # (m, 3)
    reach: np.ndarray  # (m,), largest distance of an instance's centre
    largest: np.ndarray  # (m,), radius
    smallest: np.ndarray
    _parents: Blocks | None = field(default=None, repr=False)

    @classmethod
    def empty(cls, count) -> Blocks:
        """Return `count` uninitialized blocks."""
        return cls(*np.empty((2, count, 3)), *np.empty((3, count)))

    @classmethod
    def of(cls, centers, radii, size) -> Blocks:
        """Group ordered bounding spheres, (n, 3) and (n,), by `size`; the last may be smaller."""
        slots = members(np.arange(-(-len(centers) // size)), size, len(centers))
        blocks = cls.empty(len(slots))
        blocks.fill(slice(None), centers.T.take(slots, 1), radii[slots])
        return blocks

    def fill(self, where, centers, radii) -> np.ndarray:
        """Set the spheres, (3, k, size) and (k, size), of k blocks.

        Returns the centres relative to those of the blocks, (3, k, size).
        """
        self._parents = None
        if centers.shape[2] == 1:
            self.centers[where] = centers[:, :, 0].T
            self.half_sides[where] = self.reach[where] = 0.0
            self.largest[where] = self.smallest[where] = radii[:, 0]
            return np.zeros_like(centers)
        low, high = centers.min(2), centers.max(2)
        middle = (low + high) / 2
        local = centers - middle[:, :, None]
        self.centers[where], self.half_sides[where] = middle.T, (high - low).T / 2
        self.reach[where] = np.sqrt((local * local).sum(0).max(1))
        self.largest[where], self.smallest[where] = radii.max(1), radii.min(1)
        return local

    @property
    def neighborhoods(self) -> Blocks:
        """Blocks of 64 blocks each."""
        if self._parents is None:
            count = len(self.centers)
            slots = members(np.arange(-(-count // _CHILDREN)), _CHILDREN, count)
            radii = (self.reach + self.largest)[slots]
            self._parents = Blocks.empty(len(slots))
            self._parents.fill(slice(None), self.centers.T.take(slots, 1), radii)
        return self._parents

    def seen(self, frame):
        """Return the blocks in the frustum, farthest first, and the sizes of their instances.

        Indices (k,), origins in view space (k, 3), bounds of on-screen diameters in pixels (k,).
        """
        view = frame.view_from_world
        planes = frustum_planes(frame.clip_from_view)
        planes = planes[:4]  # near and far follow what is drawn: they cull nothing
        some = self._near(view, planes, frame.parallel)
        # Coordinates lie in rows, each one piece of memory: that is several times faster.
        origins = view[:3, :3] @ self.centers[some].T + view[:3, 3:]
        around = self.reach[some] + self.largest[some]
        found = np.flatnonzero(_inside(origins, around, planes, frame.parallel))
        origins = origins.take(found, 1)
        depths = origins[2] if frame.parallel else -np.sqrt((origins * origins).sum(0))
        order = np.argsort(depths)
        origins, depths, found = origins.take(order, 1).T, depths[order], found[order]
        index = found if isinstance(some, slice) else some[found]
        scale = 2 * frame.pixel_scale
        if frame.parallel:
            near = far = 1.0
        else:
            reach, away = self.reach[index], -depths
            near, far = np.maximum(away - reach, 1e-200), away + reach
        small, large = self.smallest[index] / far, self.largest[index] / near
        return index, origins, scale * small, scale * large

    def _near(self, view, planes, parallel):
        """Return the blocks whose neighbourhoods are in view."""
        count = len(self.centers)
        if count < _FEW:
            return slice(None)
        parents = self.neighborhoods
        origins = view[:3, :3] @ parents.centers.T + view[:3, 3:]
        inside = _inside(origins, parents.reach + parents.largest, planes, parallel)
        if inside.all():
            return slice(None)
        some = (np.flatnonzero(inside)[:, None] * _CHILDREN + np.arange(_CHILDREN)).ravel()
        return some[some < count]


def members(blocks, size, count) -> np.ndarray:
    """Return the members of blocks, (k, size); the last of all stands in for missing ones."""
    return np.minimum(np.asarray(blocks)[:, None] * size + np.arange(size), count - 1)


def _inside(origins, around, planes, parallel):
    """Return which spheres, in view space, intersect a frustum."""
    inside = (planes[:, :3] @ origins + planes[:, 3:]).min(0) > -around
    if not parallel:
        inside &= origins[2] < around  # no plane stands behind the eye
    return inside


def ascending(values):
    """Return the ascending order of values by a radix sort, exact to 1/65 536 of their range."""
    if not len(values):
        return np.zeros(0, np.intp)
    low = values.min()
    scale = 65535 / max(float(values.max() - low), 1e-30)
    return np.argsort(((values - low) * scale).astype(np.uint16), kind='stable')
