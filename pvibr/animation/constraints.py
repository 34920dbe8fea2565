"""Constraints of a rig: joints that look at a point, copy another joint, or keep limits."""

from __future__ import annotations

import numpy as np

from pvibr.animation.rig import as_point, placed
from pvibr.maths import quaternions


class Aim:
    """Turn a joint so that one of its axes shows a point.

    Parameters
    ----------
    joint : str or int
        The joint.
    at : array_like, shape (3,), or str
        A point in the figure's space; or its name in ``targets``, without which nothing turns.
    axis : array_like, shape (3,), default: (0, 0, 1)
        Axis in the joint's own space that shall show the point.
    up : array_like, shape (3,), optional
        Direction in the figure's space; with it the joint rolls until ``up_axis`` is as near to
        it as can be. Without it the joint turns the shortest way.
    up_axis : array_like, shape (3,), default: (0, 1, 0)
        Axis in the joint's own space, not along ``axis``.
    weight : float, default: 1.0
        Share of the turn that is done, 0 to 1.

    Attributes
    ----------
    asks : tuple
        Names of targets that it takes.

    Raises
    ------
    ValueError
        If an axis has no direction, both are along each other or the weight is not in 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import Aim
    >>> Aim('head', 'ball', axis=[0, 0, 1], up=[0, 1, 0], weight=0.7).asks
    ('ball',)
    """

    def __init__(self, joint, at, axis=(0, 0, 1), *, up=None, up_axis=(0, 1, 0), weight=1.0):
        self.joint = joint
        self.at = at if isinstance(at, str) else as_point(at, 'at')
        self.axis = _direction(axis, 'axis')
        self.up = None if up is None else _direction(up, 'up')
        self.up_axis = _direction(up_axis, 'up_axis')
        if self.up is not None and np.linalg.norm(np.cross(self.axis, self.up_axis)) < 1e-6:
            msg = f'up_axis {up_axis} is along axis {axis}; it must point elsewhere.'
            raise ValueError(msg)
        self.weight = _share(weight)
        self.asks = (at,) if isinstance(at, str) else ()

    def bound(self, rig):
        """Return this step on the joints of a rig.

        Parameters
        ----------
        rig : Rig
            Whose joints and limits to use.

        Returns
        -------
        callable
            Takes a pose and targets, returns a pose.
        """
        joint = rig.skeleton.index(self.joint)

        def apply(pose, targets):
            point = targets.get(self.at) if isinstance(self.at, str) else self.at
            if point is None:
                return pose
            parent = rig.skeleton.parents[joint]
            inverse = np.linalg.inv(placed(rig.skeleton, pose, parent))
            way = inverse[:3, :3] @ point + inverse[:3, 3] - pose.translation[joint]
            up = None if self.up is None else inverse[:3, :3] @ self.up
            rotation = self._aimed(pose.rotation[joint], pose.scale[joint], way, up)
            return _with_rotation(rig, pose, joint, rotation, self.weight)

        return apply

    def _aimed(self, rotation, scale, way, up):
        """Return the rotation in the parent's space, where the joint's axes are scaled first."""
        if not way.any():
            return rotation
        turn = quaternions.between(quaternions.rotate(rotation, scale * self.axis), way)
        rotation = quaternions.multiply(turn, rotation)
        if up is None:
            return rotation
        way = way / np.linalg.norm(way)
        now = quaternions.rotate(rotation, scale * self.up_axis)
        # The angle between what both are across the way; without any, no roll is better.
        sine, cosine = way @ np.cross(now, up), now @ up - (now @ way) * (up @ way)
        roll = quaternions.from_axis_angle(way, np.arctan2(sine, cosine))
        return quaternions.multiply(roll, rotation)


class CopyTransform:
    """Give a joint the rotation, the position or both of another.

    Parameters
    ----------
    joint : str or int
        The joint that changes.
    source : str or int
        The joint that is copied.
    rotation, position : bool
        What is copied; default the rotation.
    space : {'figure', 'local'}, default: 'figure'
        ``'figure'``: both come to lie alike in the figure's space. ``'local'``: the joint
        leaves its rest as the source leaves its own, each seen from its parent.
    weight : float, default: 1.0
        Share of the way that is done, 0 to 1.

    Attributes
    ----------
    asks : tuple
        Names of targets that it takes: none.

    Raises
    ------
    ValueError
        If the space is unknown, nothing is copied or the weight is not in 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import CopyTransform, Pose, Rig, Skeleton
    >>> pair = Skeleton([-1, -1], Pose([[0, 0, 0], [1, 0, 0]]), ['left', 'right'])
    >>> pose = pair.rest.replaced(rotation=[[0, 0, 0, 1], [1, 0, 0, 0]])
    >>> Rig(pair, [CopyTransform('right', 'left')]).solve(pose).rotation[1].tolist()
    [0.0, 0.0, 0.0, 1.0]
    """

    asks = ()

    def __init__(
        self, joint, source, *, rotation=True, position=False, space='figure', weight=1.0
    ):
        self.joint, self.source = joint, source
        self.rotation, self.position = bool(rotation), bool(position)
        if not (rotation or position):
            msg = 'rotation and position are False: there is nothing to copy.'
            raise ValueError(msg)
        if space not in ('figure', 'local'):
            msg = f"space is {space!r}; it must be 'figure' or 'local'."
            raise ValueError(msg)
        self.space = space
        self.weight = _share(weight)

    def bound(self, rig):
        """Return this step on the joints of a rig.

        Parameters
        ----------
        rig : Rig
            Whose joints and limits to use.

        Returns
        -------
        callable
            Takes a pose and targets, returns a pose.
        """
        joint, source = rig.skeleton.index(self.joint), rig.skeleton.index(self.source)
        seen = self._in_figure if self.space == 'figure' else self._from_rest

        def apply(pose, _):
            rotation, translation = seen(rig.skeleton, pose, joint, source)
            if self.position:
                moved = pose.translation.copy()
                moved[joint] += self.weight * (translation - moved[joint])
                pose = pose.replaced(translation=moved)
            if self.rotation:
                pose = _with_rotation(rig, pose, joint, rotation, self.weight)
            return pose

        return apply

    def _in_figure(self, skeleton, pose, joint, source):
        parent = placed(skeleton, pose, skeleton.parents[joint])
        source = placed(skeleton, pose, source)
        inverse = np.linalg.inv(parent)
        rotation = quaternions.multiply(
            quaternions.conjugate(_rotation(parent)), _rotation(source)
        )
        return rotation, inverse[:3, :3] @ source[:3, 3] + inverse[:3, 3]

    def _from_rest(self, skeleton, pose, joint, source):
        rest = skeleton.rest
        away = quaternions.multiply(
            quaternions.conjugate(rest.rotation[source]), pose.rotation[source]
        )
        moved = pose.translation[source] - rest.translation[source]
        rotation = quaternions.multiply(rest.rotation[joint], away)
        return rotation, rest.translation[joint] + moved


class ClampToLimits:
    """Cut the rotations of all joints to the limits of the rig, of a clip's pose for example.

    Attributes
    ----------
    asks : tuple
        Names of targets that it takes: none.

    Examples
    --------
    >>> from pvibr.animation import ClampToLimits, JointLimit, Pose, Rig, Skeleton
    >>> knee = Skeleton([-1], Pose([[0, 0, 0]]), ['knee'])
    >>> rig = Rig(knee, [ClampToLimits()], {'knee': JointLimit.hinge([1, 0, 0], 0.0, 2.0)})
    >>> rig.solve(knee.rest.replaced(rotation=[[0.6, -0.8, 0, 0]])).rotation.tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """

    asks = ()

    def bound(self, rig):
        """Return this step on the joints of a rig.

        Parameters
        ----------
        rig : Rig
            Whose joints and limits to use.

        Returns
        -------
        callable
            Takes a pose and targets, returns a pose.
        """
        return lambda pose, _: pose.replaced(rotation=rig.limits.clamped(pose.rotation))


def _with_rotation(rig, pose, joint, rotation, weight):
    """Return the pose with a joint turned by a share of the way, inside of its limit."""
    turned = pose.rotation.copy()
    turned[joint] = rig.kept(quaternions.slerp(turned[joint], rotation, weight), joint)
    return pose.replaced(rotation=turned)


def _rotation(matrix):
    """Return the rotation that is nearest to a matrix, whatever its scale, mirror or shear."""
    u, _, v = np.linalg.svd(matrix[:3, :3] * np.sign(np.linalg.det(matrix[:3, :3])))
    return quaternions.from_matrices(u @ v)


def _direction(vector, name):
    vector = as_point(vector, name)
    if not vector.any():
        msg = f'{name} is {vector.tolist()}; it must have a direction.'
        raise ValueError(msg)
    return vector / np.linalg.norm(vector)


def _share(weight):
    if not 0 <= weight <= 1:
        msg = f'weight is {weight}; it must be from 0 to 1.'
        raise ValueError(msg)
    return float(weight)
