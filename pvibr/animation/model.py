"""What a pose does to the meshes of a figure: the float64 reference of every other way."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.animation.boxes import Boxes
from pvibr.animation.pose import Pose, as_matrices
from pvibr.animation.skeleton import Skeleton
from pvibr.maths import skinning


class Model:
    """Bodies on a skeleton, and where a pose takes them.

    Parameters
    ----------
    meshes : sequence of Body
        The meshes.
    skeleton : Skeleton, optional
        Joints; default none.
    correctives : Correctives, optional
        Pose space deformation.

    Raises
    ------
    ValueError
        If a node is out of the skeleton's range.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.animation import FigureMesh
    >>> from pvibr.animation.model import Model
    >>> Model([FigureMesh(pv.Cube())]).bounds().round(3).tolist()
    [-0.5, 0.5, -0.5, 0.5, -0.5, 0.5]
    """

    def __init__(self, meshes, skeleton=None, correctives=None):
        self.meshes = tuple(meshes)
        self.skeleton = Skeleton([], Pose(np.zeros((0, 3)))) if skeleton is None else skeleton
        self.correctives = correctives
        self._check_nodes()

    def _check_nodes(self):
        for i, mesh in enumerate(self.meshes):
            nodes = [mesh.node] if mesh.skin is None else mesh.skin.nodes
            if len(nodes) and not -1 <= min(nodes) <= max(nodes) < len(self.skeleton):
                msg = (
                    f'meshes[{i}] hangs on the joints {min(nodes)} to {max(nodes)}; the skeleton '
                    f'has {len(self.skeleton)}.'
                )
                raise ValueError(msg)

    @cached_property
    def rest(self):
        """Pose at rest, with the weights that the morph targets rest at."""
        weights = [mesh.morphs.weights for mesh in self.meshes if mesh.morphs is not None]
        return self.skeleton.rest.replaced(weights=np.concatenate([np.zeros(0), *weights]))

    def world(self, pose=None):
        """Return the matrices of all joints.

        Parameters
        ----------
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            A pose, or the ``figure_from_joint`` matrices themselves; default at rest.

        Returns
        -------
        numpy.ndarray, shape (..., n, 4, 4), float64
            ``figure_from_joint``.

        Raises
        ------
        ValueError
            If there is another number of joints.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> Figure([FigureMesh(pv.Cube())]).world().shape
        (0, 4, 4)
        """
        if pose is None or isinstance(pose, Pose):
            return self.skeleton.world(self.rest if pose is None else pose)
        world = as_matrices(pose, 'pose')
        if world.shape[-3] != len(self.skeleton):
            msg = f'pose has {world.shape[-3]} matrices, the skeleton {len(self.skeleton)} joints.'
            raise ValueError(msg)
        return world

    def weights(self, index, pose=None):
        """Return the morph weights of one mesh.

        Parameters
        ----------
        index : int
            Number of the mesh.
        pose : Pose, optional
            A pose; default, and where it holds no weights, at rest.

        Returns
        -------
        numpy.ndarray, shape (..., t), float64
            One weight per target of that mesh.

        Raises
        ------
        ValueError
            If the pose holds another number of weights.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> Figure([FigureMesh(pv.Cube())]).weights(0).shape
        (0,)
        """
        weights = self.rest.weights
        if isinstance(pose, Pose) and pose.weights.shape[-1]:
            if pose.weights.shape[-1] != len(weights):
                many = pose.weights.shape[-1]
                msg = f'the pose has {many} morph weights, the figure {len(weights)} targets.'
                raise ValueError(msg)
            weights = pose.weights
        first = sum(mesh.n_targets for mesh in self.meshes[:index])
        return weights[..., first : first + self.meshes[index].n_targets]

    def posed(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return a mesh's points and normals in a pose: the reference for all other ways.

        Parameters
        ----------
        index : int
            Number of the mesh.
        pose : Pose or array_like, shape (n, 4, 4), optional
            One pose, or the ``figure_from_joint`` matrices; default at rest.
        skinning : {'linear', 'dual'}
            How joints are blended.
        bulge : float
            Share of the dual quaternions, see :func:`pvibr.maths.skinning.dual_blend`.

        Returns
        -------
        points : numpy.ndarray, shape (v, 3), float64
            Points in the figure's space.
        normals : numpy.ndarray, shape (v, 3), float64
            Unit normals.

        Raises
        ------
        ValueError
            If the pose does not fit, or holds several poses.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> points, normals = Figure([FigureMesh(pv.Sphere())]).posed(0)
        >>> abs(points - 0.5 * normals).max() < 1e-2
        np.True_
        """
        world = self.world(pose)
        if world.ndim != 3:
            msg = f'pose holds {world.shape[:-3]} poses; one is posed at a time.'
            raise ValueError(msg)
        points, normals = self._deformed(index, pose)
        matrices = self._moves(self.meshes[index], world, skinning, bulge)
        return _moved(matrices, points, normals)

    def layers(self, index, pose=None):
        """Return what is added to a mesh before the skeleton moves it.

        Parameters
        ----------
        index : int
            Number of the mesh.
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            A pose; default at rest.

        Returns
        -------
        list of (Morphs, numpy.ndarray)
            The mesh's morph targets and the correctives, each with weights of shape (..., t).

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> Figure([FigureMesh(pv.Cube())]).layers(0)
        []
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
        """Return points and normals before the skeleton moves them."""
        mesh = self.meshes[index]
        points, normals = mesh.points, mesh.normals
        if mesh.frames is not None:
            points, normals = mesh.frames.sample(getattr(pose, 'time', 0.0))
        for morphs, weights in self.layers(index, pose):
            points = points + morphs.total('positions', weights, len(points))
            normals = normals + morphs.total('normals', weights, len(points))
        return points, normals

    def colors(self, index, pose=None):
        """Return a mesh's colours in a pose.

        Parameters
        ----------
        index : int
            Number of the mesh.
        pose : Pose or array_like, shape (n, 4, 4), optional
            One pose; default at rest.

        Returns
        -------
        numpy.ndarray, shape (v, c), uint8 or float, or None
            The array that ``look`` names as colours of the points, with what morph targets add:
            differences count the full range, of bytes too, as 1. ``None`` if the look has no
            such colours.

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
        given = np.asarray(mesh.mesh.point_data[name])
        full = 255 if given.dtype == np.uint8 else 1
        colors = given.astype(np.float64)
        for morphs, weights in self.layers(index, pose):
            change = morphs.total('colors', weights, len(colors))[:, : colors.shape[1]]
            colors[:, : change.shape[1]] += full * change
        colors = np.clip(colors, 0, full)
        return (colors + 0.5 if full == 255 else colors).astype(given.dtype)

    def tangents(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return a mesh's tangents in a pose.

        Parameters
        ----------
        index : int
            Number of the mesh.
        pose : Pose or array_like, shape (n, 4, 4), optional
            One pose; default at rest.
        skinning : {'linear', 'dual'}
            How joints are blended.
        bulge : float
            Share of the dual quaternions.

        Returns
        -------
        numpy.ndarray, shape (v, 3), float64, or None
            Unit tangents; ``None`` if the mesh has no ``'Tangents'``.

        Examples
        --------
        >>> import numpy as np
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> mesh = pv.Plane()
        >>> mesh['Tangents'] = np.tile([2.0, 0.0, 0.0], (mesh.n_points, 1))
        >>> Figure([FigureMesh(mesh)]).tangents(0)[0].tolist()
        [1.0, 0.0, 0.0]
        """
        mesh = self.meshes[index]
        if 'Tangents' not in mesh.mesh.point_data:
            return None
        tangents = np.array(mesh.mesh.point_data['Tangents'][:, :3], dtype=np.float64)
        for morphs, weights in self.layers(index, pose):
            tangents += morphs.total('tangents', weights, len(tangents))
        matrices = self._moves(mesh, self.world(pose), skinning, bulge)
        moved = np.einsum('...ij,...j->...i', matrices[..., :3], tangents)
        lengths = np.linalg.norm(moved, axis=1, keepdims=True)
        return np.divide(moved, lengths, out=np.zeros_like(moved), where=lengths > 0)

    def bounds(self, pose=None, skinning='linear'):
        """Return boxes that hold the posed figure, from the boxes of its joints.

        They are somewhat larger than needed, and cheap: no vertex is moved.

        Parameters
        ----------
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            One pose or many, or ``figure_from_joint`` matrices; default at rest.
        skinning : {'linear', 'dual'}
            How joints are blended.

        Returns
        -------
        numpy.ndarray, shape (..., 6), float64
            x, y and z, each from and to, in the figure's space; from 1 to -1, as PyVista has
            it, if there are no points.

        Raises
        ------
        ValueError
            If the pose does not fit.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> Figure([FigureMesh(pv.Cube())]).bounds().round(3).tolist()
        [-0.5, 0.5, -0.5, 0.5, -0.5, 0.5]
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
    def _boxes(self):
        return [Boxes(mesh) for mesh in self.meshes]

    @staticmethod
    def _moves(mesh, world, how, bulge):
        if mesh.skin is not None:
            return mesh.skin.blend(world, how, bulge)
        return (np.eye(4) if mesh.node < 0 else world[mesh.node])[None, :3]


def _moved(matrices, points, normals):
    return skinning.moved_points(matrices, points), skinning.moved_normals(matrices, normals)
