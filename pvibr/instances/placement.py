"""Bounding spheres and blocks of instances, and their poses as a texture."""

from __future__ import annotations

import numpy as np

from pvibr.maths.blocks import Blocks, members
from pvibr.maths.transforms import signs_of

#: Texels per row of the pose texture; a multiple of 3, so that a matrix stays in one row.
WIDTH = 3072
_AXES = [0, 1, 2, 4, 5, 6, 8, 9, 10]  # of the components of a pose
_CHUNK = 4096  # instances that fit the processor's cache


def spheres(poses, ids, center, radius):
    """Return centres (3, n) and radii (n,) of the bounding spheres of instances."""
    return _spheres(_columns(poses, ids), center, radius)


def centers_of(poses, ids, atlas):
    """Return the centres of the bounding spheres of instances, shape (n, 3)."""
    if poses.ndim == 2:
        return poses[ids] + atlas.center
    centers = np.empty((len(ids), 3))
    for start in range(0, len(ids), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        centers[chunk] = spheres(poses, ids[chunk], atlas.center, atlas.radius)[0].T
    return centers


def _columns(poses, ids):
    """Return poses with contiguous components, shape (3, n) or (12, n)."""
    width = 3 if poses.ndim == 2 else 12
    return np.ascontiguousarray(poses.reshape(len(poses), -1).take(ids, 0)[:, :width].T)


def _spheres(columns, center, radius):
    if len(columns) == 3:
        return columns + center[:, None], np.full(columns.shape[1], radius)
    matrices = columns.reshape(3, 4, -1)
    x, y, z = center
    centers = matrices[:, 0] * x + matrices[:, 1] * y + matrices[:, 2] * z + matrices[:, 3]
    return centers, stretches(matrices[:, :3]) * radius


@np.errstate(over='ignore')
def stretches(axes):
    """Return upper bounds of the stretch of matrices (3, 3, n), exact for orthogonal columns."""
    squares = (axes * axes).sum(0)
    for j in range(3):
        skew = np.abs((axes[:, j] * axes[:, j - 1]).sum(0))
        squares[j] += skew
        squares[j - 1] += skew
    return np.sqrt(squares.max(0))


class Placement:
    """Instances of one mesh in blocks of neighbours."""

    def __init__(self, atlas, unit):
        self._sphere, self.unit = (atlas.center, atlas.radius), unit
        self.pose_texture = np.zeros((0, WIDTH, 4), np.float32)
        #: Grows with each change.
        self.version = 0
        self.put(np.zeros((0, 3)), np.zeros(0, np.int32))

    @property
    def nbytes(self) -> int:
        """Bytes of main memory."""
        blocks = self.blocks
        arrays = blocks.centers, blocks.half_sides, blocks.reach, blocks.largest, blocks.smallest
        return sum(a.nbytes for a in (self.pose_texture, self._radii, self.ids, *arrays))

    def put(self, poses, ids):
        """Place instances, ordered so that neighbours are together."""
        block_count = -(-len(ids) // self.unit)
        self.ids, self.texels_per_pose = ids, 1 if poses.ndim == 2 else 3
        row_count = max(1, -(-block_count * self.unit * self.texels_per_pose // WIDTH))
        if len(self.pose_texture) != row_count:  # allocating takes longer than computing
            self.pose_texture = np.zeros((row_count, WIDTH, 4), np.float32)
            self._radii = np.zeros(row_count * WIDTH, np.float32)
        self.radii = self._radii[: len(ids)]
        self.blocks = Blocks.empty(block_count)
        self.move(poses, np.arange(block_count))

    def move(self, poses, blocks):
        """Update the instances of blocks, in ascending order."""
        self.version += 1
        unit, chunk = self.unit, max(1, _CHUNK // self.unit)
        pose_rows = self.pose_texture.reshape(-1, 4 * self.texels_per_pose)
        for start in range(0, len(blocks), chunk):
            chunk_blocks = blocks[start : start + chunk]
            slots = members(chunk_blocks, unit, len(self.ids))
            columns = _columns(poses, self.ids[slots.ravel()])
            centers, radii = _spheres(columns, *self._sphere)
            centers, radii = centers.reshape(3, *slots.shape), radii.reshape(slots.shape)
            local = self.blocks.fill(_members_at(chunk_blocks, 1), centers, radii).reshape(3, -1)
            members_at = _members_at(chunk_blocks, unit)
            self._radii[members_at] = radii.ravel()
            if self.texels_per_pose == 1:
                pose_rows[members_at, :3] = local.T
            else:
                columns[3::4] = local
                pose_rows[members_at] = columns.T

    def texture_rows(self, blocks) -> np.ndarray:
        """Return the rows of the texture that hold blocks."""
        texels = self.unit * self.texels_per_pose
        return np.unique(np.stack([blocks * texels, (blocks + 1) * texels - 1]) // WIDTH)

    def outermost(self) -> np.ndarray:
        """Return slots that may touch the bounds of the set."""
        blocks, count = self.blocks, len(self.ids)
        centers = np.ascontiguousarray(blocks.centers.T)
        half_sides = np.ascontiguousarray(blocks.half_sides.T)
        has_matrices = float(self.texels_per_pose > 1)  # points all have one radius
        # Each side of a block's box holds the centre of an instance.
        largest = has_matrices * blocks.largest
        outer_blocks = _may_be_outermost(centers - half_sides, centers + half_sides, largest)
        slots = (outer_blocks[:, None] * self.unit + np.arange(self.unit)).ravel()
        slots = slots[slots < count]
        blocks_of_slots = slots // self.unit
        slot_centers = centers[:, blocks_of_slots] + self.local(slots)
        tolerance = 1e-5 * blocks.bounding_radii[blocks_of_slots]
        radii = has_matrices * self.radii[slots] + tolerance
        return slots[_may_be_outermost(slot_centers, slot_centers, radii)]

    def axes(self, slots) -> np.ndarray | None:
        """Return the rows of the poses' axes as columns, (9, n), or None for points."""
        if self.texels_per_pose == 1:
            return None
        return self.pose_texture.reshape(-1, 12).take(slots, 0).T[_AXES]

    def mirrored(self, slots) -> np.ndarray:
        """Return which slots have poses that mirror."""
        if self.texels_per_pose == 1:
            return np.zeros(len(slots), bool)
        return signs_of(self.pose_texture.reshape(-1, 3, 4).take(slots, 0)) < 0

    def local(self, slots) -> np.ndarray:
        """Return centres of slots relative to those of their blocks, shape (3, n)."""
        pose_rows = self.pose_texture.reshape(-1, 4 * self.texels_per_pose).take(slots, 0)
        return pose_rows.T[:3] if self.texels_per_pose == 1 else pose_rows.T[3::4]


def _may_be_outermost(lowest, highest, radii) -> np.ndarray:
    """Return which boxes (3, n) of sphere centres may hold the extreme coordinates of all.

    Each side of a box holds the centre of a sphere of its radius.
    """
    upper = (highest - radii).max(1, keepdims=True)
    lower = (lowest + radii).min(1, keepdims=True)
    return np.flatnonzero(((highest + radii >= upper) | (lowest - radii <= lower)).any(0))


def _members_at(blocks, unit):
    """Return the slots of ascending blocks, as a slice if there is no gap."""
    first, last = int(blocks[0]), int(blocks[-1])
    if last - first == len(blocks) - 1:
        return slice(first * unit, (last + 1) * unit)
    return (blocks[:, None] * unit + np.arange(unit)).ravel()
