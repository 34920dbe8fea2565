"""A figure: meshes, the skeleton that moves them, and its clips."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.animation.boxes import Boxes
from pvibr.animation.pose import Pose, as_matrices
from pvibr.animation.skeleton import Skeleton
from pvibr.maths import skinning


class Figure:
    """Meshes that move: bodies, their skeleton and clips.

    Parameters
    ----------
    bodies : sequence of Body
        The meshes.
    skeleton : Skeleton, optional
        Joints; default none.
    clips : sequence of Clip
        Movements, played by name.
    correctives : object, optional
        Pose space deformation, see :mod:`pvibr.animation.correctives`.
    cameras : sequence
        Cameras that came with the figure.
    lights : sequence
        Lights that came with the figure.
    name : str
        Name of the figure.

    Raises
    ------
    ValueError
        If a node is out of the skeleton's range.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Body, Figure
    >>> Figure([Body(pv.Cube())]).mesh().n_cells
    6
    """

    def __init__(
        self,
        bodies,
        skeleton=None,
        clips=(),
        correctives=None,
        cameras=(),
        lights=(),
        name='',
    ):
        self.bodies = tuple(bodies)
        self.skeleton = Skeleton([], Pose(np.zeros((0, 3)))) if skeleton is None else skeleton
        self.clips = tuple(clips)
        self.correctives = correctives
        self.cameras = tuple(cameras)
        self.lights = tuple(lights)
        self.name = name
        self._check_nodes()

    def __repr__(self):
        names = ', '.join(repr(clip.name) for clip in self.clips)
        return f'Figure({len(self.bodies)} bodies, {len(self.skeleton)} joints, clips: {names})'

    def _check_nodes(self):
        for i, body in enumerate(self.bodies):
            nodes = [body.node] if body.skin is None else body.skin.nodes
            if len(nodes) and not -1 <= min(nodes) <= max(nodes) < len(self.skeleton):
                msg = (
                    f'bodies[{i}] hangs on the joints {min(nodes)} to {max(nodes)}; the skeleton '
                    f'has {len(self.skeleton)}.'
                )
                raise ValueError(msg)

    @cached_property
    def rest(self):
        """Pose at rest, with the weights that the morph targets rest at."""
        weights = [body.morphs.weights for body in self.bodies if body.morphs is not None]
        return self.skeleton.rest.replaced(weights=np.concatenate([np.zeros(0), *weights]))

    def clip(self, clip):
        """Return a clip.

        Parameters
        ----------
        clip : str, int, Clip or None
            Its name, its number, itself, or ``None`` for the first one there is.

        Returns
        -------
        Clip or None
            The clip; ``None`` if none is asked for and the figure has none.

        Raises
        ------
        ValueError
            If there is no such clip; the message names those that exist.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Body, Clip, Figure
        >>> Figure([Body(pv.Cube())], clips=[Clip('Walk', [])]).clip('Walk')
        Clip('Walk', 0 tracks, 0 s)
        """
        if clip is None:
            return self.clips[0] if self.clips else None
        if hasattr(clip, 'sample'):
            return clip
        for i, known in enumerate(self.clips):
            if clip in (known.name, i):
                return known
        names = ', '.join(repr(known.name) for known in self.clips) or 'none'
        msg = f'there is no clip {clip!r}; there are {names}.'
        raise ValueError(msg)

    def sample(self, time, clip=None, loop=True):
        """Return the pose at times.

        Parameters
        ----------
        time : array_like, shape (...)
            Seconds.
        clip : str, int or Clip, optional
            What is played; default the first clip, or rest.
        loop : bool
            Begin again after the end.

        Returns
        -------
        Pose
            Of shape ``time.shape``.

        Raises
        ------
        ValueError
            If there is no such clip.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube())]).sample([0.0, 1.0]).shape
        (2,)
        """
        found = self.clip(clip)
        if found is not None:
            return found.sample(time, self.rest, loop)
        times = np.asarray(time, dtype=np.float64)
        rest = self.rest
        rows = times.shape
        return Pose(
            np.broadcast_to(rest.translation, rows + rest.translation.shape),
            rest.rotation,
            rest.scale,
            rest.weights,
            times,
        )

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
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube())]).world().shape
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
        """Return the morph weights of one body.

        Parameters
        ----------
        index : int
            Number of the body.
        pose : Pose, optional
            A pose; default, and where it holds no weights, at rest.

        Returns
        -------
        numpy.ndarray, shape (..., t), float64
            One weight per target of that body.

        Raises
        ------
        ValueError
            If the pose holds another number of weights.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube())]).weights(0).shape
        (0,)
        """
        weights = self.rest.weights
        if isinstance(pose, Pose) and pose.weights.shape[-1]:
            if pose.weights.shape[-1] != len(weights):
                many = pose.weights.shape[-1]
                msg = f'the pose has {many} morph weights, the figure {len(weights)} targets.'
                raise ValueError(msg)
            weights = pose.weights
        first = sum(body.n_targets for body in self.bodies[:index])
        return weights[..., first : first + self.bodies[index].n_targets]

    def posed(self, index, pose=None, skinning='linear', bulge=1.0):
        """Return a body's points and normals in a pose: the reference for all other ways.

        Parameters
        ----------
        index : int
            Number of the body.
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
        >>> from pvibr import Body, Figure
        >>> points, normals = Figure([Body(pv.Sphere())]).posed(0)
        >>> abs(points - 0.5 * normals).max() < 1e-2
        np.True_
        """
        world = self.world(pose)
        if world.ndim != 3:
            msg = f'pose holds {world.shape[:-3]} poses; one is posed at a time.'
            raise ValueError(msg)
        points, normals = self._deformed(index, pose)
        matrices = self._moves(self.bodies[index], world, skinning, bulge)
        return _moved(matrices, points, normals)

    def layers(self, index, pose=None):
        """Return what is added to a body before the skeleton moves it.

        Parameters
        ----------
        index : int
            Number of the body.
        pose : Pose or array_like, shape (..., n, 4, 4), optional
            A pose; default at rest.

        Returns
        -------
        list of (Morphs, numpy.ndarray)
            The body's morph targets and the correctives, each with weights of shape (..., t).

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube())]).layers(0)
        []
        """
        layers = []
        if self.bodies[index].morphs is not None:
            layers.append((self.bodies[index].morphs, self.weights(index, pose)))
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
        body = self.bodies[index]
        points, normals = body.points, body.normals
        if body.frames is not None:
            points, normals = body.frames.sample(getattr(pose, 'time', 0.0))
        for morphs, weights in self.layers(index, pose):
            points = points + morphs.total('positions', weights, len(points))
            normals = normals + morphs.total('normals', weights, len(points))
        return points, normals

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
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube())]).bounds().round(3).tolist()
        [-0.5, 0.5, -0.5, 0.5, -0.5, 0.5]
        """
        world = self.world(pose)
        time = getattr(pose, 'time', 0.0)
        boxes = [
            boxes.around(world, self.layers(i, pose), time, skinning)
            for i, boxes in enumerate(self._boxes)
            if len(self.bodies[i].points)
        ]
        if not boxes:
            return np.broadcast_to([1.0, -1.0] * 3, (*world.shape[:-3], 6))
        low, high = np.min(boxes, 0)[..., ::2], np.max(boxes, 0)[..., 1::2]
        return np.stack([low, high], -1).reshape(*low.shape[:-1], 6)

    @cached_property
    def _boxes(self):
        return [Boxes(body) for body in self.bodies]

    @staticmethod
    def _moves(body, world, how, bulge):
        if body.skin is not None:
            return body.skin.blend(world, how, bulge)
        return (np.eye(4) if body.node < 0 else world[body.node])[None, :3]

    def mesh(self, time=0.0, clip=None, *, pose=None, skinning='linear', loop=True):
        """Return the figure at a time as data for any backend and for filters.

        Parameters
        ----------
        time : float
            Seconds.
        clip : str, int or Clip, optional
            What is played; default the first clip, or rest.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A pose in place of a time.
        skinning : {'linear', 'dual'}
            How joints are blended.
        loop : bool
            Begin again after the end.

        Returns
        -------
        pyvista.PolyData or pyvista.MultiBlock
            Posed copies of the meshes, with their normals and other data; a MultiBlock if the
            figure has several bodies or none.

        Raises
        ------
        ValueError
            If there is no such clip or the pose does not fit.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Body, Figure
        >>> Figure([Body(pv.Cube()), Body(pv.Sphere())]).mesh().n_blocks
        2
        """
        pose = self.sample(time, clip, loop) if pose is None else pose
        meshes = [self._posed_mesh(i, pose, skinning) for i in range(len(self.bodies))]
        if len(meshes) == 1:
            return meshes[0]
        names = [body.name or f'body{i}' for i, body in enumerate(self.bodies)]
        blocks = pv.MultiBlock()
        for name, mesh in zip(names, meshes, strict=True):
            blocks.append(mesh, name)
        return blocks

    def _posed_mesh(self, index, pose, skinning):
        mesh = self.bodies[index].mesh.copy(deep=True)
        points, normals = self.posed(index, pose, skinning)
        mesh.points = points
        mesh.point_data['Normals'] = normals
        mesh.point_data.active_normals_name = 'Normals'
        return mesh


def _moved(matrices, points, normals):
    return skinning.moved_points(matrices, points), skinning.moved_normals(matrices, normals)
