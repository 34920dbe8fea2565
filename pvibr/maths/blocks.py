"""Blocks of instances along a space-filling curve, and their frustum culling."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

#: Instances that are culled, sorted and chosen together.
BLOCK = 64
_AT_ONCE = 4096  # points per batch, which stays in the processor's cache
_CHILDREN = 64  # blocks that are culled together first
_FEW = 1024  # below so many blocks, parents do not pay off


def morton_order(points):
    """Return the order of points (n, 3) along a Morton (Z-order) curve of 21 bits per axis.

    Bits are interleaved as in Warren, "Hacker's Delight", 2002, section 7-2.
    """
    points = np.asarray(points, float)
    if not len(points):
        return np.zeros(0, np.intp)
    low_corner = points.min(0)
    extent = float((points.max(0) - low_corner).max()) or 1.0
    morton_codes = np.empty(len(points), np.uint64)
    for start in range(0, len(points), _AT_ONCE):
        batch = slice(start, start + _AT_ONCE)
        cells = ((points[batch] - low_corner).T * ((2**21 - 1) / extent)).astype(np.uint64)
        x, y, z = _spread(cells)
        morton_codes[batch] = x | y << np.uint64(1) | z << np.uint64(2)
    return np.argsort(morton_codes)


def _spread(numbers):
    """Insert two zero bits between the 21 bits of each number."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        numbers = (numbers | (numbers << np.uint64(shift))) & np.uint64(mask)
    return numbers


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
    #: Which of several groups blocks are of, ascending, if there are several; (m,) uint16.
    owners: np.ndarray | None = None
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

    @classmethod
    def joined(cls, groups) -> Blocks:
        """Return the blocks of groups, one group after the other."""
        if len(groups) == 1:
            return groups[0]
        blocks = cls.empty(sum(len(group.reach) for group in groups))
        for name in ('centers', 'half_sides', 'reach', 'largest', 'smallest'):
            np.concatenate([getattr(g, name) for g in groups], out=getattr(blocks, name))
        numbers = np.arange(len(groups), dtype=np.uint16)
        blocks.owners = np.repeat(numbers, [len(group.reach) for group in groups])
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
        local_centers = centers - middle[:, :, None]
        self.centers[where], self.half_sides[where] = middle.T, (high - low).T / 2
        self.reach[where] = np.sqrt((local_centers * local_centers).sum(0).max(1))
        self.largest[where], self.smallest[where] = radii.max(1), radii.min(1)
        return local_centers

    @property
    def neighborhoods(self) -> Blocks:
        """Blocks of 64 blocks each."""
        if self._parents is None:
            count = len(self.centers)
            slots = members(np.arange(-(-count // _CHILDREN)), _CHILDREN, count)
            radii = self.bounding_radii[slots]
            self._parents = Blocks.empty(len(slots))
            self._parents.fill(slice(None), self.centers.T.take(slots, 1), radii)
        return self._parents

    @property
    def bounding_radii(self) -> np.ndarray:
        """Radii of the spheres around the centres that hold the instances, shape (m,)."""
        return self.reach + self.largest

    def seen(self, frame):
        """Return the blocks in the frustum, farthest first (of each owner), and their sizes.

        Indices, origins in view space (k, 3), bounds of diameters in pixels, depths, negative.
        """
        view = frame.view
        view_from_world, planes, parallel = view.view_from_world, view.side_planes, view.parallel
        near_blocks = self._near(view_from_world, planes, parallel)
        # Rows of coordinates, each contiguous, are several times faster, and so is what is
        # computed in place: the system takes its time to hand out large arrays.
        origins = _origins(view_from_world, self.centers[near_blocks])
        outer_radii = self.reach[near_blocks] + self.largest[near_blocks]
        (in_frustum,) = _inside(origins, outer_radii, planes, parallel).nonzero()
        origins = origins.take(in_frustum, 1)
        depths = origins[2] if parallel else _negative_lengths(origins)
        visible = in_frustum if isinstance(near_blocks, slice) else near_blocks[in_frustum]
        far_first = depths.argsort()
        if self.owners is not None:
            owners = self.owners[visible[far_first]]
            far_first = far_first[owners.argsort(kind='stable')]  # a radix sort
        origins = origins.take(far_first, 1).T
        depths, visible = depths[far_first], visible[far_first]
        scale = 2 * frame.pixel_scale
        if parallel:
            near = far = 1.0
        else:
            center_reach, eye_distances = self.reach[visible], -depths
            near = np.maximum(eye_distances - center_reach, 1e-200)
            far = eye_distances + center_reach
        small, large = self.smallest[visible], self.largest[visible]
        small /= far
        large /= near
        small *= scale
        large *= scale
        return visible, origins, small, large, depths

    def _near(self, view_from_world, planes, parallel):
        """Return the blocks whose neighbourhoods are in view."""
        count = len(self.centers)
        if count < _FEW:
            return slice(None)
        parents = self.neighborhoods
        origins = _origins(view_from_world, parents.centers)
        visible = _inside(origins, parents.reach + parents.largest, planes, parallel)
        if visible.sum() > len(visible) / 2:  # leaving out so few takes longer
            return slice(None)
        children = (np.flatnonzero(visible)[:, None] * _CHILDREN + np.arange(_CHILDREN)).ravel()
        return children[children < count]


def members(blocks, size, count) -> np.ndarray:
    """Return the members of blocks, (k, size); the last of all stands in for missing ones."""
    return np.minimum(np.asarray(blocks)[:, None] * size + np.arange(size), count - 1)


def _inside(origins, outer_radii, planes, parallel):
    """Return which spheres, in view space, intersect a frustum."""
    distances = planes[:, :3] @ origins
    distances += planes[:, 3:]
    is_inside = np.minimum.reduce(distances) > -outer_radii
    if not parallel:
        is_inside &= origins[2] < outer_radii  # no plane lies behind the eye
    return is_inside


def _origins(view_from_world, points):
    """Return points (n, 3) in view space, (3, n)."""
    origins = view_from_world[:3, :3] @ points.T
    origins += view_from_world[:3, 3:]
    return origins


def _negative_lengths(columns):
    """Return the lengths of column vectors, negative."""
    squares = np.add.reduce(columns * columns)
    return np.negative(np.sqrt(squares, squares), squares)


def ascending(values):
    """Return the ascending order of values by a radix sort, exact to 1/65 536 of their range."""
    if not len(values):
        return np.zeros(0, np.intp)
    lowest = np.minimum.reduce(values)
    scale = 65535 / max(float(np.maximum.reduce(values) - lowest), 1e-30)
    return ((values - lowest) * scale).astype(np.uint16).argsort(kind='stable')
