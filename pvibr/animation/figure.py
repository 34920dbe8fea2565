"""A figure: meshes, the skeleton that moves them, and clips."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.animation import figure_sources
from pvibr.animation.clip import Clip
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.joint_tables import joint_table
from pvibr.animation.model import Model
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.core.arguments import checked_positive
from pvibr.core.params import checked_flag


class Figure(Model):
    """An animated model: meshes, their skeleton and clips.

    Parameters
    ----------
    meshes : sequence of FigureMesh
        The meshes.
    skeleton : Skeleton, optional
        Joints; default none.
    clips : sequence of Clip
        Animations, played by name.
    correctives : Correctives, optional
        Pose space deformation.
    cameras, lights : sequence
        Cameras and lights that move with joints, as :func:`pvibr.read_gltf` reads them.
    name : str
        Name of the figure.

    Raises
    ------
    ValueError
        If a mesh refers to a joint that the skeleton lacks.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh
    >>> Figure([FigureMesh(pv.Cube()), FigureMesh(pv.Sphere())]).mesh(merge=False).n_blocks
    2
    """

    def __init__(
        self, meshes, skeleton=None, clips=(), correctives=None, cameras=(), lights=(), name=''
    ):
        super().__init__(meshes, skeleton, correctives)
        self.clips = tuple(clips)
        self.cameras = tuple(cameras)
        self.lights = tuple(lights)
        self.name = name

    def __repr__(self):
        names = ', '.join(repr(clip.name) for clip in self.clips)
        return f'Figure({len(self.meshes)} meshes, {len(self.skeleton)} joints, clips: {names})'

    @classmethod
    def from_arrays(
        cls,
        points,
        faces,
        joints=None,
        weights=None,
        parents=None,
        rest=None,
        inverse_bind=None,
        *,
        normals=None,
        morphs=None,
        frames=None,
        names=None,
        clips=(),
        look=None,
        name='',
    ):
        """Make a figure of one mesh from arrays.

        Parameters
        ----------
        points : array_like, shape (v, 3)
            Vertices at rest.
        faces : array_like of int
            Triangles (f, 3), or polygons in PyVista's flat format.
        joints : array_like of int, shape (v, k), optional
            Up to eight joints of each vertex. Without them ``weights`` has a column per joint.
        weights : array_like, shape (v, k) or (v, n), optional
            Blend weights; normalised to sum to one.
        parents : array_like of int, shape (n,), optional
            Parent of each joint, -1 for a root.
        rest : Pose or array_like, shape (n, 4, 4), optional
            Rest pose, relative to the parents.
        inverse_bind : array_like, shape (n, 4, 4), optional
            Inverse bind matrices, ``joint_from_mesh``; default the inverse of the rest pose.
        normals : array_like, shape (v, 3), optional
            Normals at rest; default computed.
        morphs : Morphs, optional
            Morph targets.
        frames : VertexAnimation, optional
            Vertex animation.
        names : sequence of str, optional
            Names of the joints.
        clips : sequence of Clip
            Animations.
        look : dict, optional
            Keywords of ``Plotter.add_mesh``.
        name : str
            Name of the figure.

        Raises
        ------
        ValueError
            If parts of a skeleton are missing, or arrays do not fit.

        Examples
        --------
        A strip that is bent at its middle.

        >>> import numpy as np
        >>> from pvibr import Figure
        >>> from pvibr.animation import Pose
        >>> points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]
        >>> bone = np.eye(3)[[0, 0]] * [[0], [1]]
        >>> strip = Figure.from_arrays(
        ...     points,
        ...     [[0, 1, 3], [1, 2, 3]],
        ...     weights=[[1, 0], [1, 0], [0, 1], [0, 1]],
        ...     parents=[-1, 0],
        ...     rest=Pose(bone),
        ... )
        >>> bent = Pose(bone, [[1, 0, 0, 0], [1, 0, 1, 0]])
        >>> strip.posed(0, bent)[0][2].round(12).tolist()
        [1.0, 0.0, -1.0]
        """
        mesh = figure_sources.surface_of(points, faces, normals)
        skeleton, skin = figure_sources.skeleton_and_skin(
            joints, weights, parents, rest, inverse_bind, names
        )
        meshes = [FigureMesh(mesh, -1, skin, morphs, frames, look or {}, name)]
        return cls(meshes, skeleton, clips, name=name)

    @classmethod
    def from_series(cls, meshes, times=None, *, interpolation='linear', look=None, name='series'):
        """Make a figure from a time series of meshes that differ in their points only.

        Parameters
        ----------
        meshes : sequence of pyvista.DataSet, pyvista.MultiBlock, path, paths or reader
            One mesh per time, a list of files, or a file of a series (``.pvd``, ...). Volumes are
            replaced by their outer surface. Data arrays are those of the first mesh.
        times : array_like, shape (f,), optional
            Times in seconds, increasing from 0 or later; default those of the file, or one mesh
            per second.
        interpolation : {'linear', 'step', 'quadratic', 'cubic'}
            Interpolation between meshes.
        look : dict, optional
            Keywords of ``Plotter.add_mesh``.
        name : str
            Name of the figure and of its clip.

        Returns
        -------
        Figure
            A figure of one vertex animated mesh, with one clip of the length of the series.

        Raises
        ------
        ValueError
            If the meshes differ in their faces or number of points.
        FileNotFoundError
            If there is no such file.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> growing = Figure.from_series([pv.Sphere(radius=r) for r in (1, 2)])
        >>> round(growing.mesh(0.5).length / pv.Sphere(radius=1.5).length, 6)
        1.0
        """
        surfaces, times = figure_sources.series_of(meshes, times)
        vertex_frames = VertexAnimation.from_meshes(surfaces, times, interpolation)
        if vertex_frames.times[0] < 0:
            raise ValueError(f'times[0] must be 0 or later, got {vertex_frames.times[0]}')
        mesh = FigureMesh(surfaces[0], frames=vertex_frames, look=look or {}, name=name)
        return cls([mesh], clips=[Clip(name, [], vertex_frames.times[-1])], name=name)

    @classmethod
    def from_scene(cls, scene, *, clips=(), name=''):
        """Make a figure from a trimesh scene; its graph becomes the skeleton.

        Parameters
        ----------
        scene : trimesh.Scene
            Meshes and their scene graph.
        clips : sequence of Clip
            Animations of the joints, in the order of ``skeleton.names``.
        name : str
            Name of the figure.

        Returns
        -------
        Figure
            One mesh per node with a geometry, with its colours and texture.

        Raises
        ------
        ValueError
            If a node's matrix is sheared or singular.

        Examples
        --------
        >>> import trimesh
        >>> from pvibr import Figure
        >>> figure = Figure.from_scene(trimesh.Scene({'box': trimesh.creation.box()}))
        >>> figure.skeleton.names
        ('world', 'box')
        """
        meshes, skeleton = figure_sources.scene_of(scene)
        return cls(meshes, skeleton, clips, name=name)

    def clip(self, clip):
        """Return a clip; None if the figure has no clips and ``clip`` is None.

        Parameters
        ----------
        clip : str, int, Clip or None
            Name, index, the clip itself, or ``None`` for the first one.

        Raises
        ------
        ValueError
            If there is no such clip.
        """
        if clip is None:
            return self.clips[0] if self.clips else None
        if hasattr(clip, 'local_time'):
            return clip
        for i, candidate in enumerate(self.clips):
            if not np.ndim(clip) and clip in (candidate.name, i):
                return candidate
        names = ', '.join(repr(candidate.name) for candidate in self.clips) or 'none'
        raise ValueError(f'clip must be in the figure ({names}), got {clip!r}')

    def sample(self, time, clip=None, loop=True):
        """Return the poses at given times, of shape ``time.shape``.

        Parameters
        ----------
        time : array_like, shape (...)
            Times in seconds.
        clip : str, int or Clip, optional
            Clip; default the first one, or the rest pose if there is none.
        loop : bool or 'pingpong'
            Restart at the end, hold the last pose, or play back and forth.

        Raises
        ------
        ValueError
            If there is no such clip.
        """
        active_clip = self.clip(clip)
        if active_clip is not None:
            return active_clip.sample(time, self.rest, loop)
        times, rest = np.asarray(time, dtype=np.float64), self.rest
        shape = times.shape + rest.translation.shape
        return rest.replaced(translation=np.broadcast_to(rest.translation, shape), time=times)

    def mesh(
        self, time=0, clip=None, *, pose=None, skinning='linear', bulge=1.0, loop=True, merge=True
    ):
        """Return the posed figure as data, for any backend and for filters.

        Parameters
        ----------
        time : float
            Time in seconds.
        clip : str, int or Clip, optional
            Clip; default the first one, or the rest pose if there is none.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A pose in place of time and clip.
        skinning : {'linear', 'dual'}
            Linear blend or dual quaternion skinning.
        bulge : float
            Share of dual quaternions, see :func:`pvibr.animation.skinning.dual_blend`.
        loop : bool
            Restart at the end; otherwise hold the last pose.
        merge : bool
            Return one mesh, with the data that all have; False keeps them apart with their own.

        Returns
        -------
        pyvista.PolyData or pyvista.MultiBlock
            Posed copies of the meshes with their normals and data; a MultiBlock without `merge`.

        Raises
        ------
        ValueError
            If there is no such clip or the pose does not fit.
        """
        merge = checked_flag('merge', merge)
        pose = self.sample(time, clip, loop) if pose is None else pose
        meshes = [self.posed_mesh(i, pose, skinning, bulge) for i in range(len(self.meshes))]
        if merge:
            first, *others = meshes or [pv.PolyData()]
            return first.append_polydata(*others) if others else first
        names = [mesh.name or f'mesh{i}' for i, mesh in enumerate(self.meshes)]
        blocks = pv.MultiBlock()
        for name, mesh in zip(names, meshes, strict=True):
            blocks.append(mesh, name)
        return blocks

    def joints(self, time=0.0, clip=None, *, pose=None, loop=True, world=True):
        """Return where the joints are, as a table: a DataFrame takes it, and ``add_instances``.

        Parameters
        ----------
        time : float
            Time in seconds.
        clip : str, int or Clip, optional
            Clip; default the first one, or the rest pose if there is none.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A pose in place of time and clip.
        loop : bool
            Restart at the end; otherwise hold the last pose.
        world : bool
            In the figure's space, otherwise relative to the parents.

        Returns
        -------
        dict of str to numpy.ndarray, shape (n,)
            ``joint`` (name), ``parent`` (index, -1 for roots), ``x``, ``y``, ``z``, a unit
            quaternion ``qw``, ``qx``, ``qy``, ``qz``, and ``sx``, ``sy``, ``sz``.

        Raises
        ------
        ValueError
            If there is no such clip or the pose does not fit.

        Examples
        --------
        >>> from pvibr import Figure
        >>> from pvibr.animation import Pose, Skeleton
        >>> arm = Figure([], Skeleton([-1, 0], Pose([[0, 0, 0], [2, 0, 0]]), ['upper', 'lower']))
        >>> arm.joints()['x'].tolist()
        [0.0, 2.0]
        """
        pose = self.sample(time, clip, loop) if pose is None else pose
        return joint_table(self.skeleton, self.world(pose), world)

    def upright(self):
        """Return the figure turned from y up, as in glTF, to z up, by a root joint ``'upright'``.

        Returns
        -------
        Figure
            The turned figure; meshes and clips are shared.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> tall = Figure([FigureMesh(pv.Cube(y_length=3))])
        >>> [round(size, 3) for size in tall.upright().mesh().bounds_size]
        [1.0, 1.0, 3.0]
        """
        meshes, skeleton = figure_sources.upright(self.meshes, self.skeleton)
        rest = self.correctives, self.cameras, self.lights, self.name
        return Figure(meshes, skeleton, self.clips, *rest)

    def add_lights(self, plotter, pose=None, *, exposure=1.0):
        """Add the lights of the figure's file to a plotter, placed by a pose.

        :meth:`pvibr.AnimatedActor.add_lights` adds lights that move with an actor.

        Parameters
        ----------
        plotter : pyvista.Plotter
            The plotter; lights are added to its active renderer.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A pose; default at rest.
        exposure : float
            Factor of the intensities, which files give in candela and lux: 1 is VTK's full light.

        Returns
        -------
        list of pyvista.Light
            The lights, in the order of ``figure.lights``.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pvibr
        >>> pl = pv.Plotter(lighting='none', off_screen=True)
        >>> pvibr.Figure([]).add_lights(pl)
        []
        >>> pl.close()
        """
        figure_from_joint = self.world(pose)
        lights = [light.placed(figure_from_joint, exposure) for light in self.lights]
        for light in lights:
            plotter.add_light(light)
        return lights

    def camera(self, camera=0, pose=None):
        """Return a camera of the figure's file, placed by a pose, for ``plotter.camera``.

        Parameters
        ----------
        camera : int or str
            Index or name, of ``figure.cameras``.
        pose : Pose or array_like, shape (n, 4, 4), optional
            A pose; default at rest.

        Returns
        -------
        pyvista.Camera
            The camera.

        Raises
        ------
        ValueError
            If there is no such camera.

        Examples
        --------
        >>> import pvibr
        >>> pvibr.Figure([]).camera('front')
        Traceback (most recent call last):
        ...
        ValueError: camera must be in the figure (none), got 'front'
        """
        for i, candidate in enumerate(self.cameras):
            if camera in (candidate.name, i):
                return candidate.placed(self.world(pose))
        names = ', '.join(repr(c.name or i) for i, c in enumerate(self.cameras)) or 'none'
        raise ValueError(f'camera must be in the figure ({names}), got {camera!r}')

    def series(self, clip=None, fps=30.0, *, skinning='linear'):
        """Return a clip as a time series of meshes.

        Parameters
        ----------
        clip : str, int or Clip, optional
            Clip; default the first one.
        fps : float
            Meshes per second.
        skinning : {'linear', 'dual'}
            Linear blend or dual quaternion skinning.

        Returns
        -------
        times : numpy.ndarray, shape (f,), float64
            Times in seconds, from 0 to the last step within the clip.
        meshes : list of pyvista.PolyData
            One mesh per time, as :meth:`mesh` returns it.

        Raises
        ------
        ValueError
            If there is no such clip or ``fps`` is not above 0.
        """
        checked_positive('fps', fps)
        active_clip = self.clip(clip)
        duration = 0.0 if active_clip is None else active_clip.duration
        # A step just past the end by rounding still counts.
        times = np.arange(np.floor(duration * fps * (1 + 1e-12)) + 1) / fps
        return times, [self.mesh(t, active_clip, skinning=skinning, loop=False) for t in times]

    def save(self, path):
        """Write the figure as binary glTF 2.0.

        Skins, clips, morph targets, colours and textures are written, rounded to float32. Linear
        and stepped vertex animations become morph targets. Correctives, cameras and lights are
        left out.

        Parameters
        ----------
        path : str or pathlib.Path
            A ``.glb`` file; an existing one is replaced only after a complete write.

        Raises
        ------
        ValueError
            If the file name ends otherwise, or glTF cannot express a clip or vertex animation.

        Warns
        -----
        pvibr.PvibrWarning
            Names what is left out.
        """
        from pvibr.animation.write_gltf import write_glb

        write_glb(self, path)
