"""A rig: constraints and inverse kinematics applied to every pose of a skeleton."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from pvibr.animation.joint_limits import Limits
from pvibr.animation.mixer import PoseSource, Source, revision_of
from pvibr.animation.pose import Pose
from pvibr.core.arguments import checked_numbers
from pvibr.maths.transforms import trs


class Step:
    """Base of the steps of a rig."""

    #: Names of the targets that the step uses.
    asks: tuple = ()

    def bound(self, rig):
        """Return this step bound to the joints of a rig: ``(pose, targets) -> Pose``."""
        raise NotImplementedError


class Rig:
    """A skeleton with joint limits, and the constraints that are applied to its poses.

    Steps are applied in order, each to the result of the one before, so that constraints before
    and after `InverseKinematics` see different poses. Each step keeps the limits of the joints it
    turns.

    Parameters
    ----------
    skeleton : Skeleton
        The joints.
    steps : sequence of InverseKinematics, Aim, CopyTransform or ClampToLimits
        Constraints in order of application.
    limits : dict of (str or int) to JointLimit, optional
        Limits of joints, relative to the rest pose.

    Raises
    ------
    ValueError
        If a step or a limit names an unknown joint, or an effector is not below its root.

    Examples
    --------
    >>> from pvibr.animation import InverseKinematics, JointLimit, Pose, Rig, Skeleton
    >>> bones = Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]])
    >>> arm = Skeleton([-1, 0, 1], bones, ['shoulder', 'elbow', 'hand'])
    >>> elbow = JointLimit.hinge([0, 0, 1], 0.0, 2.6)
    >>> rig = Rig(arm, [InverseKinematics('hand')], {'elbow': elbow})
    >>> pose = rig.solve(arm.rest, {'hand': [1.0, 1.0, 0.0]})
    >>> arm.world(pose)[2, :3, 3].round(2) + 0.0
    array([1., 1., 0.])
    """

    def __init__(self, skeleton, steps, limits=None):
        self.skeleton = skeleton
        self.steps = tuple(steps)
        limits = {skeleton.index(joint): limit for joint, limit in (limits or {}).items()}
        self._limits = limits
        self.limits = Limits(limits, skeleton.rest.rotation)
        self._bound = [step.bound(self) for step in self.steps]

    def limit(self, joint):
        """Return the limit of a joint; None if the joint is free."""
        return self._limits.get(joint)

    def solve(self, pose, targets=None):
        """Return a pose after all steps.

        Parameters
        ----------
        pose : Pose
            A single pose: of a clip, or the one solved before.
        targets : dict of str to array_like, shape (3,), optional
            Points in the figure's space, by effector name for `InverseKinematics` and by target
            name for other steps. An effector without a target is not moved.

        Raises
        ------
        ValueError
            If there are several poses, a target is not a point or no step uses it.
        """
        if pose.shape or pose.n_joints != len(self.skeleton):
            shape, count = pose.translation.shape[:-1], len(self.skeleton)
            raise ValueError(f'pose must be one pose of {count} joints, got shape {shape}')
        targets = self._targets(targets or {})
        for step in self._bound:
            pose = step(pose, targets)
        return pose

    def on(self, source, targets=None):
        """Return a source of solved poses, to drive a figure or to be mixed.

        Parameters
        ----------
        source : Pose or object
            A pose, or anything with ``sample(times) -> Pose``.
        targets : dict or callable, optional
            Targets of :meth:`solve`, or a function that returns them for a time in seconds.

        Raises
        ------
        TypeError
            If the source has no ``sample``.

        Examples
        --------
        >>> from pvibr.animation import InverseKinematics, Pose, Rig, Skeleton
        >>> bones = Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]])
        >>> arm = Skeleton([-1, 0, 1], bones, ['shoulder', 'elbow', 'hand'])
        >>> rig = Rig(arm, [InverseKinematics('hand')])
        >>> lifted = rig.on(arm.rest, lambda time: {'hand': [1.0, time, 0.0]})
        >>> arm.world(lifted.sample([0.5, 1.5]))[:, 2, 1, 3].round(2)
        array([0.5, 1.5])
        """
        return Rigged(self, source, targets)

    def clamped_to_limit(self, rotation, joint):
        """Return a joint's rotation, shape (4,), clamped to its limit."""
        if joint not in self._limits:
            return rotation
        rotations = self.skeleton.rest.rotation.copy()
        rotations[joint] = rotation
        return self.limits.clamped(rotations)[joint]

    def _targets(self, targets):
        if not isinstance(targets, Mapping):
            raise ValueError(f'targets must map names to points, got {type(targets).__name__}')
        target_names = {name for step in self.steps for name in step.asks}
        target_points = {}
        for name, point in targets.items():
            if name not in target_names:
                known_names = ', '.join(sorted(map(str, target_names))) or 'none'
                raise ValueError(f'targets must be in use by steps ({known_names}), got {name!r}')
            target_points[name] = checked_numbers(f'targets[{name!r}]', point, (3,))
        return target_points


class Rigged(Source):
    """Poses of a source after the steps of a rig, see :meth:`Rig.on`."""

    def __init__(self, rig, source, targets=None):
        source = PoseSource(source) if isinstance(source, Pose) else source
        if not callable(getattr(source, 'sample', None)):
            raise TypeError(f'source must be a Pose or have sample(times), got {source!r}')
        self.rig, self.source, self.targets = rig, source, targets

    @property
    def revision(self) -> tuple:
        """Changes when the poses at the same times may have changed."""
        return revision_of(self.source)

    def _sampled(self, times):
        poses = self.source.sample(times)
        rotation, translation = poses.rotation.copy(), poses.translation.copy()
        for sample_index in np.ndindex(times.shape):
            pose_parts = translation, rotation, poses.scale, poses.weights
            pose = Pose(*(part[sample_index] for part in pose_parts))
            sample_time = float(times[sample_index])
            targets = self.targets(sample_time) if callable(self.targets) else self.targets
            pose = self.rig.solve(pose, targets)
            rotation[sample_index], translation[sample_index] = pose.rotation, pose.translation
        return poses.replaced(rotation=rotation, translation=translation)


def joint_matrix(skeleton, pose, joint):
    """Return the world matrix of one joint, computed from its ancestors only."""
    path = []
    while joint >= 0:
        path.append(joint)
        joint = skeleton.parents[joint]
    path = path[::-1]
    local_matrices = trs(pose.translation[path], pose.rotation[path], pose.scale[path])
    return functools.reduce(np.matmul, local_matrices, np.eye(4))
