"""The step of a rig that reaches: inverse kinematics on a pose of a skeleton."""

from __future__ import annotations

import numpy as np

from pvibr.animation.chain import Chain
from pvibr.animation.kinematics import METHODS, solve
from pvibr.animation.rig import as_point, placed

_EVEN = 1e-3  # of a scale, that its axes may differ: files hold rounded ones


class InverseKinematics:
    """Turn joints so that others, the effectors, come to their targets.

    Parameters
    ----------
    effectors : str, int or sequence of these
        Joints that shall reach; ``targets`` of :meth:`~pvibr.animation.rig.Rig.solve` has their
        points by these names.
    root : str or int, optional
        The first joint that turns. Default the root of the skeleton; for ``'two_bone'`` each
        effector's grandparent.
    method : {'damped', 'ccd', 'fabrik', 'two_bone'}, default: 'damped'
        How, see :func:`pvibr.animation.kinematics.solve`.
    weights : sequence of float, optional
        What each effector counts where not all can reach; default 1.
    poles : dict of (str or int) to (array_like or str), optional
        For an effector, where its knee or elbow shall show: a point in the figure's space, or
        the name of one in ``targets``.
    tolerance : float, default: 1e-3
        Distance that will do, as a share of each effector's reach.

    Attributes
    ----------
    asks : tuple
        Names of targets that it takes.

    Raises
    ------
    ValueError
        If the method is unknown, the weights do not fit or a pole has no effector.

    Examples
    --------
    >>> from pvibr.animation import InverseKinematics
    >>> InverseKinematics(['left', 'right'], root='chest', poles={'left': 'behind'}).asks
    ('left', 'right', 'behind')
    """

    def __init__(
        self, effectors, root=None, method='damped', *, weights=None, poles=None, tolerance=1e-3
    ):
        self.effectors = (effectors,) if isinstance(effectors, (str, int)) else tuple(effectors)
        self.root = root
        if method not in METHODS:
            msg = f'method is {method!r}; it must be one of {", ".join(METHODS)}.'
            raise ValueError(msg)
        self.method = method
        self.weights = (1.0,) * len(self.effectors) if weights is None else tuple(weights)
        if len(self.weights) != len(self.effectors):
            msg = f'weights has {len(self.weights)} for {len(self.effectors)} effectors.'
            raise ValueError(msg)
        self.poles = {
            name: pole if isinstance(pole, str) else as_point(pole, f'poles[{name!r}]')
            for name, pole in (poles or {}).items()
        }
        for name in self.poles:
            if name not in self.effectors:
                msg = f'poles has {name!r}, which is none of the effectors {self.effectors}.'
                raise ValueError(msg)
        self.tolerance = tolerance
        named = tuple(pole for pole in self.poles.values() if isinstance(pole, str))
        self.asks = self.effectors + named

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
        skeleton = rig.skeleton
        limbs: dict = {}
        for name, weight in zip(self.effectors, self.weights, strict=True):
            path = self._path(skeleton, name)
            # What hangs on one root moves together; two bones are each for themselves.
            key = (path[0], name) if self.method == 'two_bone' else path[0]
            limbs.setdefault(key, []).append((name, weight, path))
        limbs_ = [_Limb(self, rig, limb) for limb in limbs.values()]

        def apply(pose, targets):
            for limb in limbs_:
                pose = limb.posed(pose, targets)
            return pose

        return apply

    def _path(self, skeleton, name):
        """Return the joints from the first that turns to an effector."""
        path = [skeleton.index(name)]
        while skeleton.parents[path[0]] >= 0:
            path.insert(0, int(skeleton.parents[path[0]]))
        if self.root is not None:
            root = skeleton.index(self.root)
            if root not in path:
                msg = f'effector {name!r} does not hang on the root {self.root!r}.'
                raise ValueError(msg)
            return path[path.index(root) :]
        if self.method == 'two_bone':
            if len(path) < 3:
                msg = f'effector {name!r} has {len(path) - 1} joints above it; two bones need 2.'
                raise ValueError(msg)
            return path[-3:]
        return path


class _Limb:
    """The joints that turn together, in the space of their root's parent."""

    def __init__(self, reach, rig, effectors):
        self.reach, self.rig, self.skeleton = reach, rig, rig.skeleton
        joints = {joint for _, _, path in effectors for joint in path}
        self.joints = np.array([joint for joint in rig.skeleton.order if joint in joints])
        local = {int(joint): i for i, joint in enumerate(self.joints)}
        self.effectors = [(name, weight, local[path[-1]]) for name, weight, path in effectors]
        self.parents = [local.get(int(parent), -1) for parent in rig.skeleton.parents[self.joints]]
        limits = {i: rig.limit(joint) for joint, i in local.items()}
        self.limits = {i: limit for i, limit in limits.items() if limit is not None}
        self.bears = np.unique([parent for parent in self.parents if parent >= 0]).astype(int)
        self.chain = None

    def posed(self, pose, targets):
        """Return the pose with these joints turned."""
        wanted = [row for row in self.effectors if row[0] in targets]
        if not wanted:
            return pose
        chain = self._chain(pose)
        root = self.joints[0]
        inverse = np.linalg.inv(placed(self.skeleton, pose, self.skeleton.parents[root]))

        def local(point):
            return inverse[:3, :3] @ point + inverse[:3, 3] - pose.translation[root]

        poles = {}
        for name, _, effector in wanted:
            pole = self.reach.poles.get(name)
            pole = targets.get(pole) if isinstance(pole, str) else pole
            if pole is not None:
                poles[effector] = local(pole)
        found = solve(
            chain,
            pose.rotation[self.joints],
            [effector for _, _, effector in wanted],
            [local(targets[name]) for name, _, _ in wanted],
            [weight for _, weight, _ in wanted],
            method=self.reach.method,
            poles=poles,
            tolerance=self.reach.tolerance,
        )
        rotation = pose.rotation.copy()
        rotation[self.joints] = found.rotations
        return pose.replaced(rotation=rotation)

    def _chain(self, pose):
        """Return the chain with the lengths that bones have in a pose, kept while they do."""
        offsets = pose.translation[self.joints]
        offsets[0] = 0.0
        scale = pose.scale[self.joints]
        if (scale != 1.0).any():
            offsets = offsets * self._sizes(scale)[:, None]
        if self.chain is None or not np.array_equal(self.chain.offsets, offsets):
            rest = self.skeleton.rest.rotation[self.joints]
            self.chain = Chain(self.parents, offsets, self.limits, rest)
        return self.chain

    def _sizes(self, scale):
        """Return the scale of each joint's space relative to the root's parent."""
        spread = np.ptp(scale, axis=1) > _EVEN * np.abs(scale).max(1)
        for i in self.bears[spread[self.bears]]:
            name = self.skeleton.names[self.joints[i]]
            msg = (
                f'joint {name!r} has the scale {scale[i].tolist()}; joints that shall turn so '
                'that others reach must scale all axes alike.'
            )
            raise ValueError(msg)
        own, sizes = scale.mean(1), np.ones(len(scale))
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                sizes[i] = sizes[parent] * own[parent]
        return sizes
