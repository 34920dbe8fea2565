"""Bounding boxes of a posed mesh, from the boxes of its joints."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.animation.skinning import dual_parts, rigid

#: Growth of a box relative to its size, for rounding to float32.
_ROUNDING = 1e-6
#: Corners of a box: lower (0) or upper (1) bound of each axis.
_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
_AXES = np.arange(3)


class Boxes:
    """Bounding boxes of a mesh in any pose, without looking at its vertices again."""

    def __init__(self, mesh):
        self._figure_mesh = mesh

    def around(self, world, layers=(), time=0.0, skinning='linear'):
        """Return boxes (..., 6) around the posed mesh."""
        mesh, world = self._figure_mesh, np.asarray(world, dtype=np.float64)
        if mesh.skin is None:
            node_matrix = np.eye(4) if mesh.node < 0 else world[..., mesh.node, :, :]
            node_matrix = np.broadcast_to(node_matrix, (*world.shape[:-3], 4, 4))[..., None, :, :]
            boxes = _transformed_boxes(node_matrix, self._still(self._all, layers, time))
        elif (
            skinning == 'linear' or not self._minor_weight
        ):  # one joint per vertex: both ways agree
            matrices = mesh.skin.matrices(world)[..., self._singles.keys, :, :]
            boxes = _transformed_boxes(matrices, self._still(self._singles, layers, time))
        else:
            boxes = self._dual(mesh.skin, world, self._still(self._pairs, layers, time))
        return _box_union(boxes)

    def of_joints(self, skinning):
        """Return joints, matrices and boxes that they move, None if that does not suffice."""
        mesh = self._figure_mesh
        if mesh.frames is not None or mesh.morphs is not None:
            return None
        if mesh.skin is None:
            return None if mesh.node < 0 else ([mesh.node], [np.eye(4)], self._still(self._all))
        if skinning != 'linear' and self._minor_weight:
            return None
        skin, keys = mesh.skin, self._singles.keys
        return skin.nodes[keys], skin.inverse_bind[keys], self._still(self._singles)

    def _dual(self, skin, world, boxes):
        """Return the boxes of single joints, from those of vertices that pairs of them share."""
        pair_joints, pair_starts, first_pair, second_pair = self._members
        matrices = skin.matrices(world)[..., pair_joints, :, :]
        real, dual, stretch = dual_parts(matrices, skin.centers[pair_joints])
        rigid_parts = rigid(real, dual)

        def pair_max(values):  # of all pairs with the same first joint
            return np.maximum.reduceat(values, pair_starts, -1)[..., first_pair]

        # First phase: a vertex is stretched by the mean of its joints, at most by the largest.
        stretch_gap = _largest_gap(stretch[..., second_pair, :, :], np.eye(4)[:3], boxes)
        boxes = _grown(boxes, pair_max(stretch_gap))
        # Second phase: the blended rotation deviates at most this far from the first joint's.
        motion_gap = pair_max(
            _largest_gap(
                rigid_parts[..., first_pair, :, :], rigid_parts[..., second_pair, :, :], boxes
            )
        )
        rotation_gap = pair_max(
            1.0 - np.abs((real[..., first_pair, :] * real[..., second_pair, :]).sum(-1))
        )
        minor_weight = self._minor_weight
        is_self = first_pair == second_pair
        margin = minor_weight * motion_gap / np.maximum(1.0 - minor_weight * rotation_gap, 1e-300)
        boxes = _transformed_boxes(
            rigid_parts[..., first_pair[is_self], :, :], boxes[..., is_self, :, :]
        )
        return _grown(boxes, margin[..., is_self])

    def _still(self, groups, layers=(), time=0.0):
        """Return the boxes of vertex groups before skinning, (..., g, 2, 3)."""
        mesh, n = self._figure_mesh, len(self._figure_mesh.points)
        if mesh.frames is None:
            boxes = groups.boxes('points', lambda: mesh.points)
        else:
            boxes = self._framed(groups, *mesh.frames.at(time))
        for morphs, weights in layers:
            weights = np.asarray(weights, dtype=np.float64)
            for i in np.flatnonzero((weights != 0).reshape(-1, len(morphs)).any(0)):
                one_hot = np.arange(len(morphs)) == i
                box = groups.boxes(
                    (morphs, i), lambda m=morphs, w=one_hot: m.total('positions', w, n)
                )
                boxes = boxes + _scaled(box, weights[..., i])
        return boxes

    def _framed(self, groups, frames, shares):
        frame_indices, places = np.unique(frames, return_inverse=True)
        positions = self._figure_mesh.frames.positions
        frame_boxes = [
            groups.boxes(('frame', i), lambda i=i: np.asarray(positions[i], float))
            for i in frame_indices
        ]
        return _scaled(np.stack(frame_boxes)[places.reshape(frames.shape)], shares).sum(-4)

    @cached_property
    def _all(self):
        return _Groups(np.zeros(len(self._figure_mesh.points), np.int64))

    @cached_property
    def _singles(self):
        """Vertices by joint."""
        skin = self._figure_mesh.skin
        return _Groups(*(part[skin.weights > 0] for part in (skin.joints, _rows(skin.joints))))

    @cached_property
    def _minor_weight(self):
        """The largest total weight of all joints but the heaviest of a vertex."""
        return 1.0 - self._figure_mesh.skin.weights.max(1).min()

    @cached_property
    def _pairs(self):
        """Vertices by pairs of joints that influence them; a joint also pairs with itself."""
        skin = self._figure_mesh.skin
        pair_keys = skin.joints[:, :, None] * len(skin.nodes) + skin.joints[:, None, :]
        pair_keys = pair_keys.reshape(len(pair_keys), -1)
        pulls = skin.weights > 0
        pair_mask = (pulls[:, :, None] & pulls[:, None, :]).reshape(pair_keys.shape)
        return _Groups(pair_keys[pair_mask], _rows(pair_keys)[pair_mask])

    @cached_property
    def _members(self):
        """Joints of pairs, where pairs of each begin, and first and second of each pair."""
        first_joint, second_joint = np.divmod(self._pairs.keys, len(self._figure_mesh.skin.nodes))
        unique = np.unique(first_joint, return_index=True, return_inverse=True)
        return *unique, np.searchsorted(unique[0], second_joint)


class _Groups:
    """Rows of an array in overlapping groups, and the box of each group."""

    def __init__(self, vertex_keys, vertex_indices=None):
        sort_order = np.argsort(vertex_keys, kind='stable')
        self._vertex_indices = sort_order if vertex_indices is None else vertex_indices[sort_order]
        self.keys, self._starts = np.unique(vertex_keys[sort_order], return_index=True)
        self._boxes = {}

    def boxes(self, cache_key, load_values):
        """Return the cached boxes of an array's groups, (g, 2, 3)."""
        if cache_key not in self._boxes:
            group_values = load_values()[self._vertex_indices]
            box_bounds = [f.reduceat(group_values, self._starts) for f in (np.minimum, np.maximum)]
            self._boxes[cache_key] = np.stack(box_bounds, 1)
        return self._boxes[cache_key]


def _rows(array):
    return np.broadcast_to(np.arange(len(array))[:, None], array.shape)


def _scaled(boxes, factors):
    """Return boxes times factors of any sign."""
    factors = np.asarray(factors)[..., None, None, None]
    return np.maximum(factors, 0) * boxes + np.minimum(factors, 0) * boxes[..., ::-1, :]


def _transformed_boxes(matrices, boxes):
    """Return the boxes around boxes that matrices (..., g, 3 or 4, 4) move."""
    linear, translations = matrices[..., :3, :3], matrices[..., :3, 3]
    centers, halves = boxes.mean(-2), (boxes[..., 1, :] - boxes[..., 0, :]) / 2
    centers = np.einsum('...ij,...j->...i', linear, centers) + translations
    halves = np.einsum('...ij,...j->...i', np.abs(linear), halves)
    return np.stack([centers - halves, centers + halves], -2)


def _grown(boxes, lengths):
    return boxes + lengths[..., None, None] * np.array([[-1.0], [1.0]])


def _largest_gap(a, b, boxes):
    """Return the largest distance between two motions of a point of a box."""
    corners = boxes[..., _CORNERS, _AXES]
    between = a - b
    offsets = corners @ np.swapaxes(between[..., :3, :3], -1, -2) + between[..., None, :3, 3]
    return np.sqrt((offsets * offsets).sum(-1).max(-1))


def joint_bounds(matrices, boxes, starts):
    """Return the unions, (f, 6), of moved boxes (g, 2, 3), each from a start to the next."""
    joint_boxes = _transformed_boxes(matrices, boxes)
    ends = [f.reduceat(joint_boxes[:, i], starts) for i, f in enumerate((np.minimum, np.maximum))]
    return _box_union(np.stack(ends, 1)[:, None])


def _box_union(boxes):
    """Return the union of the boxes of groups, (..., 6)."""
    low, high = boxes[..., 0, :].min(-2), boxes[..., 1, :].max(-2)
    rounding = _ROUNDING * (high - low).max(-1, keepdims=True)
    return np.stack([low - rounding, high + rounding], -1).reshape(*low.shape[:-1], 6)
