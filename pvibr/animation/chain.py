"""Rigid joints in a hierarchy, as the solvers of inverse kinematics see them."""

from __future__ import annotations

import numpy as np

from pvibr.animation.batched_quaternions import matrices
from pvibr.animation.joint_limits import Limits
from pvibr.animation.skeleton import Jumps
from pvibr.maths import quaternions


class Chain:
    """Rigid joints, parents before children: a chain or a tree."""

    def __init__(self, parents, offsets, limits=None, rest=None):
        self.parents = np.array(parents, dtype=np.int64).reshape(-1)
        joint_count = len(self.parents)
        self.offsets = np.array(offsets, dtype=np.float64)
        rest = np.tile([1.0, 0.0, 0.0, 0.0], (joint_count, 1)) if rest is None else rest
        self.limits = Limits(limits or {}, rest)
        self.rest_matrices = quaternions.to_matrices(self.limits.rest)
        self.lengths = np.where(self.parents < 0, 0.0, np.linalg.norm(self.offsets, axis=1))
        # Row 0 is the space of the figure.
        self._locals = np.tile(np.eye(4), (joint_count + 1, 1, 1))
        self._locals[1:, :3, 3] = self.offsets
        self.above = self.parents + 1
        self._jumps = Jumps(self.parents)

    def __len__(self):
        return len(self.parents)

    def path(self, joint):
        """Return the joints from the root to a joint."""
        joint_path = []
        while joint >= 0:
            joint_path.append(int(joint))
            joint = self.parents[joint]
        return joint_path[::-1]

    def reach(self, joint):
        """Return the largest distance of a joint from its root."""
        return self.lengths[self.path(joint)].sum()

    def world(self, rotations):
        """Return the ``figure_from_joint`` matrices."""
        return self.scanned(np.asarray(rotations, dtype=np.float64).T)[1:]

    def scanned(self, rotation_columns):
        """Return world matrices after a row for the figure's space."""
        figure_from_joint = self._locals.copy()
        figure_from_joint[1:, :3, :3] = matrices(rotation_columns)
        return self._jumps.chained(figure_from_joint)
