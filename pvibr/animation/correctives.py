"""Pose space deformation: shapes keyed to poses that correct artefacts of skinning.

J. P. Lewis, M. Cordner and N. Fong, "Pose space deformation: a unified approach to shape
interpolation and skeleton-driven deformation", SIGGRAPH 2000. The shapes act as morph targets
before skinning; their weights follow from the pose.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.animation.morphs import Morphs
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
        Joints of the skeleton that count.
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
            held, n = f'poses {keys.shape} of {keys.n_joints} joints', neutral.n_joints
            raise ValueError(f'keys holds {held}; it must be (k,) poses of {n}, with k > 0.')
        k = keys.shape[0]
        self.names = tuple(f'key{i}' for i in range(k)) if names is None else tuple(names)
        if len(self.names) != k:
            raise ValueError(f'names holds {len(self.names)} names for {k} key poses.')
        self.influence = _positive('influence', influence, len(self.joints), 1.0)
        centers = [neutral.rotation[None], keys.rotation]
        self._centers = np.concatenate(centers)[:, self.joints]
        apart = self._distances(self._centers)
        self._check_apart(apart)
        nearest = np.where(np.eye(k + 1, dtype=bool), np.inf, apart).min(1)
        self.radius = _positive('radius', radius, k, 2 * nearest[1:])
        # The neutral pose is a centre too, with no shape.
        self._radii = np.append(2 * nearest[0], self.radius)
        self._mix = self._solved(_wendland(apart / self._radii))

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
            raise ValueError(
                f'the pose has {pose.n_joints} joints; joint {self.joints.max()} is needed.'
            )
        distances = self._distances(pose.rotation[..., self.joints, :])
        return _wendland(distances / self._radii) @ self._mix

    def _distances(self, rotations):
        """Return the distance of rotations (..., j, 4) from each centre, (..., k + 1)."""
        # Near 1 the cosine loses digits of the angle, but there the kernel is flat.
        cosine = np.abs(np.einsum('...jq,cjq->...cj', rotations, self._centers))
        angles = 2 * np.arccos(np.minimum(cosine, 1.0))
        return np.sqrt(np.square(angles * self.influence).sum(-1))

    def _check_apart(self, apart):
        i, j = np.unravel_index(np.argmin(apart + np.pi * 1e3 * np.eye(len(apart))), apart.shape)
        if apart[i, j] < _SAME:
            names = ('the neutral pose', *self.names)
            raise ValueError(
                f'{names[i]} and {names[j]} are equal poses of joints {self.joints.tolist()}.'
            )

    def _solved(self, kernel):
        """Return the factors that make each weight 1 at its own key and 0 at the others."""
        if np.linalg.cond(kernel) > _CONDITION:
            raise ValueError(
                f'radius is {self.radius.tolist()}; too large to separate the key poses.'
            )
        return np.linalg.solve(kernel, np.eye(len(kernel))[:, 1:])


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
        If a mesh has another number of shapes than there are keys.

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
        for mesh, morphs in self.shapes.items():
            if len(morphs) != len(self):
                raise ValueError(
                    f'shapes[{mesh}] has {len(morphs)} shapes; there are {len(self)} key poses.'
                )

    def __len__(self):
        return sum(len(space) for space in self.spaces)

    def __repr__(self):
        return f'Correctives({len(self)} shapes in {len(self.spaces)} spaces)'

    def __add__(self, other):
        """Return the correctives of both."""
        both = sorted({*self.shapes, *other.shapes})
        return Correctives(
            self.spaces + other.spaces,
            {
                mesh: _joined([(c.shapes.get(mesh), len(c)) for c in (self, other)])
                for mesh in both
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
        parts = [space.weights(pose) for space in self.spaces]
        return np.concatenate([np.zeros((*pose.shape, 0)), *parts], axis=-1)

    @classmethod
    def from_sculpted(cls, figure, joints, keys, points, normals=None, **options):
        """Return the correctives that give a mesh sculpted shapes in key poses.

        Each shape is transformed back through the inverse of the skinning.

        Parameters
        ----------
        figure : Figure
            The figure, without these correctives.
        joints : sequence of str or int
            Joints that count.
        keys : Pose
            The k key poses of the whole skeleton, of shape (k,).
        points : array_like, shape (k, v, 3)
            Sculpted vertices in each key pose, in the figure's space.
        normals : array_like, shape (k, v, 3), optional
            Sculpted normals, exact if no morph target is active in the key pose; default estimated
            from the change of the faces.
        **options
            ``mesh``, its index (default 0); ``skinning``, as it will be used ('linear');
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
        mesh = options.pop('mesh', 0)
        skinning = options.pop('skinning', 'linear')
        skeleton = figure.skeleton
        joints = [skeleton.index(joint) for joint in joints]
        space = PoseSpace(joints, keys, skeleton.rest, **options)
        shape = (len(space), len(figure.meshes[mesh].points), 3)
        for name, values in (('points', points), ('normals', normals)):
            if values is not None and np.shape(values) != shape:
                raise ValueError(f'{name} has the shape {np.shape(values)}; it must be {shape}.')
        differences = [
            _brought_back(
                figure, mesh, keys[i], skinning, points[i], None if normals is None else normals[i]
            )
            for i in range(len(space))
        ]
        moved, tilted = zip(*differences, strict=True)
        morphs = Morphs(moved, tilted, names=space.names)
        return cls(space, {mesh: morphs})


def _wendland(r):
    """Return Wendland's C2 function of r >= 0: 1 at 0, 0 from 1 on."""
    return np.square(np.square(np.maximum(1 - r, 0.0))) * (4 * r + 1)


def _brought_back(figure, mesh, pose, skinning, points, normals):
    """Return differences of points and normals before skinning, from those after it."""
    linear = _linear(figure, mesh, pose, skinning)
    stretch = np.abs(linear).max((1, 2), initial=np.finfo(float).tiny)
    collapsed = np.flatnonzero(np.abs(np.linalg.det(linear)) < _COLLAPSED * stretch**3)
    if collapsed.size:
        lost = f'{collapsed.size} vertices in a key pose, first {collapsed[0]}'
        raise ValueError(f'{skinning} skinning collapses {lost}: use a smaller angle or "dual".')
    posed, upright = figure.posed(mesh, pose, skinning)
    moved = np.linalg.solve(linear, (np.asarray(points) - posed)[..., None])[..., 0]
    if normals is None:
        mesh = figure.meshes[mesh].mesh
        normals = upright + _slopes(mesh, points) - _slopes(mesh, posed)
    # Normals transform by the inverse transpose, so they transform back by the transpose.
    before, after = (unit_vectors(np.einsum('vij,vi->vj', linear, n)) for n in (upright, normals))
    return moved, after - before


def _slopes(mesh, points):
    """Return the normals of a mesh with its points moved; zero for points without polygons."""
    if not mesh.GetNumberOfPolys():
        return np.zeros((mesh.n_points, 3))
    shape = pv.PolyData()
    shape.copy_structure(mesh)
    shape.SetPoints(pv.vtk_points(np.asarray(points, dtype=np.float64)))  # the others are shared
    found = shape.compute_normals(
        cell_normals=False, split_vertices=False, consistent_normals=False
    )
    return np.asarray(found.point_data['Normals'], dtype=np.float64)


def _linear(figure, index, pose, skinning):
    """Return the linear part of the transform of each vertex, (v, 3, 3)."""
    mesh, world = figure.meshes[index], figure.world(pose)
    if mesh.skin is not None:
        return mesh.skin.blend(world, skinning)[:, :, :3]
    matrix = np.eye(4) if mesh.node < 0 else world[mesh.node]
    return np.broadcast_to(matrix[:3, :3], (len(mesh.points), 3, 3))


def _joined(parts):
    """Return the targets of several Morphs, or of (None, count), one after another."""
    entries: dict = {'positions': [], 'normals': [], 'tangents': [], 'colors': []}
    for morphs, n in parts:
        for what, targets in entries.items():
            targets += [None if morphs is None else morphs.target(what, i) for i in range(n)]
    names = [morphs.names[i] if morphs else f'none{i}' for morphs, n in parts for i in range(n)]
    return Morphs(**{what: [_entry(t) for t in ts] for what, ts in entries.items()}, names=names)


def _entry(target):
    """Return a target as the constructor of Morphs takes it."""
    return target if target is None or not isinstance(target[0], slice) else target[1]


def _joints(joints, n):
    joints = np.array(joints, dtype=np.int64).reshape(-1)
    if not joints.size or joints.min() < 0 or joints.max() >= n:
        raise ValueError(
            f'joints is {joints.tolist()}; it must name at least one of the {n} joints.'
        )
    return joints


def _positive(name, values, n, default):
    values = np.asarray(default if values is None else values, dtype=np.float64)
    if values.shape not in ((), (1,), (n,)) or not ((values > 0) & np.isfinite(values)).all():
        raise ValueError(f'{name} is {values.tolist()}; it must be positive, one or {n}.')
    return np.broadcast_to(values, n)
