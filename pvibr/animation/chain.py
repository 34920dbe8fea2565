"""Rigid joints in a hierarchy, as the solvers of inverse kinematics see them."""

from __future__ import annotations

import numpy as np

from pvibr.animation.batched_quaternions import matrices
from pvibr.animation.limits import Limits
from pvibr.animation.skeleton import Jumps
from pvibr.maths import quaternions


class Chain:
    """Rigid joints, parents before children: a chain or a tree."""

    def __init__(self, parents, offsets, limits=None, rest=None):
        self.parents = np.array(parents, dtype=np.int64).reshape(-1)
        n = len(self.parents)
        for joint in np.flatnonzero((self.parents < -1) | (self.parents >= np.arange(n))):
            raise ValueError(
                f'parents[{joint}] is {self.parents[joint]}; parents come before children.'
            )
        self.offsets = np.array(offsets, dtype=np.float64)
        if self.offsets.shape != (n, 3) or not np.isfinite(self.offsets).all():
            raise ValueError(
                f'offsets must be finite and of shape {(n, 3)}, not {self.offsets.shape}.'
            )
        self.limits = Limits(limits or {}, _identities(n) if rest is None else rest)
        self.rest_matrices = quaternions.to_matrices(self.limits.rest)
        self.lengths = np.where(self.parents < 0, 0.0, np.linalg.norm(self.offsets, axis=1))
        # Row 0 is the space of the figure.
        self._locals = np.tile(np.eye(4), (n + 1, 1, 1))
        self._locals[1:, :3, 3] = self.offsets
        self.above = self.parents + 1
        self._jumps = Jumps(self.parents)

    def __len__(self):
        return len(self.parents)

    def path(self, joint):
        """Return the joints from the root to a joint."""
        path = []
        while joint >= 0:
            path.append(int(joint))
            joint = self.parents[joint]
        return path[::-1]

    def reach(self, joint):
        """Return the largest distance of a joint from its root."""
        return self.lengths[self.path(joint)].sum()

    def world(self, rotations):
        """Return the ``figure_from_joint`` matrices."""
        return self.scanned(np.asarray(rotations, dtype=np.float64).T)[1:]

    def scanned(self, columns):
        """Return world matrices after a row for the figure's space."""
        world = self._locals.copy()
        world[1:, :3, :3] = matrices(columns)
        return self._jumps.chained(world)


def _identities(n):
    return np.broadcast_to([1.0, 0.0, 0.0, 0.0], (n, 4))
