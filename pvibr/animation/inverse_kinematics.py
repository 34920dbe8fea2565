"""Inverse kinematics as a step of a rig."""

from __future__ import annotations

import numpy as np

from pvibr.animation.chain import Chain
from pvibr.animation.kinematics import METHODS, solve
from pvibr.animation.rig import Step, placed
from pvibr.maths.arguments import check_one_of, checked_numbers
from pvibr.maths.transforms import inverses

_EVEN = 1e-3  # relative difference between the axes of a scale: files round them


class InverseKinematics(Step):
    """Turn joints so that end effectors reach their targets.

    Parameters
    ----------
    effectors : str, int or sequence of these
        End effectors: joints that reach for the points of these names in ``targets`` of
        :meth:`Rig.solve`.
    root : str or int, optional
        First joint of the chain. Default the root of the skeleton; for ``'two_bone'`` each
        effector's grandparent.
    method : {'damped', 'ccd', 'fabrik', 'two_bone'}, default: 'damped'
        Solver: damped least squares, cyclic coordinate descent, FABRIK, or the closed form for
        two bones.
    weights : sequence of float, optional
        Weight of each effector where not all targets can be reached; default 1.
    poles : dict of (str or int) to (array_like or str), optional
        Pole vector per effector: the point that its knee or elbow turns to, in the figure's space,
        or the name of a target.
    tolerance : float, default: 1e-3
        Accepted distance to the target, as a fraction of the effector's reach.

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
        check_one_of('method', method, METHODS)
        self.method = method
        self.weights = (1.0,) * len(self.effectors) if weights is None else tuple(weights)
        if len(self.weights) != len(self.effectors):
            raise ValueError(
                f'weights has {len(self.weights)} for {len(self.effectors)} effectors.'
            )
        self.poles = {
            name: pole
            if isinstance(pole, str)
            else checked_numbers(f'poles[{name!r}]', pole, (3,))
            for name, pole in (poles or {}).items()
        }
        for name in self.poles:
            if name not in self.effectors:
                raise ValueError(
                    f'poles has {name!r}; it must be one of the effectors {self.effectors}.'
                )
        self.tolerance = tolerance
        named = tuple(pole for pole in self.poles.values() if isinstance(pole, str))
        self.asks = self.effectors + named

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        skeleton = rig.skeleton
        limbs: dict = {}
        for name, weight in zip(self.effectors, self.weights, strict=True):
            path = self._path(skeleton, name)
            # Effectors of one root are solved together; two-bone limbs on their own.
            key = (path[0], name) if self.method == 'two_bone' else path[0]
            limbs.setdefault(key, []).append((name, weight, path))
        limbs_ = [_Limb(self, rig, limb) for limb in limbs.values()]

        def apply(pose, targets):
            for limb in limbs_:
                pose = limb.posed(pose, targets)
            return pose

        return apply

    def _path(self, skeleton, name):
        """Return the joints from the first of the chain to an effector."""
        path = [skeleton.index(name)]
        while skeleton.parents[path[0]] >= 0:
            path.insert(0, int(skeleton.parents[path[0]]))
        if self.root is not None:
            root = skeleton.index(self.root)
            if root not in path:
                raise ValueError(f'effector {name!r} is not below the root {self.root!r}.')
            return path[path.index(root) :]
        if self.method == 'two_bone':
            if len(path) < 3:
                raise ValueError(
                    f'effector {name!r} has {len(path) - 1} joints above it; two bones need 2.'
                )
            return path[-3:]
        return path


class _Limb:
    """Joints that are solved together, in the space of their root's parent."""

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
        """Return the pose with these joints solved."""
        wanted = [row for row in self.effectors if row[0] in targets]
        if not wanted:
            return pose
        chain = self._chain(pose)
        root = self.joints[0]
        inverse = inverses(placed(self.skeleton, pose, self.skeleton.parents[root]))

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
        """Return the chain with the bone lengths of a pose; it is kept while they stay."""
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
            name, found = self.skeleton.names[self.joints[i]], scale[i].tolist()
            raise ValueError(
                f'joint {name!r} has the scale {found}; inverse kinematics needs a uniform one.'
            )
        own, sizes = scale.mean(1), np.ones(len(scale))
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                sizes[i] = sizes[parent] * own[parent]
        return sizes
