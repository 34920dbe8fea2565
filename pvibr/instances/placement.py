"""Where the instances of a mesh are: spheres, blocks, and poses as the GPU has them."""

from __future__ import annotations

import numpy as np

from pvibr.maths.blocks import Blocks, members
from pvibr.maths.transforms import signs_of

#: Texels of a row of the poses; a multiple of 3, so that a matrix stays in one row.
WIDTH = 3072
_AT_ONCE = 4096  # instances whose numbers stay in the processor's cache


def spheres(poses, ids, center, radius):
    """Return centres (3, n) and radii (n,) of the bounding spheres of some instances."""
    return _spheres(_columns(poses, ids), center, radius)


def centers_of(poses, ids, atlas):
    """Return the centres of the bounding spheres of some instances, shape (n, 3)."""
    if poses.ndim == 2:
        return poses[ids] + atlas.center
    out = np.empty((len(ids), 3))
    for start in range(0, len(ids), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        out[part] = spheres(poses, ids[part], atlas.center, atlas.radius)[0].T
    return out


def _columns(poses, ids):
    """Return each number of some poses in one piece of memory, shape (3, n) or (12, n)."""
    width = 3 if poses.ndim == 2 else 12
    return np.ascontiguousarray(poses.reshape(len(poses), -1).take(ids, 0)[:, :width].T)


def _spheres(columns, center, radius):
    if len(columns) == 3:
        return columns + center[:, None], np.full(columns.shape[1], radius)
    rows = columns.reshape(3, 4, -1)
    x, y, z = center
    centers = rows[:, 0] * x + rows[:, 1] * y + rows[:, 2] * z + rows[:, 3]
    return centers, stretches(rows[:, :3]) * radius


@np.errstate(over='ignore')
def stretches(axes):
    """Return bounds on the stretch of matrices (3, 3, n), exact if columns are orthogonal."""
    sums = (axes * axes).sum(0)
    for j in range(3):
        across = np.abs((axes[:, j] * axes[:, j - 1]).sum(0))
        sums[j] += across
        sums[j - 1] += across
    return np.sqrt(sums.max(0))


class Placement:
    """Instances of one mesh in blocks of neighbours."""

    def __init__(self, atlas, unit):
        self._sphere, self.unit = (atlas.center, atlas.radius), unit
        self.rows = np.zeros((0, WIDTH, 4), np.float32)
        self.put(np.zeros((0, 3)), np.zeros(0, np.int32))

    @property
    def nbytes(self) -> int:
        """Bytes of main memory."""
        blocks = self.blocks
        arrays = self.rows, self._radii, self.ids, blocks.centers, blocks.half_sides, blocks.reach
        return sum(a.nbytes for a in (*arrays, blocks.largest, blocks.smallest))

    def put(self, poses, ids):
        """Place instances, given in an order that keeps neighbours together."""
        count = -(-len(ids) // self.unit)
        self.ids, self.texels = ids, 1 if poses.ndim == 2 else 3
        height = max(1, -(-count * self.unit * self.texels // WIDTH))
        if len(self.rows) != height:  # fresh memory takes longer than all that is computed
            self.rows = np.zeros((height, WIDTH, 4), np.float32)
            self._radii = np.zeros(height * WIDTH, np.float32)
        self.radii = self._radii[: len(ids)]
        self.blocks = Blocks.empty(count)
        self.move(poses, np.arange(count))

    def move(self, poses, blocks):
        """Place the instances of rising blocks again."""
        unit, step = self.unit, max(1, _AT_ONCE // self.unit)
        rows = self.rows.reshape(-1, 4 * self.texels)
        for start in range(0, len(blocks), step):
            some = blocks[start : start + step]
            slots = members(some, unit, len(self.ids))
            columns = _columns(poses, self.ids[slots.ravel()])
            centers, radii = _spheres(columns, *self._sphere)
            centers, radii = centers.reshape(3, *slots.shape), radii.reshape(slots.shape)
            local = self.blocks.fill(_run(some, 1), centers, radii).reshape(3, -1)
            run = _run(some, unit)
            self._radii[run] = radii.ravel()
            if self.texels == 1:
                rows[run, :3] = local.T
            else:
                columns[3::4] = local
                rows[run] = columns.T

    def rows_of(self, blocks) -> np.ndarray:
        """Return the rows of the texture that hold some blocks."""
        texels = self.unit * self.texels
        return np.unique(np.stack([blocks * texels, (blocks + 1) * texels - 1]) // WIDTH)

    def outermost(self) -> np.ndarray:
        """Return slots that hold all that bounds are made of."""
        blocks, count = self.blocks, len(self.ids)
        centers = np.ascontiguousarray(blocks.centers.T)
        half_sides = np.ascontiguousarray(blocks.half_sides.T)
        turned = float(self.texels > 1)  # what is not reaches as far from its centre as all others
        # On each side of the box of a block lies the centre of one.
        largest = turned * blocks.largest
        some = _may_be_outermost(centers - half_sides, centers + half_sides, largest)
        slots = (some[:, None] * self.unit + np.arange(self.unit)).ravel()
        slots = slots[slots < count]
        of = slots // self.unit
        places = centers[:, of] + self.local(slots)
        radii = turned * self.radii[slots] + 1e-5 * (blocks.reach + blocks.largest)[of]
        return slots[_may_be_outermost(places, places, radii)]

    def directions(self, slots, toward) -> np.ndarray:
        """Turn directions, (3, n) or (3, 1), to model axes: of any length, (n, 3)."""
        if self.texels == 1:
            return np.broadcast_to(toward.T, (len(slots), 3))
        rows = self.rows.reshape(-1, 12).take(slots, 0).T
        (a, b, c), (d, e, f), (g, h, i) = rows[:3], rows[4:7], rows[8:11]
        x, y, z = toward
        # The adjugate, which is the inverse but for the sign and size of the determinant.
        minors = (e * i - f * h, f * g - d * i, d * h - e * g)
        out = np.stack(
            [
                minors[0] * x + (c * h - b * i) * y + (b * f - c * e) * z,
                minors[1] * x + (a * i - c * g) * y + (c * d - a * f) * z,
                minors[2] * x + (b * g - a * h) * y + (a * e - b * d) * z,
            ],
            1,
        )
        mirrored = a * minors[0] + b * minors[1] + c * minors[2] < 0
        return np.where(mirrored[:, None], -out, out)

    def mirrored(self, slots) -> np.ndarray:
        """Return which poses of some slots mirror."""
        if self.texels == 1:
            return np.zeros(len(slots), bool)
        return signs_of(self.rows.reshape(-1, 3, 4).take(slots, 0)) < 0

    def local(self, slots) -> np.ndarray:
        """Return centres of some slots relative to those of their blocks, shape (3, n)."""
        rows = self.rows.reshape(-1, 4 * self.texels).take(slots, 0)
        return rows.T[:3] if self.texels == 1 else rows.T[3::4]


def _may_be_outermost(lowest, highest, radii) -> np.ndarray:
    """Return which may hold the lowest or highest coordinates of something in each.

    Of boxes (3, n) around centres of spheres of such radii, with a centre on each side.
    """
    high = (highest - radii).max(1, keepdims=True)
    low = (lowest + radii).min(1, keepdims=True)
    return np.flatnonzero(((highest + radii >= high) | (lowest - radii <= low)).any(0))


def _run(blocks, unit):
    """Return the places of the members of rising blocks, as a slice if there is no gap."""
    first, last = int(blocks[0]), int(blocks[-1])
    if last - first == len(blocks) - 1:
        return slice(first * unit, (last + 1) * unit)
    return (blocks[:, None] * unit + np.arange(unit)).ravel()
