"""Posing of the meshes of a figure: the float64 reference of the GPU."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.animation.boxes import Boxes
from pvibr.animation.normals import with_flipped_winding
from pvibr.animation.pose import Pose, as_matrices
from pvibr.animation.skeleton import Skeleton
from pvibr.animation.skinning import moved_normals, moved_points
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
            mesh_joints = np.array([mesh.node]) if mesh.skin is None else mesh.skin.nodes
            for joint in mesh_joints[(mesh_joints < -1) | (mesh_joints >= len(self.skeleton))]:
                last = len(self.skeleton) - 1
                raise ValueError(f'joints of meshes[{i}] must be from -1 to {last}, got {joint}')

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
            If the number of joints differs.
        """
        if pose is None or isinstance(pose, Pose):
            return self.skeleton.world(self.rest if pose is None else pose)
        world = as_matrices(pose, 'pose')
        if world.shape[-3] != len(self.skeleton):
            raise ValueError(
                f'pose must have {len(self.skeleton)} matrices, one per joint, got '
                f'{world.shape[-3]}'
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
            If the number of weights differs.
        """
        weights = self.rest.weights
        if isinstance(pose, Pose) and pose.weights.shape[-1]:
            if pose.weights.shape[-1] != len(weights):
                raise ValueError(
                    f'pose must have {len(weights)} morph weights, got {pose.weights.shape[-1]}'
                )
            weights = pose.weights
        first_target = sum(mesh.n_targets for mesh in self.meshes[:index])
        return weights[..., first_target : first_target + self.meshes[index].n_targets]

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
            Share of dual quaternions, see :func:`pvibr.animation.skinning.dual_blend`.

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
            raise ValueError(f'pose must be a single pose, got {world.shape[:-3]} poses')
        points, normals = self._deformed(index, pose)
        matrices = vertex_matrices(self.meshes[index], world, skinning, bulge)
        return moved_points(matrices, points), moved_normals(matrices, normals)

    def layers(self, index, pose=None):
        """Return the morph targets that act on one mesh before skinning, correctives included.

        Pairs of Morphs and their weights, shape (..., t).
        """
        morph_layers = []
        if self.meshes[index].morphs is not None:
            morph_layers.append((self.meshes[index].morphs, self.weights(index, pose)))
        if self.correctives is not None and index in self.correctives.shapes:
            weights = self.correctives.weights(self._local(pose))
            morph_layers.append((self.correctives.shapes[index], weights))
        return morph_layers

    def _local(self, pose):
        if pose is None or isinstance(pose, Pose):
            return self.rest if pose is None else pose
        return Pose.from_matrices(self.skeleton.local(pose), self.rest.weights)

    def _deformed(self, mesh_index, pose):
        """Return points and normals before skinning."""
        figure_mesh = self.meshes[mesh_index]
        points, normals = figure_mesh.points, figure_mesh.normals
        if figure_mesh.frames is not None:
            points, normals = figure_mesh.frames.sample(getattr(pose, 'time', 0.0))
        for morphs, weights in self.layers(mesh_index, pose):
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
        figure_mesh = self.meshes[index]
        array_name = figure_mesh.look.get('scalars') if figure_mesh.look.get('rgb') else None
        if array_name not in figure_mesh.mesh.point_data:
            return None
        rest_colors = np.asarray(figure_mesh.mesh.point_data[array_name])
        full_scale = 255 if rest_colors.dtype == np.uint8 else 1
        colors = rest_colors.astype(np.float64)
        for morphs, weights in self.layers(index, pose):
            color_change = morphs.total('colors', weights, len(colors))[:, : colors.shape[1]]
            colors[:, : color_change.shape[1]] += full_scale * color_change
        colors = np.clip(colors, 0, full_scale)
        return (colors + 0.5 if full_scale == 255 else colors).astype(rest_colors.dtype)

    def tangents(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return unit tangents of one mesh in a pose, shape (v, 3); None without ``'Tangents'``.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose, skinning, bulge : optional
            As in :meth:`posed`.
        """
        figure_mesh = self.meshes[index]
        if 'Tangents' not in figure_mesh.mesh.point_data:
            return None
        tangents = np.array(figure_mesh.mesh.point_data['Tangents'][:, :3], dtype=np.float64)
        for morphs, weights in self.layers(index, pose):
            tangents += morphs.total('tangents', weights, len(tangents))
        matrices = vertex_matrices(figure_mesh, self.world(pose), skinning, bulge)
        return unit_vectors(np.einsum('...ij,...j->...i', matrices[..., :3], tangents))

    def posed_mesh(self, index, pose, skinning='linear', bulge=1.0):
        """Return a posed copy of one mesh, with its normals and data.

        Parameters
        ----------
        index : int
            Index of the mesh.
        pose, skinning, bulge : optional
            As in :meth:`posed`.
        """
        options = pose, skinning, bulge
        figure_mesh, mesh = self.meshes[index], self.meshes[index].mesh.copy(deep=True)
        mesh.points, mesh.point_data['Normals'] = self.posed(index, *options)
        mesh.point_data.active_normals_name = 'Normals'
        posed_arrays = {
            'Tangents': self.tangents(index, *options),
            figure_mesh.look.get('scalars'): self.colors(index, pose),
        }
        for name, values in posed_arrays.items():
            if values is not None:
                mesh.point_data[name] = values
        return with_flipped_winding(mesh) if figure_mesh.mirrors(self.world(pose)) else mesh

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
        mesh_boxes = [
            mesh_boxes.around(world, self.layers(i, pose), time, skinning)
            for i, mesh_boxes in enumerate(self._boxes)
            if len(self.meshes[i].points)
        ]
        if not mesh_boxes:
            return np.broadcast_to([1.0, -1.0] * 3, (*world.shape[:-3], 6))
        low, high = np.min(mesh_boxes, 0)[..., ::2], np.max(mesh_boxes, 0)[..., 1::2]
        return np.stack([low, high], -1).reshape(*low.shape[:-1], 6)

    @cached_property
    def joint_boxes(self) -> dict:
        """Joints, matrices and boxes by skinning; None if not only joints move points."""
        return {how: self._joint_boxes(how) for how in ('linear', 'dual')}

    def _joint_boxes(self, skinning):
        pairs = zip(self._boxes, self.meshes, strict=True)
        mesh_parts = [boxes.of_joints(skinning) for boxes, mesh in pairs if len(mesh.points)]
        if not mesh_parts or self.correctives is not None or any(b is None for b in mesh_parts):
            return None
        return tuple(np.concatenate(parts) for parts in zip(*mesh_parts, strict=True))

    @cached_property
    def _boxes(self):
        return [Boxes(mesh) for mesh in self.meshes]


def vertex_matrices(mesh, world, skinning, bulge):
    """Return ``figure_from_mesh`` of each vertex, (v, 3, 4), or of all, (1, 3, 4)."""
    if mesh.skin is not None:
        return mesh.skin.blend(world, skinning, bulge)
    return (np.eye(4) if mesh.node < 0 else world[mesh.node])[None, :3]
