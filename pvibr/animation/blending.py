"""Blending of poses: weighted means, cross-fades, additive poses and joint masks."""

from __future__ import annotations

import numpy as np

from pvibr.animation.pose import Pose
from pvibr.maths import quaternions


def mix(poses, weights):
    """Return the weighted mean of poses."""
    poses = list(poses)
    weights = shares(weights)
    if not poses or weights.shape[-1] != len(poses):
        raise ValueError(f'weights must have shape (..., {len(poses)}), got {weights.shape}')
    leading_shape = np.broadcast_shapes(weights.shape[:-1], *(pose.shape for pose in poses))
    pose_sum = PoseSum(leading_shape, poses[0])
    for i, pose in enumerate(poses):
        pose_sum.add(pose, weights[..., i])
    return pose_sum.pose()


def crossfade(a, b, weight, mask=None):
    """Return poses blended between two poses; a mask scales the weight per joint."""
    weight = unit_range('weight', weight)
    joint_factors, morph_factor = _factors(mask, a.n_joints)
    pose_sum = PoseSum(np.broadcast_shapes(weight.shape, a.shape, b.shape), a)
    joint_weights = weight[..., None] * joint_factors
    pose_sum.add(a, 1 - weight, 1 - joint_weights, 1 - weight * morph_factor)
    pose_sum.add(b, weight, joint_weights, weight * morph_factor)
    return pose_sum.pose()


def difference(pose, reference):
    """Return the additive pose that leads from a reference to a pose."""
    has_scale = reference.scale != 0
    return Pose(
        pose.translation - reference.translation,
        quaternions.multiply(quaternions.conjugate(reference.rotation), pose.rotation),
        np.where(has_scale, pose.scale / np.where(has_scale, reference.scale, 1.0), 1.0),
        pose.weights - reference.weights,
        pose.time,
    )


def with_additive(pose, extra, weight=1.0, mask=None):
    """Return poses with an additive pose on top."""
    weight = np.asarray(weight, dtype=np.float64)
    joint_factors, morph_factor = _factors(mask, pose.n_joints)
    joint_weights = (weight[..., None] * joint_factors)[..., None]
    weighted_turn = quaternions.exp(joint_weights * quaternions.log(extra.rotation))
    return Pose(
        pose.translation + joint_weights * extra.translation,
        quaternions.multiply(pose.rotation, weighted_turn),
        pose.scale * (1 + joint_weights * (extra.scale - 1)),
        pose.weights + weight[..., None] * morph_factor * extra.weights,
        pose.time,
    )


def joint_mask(skeleton, joints, feather=0):
    """Return a mask of joints and all their descendants.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    joints : sequence of str or int
        First joints, such as 'spine' for the upper body.
    feather : int
        Number of joints over which the mask rises to 1, which avoids a sharp twist.

    Returns
    -------
    numpy.ndarray, shape (n,), float64
        0 outside, 1 inside, between on the feathered joints.

    Raises
    ------
    ValueError
        If there is no such joint or ``feather`` is negative.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Pose, Skeleton, joint_mask
    >>> chain = Skeleton([-1, 0, 1, 2], Pose(np.zeros((4, 3))))
    >>> joint_mask(chain, [1], feather=1).tolist()
    [0.0, 0.5, 1.0, 1.0]
    """
    if feather < 0:
        raise ValueError(f'feather must be 0 or more, got {feather}')
    mask = np.zeros(len(skeleton))
    roots = [skeleton.index(joint) for joint in joints]
    feather_step = 1 / (feather + 1)
    for joint in skeleton.order:
        parent = skeleton.parents[joint]
        above = mask[parent] if parent >= 0 else 0.0
        mask[joint] = min(above + feather_step, 1.0) if above or joint in roots else 0.0
    return mask


class PoseSum:
    """A weighted sum of poses."""

    def __init__(self, shape, sample_pose):
        joint_count = sample_pose.n_joints
        self._translation = np.zeros((*shape, joint_count, 3))
        self._rotation = np.zeros((*shape, joint_count, 4))
        self._scale = np.zeros((*shape, joint_count, 3))
        self._weights = np.zeros((*shape, sample_pose.weights.shape[-1]))
        self._time = np.zeros(shape)
        self._largest = np.zeros(shape)

    def add(self, pose, pose_weight, joint_weights=None, morph_weights=None, where=...):
        """Add weighted poses."""
        pose_weight = np.asarray(pose_weight, dtype=np.float64)
        joint_weights = pose_weight[..., None] if joint_weights is None else joint_weights
        morph_weights = pose_weight if morph_weights is None else np.asarray(morph_weights)
        joint_weights = joint_weights[..., None]
        self._translation[where] += joint_weights * pose.translation
        self._scale[where] += joint_weights * pose.scale
        self._weights[where] += morph_weights[..., None] * pose.weights
        flips = (self._rotation[where] * pose.rotation).sum(-1, keepdims=True) < 0
        self._rotation[where] += np.where(flips, -joint_weights, joint_weights) * pose.rotation
        is_largest = pose_weight > self._largest[where]
        self._time[where] = np.where(is_largest, pose.time, self._time[where])
        self._largest[where] = np.maximum(pose_weight, self._largest[where])

    def pose(self):
        """Return the sum, with unit quaternions."""
        return Pose(self._translation, self._rotation, self._scale, self._weights, self._time)


def shares(weights):
    """Return weights normalised to sum to one."""
    weights = np.atleast_1d(np.asarray(weights, dtype=np.float64))
    weight_sum = weights.sum(-1, keepdims=True)
    if not np.isfinite(weights).all() or (weights < 0).any() or not (weight_sum > 0).all():
        raise ValueError(
            f'weights must be finite, not negative and not all 0, got {weights.tolist()!r:.80}'
        )
    return weights / weight_sum


def unit_range(name, values):
    """Return values checked to be within 0 to 1."""
    values = np.asarray(values, dtype=np.float64)
    out_of_range = values[~((values >= 0) & (values <= 1))]
    if out_of_range.size:
        raise ValueError(f'{name} must be from 0 to 1, got {out_of_range.flat[0]}')
    return values


def _factors(mask, joint_count):
    """Return the factors of the joints and of the morph weights."""
    if mask is None:
        return np.ones(joint_count), 1.0
    mask = unit_range('mask', mask)
    if mask.shape != (joint_count,):
        raise ValueError(f'mask must have shape ({joint_count},), got {mask.shape}')
    return mask, 0.0
