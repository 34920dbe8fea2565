"""A rig: what is done to every pose of a skeleton, step by step."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from pvibr.animation.limits import Limits
from pvibr.animation.mixer import PoseSource, revision_of
from pvibr.animation.pose import Pose
from pvibr.maths.transforms import trs


class Rig:
    """A skeleton with limits, constraints and targets to reach.

    The steps are done in the order given, each on the pose that the one before left: constraints
    before and after `InverseKinematics` differ in what they see. A step keeps
    the limits of the joints that it turns.

    Parameters
    ----------
    skeleton : Skeleton
        The joints.
    steps : sequence of Reach, Aim, Copy or ClampToLimits
        What to do.
    limits : dict of (str or int) to Limit, optional
        Limits of joints, counted from the skeleton's pose at rest.

    Attributes
    ----------
    skeleton : Skeleton
        The joints.
    steps : tuple
        What is done.
    limits : Limits
        The limits.

    Raises
    ------
    ValueError
        If a step or a limit names a joint that is not there, or an effector that does not hang
        on its root.

    Examples
    --------
    >>> from pvibr.animation import JointLimit, Pose, InverseKinematics, Rig, Skeleton
    >>> bones = Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]])
    >>> arm = Skeleton([-1, 0, 1], bones, ['shoulder', 'elbow', 'hand'])
    >>> rig = Rig(
    ...     arm, [InverseKinematics('hand')], {'elbow': JointLimit.hinge([0, 0, 1], 0.0, 2.6)}
    ... )
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
        """Return the limit of a joint.

        Parameters
        ----------
        joint : int
            Its number.

        Returns
        -------
        Limit or None
            None if it is free.
        """
        return self._limits.get(joint)

    def solve(self, pose, targets=None):
        """Return a pose after all steps.

        Parameters
        ----------
        pose : Pose
            One pose: of a clip, or the one solved before.
        targets : dict of str to array_like, shape (3,), optional
            Points in the figure's space by name: for `InverseKinematics`
            the names of effectors, for others the names that they ask for. An effector without
            a target is left alone.

        Returns
        -------
        Pose
            A new pose.

        Raises
        ------
        ValueError
            If there are several poses, or a target is no point or nobody asks for it.

        Examples
        --------
        >>> import numpy as np
        >>> from pvibr.animation import Aim, Pose, Rig, Skeleton
        >>> eye = Skeleton([-1], Pose([[0, 0, 0]]), ['eye'])
        >>> pose = Rig(eye, [Aim('eye', 'moon', axis=[1, 0, 0])]).solve(
        ...     eye.rest, {'moon': [0, 0, 5]}
        ... )
        >>> (pose.matrices()[0, :3, 0] + 0.0).round(9).tolist()
        [0.0, 0.0, 1.0]
        """
        if pose.shape or pose.n_joints != len(self.skeleton):
            msg = (
                f'pose is of shape {pose.translation.shape[:-1]}; it must be one pose of the '
                f"skeleton's {len(self.skeleton)} joints."
            )
            raise ValueError(msg)
        targets = self._targets(targets or {})
        for step in self._bound:
            pose = step(pose, targets)
        return pose

    def on(self, source, targets=None):
        """Return the poses of a source after all steps: what drives a figure, or is mixed.

        Parameters
        ----------
        source : Pose or object
            One pose, or anything with ``sample(times)`` that returns poses: a clip that is
            played, a mixer, a graph of states.
        targets : dict or callable, optional
            Targets of :meth:`solve`, or what returns them at a time in seconds.

        Returns
        -------
        Rigged
            It has ``sample(times)`` too.

        Examples
        --------
        >>> from pvibr.animation import Pose, InverseKinematics, Rig, Skeleton
        >>> bones = Pose([[0, 0, 0], [1, 0, 0], [1, 0, 0]])
        >>> arm = Skeleton([-1, 0, 1], bones, ['shoulder', 'elbow', 'hand'])
        >>> rig = Rig(arm, [InverseKinematics('hand')])
        >>> lifted = rig.on(arm.rest, lambda time: {'hand': [1.0, time, 0.0]})
        >>> arm.world(lifted.sample([0.5, 1.5]))[:, 2, 1, 3].round(2)
        array([0.5, 1.5])
        """
        return Rigged(self, source, targets)

    def kept(self, rotation, joint):
        """Return the rotation of a joint, cut to its limit.

        Parameters
        ----------
        rotation : array_like, shape (4,)
            Relative to its parent, a unit quaternion (w, x, y, z).
        joint : int
            Its number.

        Returns
        -------
        numpy.ndarray, shape (4,), float64
            Inside of the limit.
        """
        if joint not in self._limits:
            return rotation
        rotations = self.skeleton.rest.rotation.copy()
        rotations[joint] = rotation
        return self.limits.clamped(rotations)[joint]

    def _targets(self, targets):
        if not isinstance(targets, Mapping):
            msg = f'targets must map names to points, not be a {type(targets).__name__}.'
            raise ValueError(msg)
        asked = {name for step in self.steps for name in step.asks}
        points = {}
        for name, point in targets.items():
            if name not in asked:
                wanted = ', '.join(sorted(map(str, asked))) or 'nothing'
                msg = f'no step asks for the target {name!r}; they ask for {wanted}.'
                raise ValueError(msg)
            points[name] = as_point(point, f'targets[{name!r}]')
        return points


class Rigged:
    """Poses of a source after the steps of a rig, see :meth:`Rig.on`."""

    def __init__(self, rig, source, targets=None):
        source = PoseSource(source) if isinstance(source, Pose) else source
        if not callable(getattr(source, 'sample', None)):
            msg = f'source is {source!r}; it must be a Pose or have sample(times).'
            raise TypeError(msg)
        self.rig, self.source, self.targets = rig, source, targets

    @property
    def revision(self) -> tuple:
        """What changes when what is shown at the same time may have."""
        return revision_of(self.source)

    def sample(self, times):
        """Return the poses at times."""
        times = np.asarray(times, dtype=np.float64)
        poses = self.source.sample(times)
        rotation, translation = poses.rotation.copy(), poses.translation.copy()
        for place in np.ndindex(times.shape):
            pose = Pose(
                *(part[place] for part in (translation, rotation, poses.scale, poses.weights))
            )
            time = float(times[place])
            targets = self.targets(time) if callable(self.targets) else self.targets
            pose = self.rig.solve(pose, targets)
            rotation[place], translation[place] = pose.rotation, pose.translation
        return poses.replaced(rotation=rotation, translation=translation)


def as_point(point, name):
    """Return one point."""
    values = np.asarray(point, dtype=np.float64)
    if values.shape != (3,) or not np.isfinite(values).all():
        msg = f'{name} is {point}; it must be three finite numbers.'
        raise ValueError(msg)
    return values


def placed(skeleton, pose, joint):
    """Return the matrix of one joint, for which only those above it are looked at."""
    path = []
    while joint >= 0:
        path.append(joint)
        joint = skeleton.parents[joint]
    path = path[::-1]
    local = trs(pose.translation[path], pose.rotation[path], pose.scale[path])
    return functools.reduce(np.matmul, local, np.eye(4))
