"""Posing of the meshes of a figure: the float64 reference of the GPU."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.animation.boxes import Boxes
from pvibr.animation.pose import Pose, as_matrices
from pvibr.animation.skeleton import Skeleton
from pvibr.maths.skinning import moved_normals, moved_points
from pvibr.maths.vectors import unit_vectors


class Model:
    """Meshes on a skeleton, and their posed points, normals, colours, tangents and bounds.

    Parameters are those of :class:`pvibr.animation.Figure`.
    """

    def __init__(self, meshes, skeleton=None, correctives=None):
        self.meshes = tuple(meshes)
        self.skeleton = Skeleton([], Pose(np.zeros((0, 3)))) if skeleton is None else skeleton
        self.correctives = correctives
        self._check_nodes()

    def _check_nodes(self):
        for i, mesh in enumerate(self.meshes):
            nodes = np.array([mesh.node]) if mesh.skin is None else mesh.skin.nodes
            low, high = (nodes.min(), nodes.max()) if len(nodes) else (-1, -1)
            if not -1 <= low <= high < len(self.skeleton):
                used, n = f'the joints {low} to {high}', len(self.skeleton)
                raise ValueError(f'meshes[{i}] uses {used}; the skeleton has {n}.')

    @cached_property
    def rest(self):
        """The rest pose, with the rest weights of the morph targets."""
        weights = [mesh.morphs.weights for mesh in self.meshes if mesh.morphs is not None]
        return self.skeleton.rest.replaced(weights=np.concatenate([np.zeros(0), *weights]))

    def world(self, pose=None):
        """Return ``figure_from_joint`` of all joints, shape (..., n, 4, 4), float64.

        Parameters
        ----------
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            A pose, or ``figure_from_joint`` matrices, which are checked; default at rest.

        Raises
        ------
        ValueError
            If there is another number of joints.
        """
        if pose is None or isinstance(pose, Pose):
            return self.skeleton.world(self.rest if pose is None else pose)
        world = as_matrices(pose, 'pose')
        if world.shape[-3] != len(self.skeleton):
            raise ValueError(
                f'pose has {world.shape[-3]} matrices, the skeleton {len(self.skeleton)} joints.'
            )
        return world

    def weights(self, index, pose=None):
        """Return the morph weights of one mesh, shape (..., t), float64.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose : Pose, optional
            A pose; default, and if it holds no weights, at rest.

        Raises
        ------
        ValueError
            If the pose holds another number of weights.
        """
        weights = self.rest.weights
        if isinstance(pose, Pose) and pose.weights.shape[-1]:
            if pose.weights.shape[-1] != len(weights):
                many = pose.weights.shape[-1]
                raise ValueError(
                    f'the pose has {many} morph weights, the figure {len(weights)} targets.'
                )
            weights = pose.weights
        first = sum(mesh.n_targets for mesh in self.meshes[:index])
        return weights[..., first : first + self.meshes[index].n_targets]

    def posed(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return the points and normals of one mesh in a pose, computed in float64.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A single pose, or ``figure_from_joint`` matrices; default at rest.
        skinning : {'linear', 'dual'}
            Linear blend or dual quaternion skinning.
        bulge : float
            Share of dual quaternions, see :func:`pvibr.maths.skinning.dual_blend`.

        Returns
        -------
        tuple of numpy.ndarray, shape (v, 3), float64
            Points and unit normals in the figure's space.

        Raises
        ------
        ValueError
            If the pose does not fit, or holds several poses.
        """
        world = self.world(pose)
        if world.ndim != 3:
            raise ValueError(f'pose holds {world.shape[:-3]} poses; one is posed at a time.')
        points, normals = self._deformed(index, pose)
        matrices = self._moves(self.meshes[index], world, skinning, bulge)
        return moved_points(matrices, points), moved_normals(matrices, normals)

    def layers(self, index, pose=None):
        """Return the morph targets that act on one mesh before skinning, correctives included.

        Pairs of Morphs and their weights, shape (..., t).
        """
        layers = []
        if self.meshes[index].morphs is not None:
            layers.append((self.meshes[index].morphs, self.weights(index, pose)))
        if self.correctives is not None and index in self.correctives.shapes:
            weights = self.correctives.weights(self._local(pose))
            layers.append((self.correctives.shapes[index], weights))
        return layers

    def _local(self, pose):
        if pose is None or isinstance(pose, Pose):
            return self.rest if pose is None else pose
        return Pose.from_matrices(self.skeleton.local(pose), self.rest.weights)

    def _deformed(self, index, pose):
        """Return points and normals before skinning."""
        mesh = self.meshes[index]
        points, normals = mesh.points, mesh.normals
        if mesh.frames is not None:
            points, normals = mesh.frames.sample(getattr(pose, 'time', 0.0))
        for morphs, weights in self.layers(index, pose):
            points = points + morphs.total('positions', weights, len(points))
            normals = normals + morphs.total('normals', weights, len(points))
        return points, normals

    def colors(self, index, pose=None):
        """Return the point colours of one mesh in a pose.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A single pose; default at rest.

        Returns
        -------
        numpy.ndarray, shape (v, c), uint8 or float, or None
            The colours that ``look`` names plus the differences of morph targets, in which 1 is
            the full range, of uint8 too. ``None`` if the look has no point colours.

        Examples
        --------
        >>> import numpy as np
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Morphs
        >>> mesh = pv.PolyData(np.zeros((1, 3)))
        >>> mesh['paint'] = np.array([[0, 0, 100]], np.uint8)
        >>> blush = Morphs([[[0, 0, 0]]], colors=[[[1, 0, 0]]], weights=[0.5])
        >>> look = {'scalars': 'paint', 'rgb': True}
        >>> Figure([FigureMesh(mesh, morphs=blush, look=look)]).colors(0).tolist()
        [[128, 0, 100]]
        """
        mesh = self.meshes[index]
        name = mesh.look.get('scalars') if mesh.look.get('rgb') else None
        if name not in mesh.mesh.point_data:
            return None
        stored = np.asarray(mesh.mesh.point_data[name])
        full = 255 if stored.dtype == np.uint8 else 1
        colors = stored.astype(np.float64)
        for morphs, weights in self.layers(index, pose):
            change = morphs.total('colors', weights, len(colors))[:, : colors.shape[1]]
            colors[:, : change.shape[1]] += full * change
        colors = np.clip(colors, 0, full)
        return (colors + 0.5 if full == 255 else colors).astype(stored.dtype)

    def tangents(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return unit tangents of one mesh in a pose, shape (v, 3); None without ``'Tangents'``.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose, skinning, bulge : optional
            As in :meth:`posed`.
        """
        mesh = self.meshes[index]
        if 'Tangents' not in mesh.mesh.point_data:
            return None
        tangents = np.array(mesh.mesh.point_data['Tangents'][:, :3], dtype=np.float64)
        for morphs, weights in self.layers(index, pose):
            tangents += morphs.total('tangents', weights, len(tangents))
        matrices = self._moves(mesh, self.world(pose), skinning, bulge)
        return unit_vectors(np.einsum('...ij,...j->...i', matrices[..., :3], tangents))

    def bounds(self, pose=None, skinning='linear'):
        """Return bounding boxes of the posed figure without posing its vertices.

        The boxes of the joints are moved, so that the result is fast and slightly too large.

        Parameters
        ----------
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            One or many poses, or ``figure_from_joint`` matrices; default at rest.
        skinning : {'linear', 'dual'}
            Linear blend or dual quaternion skinning.

        Returns
        -------
        numpy.ndarray, shape (..., 6), float64
            (x min, x max, y min, ...) in the figure's space; (1, -1, 1, -1, 1, -1), as PyVista
            has it, if there are no points.

        Raises
        ------
        ValueError
            If the pose does not fit.
        """
        world = self.world(pose)
        time = getattr(pose, 'time', 0.0)
        boxes = [
            boxes.around(world, self.layers(i, pose), time, skinning)
            for i, boxes in enumerate(self._boxes)
            if len(self.meshes[i].points)
        ]
        if not boxes:
            return np.broadcast_to([1.0, -1.0] * 3, (*world.shape[:-3], 6))
        low, high = np.min(boxes, 0)[..., ::2], np.max(boxes, 0)[..., 1::2]
        return np.stack([low, high], -1).reshape(*low.shape[:-1], 6)

    @cached_property
    def joint_boxes(self) -> dict:
        """Joints, matrices and boxes that they move, by skinning; None if others move points."""
        return {how: self._joint_boxes(how) for how in ('linear', 'dual')}

    def _joint_boxes(self, how):
        pairs = zip(self._boxes, self.meshes, strict=True)
        found = [boxes.of_joints(how) for boxes, mesh in pairs if len(mesh.points)]
        if not found or self.correctives is not None or any(b is None for b in found):
            return None
        return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))

    @cached_property
    def _boxes(self):
        return [Boxes(mesh) for mesh in self.meshes]

    @staticmethod
    def _moves(mesh, world, how, bulge):
        if mesh.skin is not None:
            return mesh.skin.blend(world, how, bulge)
        return (np.eye(4) if mesh.node < 0 else world[mesh.node])[None, :3]
