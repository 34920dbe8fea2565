"""Inverse kinematics as a step of a rig."""

from __future__ import annotations

import numpy as np

from pvibr.animation.chain import Chain
from pvibr.animation.ik_solvers import METHODS, solve
from pvibr.animation.rig import Step, joint_matrix
from pvibr.core.arguments import check_one_of, checked_numbers
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
                f'weights must have {len(self.effectors)} values, one per effector, got '
                f'{len(self.weights)}'
            )
        self.poles = {
            name: pole
            if isinstance(pole, str)
            else checked_numbers(f'poles[{name!r}]', pole, (3,))
            for name, pole in (poles or {}).items()
        }
        for name in self.poles:
            if name not in self.effectors:
                raise ValueError(f'poles must name effectors {self.effectors}, got {name!r}')
        self.tolerance = tolerance
        pole_targets = tuple(pole for pole in self.poles.values() if isinstance(pole, str))
        self.asks = self.effectors + pole_targets

    def bound(self, rig):
        """Return this step bound to the joints of a rig."""
        skeleton = rig.skeleton
        effectors_by_chain: dict = {}
        for name, weight in zip(self.effectors, self.weights, strict=True):
            joint_path = self._path(skeleton, name)
            # Effectors of one root are solved together; two-bone limbs on their own.
            chain_key = (joint_path[0], name) if self.method == 'two_bone' else joint_path[0]
            effectors_by_chain.setdefault(chain_key, []).append((name, weight, joint_path))
        limb_solvers = [_Limb(self, rig, limb) for limb in effectors_by_chain.values()]

        def apply(pose, targets):
            for limb in limb_solvers:
                pose = limb.solved(pose, targets)
            return pose

        return apply

    def _path(self, skeleton, effector_name):
        """Return the joints from the first of the chain to an effector."""
        joint_path = [skeleton.index(effector_name)]
        while skeleton.parents[joint_path[0]] >= 0:
            joint_path.insert(0, int(skeleton.parents[joint_path[0]]))
        if self.root is not None:
            root_joint = skeleton.index(self.root)
            if root_joint not in joint_path:
                raise ValueError(f'effector must be below {self.root!r}, got {effector_name!r}')
            return joint_path[joint_path.index(root_joint) :]
        if self.method == 'two_bone':
            if len(joint_path) < 3:
                raise ValueError(
                    f'effector {effector_name!r} must have 2 joints above it for two_bone, got '
                    f'{len(joint_path) - 1}'
                )
            return joint_path[-3:]
        return joint_path


class _Limb:
    """Joints that are solved together, in the space of their root's parent."""

    def __init__(self, reach, rig, effectors):
        self.reach, self.rig, self.skeleton = reach, rig, rig.skeleton
        chain_joints = {joint for _, _, path in effectors for joint in path}
        self.joints = np.array([joint for joint in rig.skeleton.order if joint in chain_joints])
        local = {int(joint): i for i, joint in enumerate(self.joints)}
        self.effectors = [(name, weight, local[path[-1]]) for name, weight, path in effectors]
        self.parents = [local.get(int(above), -1) for above in rig.skeleton.parents[self.joints]]
        limit_by_joint = {i: rig.limit(joint) for joint, i in local.items()}
        self.limits = {i: limit for i, limit in limit_by_joint.items() if limit is not None}
        self.parent_joints = np.unique([i for i in self.parents if i >= 0]).astype(int)
        self.chain = None

    def solved(self, pose, targets):
        """Return the pose with these joints solved."""
        active = [row for row in self.effectors if row[0] in targets]
        if not active:
            return pose
        chain = self._chain(pose)
        root = self.joints[0]
        inverse = inverses(joint_matrix(self.skeleton, pose, self.skeleton.parents[root]))

        def local_point(point):
            return inverse[:3, :3] @ point + inverse[:3, 3] - pose.translation[root]

        pole_by_effector = {}
        for name, _, effector in active:
            pole_point = self.reach.poles.get(name)
            pole_point = targets.get(pole_point) if isinstance(pole_point, str) else pole_point
            if pole_point is not None:
                pole_by_effector[effector] = local_point(pole_point)
        ik_solution = solve(
            chain,
            pose.rotation[self.joints],
            [effector for _, _, effector in active],
            [local_point(targets[name]) for name, _, _ in active],
            [weight for _, weight, _ in active],
            method=self.reach.method,
            poles=pole_by_effector,
            tolerance=self.reach.tolerance,
        )
        new_rotations = pose.rotation.copy()
        new_rotations[self.joints] = ik_solution.rotations
        return pose.replaced(rotation=new_rotations)

    def _chain(self, pose):
        """Return the chain with the bone lengths of a pose; it is kept while they stay."""
        bone_offsets = pose.translation[self.joints]
        bone_offsets[0] = 0.0
        joint_scales = pose.scale[self.joints]
        if (joint_scales != 1.0).any():
            bone_offsets = bone_offsets * self._sizes(joint_scales)[:, None]
        if self.chain is None or not np.array_equal(self.chain.offsets, bone_offsets):
            rest_rotations = self.skeleton.rest.rotation[self.joints]
            self.chain = Chain(self.parents, bone_offsets, self.limits, rest_rotations)
        return self.chain

    def _sizes(self, joint_scales):
        """Return the scale of each joint's space relative to the root's parent."""
        is_uneven = np.ptp(joint_scales, axis=1) > _EVEN * np.abs(joint_scales).max(1)
        for i in self.parent_joints[is_uneven[self.parent_joints]]:
            name, scale = self.skeleton.names[self.joints[i]], joint_scales[i].tolist()
            raise ValueError(f'scale of joint {name!r} must be uniform for solvers, got {scale}')
        mean_scales, inherited_scales = joint_scales.mean(1), np.ones(len(joint_scales))
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                inherited_scales[i] = inherited_scales[parent] * mean_scales[parent]
        return inherited_scales
