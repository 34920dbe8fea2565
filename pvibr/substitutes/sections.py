"""Which clipping planes cut the leaves of an impostor, and which have moved."""

from __future__ import annotations

import numpy as np

# What the planes leave of a leaf.
_WHOLE, _REMOVED, _CUT, _MOVING = range(4)


class Sections:
    """The clipping planes of leaves, each of which keeps all, nothing or a part of a leaf."""

    # Decided by the signs of a plane at the corners of a leaf's oriented box. An image depends on
    # the planes that cut its leaf, and on no others.

    def __init__(self):
        self._state = np.zeros(0, int)
        self._cuts: dict[int, list] = {}  # by leaf: the planes that cut it
        self._cut_keys: dict[int, bytes] = {}  # by leaf: their numbers
        self._planes: list = []
        self._pairs = np.zeros((2, 0), int)  # leaf and plane of each pair
        self._times: tuple = ()
        self._is_stale = True
        self.has_moving = False  # whether any leaf is
        self.version = 0  # that changes with what the planes leave

    def grow(self, count):
        """Follow leaves that grew."""
        self._state = np.append(self._state, np.zeros(count, int))

    @property
    def removed(self) -> np.ndarray:
        """Which leaves lie outside a plane."""
        return self._state == _REMOVED

    @property
    def cut(self) -> np.ndarray:
        """Which leaves are cut by planes."""
        return self._state >= _CUT

    @property
    def moving(self) -> np.ndarray:
        """Which leaves are cut by other planes than in the frame before."""
        return self._state == _MOVING

    def planes_of(self, leaf) -> list:
        """Return the planes that cut a leaf."""
        return self._cuts.get(leaf, [])

    def key(self) -> tuple:
        """Return a value that changes with the planes."""
        return tuple(plane.GetMTime() for plane in self._planes)

    def list_planes(self, leaves):
        """List the planes of leaves, which changed."""
        self._is_stale = True
        planes: dict = {}
        pairs = [
            (leaf, planes.setdefault(plane, len(planes)))
            for leaf, source in enumerate(leaves.sources)
            if source is not None and not source.why
            for plane in source.planes
        ]
        self._planes = list(planes)
        self._pairs = np.array(pairs, int).reshape(-1, 2).T

    def update(self, leaves) -> list[int]:
        """Compare the planes with those of the frame before; return the leaves that it changes."""
        times = self.key()
        if not self._is_stale and times == self._times and not self.has_moving:
            return []
        self._is_stale, self._times = False, times
        previous_state, previous_keys = self._state, self._cut_keys
        self._find(leaves)
        for leaf, cut_key in self._cut_keys.items():
            if cut_key != previous_keys.get(leaf):
                self._state[leaf] = _MOVING
        self.has_moving = bool(self.moving.any())
        changed_leaves = np.flatnonzero((self._state != previous_state) | self.moving).tolist()
        self.version += bool(changed_leaves)
        return changed_leaves

    def _find(self, leaves):
        """Find the planes that cut each leaf."""
        self._state, self._cuts, self._cut_keys = np.zeros(len(leaves), int), {}, {}
        if not self._planes:
            return
        normals = np.array([plane.GetNormal() for plane in self._planes])
        origins = np.array([plane.GetOrigin() for plane in self._planes])
        leaf, plane = self._pairs
        height = ((leaves.center[leaf] - origins[plane]) * normals[plane]).sum(1)
        half_depth = np.abs(np.einsum('nij,nj->ni', leaves.half[leaf], normals[plane])).sum(1)
        is_outside = height + half_depth < 0
        self._state[leaf[is_outside]] = _REMOVED
        is_cut = ~(height - half_depth >= 0) & (self._state[leaf] != _REMOVED)
        self._state[leaf[is_cut]] = _CUT
        equations = np.concatenate([normals, origins], 1)
        for row in np.flatnonzero(is_cut).tolist():
            i, k = int(leaf[row]), int(plane[row])
            self._cuts.setdefault(i, []).append(self._planes[k])
            self._cut_keys[i] = self._cut_keys.get(i, b'') + equations[k].tobytes()
