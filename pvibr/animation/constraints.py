"""Constraints of a rig: aim a joint at a point, copy another joint, clamp to limits."""

from __future__ import annotations

import numpy as np

from pvibr.animation.rig import Step, placed
from pvibr.maths import quaternions
from pvibr.maths.arguments import check_one_of, checked_direction, checked_number, checked_numbers
from pvibr.maths.transforms import inverses


class Aim(Step):
    """Turn a joint so that one of its axes points at a target.

    Parameters
    ----------
    joint : str or int
        The joint.
    at : array_like, shape (3,), or str
        A point in the figure's space, or the name of a target; without that target nothing turns.
    axis : array_like, shape (3,), default: (0, 0, 1)
        Axis in the joint's space that points at the target.
    up : array_like, shape (3,), optional
        Direction in the figure's space that ``up_axis`` is rolled towards. By default the joint
        turns the shortest way.
    up_axis : array_like, shape (3,), default: (0, 1, 0)
        Axis in the joint's space, not parallel to ``axis``.
    weight : float, default: 1.0
        Fraction of the turn to apply, 0 to 1.

    Raises
    ------
    ValueError
        If an axis is zero, the axes are parallel or the weight is outside 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import Aim
    >>> Aim('head', 'ball', axis=[0, 0, 1], up=[0, 1, 0], weight=0.7).asks
    ('ball',)
    """

    def __init__(self, joint, at, axis=(0, 0, 1), *, up=None, up_axis=(0, 1, 0), weight=1.0):
        self.joint = joint
        self.at = at if isinstance(at, str) else checked_numbers('at', at, (3,))
        self.axis = checked_direction('axis', axis)
        self.up = None if up is None else checked_direction('up', up)
        self.up_axis = checked_direction('up_axis', up_axis)
        if self.up is not None and np.linalg.norm(np.cross(self.axis, self.up_axis)) < 1e-6:
            raise ValueError(
                f'up_axis {up_axis} is parallel to axis {axis}; choose another up_axis.'
            )
        self.weight = checked_number('weight', weight, 0, 1)
        self.asks = (at,) if isinstance(at, str) else ()

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        joint = rig.skeleton.index(self.joint)

        def apply(pose, targets):
            point = targets.get(self.at) if isinstance(self.at, str) else self.at
            if point is None:
                return pose
            parent = rig.skeleton.parents[joint]
            inverse = inverses(placed(rig.skeleton, pose, parent))
            way = inverse[:3, :3] @ point + inverse[:3, 3] - pose.translation[joint]
            up = None if self.up is None else inverse[:3, :3] @ self.up
            rotation = self._aimed(pose.rotation[joint], pose.scale[joint], way, up)
            return _with_rotation(rig, pose, joint, rotation, self.weight)

        return apply

    def _aimed(self, rotation, scale, way, up):
        """Return the rotation in the parent's space; the joint's axes are scaled first."""
        if not way.any():
            return rotation
        turn = quaternions.between(quaternions.rotate(rotation, scale * self.axis), way)
        rotation = quaternions.multiply(turn, rotation)
        if up is None:
            return rotation
        way = way / np.linalg.norm(way)
        now = quaternions.rotate(rotation, scale * self.up_axis)
        # The angle between both, projected across the way; if either vanishes, any roll will do.
        sine, cosine = way @ np.cross(now, up), now @ up - (now @ way) * (up @ way)
        roll = quaternions.from_axis_angle(way, np.arctan2(sine, cosine))
        return quaternions.multiply(roll, rotation)


class CopyTransform(Step):
    """Copy the rotation, the position or both of another joint.

    Parameters
    ----------
    joint : str or int
        The joint that changes.
    source : str or int
        The joint that is copied.
    rotation, position : bool
        What to copy; default the rotation.
    space : {'figure', 'local'}, default: 'figure'
        ``'figure'`` copies the transform in the figure's space; ``'local'`` copies the offset
        from the rest pose, each relative to its parent.
    weight : float, default: 1.0
        Blend weight, 0 to 1.

    Raises
    ------
    ValueError
        If the space is unknown, nothing is copied or the weight is outside 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import CopyTransform, Pose, Rig, Skeleton
    >>> pair = Skeleton([-1, -1], Pose([[0, 0, 0], [1, 0, 0]]), ['left', 'right'])
    >>> pose = pair.rest.replaced(rotation=[[0, 0, 0, 1], [1, 0, 0, 0]])
    >>> Rig(pair, [CopyTransform('right', 'left')]).solve(pose).rotation[1].tolist()
    [0.0, 0.0, 0.0, 1.0]
    """

    def __init__(
        self, joint, source, *, rotation=True, position=False, space='figure', weight=1.0
    ):
        self.joint, self.source = joint, source
        self.rotation, self.position = bool(rotation), bool(position)
        if not (rotation or position):
            raise ValueError('rotation and position are both False; set at least one of them.')
        check_one_of('space', space, ('figure', 'local'))
        self.space = space
        self.weight = checked_number('weight', weight, 0, 1)

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
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
        inverse = inverses(parent)
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


class ClampToLimits(Step):
    """Clamp the rotations of all joints to the limits of the rig, for example of a clip's pose.

    Examples
    --------
    >>> from pvibr.animation import ClampToLimits, JointLimit, Pose, Rig, Skeleton
    >>> knee = Skeleton([-1], Pose([[0, 0, 0]]), ['knee'])
    >>> rig = Rig(knee, [ClampToLimits()], {'knee': JointLimit.hinge([1, 0, 0], 0.0, 2.0)})
    >>> rig.solve(knee.rest.replaced(rotation=[[0.6, -0.8, 0, 0]])).rotation.tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        return lambda pose, _: pose.replaced(rotation=rig.limits.clamped(pose.rotation))


def _with_rotation(rig, pose, joint, rotation, weight):
    """Return a pose with one joint blended towards a rotation, within its limit."""
    turned = pose.rotation.copy()
    turned[joint] = rig.kept(quaternions.slerp(turned[joint], rotation, weight), joint)
    return pose.replaced(rotation=turned)


def _rotation(matrix):
    """Return the rotation nearest to a matrix that may scale, mirror or shear."""
    u, _, v = np.linalg.svd(matrix[:3, :3] * np.sign(np.linalg.det(matrix[:3, :3])))
    return quaternions.from_matrices(u @ v)
