"""Constraints of a rig: aim a joint at a point, copy another joint, clamp to limits."""

from __future__ import annotations

import numpy as np

from pvibr.animation.rig import Step, joint_matrix
from pvibr.core.arguments import check_one_of, checked_direction, checked_number, checked_numbers
from pvibr.maths import quaternions
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
            raise ValueError(f'up_axis must not be parallel to axis {axis}, got {up_axis}')
        self.weight = checked_number('weight', weight, 0, 1)
        self.asks = (at,) if isinstance(at, str) else ()

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        joint = rig.skeleton.index(self.joint)

        def apply(pose, targets):
            target_point = targets.get(self.at) if isinstance(self.at, str) else self.at
            if target_point is None:
                return pose
            parent_joint = rig.skeleton.parents[joint]
            parent_from_figure = inverses(joint_matrix(rig.skeleton, pose, parent_joint))
            aim = (
                parent_from_figure[:3, :3] @ target_point
                + parent_from_figure[:3, 3]
                - pose.translation[joint]
            )
            up_in_parent = None if self.up is None else parent_from_figure[:3, :3] @ self.up
            rotation = self._aimed(pose.rotation[joint], pose.scale[joint], aim, up_in_parent)
            return _with_rotation(rig, pose, joint, rotation, self.weight)

        return apply

    def _aimed(self, rotation, scale, aim_direction, up_direction):
        """Return the rotation in the parent's space; the joint's axes are scaled first."""
        if not aim_direction.any():
            return rotation
        turn = quaternions.between(quaternions.rotate(rotation, scale * self.axis), aim_direction)
        rotation = quaternions.multiply(turn, rotation)
        if up_direction is None:
            return rotation
        aim_direction = aim_direction / np.linalg.norm(aim_direction)
        current_up = quaternions.rotate(rotation, scale * self.up_axis)
        # The angle between them around the aim; any roll will do if either is parallel to it.
        sine, cosine = (
            aim_direction @ np.cross(current_up, up_direction),
            current_up @ up_direction
            - (current_up @ aim_direction) * (up_direction @ aim_direction),
        )
        roll_turn = quaternions.from_axis_angle(aim_direction, np.arctan2(sine, cosine))
        return quaternions.multiply(roll_turn, rotation)


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
            raise ValueError('rotation or position must be True, got False for both')
        check_one_of('space', space, ('figure', 'local'))
        self.space = space
        self.weight = checked_number('weight', weight, 0, 1)

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        joint, source_joint = rig.skeleton.index(self.joint), rig.skeleton.index(self.source)
        source_transform = self._in_figure if self.space == 'figure' else self._from_rest

        def apply(pose, _):
            rotation, translation = source_transform(rig.skeleton, pose, joint, source_joint)
            if self.position:
                new_translation = pose.translation.copy()
                new_translation[joint] += self.weight * (translation - new_translation[joint])
                pose = pose.replaced(translation=new_translation)
            if self.rotation:
                pose = _with_rotation(rig, pose, joint, rotation, self.weight)
            return pose

        return apply

    def _in_figure(self, skeleton, pose, joint, source):
        parent = joint_matrix(skeleton, pose, skeleton.parents[joint])
        source = joint_matrix(skeleton, pose, source)
        inverse = inverses(parent)
        rotation = quaternions.multiply(
            quaternions.conjugate(_rotation(parent)), _rotation(source)
        )
        return rotation, inverse[:3, :3] @ source[:3, 3] + inverse[:3, 3]

    def _from_rest(self, skeleton, pose, joint, source_joint):
        rest_pose = skeleton.rest
        rest_turn = quaternions.multiply(
            quaternions.conjugate(rest_pose.rotation[source_joint]), pose.rotation[source_joint]
        )
        rest_offset = pose.translation[source_joint] - rest_pose.translation[source_joint]
        rotation = quaternions.multiply(rest_pose.rotation[joint], rest_turn)
        return rotation, rest_pose.translation[joint] + rest_offset


class ClampToLimits(Step):
    """Clamp the rotations of all joints to the rig's limits, such as those of a clip.

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
    turned[joint] = rig.clamped_to_limit(quaternions.slerp(turned[joint], rotation, weight), joint)
    return pose.replaced(rotation=turned)


def _rotation(matrix):
    """Return the rotation nearest to a matrix that may scale, mirror or shear."""
    u, _, v = np.linalg.svd(matrix[:3, :3] * np.sign(np.linalg.det(matrix[:3, :3])))
    return quaternions.from_matrices(u @ v)
