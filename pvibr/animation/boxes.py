"""Bounding boxes of a posed mesh, from the boxes of its joints."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.maths import skinning

#: Growth of a box relative to its size, for rounding to float32.
_ROUNDING = 1e-6
#: Corners of a box: lower (0) or upper (1) bound of each axis.
_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
_AXES = np.arange(3)


class Boxes:
    """Bounding boxes of a mesh in any pose, without looking at its vertices again."""

    def __init__(self, mesh):
        self._mesh = mesh

    def around(self, world, layers=(), time=0.0, how='linear'):
        """Return boxes (..., 6) around the posed mesh."""
        mesh, world = self._mesh, np.asarray(world, dtype=np.float64)
        if mesh.skin is None:
            node = np.eye(4) if mesh.node < 0 else world[..., mesh.node, :, :]
            node = np.broadcast_to(node, (*world.shape[:-3], 4, 4))[..., None, :, :]
            boxes = _moved(node, self._still(self._all, layers, time))
        elif how == 'linear' or not self._others:  # one joint per vertex: both ways agree
            matrices = mesh.skin.matrices(world)[..., self._singles.keys, :, :]
            boxes = _moved(matrices, self._still(self._singles, layers, time))
        else:
            boxes = self._dual(mesh.skin, world, self._still(self._pairs, layers, time))
        return _joined(boxes)

    def of_joints(self, how):
        """Return joints, matrices and boxes that they move, None if that does not suffice."""
        mesh = self._mesh
        if mesh.frames is not None or mesh.morphs is not None:
            return None
        if mesh.skin is None:
            return None if mesh.node < 0 else ([mesh.node], [np.eye(4)], self._still(self._all))
        if how != 'linear' and self._others:
            return None
        keys = self._singles.keys
        return mesh.skin.nodes[keys], mesh.skin.inverse_bind[keys], self._still(self._singles)

    def _dual(self, skin, world, boxes):
        """Return the boxes of single joints, from those of vertices that pairs of them share."""
        joints, starts, first, second = self._members
        matrices = skin.matrices(world)[..., joints, :, :]
        real, dual, stretch = skinning.dual_parts(matrices, skin.centers[joints])
        rigid = skinning.rigid(real, dual)

        def most(values):  # of all pairs with the same first joint
            return np.maximum.reduceat(values, starts, -1)[..., first]

        # First phase: a vertex is stretched by the mean of its joints, at most by the largest.
        boxes = _grown(boxes, most(_apart(stretch[..., second, :, :], np.eye(4)[:3], boxes)))
        # Second phase: the blended rotation deviates at most this far from the first joint's.
        apart = most(_apart(rigid[..., first, :, :], rigid[..., second, :, :], boxes))
        turned = most(1.0 - np.abs((real[..., first, :] * real[..., second, :]).sum(-1)))
        others = self._others
        own = first == second
        leave = (others * apart / np.maximum(1.0 - others * turned, 1e-300))[..., own]
        return _grown(_moved(rigid[..., first[own], :, :], boxes[..., own, :, :]), leave)

    def _still(self, groups, layers=(), time=0.0):
        """Return the boxes of vertex groups before skinning, (..., g, 2, 3)."""
        mesh = self._mesh
        if mesh.frames is None:
            boxes = groups.boxes('points', lambda: mesh.points)
        else:
            boxes = self._framed(groups, *mesh.frames.at(time))
        for morphs, weights in layers:
            weights = np.asarray(weights, dtype=np.float64)
            for i in np.flatnonzero((weights != 0).reshape(-1, len(morphs)).any(0)):
                one = np.zeros(len(morphs))
                one[i] = 1.0
                box = groups.boxes((morphs, i), lambda m=morphs, w=one: self._total(m, w))
                boxes = boxes + _scaled(box, weights[..., i])
        return boxes

    def _framed(self, groups, frames, shares):
        used, place = np.unique(frames, return_inverse=True)
        positions = self._mesh.frames.positions
        table = np.stack(
            [groups.boxes(('frame', i), lambda i=i: np.asarray(positions[i], float)) for i in used]
        )
        return _scaled(table[place.reshape(frames.shape)], shares).sum(-4)

    def _total(self, morphs, weights):
        return morphs.total('positions', weights, len(self._mesh.points))

    @cached_property
    def _all(self):
        return _Groups(np.zeros(len(self._mesh.points), np.int64))

    @cached_property
    def _singles(self):
        """Vertices by joint."""
        skin = self._mesh.skin
        return _Groups(*(part[skin.weights > 0] for part in (skin.joints, _rows(skin.joints))))

    @cached_property
    def _others(self):
        """The largest total weight of all joints but the heaviest of a vertex."""
        return 1.0 - self._mesh.skin.weights.max(1).min()

    @cached_property
    def _pairs(self):
        """Vertices by pairs of joints that influence them; a joint also pairs with itself."""
        skin = self._mesh.skin
        keys = skin.joints[:, :, None] * len(skin.nodes) + skin.joints[:, None, :]
        keys = keys.reshape(len(keys), -1)
        pulls = skin.weights > 0
        both = (pulls[:, :, None] & pulls[:, None, :]).reshape(keys.shape)
        return _Groups(keys[both], _rows(keys)[both])

    @cached_property
    def _members(self):
        """Joints of pairs, where pairs of each begin, and first and second of each pair."""
        first, second = np.divmod(self._pairs.keys, len(self._mesh.skin.nodes))
        joints, starts, place = np.unique(first, return_index=True, return_inverse=True)
        return joints, starts, place, np.searchsorted(joints, second)


class _Groups:
    """Rows of an array in overlapping groups, and the box of each group."""

    def __init__(self, keys, rows=None):
        order = np.argsort(keys, kind='stable')
        self._rows = order if rows is None else rows[order]
        self.keys, self._starts = np.unique(keys[order], return_index=True)
        self._boxes = {}

    def boxes(self, name, values):
        """Return the cached boxes of an array's groups, (g, 2, 3)."""
        if name not in self._boxes:
            rows = values()[self._rows]
            bounds = [f.reduceat(rows, self._starts) for f in (np.minimum, np.maximum)]
            self._boxes[name] = np.stack(bounds, 1)
        return self._boxes[name]


def _rows(array):
    return np.broadcast_to(np.arange(len(array))[:, None], array.shape)


def _scaled(boxes, factors):
    """Return boxes times factors of any sign."""
    factors = np.asarray(factors)[..., None, None, None]
    return np.maximum(factors, 0) * boxes + np.minimum(factors, 0) * boxes[..., ::-1, :]


def _moved(matrices, boxes):
    """Return the boxes around boxes that matrices (..., g, 3 or 4, 4) move."""
    linear, shift = matrices[..., :3, :3], matrices[..., :3, 3]
    middle, half = boxes.mean(-2), (boxes[..., 1, :] - boxes[..., 0, :]) / 2
    middle = np.einsum('...ij,...j->...i', linear, middle) + shift
    half = np.einsum('...ij,...j->...i', np.abs(linear), half)
    return np.stack([middle - half, middle + half], -2)


def _grown(boxes, lengths):
    return boxes + lengths[..., None, None] * np.array([[-1.0], [1.0]])


def _apart(a, b, boxes):
    """Return the largest distance between two motions of a point of a box."""
    corners = boxes[..., _CORNERS, _AXES]
    between = a - b
    apart = corners @ np.swapaxes(between[..., :3, :3], -1, -2) + between[..., None, :3, 3]
    return np.sqrt((apart * apart).sum(-1).max(-1))


def around_moved(matrices, boxes, starts):
    """Return the unions, (f, 6), of moved boxes (g, 2, 3), each from a start to the next."""
    moved = _moved(matrices, boxes)
    ends = [f.reduceat(moved[:, i], starts) for i, f in enumerate((np.minimum, np.maximum))]
    return _joined(np.stack(ends, 1)[:, None])


def _joined(boxes):
    """Return the union of the boxes of groups, (..., 6)."""
    low, high = boxes[..., 0, :].min(-2), boxes[..., 1, :].max(-2)
    rounding = _ROUNDING * (high - low).max(-1, keepdims=True)
    return np.stack([low - rounding, high + rounding], -1).reshape(*low.shape[:-1], 6)
