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
        raise ValueError(f'weights has the shape {weights.shape} for {len(poses)} poses.')
    lead = np.broadcast_shapes(weights.shape[:-1], *(pose.shape for pose in poses))
    total = PoseSum(lead, poses[0])
    for i, pose in enumerate(poses):
        total.add(pose, weights[..., i])
    return total.pose()


def crossfade(a, b, weight, mask=None):
    """Return poses blended between two poses; a mask scales the weight per joint."""
    weight = unit_range('weight', weight)
    factors, morphs = _factors(mask, a.n_joints)
    total = PoseSum(np.broadcast_shapes(weight.shape, a.shape, b.shape), a)
    joints = weight[..., None] * factors
    total.add(a, 1 - weight, 1 - joints, 1 - weight * morphs)
    total.add(b, weight, joints, weight * morphs)
    return total.pose()


def difference(pose, reference):
    """Return the additive pose that leads from a reference to a pose."""
    some = reference.scale != 0
    return Pose(
        pose.translation - reference.translation,
        quaternions.multiply(quaternions.conjugate(reference.rotation), pose.rotation),
        np.where(some, pose.scale / np.where(some, reference.scale, 1.0), 1.0),
        pose.weights - reference.weights,
        pose.time,
    )


def added(pose, extra, weight=1.0, mask=None):
    """Return poses with an additive pose on top."""
    weight = np.asarray(weight, dtype=np.float64)
    factors, morphs = _factors(mask, pose.n_joints)
    joints = (weight[..., None] * factors)[..., None]
    turn = quaternions.exp(joints * quaternions.log(extra.rotation))
    return Pose(
        pose.translation + joints * extra.translation,
        quaternions.multiply(pose.rotation, turn),
        pose.scale * (1 + joints * (extra.scale - 1)),
        pose.weights + weight[..., None] * morphs * extra.weights,
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
        raise ValueError(f'feather is {feather}; it must be at least 0.')
    mask = np.zeros(len(skeleton))
    first = [skeleton.index(joint) for joint in joints]
    step = 1 / (feather + 1)
    for joint in skeleton.order:
        parent = skeleton.parents[joint]
        above = mask[parent] if parent >= 0 else 0.0
        mask[joint] = min(above + step, 1.0) if above or joint in first else 0.0
    return mask


class PoseSum:
    """A weighted sum of poses."""

    def __init__(self, shape, like):
        n = like.n_joints
        self._translation = np.zeros((*shape, n, 3))
        self._rotation = np.zeros((*shape, n, 4))
        self._scale = np.zeros((*shape, n, 3))
        self._weights = np.zeros((*shape, like.weights.shape[-1]))
        self._time = np.zeros(shape)
        self._largest = np.zeros(shape)

    def add(self, pose, share, joints=None, morphs=None, where=...):
        """Add weighted poses."""
        share = np.asarray(share, dtype=np.float64)
        joints = share[..., None] if joints is None else joints
        morphs = share if morphs is None else np.asarray(morphs)
        joints = joints[..., None]
        self._translation[where] += joints * pose.translation
        self._scale[where] += joints * pose.scale
        self._weights[where] += morphs[..., None] * pose.weights
        turned = (self._rotation[where] * pose.rotation).sum(-1, keepdims=True) < 0
        self._rotation[where] += np.where(turned, -joints, joints) * pose.rotation
        largest = share > self._largest[where]
        self._time[where] = np.where(largest, pose.time, self._time[where])
        self._largest[where] = np.maximum(share, self._largest[where])

    def pose(self):
        """Return the sum, with unit quaternions."""
        return Pose(self._translation, self._rotation, self._scale, self._weights, self._time)


def shares(weights):
    """Return weights normalised to sum to one."""
    weights = np.atleast_1d(np.asarray(weights, dtype=np.float64))
    total = weights.sum(-1, keepdims=True)
    if not np.isfinite(weights).all() or (weights < 0).any() or not (total > 0).all():
        raise ValueError('weights must be finite, not negative and not all 0.')
    return weights / total


def unit_range(name, values):
    """Return values checked to be within 0 to 1."""
    values = np.asarray(values, dtype=np.float64)
    bad = values[~((values >= 0) & (values <= 1))]
    if bad.size:
        raise ValueError(f'{name} is {bad.flat[0]}; it must be from 0 to 1.')
    return values


def _factors(mask, n):
    """Return the factors of the joints and of the morph weights."""
    if mask is None:
        return np.ones(n), 1.0
    mask = unit_range('mask', mask)
    if mask.shape != (n,):
        raise ValueError(f'mask has the shape {mask.shape}; there are {n} joints.')
    return mask, 0.0
