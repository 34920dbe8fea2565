"""Blending of poses: weighted mixes, cross-fades, additive poses and masks of joints.

Rotations are mixed as normalized sums of quaternions, each taken on the hemisphere of the sum so
far. Unlike repeated slerp this is one weighted mean whatever the order (a fade that interrupts
a fade is a mean of three), and it takes one pass for any number of poses. On its way between
rotations 90 degrees apart it is nowhere more than one degree from slerp.
"""

from __future__ import annotations

import numpy as np

from pvibr.animation.pose import Pose
from pvibr.maths import quaternions


def mix(poses, weights):
    """Return the weighted mean of poses.

    Parameters
    ----------
    poses : sequence of Pose, length k
        Of the same joints; their leading axes are broadcast.
    weights : array_like, shape (..., k)
        Not negative; made to sum to one. Their leading axes are broadcast as well.

    Returns
    -------
    Pose
        The mean. Its ``time`` is that of the pose with the largest weight: key frames are mixed
        by :class:`pvibr.animation.states.FrameStates`.

    Raises
    ------
    ValueError
        If there are no poses, or weights are negative, not finite, all zero or of another number.

    Examples
    --------
    >>> from pvibr.animation.blending import mix
    >>> from pvibr.animation.pose import Pose
    >>> a, b = Pose([[0.0, 0.0, 0.0]]), Pose([[4.0, 0.0, 0.0]])
    >>> mix([a, b], [3, 1]).translation.tolist()
    [[1.0, 0.0, 0.0]]
    """
    poses = list(poses)
    weights = shares(weights)
    if not poses or weights.shape[-1] != len(poses):
        msg = f'weights has the shape {weights.shape} for {len(poses)} poses.'
        raise ValueError(msg)
    lead = np.broadcast_shapes(weights.shape[:-1], *(pose.shape for pose in poses))
    total = PoseSum(lead, poses[0])
    for i, pose in enumerate(poses):
        total.add(pose, weights[..., i])
    return total.pose()


def crossfade(a, b, weight, mask=None):
    """Return poses between two poses.

    Parameters
    ----------
    a, b : Pose
        Poses of the same joints; their leading axes are broadcast.
    weight : array_like, shape (...)
        Share of b, 0 to 1.
    mask : array_like, shape (n,), optional
        Factor on the weight of each joint, 0 to 1; morph weights then stay those of a.

    Returns
    -------
    Pose
        a where the weight is 0, b where it is 1.

    Raises
    ------
    ValueError
        If a weight or a factor is outside 0 to 1, or the mask does not fit.

    Examples
    --------
    >>> from pvibr.animation.blending import crossfade
    >>> from pvibr.animation.pose import Pose
    >>> a, b = Pose([[0.0, 0.0, 0.0]] * 2), Pose([[4.0, 0.0, 0.0]] * 2)
    >>> crossfade(a, b, 0.5, mask=[1.0, 0.5]).translation[:, 0].tolist()
    [2.0, 1.0]
    """
    weight = unit_range('weight', weight)
    factors, morphs = _factors(mask, a.n_joints)
    total = PoseSum(np.broadcast_shapes(weight.shape, a.shape, b.shape), a)
    joints = weight[..., None] * factors
    total.add(a, 1 - weight, 1 - joints, 1 - weight * morphs)
    total.add(b, weight, joints, weight * morphs)
    return total.pose()


def difference(pose, reference):
    """Return what leads from a reference to a pose: an additive pose.

    Parameters
    ----------
    pose : Pose
        One or many.
    reference : Pose
        What counts as no difference, as the pose at rest or the first one of a clip.

    Returns
    -------
    Pose
        Translations and morph weights to add, rotations that follow in each joint's own axes, and
        factors on scales (1 where the reference has none).

    Examples
    --------
    >>> from pvibr.animation.blending import added, difference
    >>> from pvibr.animation.pose import Pose
    >>> rest, up = Pose([[0.0, 0.0, 1.0]]), Pose([[0.0, 0.0, 3.0]])
    >>> difference(up, rest).translation.tolist()
    [[0.0, 0.0, 2.0]]
    """
    some = reference.scale != 0
    return Pose(
        pose.translation - reference.translation,
        quaternions.multiply(quaternions.conjugate(reference.rotation), pose.rotation),
        np.where(some, pose.scale / np.where(some, reference.scale, 1.0), 1.0),
        pose.weights - reference.weights,
        pose.time,
    )


def added(pose, extra, weight=1.0, mask=None):
    """Return poses with an additive pose on top.

    Parameters
    ----------
    pose : Pose
        One or many.
    extra : Pose
        From :func:`difference`.
    weight : array_like, shape (...), optional
        How much of it; any number: 2 is twice as far, -1 the other way.
    mask : array_like, shape (n,), optional
        Factor on the weight of each joint; morph weights then stay.

    Returns
    -------
    Pose
        The sum.

    Raises
    ------
    ValueError
        If a sum is not finite, a factor is outside 0 to 1, or the mask does not fit.

    Examples
    --------
    >>> from pvibr.animation.blending import added, difference
    >>> from pvibr.animation.pose import Pose
    >>> rest, up = Pose([[0.0, 0.0, 1.0]]), Pose([[0.0, 0.0, 3.0]])
    >>> added(Pose([[5.0, 0.0, 0.0]]), difference(up, rest), 0.5).translation.tolist()
    [[5.0, 0.0, 1.0]]
    """
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
    """Return a mask of joints and all that hangs on them.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    joints : sequence of str or int
        Where it begins, as 'spine' for the upper body.
    feather : int
        Joints on the way down over which it grows to 1: a begin in steps twists the body less.

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
    >>> from pvibr import Pose, Skeleton
    >>> from pvibr.animation.blending import joint_mask
    >>> chain = Skeleton([-1, 0, 1, 2], Pose(np.zeros((4, 3))))
    >>> joint_mask(chain, [1], feather=1).tolist()
    [0.0, 0.5, 1.0, 1.0]
    """
    if feather < 0:
        msg = f'feather is {feather}; it must be at least 0.'
        raise ValueError(msg)
    mask = np.zeros(len(skeleton))
    first = [skeleton.index(joint) for joint in joints]
    step = 1 / (feather + 1)
    for joint in skeleton.order:
        parent = skeleton.parents[joint]
        above = mask[parent] if parent >= 0 else 0.0
        mask[joint] = min(above + step, 1.0) if above or joint in first else 0.0
    return mask


class PoseSum:
    """A weighted sum of poses that grows pose by pose.

    Parameters
    ----------
    shape : tuple of int
        Leading axes of the sum.
    like : Pose
        Tells the numbers of joints and morph weights.

    Examples
    --------
    >>> from pvibr.animation.blending import PoseSum
    >>> from pvibr.animation.pose import Pose
    >>> total = PoseSum((), Pose([[0.0, 0.0, 0.0]]))
    >>> total.add(Pose([[4.0, 0.0, 0.0]]), 0.5)
    >>> total.add(Pose([[2.0, 0.0, 0.0]]), 0.5)
    >>> total.pose().translation.tolist()
    [[3.0, 0.0, 0.0]]
    """

    def __init__(self, shape, like):
        n = like.n_joints
        self._translation = np.zeros((*shape, n, 3))
        self._rotation = np.zeros((*shape, n, 4))
        self._scale = np.zeros((*shape, n, 3))
        self._weights = np.zeros((*shape, like.weights.shape[-1]))
        self._time = np.zeros(shape)
        self._largest = np.zeros(shape)

    def add(self, pose, share, joints=None, morphs=None, where=...):
        """Add a pose.

        Parameters
        ----------
        pose : Pose
            Broadcast to the sum, or to its part.
        share : array_like, shape (...)
            Its share of all; the pose with the largest gives the sum its ``time``.
        joints : array_like, shape (..., n), optional
            Shares of the joints; default the share.
        morphs : array_like, shape (...), optional
            Share of the morph weights; default the share.
        where : object, optional
            Index of a part of the sum's leading axes.

        Examples
        --------
        >>> from pvibr.animation.blending import PoseSum
        >>> from pvibr.animation.pose import Pose
        >>> total = PoseSum((2,), Pose([[0.0, 0.0, 0.0]]))
        >>> total.add(Pose([[4.0, 0.0, 0.0]]), 1.0)
        >>> total.add(Pose([[2.0, 0.0, 0.0]]), 0.5, where=1)
        >>> total.pose().translation[:, 0, 0].tolist()
        [4.0, 5.0]
        """
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
        """Return the sum, with rotations of length one.

        Returns
        -------
        Pose
            The sum; a mean if the shares add up to 1.

        Examples
        --------
        >>> from pvibr.animation.blending import PoseSum
        >>> from pvibr.animation.pose import Pose
        >>> total = PoseSum((), Pose([[0.0, 0.0, 0.0]]))
        >>> total.add(Pose([[4.0, 0.0, 0.0]]), 1.0)
        >>> total.pose().rotation.tolist()
        [[1.0, 0.0, 0.0, 0.0]]
        """
        return Pose(self._translation, self._rotation, self._scale, self._weights, self._time)


def shares(weights):
    """Return weights that sum to one.

    Parameters
    ----------
    weights : array_like, shape (..., k)
        Weights, not negative.

    Returns
    -------
    numpy.ndarray, shape (..., k), float64
        Their shares.

    Raises
    ------
    ValueError
        If weights are negative, not finite or all zero.

    Examples
    --------
    >>> from pvibr.animation.blending import shares
    >>> shares([3, 1]).tolist()
    [0.75, 0.25]
    """
    weights = np.atleast_1d(np.asarray(weights, dtype=np.float64))
    total = weights.sum(-1, keepdims=True)
    if not np.isfinite(weights).all() or (weights < 0).any() or not (total > 0).all():
        msg = 'weights must be finite and not negative, and some of each mix above 0.'
        raise ValueError(msg)
    return weights / total


def unit_range(name, values):
    """Return values from 0 to 1, or say which is not.

    Parameters
    ----------
    name : str
        What the error calls them.
    values : array_like, any shape
        Values.

    Returns
    -------
    numpy.ndarray, float64
        The values.

    Raises
    ------
    ValueError
        If one is outside 0 to 1 or not a number.

    Examples
    --------
    >>> from pvibr.animation.blending import unit_range
    >>> unit_range('weight', [0, 1]).tolist()
    [0.0, 1.0]
    """
    values = np.asarray(values, dtype=np.float64)
    bad = values[~((values >= 0) & (values <= 1))]
    if bad.size:
        msg = f'{name} is {bad.flat[0]}; it must be from 0 to 1.'
        raise ValueError(msg)
    return values


def _factors(mask, n):
    """Return the factors of the joints, and that of the morph weights."""
    if mask is None:
        return np.ones(n), 1.0
    mask = unit_range('mask', mask)
    if mask.shape != (n,):
        msg = f'mask has the shape {mask.shape}; there are {n} joints.'
        raise ValueError(msg)
    return mask, 0.0
