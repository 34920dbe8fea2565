"""A skeleton: joints, their parents and the rest pose."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.animation.pose import Pose, as_matrices
from pvibr.maths.transforms import inverses


class Skeleton:
    """A hierarchy of joints, in any order.

    Parameters
    ----------
    parents : array_like of int, shape (n,)
        Parent of each joint, -1 for a root.
    rest : Pose or array_like, shape (n, 4, 4)
        Rest pose, relative to the parents (``parent_from_joint``).
    names : sequence of str, optional
        Names of the joints; default 'joint0', 'joint1', ...

    Raises
    ------
    ValueError
        If a parent is out of range, the parents have a cycle, or the rest pose does not fit; the
        message names the joint.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Pose, Skeleton
    >>> arm = Skeleton([-1, 0, 1], Pose(np.eye(3)[[0, 0, 0]]), ['shoulder', 'elbow', 'hand'])
    >>> arm.world(arm.rest)[arm.index('hand'), :3, 3].tolist()
    [3.0, 0.0, 0.0]
    """

    def __init__(self, parents, rest, names=None):
        parents = whole_numbers(parents, 'parents')
        joint_count = len(parents)
        self.names = _names(names, joint_count)
        self.parents = parents
        self.rest = rest if isinstance(rest, Pose) else Pose.from_matrices(rest, name='rest')
        if self.rest.translation.shape != (joint_count, 3):
            raise ValueError(
                f'rest must hold {joint_count} joints, as parents, got shape '
                f'{self.rest.translation.shape[:-1]}'
            )
        parents.setflags(write=False)
        self._check_range()
        #: Joints by distance from their root: parents come first.
        self.levels = self._levels()

    def __len__(self):
        return len(self.parents)

    def __repr__(self):
        return f'Skeleton({len(self)} joints, {len(self.levels)} levels)'

    @property
    def order(self):
        """All joints, parents before their children: int array of shape (n,)."""
        return np.concatenate([np.zeros(0, np.int64), *self.levels])

    @cached_property
    def _jumps(self):
        return Jumps(self.parents)

    @cached_property
    def children(self):
        """Children of each joint: a list of n int arrays."""
        child_order = np.argsort(self.parents, kind='stable')
        child_starts = np.searchsorted(self.parents[child_order], np.arange(len(self) + 1))
        return np.split(child_order, child_starts)[1:-1]

    def index(self, name):
        """Return the index of a joint, the first one of that name.

        Parameters
        ----------
        name : str or int
            Name or index.

        Raises
        ------
        ValueError
            If there is no such joint.
        """
        if isinstance(name, (int, np.integer)) and 0 <= name < len(self):
            return int(name)
        if name not in self.names:
            raise ValueError(
                f'joint must be in the skeleton ({", ".join(self.names) or "none"}), got {name!r}'
            )
        return self.names.index(name)

    def world(self, pose):
        """Return ``figure_from_joint`` of all joints, shape (..., n, 4, 4), float64.

        Parameters
        ----------
        pose : Pose or array_like, shape (..., n, 4, 4)
            A pose, or matrices relative to the parents.

        Raises
        ------
        ValueError
            If the number of joints differs.
        """
        return self._jumps.world(self._matrices(pose))

    def local(self, world):
        """Return ``parent_from_joint``, shape (..., n, 4, 4): the inverse of :meth:`world`.

        Parameters
        ----------
        world : array_like, shape (..., n, 4, 4)
            ``figure_from_joint``, as physics simulators give them.

        Raises
        ------
        ValueError
            If the number of joints differs.
        """
        world = self._matrices(world)
        local = world.copy()
        joints = np.flatnonzero(self.parents >= 0)
        inverse = inverses(world[..., self.parents[joints], :, :])
        local[..., joints, :, :] = inverse @ world[..., joints, :, :]
        return local

    def _matrices(self, pose):
        matrices = pose.matrices() if isinstance(pose, Pose) else as_matrices(pose, 'pose')
        if matrices.shape[-3] != len(self):
            raise ValueError(f'pose must have {len(self)} joints, got {matrices.shape[-3]}')
        return matrices

    def _check_range(self):
        for joint in np.flatnonzero((self.parents < -1) | (self.parents >= len(self))):
            name = f'parents[{joint}] ({self.names[joint]!r})'
            raise ValueError(
                f'{name} must be from -1 to {len(self) - 1}, got {self.parents[joint]}'
            )

    def _levels(self):
        depth = depths(self.parents)
        cyclic_joints = np.flatnonzero(depth < 0)
        if len(cyclic_joints):
            names = [self.names[joint] for joint in self._cycle(cyclic_joints[0])]
            raise ValueError(f'parents must not form a cycle, got {" -> ".join(names)}')
        if not len(depth):
            return []
        return np.split(np.argsort(depth, kind='stable'), np.cumsum(np.bincount(depth))[:-1])

    def _cycle(self, joint):
        for _ in range(len(self)):  # from below the cycle into it
            joint = self.parents[joint]
        joint_cycle = [joint]
        while len(joint_cycle) == 1 or joint_cycle[-1] != joint:
            joint_cycle.append(self.parents[joint_cycle[-1]])
        return joint_cycle


def depths(parents):
    """Return the number of ancestors of each joint, -1 in and below a cycle."""
    ancestor_rows = np.concatenate([[0], parents + 1])  # row 0 is the root of all
    ancestor_counts = (ancestor_rows > 0).astype(np.int64)
    for _ in range(len(parents).bit_length()):
        ancestor_counts += ancestor_counts[ancestor_rows]
        ancestor_rows = ancestor_rows[ancestor_rows]
    return np.where(ancestor_rows > 0, -1, ancestor_counts)[1:]


class Jumps:
    """The ancestors of joints 1, 2, 4, 8, ... levels up; row 0 is the root of all."""

    def __init__(self, parents):
        self._jumps = []
        ancestor_rows = np.concatenate([[0], parents + 1])
        while ancestor_rows.any():
            self._jumps.append(ancestor_rows)
            ancestor_rows = ancestor_rows[ancestor_rows]

    def world(self, local):
        """Return ``figure_from_joint`` of ``parent_from_joint``, (..., n, 4, 4)."""
        rooted_matrices = np.empty((*local.shape[:-3], local.shape[-3] + 1, 4, 4))
        rooted_matrices[..., 0, :, :] = np.eye(4)
        rooted_matrices[..., 1:, :, :] = local
        return self.chained(rooted_matrices)[..., 1:, :, :]

    def chained(self, matrices):
        """Return products of matrices from row 0 down, in log2(levels) steps."""
        for ancestor_rows in self._jumps:
            matrices = matrices.take(ancestor_rows, -3) @ matrices
        return matrices


def whole_numbers(values, name):
    """Return a checked row of integers, shape (n,), int64."""
    values = np.asarray(values)
    if values.ndim != 1 or (len(values) and values.dtype.kind not in 'iu'):
        raise ValueError(
            f'{name} must be whole numbers of shape (n,), got {values.dtype} of shape '
            f'{values.shape}'
        )
    return values.astype(np.int64)


def _names(names, joint_count):
    if names is None:
        return tuple(f'joint{i}' for i in range(joint_count))
    names = tuple(str(name) for name in names)
    if len(names) != joint_count:
        raise ValueError(f'names must hold {joint_count} names, one per joint, got {len(names)}')
    return names
