"""Pose space deformation: shapes keyed to poses that correct artefacts of skinning.

J. P. Lewis, M. Cordner and N. Fong, "Pose space deformation: a unified approach to shape
interpolation and skeleton-driven deformation", SIGGRAPH 2000. The shapes act as morph targets
before skinning; their weights follow from the pose.
"""

from __future__ import annotations

import numpy as np

from pvibr.animation.model import vertex_matrices
from pvibr.animation.morphs import Morphs
from pvibr.animation.normals import normals_at
from pvibr.maths.vectors import unit_vectors

_SAME = 1e-4  # radians: nearer poses count as equal
_CONDITION = 1e8  # leaves eight digits for the shapes at the key poses
_COLLAPSED = 1e-6  # |det| relative to the largest stretch cubed


class PoseSpace:
    """Key poses, and interpolation weights of any pose between them.

    A pose is the rotations of some joints; the distance of two poses is the geodesic angle between
    rotations, as a root of squares over the joints. Weights are interpolated by radial basis
    functions (Wendland's, C2), which vanish beyond their radius.

    Parameters
    ----------
    joints : sequence of int, length j
        Joints whose rotations are compared.
    keys : Pose
        The key poses, of shape (k,).
    neutral : Pose
        Pose at which all weights are 0, usually the rest pose.
    radius : float or array_like, shape (k,), optional
        Support of each key in radians; default twice the distance to the nearest key or the
        neutral pose.
    influence : array_like, shape (j,), optional
        Factor on the angle of each joint; default 1.
    names : sequence of str, optional
        Names of the keys; default 'key0', 'key1', ...

    Raises
    ------
    ValueError
        If there are no keys or joints, a joint is out of range, two keys are equal, or the radii
        are not positive or too large to separate the keys.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Pose, PoseSpace
    >>> from pvibr.maths.quaternions import from_axis_angle
    >>> bent = from_axis_angle([0, 0, 1], np.radians([[45.0], [90.0]]))  # two poses, one joint
    >>> space = PoseSpace([0], Pose(np.zeros((2, 1, 3)), bent), Pose(np.zeros((1, 3))))
    >>> space.weights(Pose(np.zeros((1, 3)), bent[1])).round(9).tolist()
    [0.0, 1.0]
    """

    def __init__(self, joints, keys, neutral, radius=None, influence=None, names=None):
        self.joints = _joints(joints, neutral.n_joints)
        if len(keys.shape) != 1 or not keys.shape[0] or keys.n_joints != neutral.n_joints:
            raise ValueError(
                f'keys must be (k,) poses of {neutral.n_joints} joints, k > 0, '
                f'got {keys.shape} of {keys.n_joints}'
            )
        key_count = keys.shape[0]
        self.names = tuple(f'key{i}' for i in range(key_count)) if names is None else tuple(names)
        if len(self.names) != key_count:
            raise ValueError(f'names must hold {key_count} names, got {len(self.names)}')
        self.influence = _positive('influence', influence, len(self.joints), 1.0)
        center_rotations = [neutral.rotation[None], keys.rotation]
        self._centers = np.concatenate(center_rotations)[:, self.joints]
        distances = self._distances(self._centers)
        self._check_apart(distances)
        nearest = np.where(np.eye(key_count + 1, dtype=bool), np.inf, distances).min(1)
        self.radius = _positive('radius', radius, key_count, 2 * nearest[1:])
        # The neutral pose is a centre too, with no shape.
        self._radii = np.append(2 * nearest[0], self.radius)
        self._mix = self._solved(_wendland(distances / self._radii))

    def __len__(self):
        return len(self.names)

    def __repr__(self):
        return f'PoseSpace({len(self)} keys of {len(self.joints)} joints)'

    def weights(self, pose):
        """Return the weight of each key's shape in poses, (..., k).

        It is 1 at the key, 0 at all others and at the neutral pose, and may overshoot between.

        Parameters
        ----------
        pose : Pose
            One or many poses.

        Raises
        ------
        ValueError
            If the pose lacks joints.
        """
        if pose.n_joints <= self.joints.max():
            last = self.joints.max()
            raise ValueError(f'pose must have joints up to {last}, got {pose.n_joints} joints')
        distances = self._distances(pose.rotation[..., self.joints, :])
        return _wendland(distances / self._radii) @ self._mix

    def _distances(self, rotations):
        """Return the distance of rotations (..., j, 4) from each centre, (..., k + 1)."""
        # Near 1 the cosine loses digits of the angle, but there the kernel is flat.
        cosine = np.abs(np.einsum('...jq,cjq->...cj', rotations, self._centers))
        joint_angles = 2 * np.arccos(np.minimum(cosine, 1.0))
        return np.sqrt(np.square(joint_angles * self.influence).sum(-1))

    def _check_apart(self, center_distances):
        i, j = np.unravel_index(
            np.argmin(center_distances + np.pi * 1e3 * np.eye(len(center_distances))),
            center_distances.shape,
        )
        if center_distances[i, j] < _SAME:
            center_names = 'the neutral pose', *self.names
            raise ValueError(
                f'key poses must differ at joints {self.joints.tolist()}, got equal '
                f'{center_names[i]} and {center_names[j]}'
            )

    def _solved(self, kernel_matrix):
        """Return the factors that make each weight 1 at its own key and 0 at the others."""
        if np.linalg.cond(kernel_matrix) > _CONDITION:
            raise ValueError(
                'radius must be small enough to separate the key poses, got '
                f'{self.radius.tolist()}'
            )
        return np.linalg.solve(kernel_matrix, np.eye(len(kernel_matrix))[:, 1:])


class Correctives:
    """Corrective shapes of a figure and the pose spaces that weigh them.

    Parameters
    ----------
    spaces : PoseSpace or sequence of PoseSpace
        Pose spaces, one for each group of joints that belong together; their keys in order are
        the k shapes.
    shapes : dict of int to Morphs
        By index of the mesh: k targets, applied before skinning.

    Raises
    ------
    ValueError
        If a mesh does not have one shape per key.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Correctives, Morphs, Pose, PoseSpace
    >>> half_turn = Pose(np.zeros((1, 1, 3)), [[[0.0, 1.0, 0.0, 0.0]]])
    >>> space = PoseSpace([0], half_turn, Pose(np.zeros((1, 3))))
    >>> Correctives(space, {0: Morphs([[[0.0, 0.0, 1.0]]])}).weights(half_turn).tolist()
    [[1.0]]
    """

    def __init__(self, spaces, shapes):
        self.spaces = (spaces,) if isinstance(spaces, PoseSpace) else tuple(spaces)
        self.shapes = dict(shapes)
        for mesh_index, morphs in self.shapes.items():
            if len(morphs) != len(self):
                raise ValueError(
                    f'shapes[{mesh_index}] must have {len(self)} shapes, got {len(morphs)}'
                )

    def __len__(self):
        return sum(len(space) for space in self.spaces)

    def __repr__(self):
        return f'Correctives({len(self)} shapes in {len(self.spaces)} spaces)'

    def __add__(self, other):
        """Return the correctives of both."""
        mesh_indices = sorted({*self.shapes, *other.shapes})
        return Correctives(
            self.spaces + other.spaces,
            {
                mesh_index: _concatenated(
                    [(c.shapes.get(mesh_index), len(c)) for c in (self, other)]
                )
                for mesh_index in mesh_indices
            },
        )

    def weights(self, pose):
        """Return the weight of each shape in poses, (..., k).

        Parameters
        ----------
        pose : Pose
            One or many poses.

        Raises
        ------
        ValueError
            If the pose lacks joints.
        """
        space_weights = [space.weights(pose) for space in self.spaces]
        return np.concatenate([np.zeros((*pose.shape, 0)), *space_weights], axis=-1)

    @classmethod
    def from_sculpted(cls, figure, joints, keys, points, normals=None, **options):
        """Return the correctives that give a mesh sculpted shapes in key poses.

        Each shape is transformed back through the inverse of the skinning.

        Parameters
        ----------
        figure : Figure
            The figure, without these correctives.
        joints : sequence of str or int
            Joints whose rotations are compared.
        keys : Pose
            The k key poses of the whole skeleton, of shape (k,).
        points : array_like, shape (k, v, 3)
            Sculpted vertices in each key pose, in the figure's space.
        normals : array_like, shape (k, v, 3), optional
            Sculpted normals, exact if no morph target is active in the key pose; default estimated
            from the change of the faces.
        **options
            ``mesh``, its index (default 0); ``skinning``, that of later use ('linear');
            ``radius``, ``influence`` and ``names`` of :class:`PoseSpace`.

        Raises
        ------
        ValueError
            If shapes do not fit, or skinning collapses vertices in a key pose, so that no shape
            can correct them; and as :class:`PoseSpace` does.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import Correctives, FigureMesh, Pose, Skeleton
        >>> ball = Figure(
        ...     [FigureMesh(pv.Sphere(), node=0)], Skeleton([-1], Pose([[0.0, 0.0, 0.0]]))
        ... )
        >>> turned = Pose([[[0.0, 0.0, 0.0]]], [[[0.0, 1.0, 0.0, 0.0]]])
        >>> larger = 2 * ball.posed(0, turned[0])[0]
        >>> fix = Correctives.from_sculpted(ball, [0], turned, larger[None])
        >>> abs(fix.shapes[0].target('positions', 0)[1] - pv.Sphere().points).max() < 1e-6
        np.True_
        """
        mesh_index = options.pop('mesh', 0)
        skinning = options.pop('skinning', 'linear')
        skeleton = figure.skeleton
        joints = [skeleton.index(joint) for joint in joints]
        pose_space = PoseSpace(joints, keys, skeleton.rest, **options)
        expected_shape = len(pose_space), len(figure.meshes[mesh_index].points), 3
        for name, values in (('points', points), ('normals', normals)):
            if values is not None and np.shape(values) != expected_shape:
                raise ValueError(f'{name} must be {expected_shape}, got {np.shape(values)}')
        normals = [None] * len(pose_space) if normals is None else normals
        rest_deltas = [
            _rest_deltas(figure, mesh_index, keys[i], skinning, points[i], normals[i])
            for i in range(len(pose_space))
        ]
        point_deltas, normal_deltas = zip(*rest_deltas, strict=True)
        morphs = Morphs(point_deltas, normal_deltas, names=pose_space.names)
        return cls(pose_space, {mesh_index: morphs})


def _wendland(r):
    """Return Wendland's C2 function of r >= 0: 1 at 0, 0 from 1 on."""
    return np.square(np.square(np.maximum(1 - r, 0.0))) * (4 * r + 1)


def _rest_deltas(figure, mesh_index, pose, skinning, points, normals):
    """Return differences of points and normals before skinning, from those after it."""
    figure_mesh = figure.meshes[mesh_index]
    linear = vertex_matrices(figure_mesh, figure.world(pose), skinning, 1.0)[:, :, :3]
    linear = np.broadcast_to(linear, (len(figure_mesh.points), 3, 3))
    stretch = np.abs(linear).max((1, 2), initial=np.finfo(float).tiny)
    collapsed = np.flatnonzero(np.abs(np.linalg.det(linear)) < _COLLAPSED * stretch**3)
    if collapsed.size:
        raise ValueError(
            f'{skinning} skinning must not collapse vertices in a key pose, got '
            f'{collapsed.size}, first {collapsed[0]}; use a smaller angle or "dual"'
        )
    posed, posed_normals = figure.posed(mesh_index, pose, skinning)
    point_delta = np.linalg.solve(linear, (np.asarray(points) - posed)[..., None])[..., 0]
    if normals is None:
        mesh = figure_mesh.mesh
        normals = posed_normals + normals_at(mesh, points) - normals_at(mesh, posed)
    # Normals transform by the inverse transpose, so they transform back by the transpose.
    rest_normals, sculpted_normals = (
        unit_vectors(np.einsum('vij,vi->vj', linear, n)) for n in (posed_normals, normals)
    )
    return point_delta, sculpted_normals - rest_normals


def _concatenated(parts):
    """Return the targets of several Morphs, or of (None, count), one after another."""
    entries: dict = {'positions': [], 'normals': [], 'tangents': [], 'colors': []}
    for morphs, n in parts:
        for attribute, targets in entries.items():
            targets += [None if morphs is None else morphs.target(attribute, i) for i in range(n)]
    names = [morphs.names[i] if morphs else f'none{i}' for morphs, n in parts for i in range(n)]
    return Morphs(**entries, names=names)


def _joints(joints, joint_count):
    joints = np.array(joints, dtype=np.int64).reshape(-1)
    if not joints.size or joints.min() < 0 or joints.max() >= joint_count:
        raise ValueError(
            f'joints must name at least one of the {joint_count} joints, got {joints.tolist()}'
        )
    return joints


def _positive(name, values, count, default):
    values = np.asarray(default if values is None else values, dtype=np.float64)
    if values.shape not in ((), (1,), (count,)) or not ((values > 0) & np.isfinite(values)).all():
        raise ValueError(f'{name} must be positive, one value or {count}, got {values.tolist()}')
    return np.broadcast_to(values, count)
