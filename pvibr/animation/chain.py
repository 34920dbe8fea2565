"""Rigid joints in a hierarchy, as the solvers of inverse kinematics see them."""

from __future__ import annotations

import numpy as np

from pvibr.animation.columns import matrices
from pvibr.animation.limits import Limits
from pvibr.animation.skeleton import ancestors, chained
from pvibr.maths import quaternions


class Chain:
    """Rigid joints: one chain or a tree, in any place.

    Parameters
    ----------
    parents : array_like of int, shape (n,)
        Parent of each joint, -1 for a root; parents come before their children.
    offsets : array_like, shape (n, 3)
        Origin of each joint in its parent's space; of a root in the figure's.
    limits : dict of int to Limit, optional
        Limits of the joints that have one.
    rest : array_like, shape (n, 4), optional
        Rotations at rest, from which limits are counted; default none.

    Attributes
    ----------
    parents : numpy.ndarray, shape (n,), int
        As given.
    offsets : numpy.ndarray, shape (n, 3), float64
        As given.
    lengths : numpy.ndarray, shape (n,), float64
        Length of the bone from the parent to each joint, 0 for roots.
    limits : Limits
        The limits.

    Raises
    ------
    ValueError
        If a parent does not come before its child, or shapes do not fit.

    Examples
    --------
    >>> from pvibr.animation.chain import Chain
    >>> arm = Chain([-1, 0, 1], [[0, 0, 0], [1, 0, 0], [1, 0, 0]])
    >>> arm.reach(2)
    np.float64(2.0)
    """

    def __init__(self, parents, offsets, limits=None, rest=None):
        self.parents = np.array(parents, dtype=np.int64).reshape(-1)
        n = len(self.parents)
        for joint in np.flatnonzero((self.parents < -1) | (self.parents >= np.arange(n))):
            msg = f'parents[{joint}] is {self.parents[joint]}; parents come before children.'
            raise ValueError(msg)
        self.offsets = np.array(offsets, dtype=np.float64)
        if self.offsets.shape != (n, 3) or not np.isfinite(self.offsets).all():
            msg = f'offsets must be finite and of shape {(n, 3)}, not {self.offsets.shape}.'
            raise ValueError(msg)
        self.limits = Limits(limits or {}, _identities(n) if rest is None else rest)
        self.rest_matrices = quaternions.to_matrices(self.limits.rest)
        self.lengths = np.where(self.parents < 0, 0.0, np.linalg.norm(self.offsets, axis=1))
        # Row 0 is the space of the figure.
        self._locals = np.tile(np.eye(4), (n + 1, 1, 1))
        self._locals[1:, :3, 3] = self.offsets
        self.above = self.parents + 1
        self._jumps = ancestors(self.parents)

    def __len__(self):
        return len(self.parents)

    def path(self, joint):
        """Return the joints from the root to a joint.

        Parameters
        ----------
        joint : int
            The last joint.

        Returns
        -------
        list of int
            The root first.

        Examples
        --------
        >>> from pvibr.animation.chain import Chain
        >>> Chain([-1, 0, 0], [[0, 0, 0]] * 3).path(2)
        [0, 2]
        """
        path = []
        while joint >= 0:
            path.append(int(joint))
            joint = self.parents[joint]
        return path[::-1]

    def reach(self, joint):
        """Return how far a joint can be from its root.

        Parameters
        ----------
        joint : int
            The joint.

        Returns
        -------
        float
            Sum of the bones between, in the figure's unit.

        Examples
        --------
        >>> from pvibr.animation.chain import Chain
        >>> Chain([-1, 0], [[5, 0, 0], [0, 3, 4]]).reach(1)
        np.float64(5.0)
        """
        return self.lengths[self.path(joint)].sum()

    def world(self, rotations):
        """Return the matrices that take points of each joint to the figure's space.

        Parameters
        ----------
        rotations : array_like, shape (n, 4)
            Rotations relative to the parents, unit quaternions (w, x, y, z).

        Returns
        -------
        numpy.ndarray, shape (n, 4, 4), float64
            ``figure_from_joint``.

        Examples
        --------
        >>> from pvibr.animation.chain import Chain
        >>> arm = Chain([-1, 0], [[0, 0, 0], [1, 0, 0]])
        >>> arm.world([[0, 0, 0, 1], [1, 0, 0, 0]])[1, :3, 3].tolist()
        [-1.0, 0.0, 0.0]
        """
        return self.scanned(np.asarray(rotations, dtype=np.float64).T)[1:]

    def scanned(self, columns):
        """Return world matrices after a row for the space of the figure.

        Parameters
        ----------
        columns : numpy.ndarray, shape (4, n), float64
            Rotations relative to the parents, components first.

        Returns
        -------
        numpy.ndarray, shape (n + 1, 4, 4), float64
            Row 0 is the identity, row i + 1 is joint i; ``above`` indexes the parents' rows.

        Examples
        --------
        >>> import numpy as np
        >>> from pvibr.animation.chain import Chain
        >>> Chain([-1], [[1, 2, 3]]).scanned(np.eye(4)[:, :1])[1, :3, 3].tolist()
        [1.0, 2.0, 3.0]
        """
        world = self._locals.copy()
        world[1:, :3, :3] = matrices(columns)
        return chained(world, self._jumps)


def _identities(n):
    return np.broadcast_to([1.0, 0.0, 0.0, 0.0], (n, 4))
