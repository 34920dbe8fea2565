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
        n = len(parents)
        self.names = _names(names, n)
        self.parents = parents
        self.rest = rest if isinstance(rest, Pose) else Pose.from_matrices(rest, name='rest')
        if self.rest.translation.shape != (n, 3):
            raise ValueError(
                f'rest holds joints of shape {self.rest.translation.shape[:-1]}, parents {n}.'
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
        order = np.argsort(self.parents, kind='stable')
        starts = np.searchsorted(self.parents[order], np.arange(len(self) + 1))
        return np.split(order, starts)[1:-1]

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
                f'there is no joint {name!r}; joints: {", ".join(self.names) or "none"}.'
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
            If the pose has another number of joints.
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
            If there is another number of joints.
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
            raise ValueError(
                f'the pose has {matrices.shape[-3]} joints, the skeleton {len(self)}.'
            )
        return matrices

    def _check_range(self):
        for joint in np.flatnonzero((self.parents < -1) | (self.parents >= len(self))):
            what = f'parents[{joint}] ({self.names[joint]!r}) is {self.parents[joint]}'
            raise ValueError(f'{what}; it must be -1 or one of the {len(self)} joints.')

    def _levels(self):
        depth = depths(self.parents)
        lost = np.flatnonzero(depth < 0)
        if len(lost):
            names = [self.names[joint] for joint in self._cycle(lost[0])]
            raise ValueError(f'parents have a cycle: {" -> ".join(names)}.')
        if not len(depth):
            return []
        return np.split(np.argsort(depth, kind='stable'), np.cumsum(np.bincount(depth))[:-1])

    def _cycle(self, joint):
        for _ in range(len(self)):  # from below the cycle into it
            joint = self.parents[joint]
        cycle = [joint]
        while len(cycle) == 1 or cycle[-1] != joint:
            cycle.append(self.parents[cycle[-1]])
        return cycle


def depths(parents):
    """Return the number of ancestors of each joint, -1 in and below a cycle."""
    jump = np.concatenate([[0], parents + 1])  # row 0 is the root of all
    depth = (jump > 0).astype(np.int64)
    for _ in range(len(parents).bit_length()):
        depth += depth[jump]
        jump = jump[jump]
    return np.where(jump > 0, -1, depth)[1:]


class Jumps:
    """The ancestors of joints 1, 2, 4, 8, ... levels up; row 0 is the root of all."""

    def __init__(self, parents):
        self._jumps = []
        jump = np.concatenate([[0], parents + 1])
        while jump.any():
            self._jumps.append(jump)
            jump = jump[jump]

    def world(self, local):
        """Return ``figure_from_joint`` of ``parent_from_joint``, (..., n, 4, 4)."""
        rooted = np.empty((*local.shape[:-3], local.shape[-3] + 1, 4, 4))
        rooted[..., 0, :, :] = np.eye(4)
        rooted[..., 1:, :, :] = local
        return self.chained(rooted)[..., 1:, :, :]

    def chained(self, matrices):
        """Return products of matrices from row 0 down, in log2(levels) steps."""
        for jump in self._jumps:
            matrices = matrices.take(jump, -3) @ matrices
        return matrices


def whole_numbers(values, name):
    """Return a checked row of integers, shape (n,), int64."""
    values = np.asarray(values)
    if values.ndim != 1 or (len(values) and values.dtype.kind not in 'iu'):
        raise ValueError(
            f'{name} must be whole numbers (n,), not {values.dtype} of shape {values.shape}.'
        )
    return values.astype(np.int64)


def _names(names, n):
    if names is None:
        return tuple(f'joint{i}' for i in range(n))
    names = tuple(str(name) for name in names)
    if len(names) != n:
        raise ValueError(f'names holds {len(names)} names for {n} joints.')
    return names
