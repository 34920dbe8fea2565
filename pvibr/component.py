"""``plotter.ibr``: what users add to a subplot, and what they read of it."""

from __future__ import annotations

import atexit
import math
import weakref
from typing import Any

import pyvista as pv

from pvibr.capture.adaptive_quality import AdaptiveQuality
from pvibr.capture.clock import Clock
from pvibr.capture.movies import Film, frame_times, write_movie
from pvibr.capture.tiled_screenshot import TiledScreenshot
from pvibr.core import state_files
from pvibr.core.errors import ClosedError
from pvibr.core.params import Param, params_of
from pvibr.core.report import Report
from pvibr.export.web_report import Page, Watch, WebReport, warn_missing, web_report
from pvibr.pipeline import Pipeline

_attached: weakref.WeakValueDictionary = weakref.WeakValueDictionary()


@pv.register_plotter_component('ibr')
class IBRComponent:
    """Image-based rendering of a plotter; it acts on the active subplot.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        The plotter.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> print(pl.ibr.report())
    effect  state  ms  bytes  why
    0 frames, 0 bytes between effects
    >>> pl.close()
    """

    interactive_frame_ms = Param(
        100.0,
        'What a frame may take while the view moves: quality is lowered where it takes '
        'longer, and is full again at rest; 0 never lowers it.',
        range='[0, inf)',
        unit='ms',
    )

    def __init__(self, plotter):
        self._plotter = plotter
        self._pipelines: list[Pipeline] = []
        self._time = 0.0
        self._clock = Clock(plotter, self._show_time)
        self._adaptive_quality = AdaptiveQuality(
            plotter, lambda: self.interactive_frame_ms, lambda: self._clock.ticking
        )
        self._shots = TiledScreenshot(plotter, self._all_effects, self._adaptive_quality.full)
        self._numbered: list = []
        self._told: list = []
        self._followed: Any = None
        self._followers: list = []
        self._closed = False

    @property
    def pipeline(self) -> Pipeline:
        """The active subplot's pipeline."""
        if self._closed or getattr(self._plotter, '_closed', False):
            msg = 'the plotter is closed: make a new one and add to its ibr'
            raise ClosedError(msg)
        renderer = self._plotter.renderer
        for pipeline in self._pipelines:
            if pipeline.renderer is renderer:
                return pipeline
        pipeline = Pipeline(renderer, self._adaptive_quality)
        pipeline.time = self._time
        pipeline.watch = Watch(renderer, self._handed_over)
        self._pipelines.append(pipeline)
        return pipeline

    def _all_effects(self):
        return [effect for pipeline in self._pipelines for effect in pipeline.effects]

    @property
    def quality(self) -> float:
        """Quality of the last frame: below 1 if one exceeded `interactive_frame_ms` in motion."""
        return self._adaptive_quality.latest

    @property
    def effects(self) -> tuple:
        """Effects and things in the active subplot, in the order in which they run."""
        return self.pipeline.effects

    @property
    def time(self) -> float:
        """Seconds; what is animated shows this moment."""
        return self._time

    @time.setter
    def time(self, seconds):
        try:
            finite = math.isfinite(float(seconds))
        except (TypeError, ValueError, OverflowError):
            finite = False
        if not finite:
            msg = f'time = {seconds!r:.60}: must be a finite number of seconds'
            raise ValueError(msg)
        self._show_time(float(seconds))
        self._clock.set(self._time)

    def _show_time(self, seconds):
        self._time = seconds
        for pipeline in self._pipelines:
            pipeline.time = seconds
            for thing in pipeline.things:
                thing.follow()

    def play(self, speed=1.0, loop=None, *, fps=None):
        """Let the time go on by itself, in windows, notebooks and movies.

        A window's time is that of the wall. So is that of pages whose pictures come from a server
        (``jupyter_backend='server'`` or ``'trame'``, applications of trame), from the first frame
        that one asks for. While a movie is open, each ``plotter.write_frame()`` moves the time on
        by one frame's share of a second. Off screen nothing else does: set `time` there.

        Parameters
        ----------
        speed : float
            Seconds in a second of those who look; backward below 0.
        loop : float, optional
            Seconds after which it begins again where it began.
        fps : float, optional
            Frames of a movie in a second; by default those that the movie was opened with.

        Raises
        ------
        ValueError
            Where a number is not allowed.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
        >>> pl.ibr.play(speed=0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     pl.open_gif(pathlib.Path(folder) / 'ball.gif', fps=10)
        ...     for _ in range(4):
        ...         pl.write_frame()
        ...     pl.close()
        >>> pl.ibr.time
        0.2
        """
        self._check_open()
        self._clock.start(self._time, speed=speed, loop=loop, fps=fps)

    def stop(self):
        """Let the time stand still, at what it is now."""
        self._clock.stop()

    @property
    def playing(self) -> bool:
        """Whether the time goes on by itself."""
        return self._clock.running

    def add(self, effect):
        """Put an effect or a thing into the active subplot.

        Parameters
        ----------
        effect : pvibr.Effect
            In no subplot yet.

        Returns
        -------
        pvibr.Effect
            The same, so that its settings can be changed.

        Raises
        ------
        TypeError
            Where it is no effect.
        ValueError
            Where it is in a subplot already.
        ClosedError
            Where the plotter is closed.
        """
        return self.pipeline.add(effect)

    def add_instances(
        self,
        mesh,
        poses=None,
        *,
        name=None,
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw a mesh many times: near as a mesh, far as images, within an error.

        Parameters
        ----------
        mesh : dataset, MultiBlock, actor, trimesh object, path, or a list of these
            What is drawn.
        poses : array_like, shape (n, 3) or (n, 4, 4), optional
            Points or matrices, world units; the graph of a trimesh scene gives them otherwise.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.Instances`: ``max_error``, ``index``, ``scalars``, ``colors``,
            ``cmap``, ``clim``, ``opacity``, ``pickable``, and whatever ``add_mesh`` takes.

        Returns
        -------
        pvibr.Instances
            The instances; their settings can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.
        """
        from pvibr.instances.instances import Instances

        self._check_open()
        kwargs.setdefault('theme', getattr(self._plotter, 'theme', None))
        made = Instances(mesh, poses, name=name, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def add_animated(
        self,
        figure,
        poses=None,
        *,
        name=None,
        clip=None,
        skinning='linear',
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw a figure that moves, or a crowd of them, posed on the GPU.

        Parameters
        ----------
        figure : pvibr.Figure, path, trimesh.Scene, mesh, or a series of meshes
            Meshes, skeleton and clips; a ``.glb`` file; meshes that differ in their points only.
        poses : array_like, shape (n, 3) or (n, 4, 4), optional
            Where each one of a crowd is: points or matrices, world units.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        clip : str, int or Clip, optional
            What is played from time 0 on; the first one there is by default.
        skinning : {'linear', 'dual'}
            How joints are blended.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.AnimatedActor`: ``pickable``, ``bulge``, and whatever ``add_mesh``
            takes, which wins over the looks of the figure's bodies. With `poses` see
            :class:`pvibr.Crowd`: ``times``, ``clips``, ``speeds``, ``colors``, ``max_error``.

        Returns
        -------
        pvibr.AnimatedActor or pvibr.Crowd
            What plays clips and takes poses; a crowd where there are `poses`.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Clip, Skeleton, Track
        >>> rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2]])])
        >>> ball = FigureMesh(pv.Sphere(), node=0)
        >>> balloon = Figure(
        ...     [ball],
        ...     Skeleton([-1], [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]),
        ...     [rise],
        ... )
        >>> pl = pv.Plotter(off_screen=True)
        >>> actor = pl.ibr.add_animated(balloon, clip='rise')
        >>> pl.ibr.time = 0.5
        >>> actor.center
        (0.0, 0.0, 1.0)
        >>> pl.close()
        """
        from pvibr.figures.animated_actor import AnimatedActor
        from pvibr.figures.as_figure import as_figure
        from pvibr.figures.crowd import Crowd

        self._check_open()
        figure = as_figure(figure)
        kwargs |= {'name': name, 'skinning': skinning}
        kwargs.setdefault('theme', getattr(self._plotter, 'theme', None))
        if poses is None:
            made: AnimatedActor | Crowd = AnimatedActor(figure, clip=clip, **kwargs)
        else:
            kwargs.setdefault('clips', clip)
            made = Crowd(figure, poses, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def add_impostor(self, actors, *, name=None, render=False, **settings):
        """Draw actors as images of themselves, taken again only when the error asks for it.

        Parameters
        ----------
        actors : vtkActor, pvibr.Instances, or sequence of these
            In the active subplot, as :meth:`pyvista.Plotter.add_mesh` and :meth:`add_instances`
            return them; instances with ``hierarchical=True`` only.
        name : str, optional
            What reports call it; what had the name before is replaced.
        render : bool, optional
            Draw at once.
        **settings
            See :class:`pvibr.Impostor`: ``max_error``, ``budget_ms``, ``depth``,
            ``hierarchical``, ``memory``, ``views``.

        Returns
        -------
        pvibr.Impostor
            The actors stay what they are; its settings can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> heavy = pl.add_mesh(pv.Sphere(theta_resolution=300, phi_resolution=300))
        >>> impostor = pl.ibr.add_impostor(heavy, max_error=0.5)
        >>> impostor.max_error
        0.5
        >>> pl.close()
        """
        from pvibr.impostors.impostor import Impostor

        self._check_open()
        made = Impostor(actors, name=name, **settings)
        return self._add_thing(made, name, None, None, None, render)

    def add_image_layers(self, groups=None, *, name=None, render=False, **settings):
        """Draw parts of the scene as pictures, taken again only when they must be.

        Parameters
        ----------
        groups : sequence of vtkActor or sequences of them, optional
            The layers, each one actor or several, in this subplot; by default all actors of the
            subplot, by their depth.
        name : str, optional
            What reports call it; what had the name before is replaced.
        render : bool, optional
            Draw at once.
        **settings
            See :class:`pvibr.ImageLayers`: ``max_error``, ``max_shade``, ``warp``, ``overscan``,
            ``resolution``, ``blur``, ``count``, ``budget_ms``, ``memory``, ``only_if_faster``.

        Returns
        -------
        pvibr.ImageLayers
            The layers; their settings can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> ground, ball = pl.add_mesh(pv.Plane()), pl.add_mesh(pv.Sphere())
        >>> layers = pl.ibr.add_image_layers([ground, ball], max_error=0.5, blur=(2, 0))
        >>> layers.blur
        (2.0, 0.0)
        >>> pl.close()
        """
        from pvibr.image_layers.image_layers import ImageLayers

        self._check_open()
        made = ImageLayers(groups, name=name, **settings)
        return self._add_thing(made, name, None, None, None, render)

    def add_billboards(
        self,
        points,
        image,
        *,
        name=None,
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw an image at each point, turned toward the eye, all in one draw.

        Parameters
        ----------
        points : array_like, shape (n, 3), or dataset
            World units.
        image : path, array, pyvista.Texture, pvibr.LiveTexture, or a list of the first three
            What is shown; several are packed into one texture.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.Billboards`: ``size``, ``facing``, ``axis``, ``towards``,
            ``rotation``, ``index``, ``frames``, ``fps``, ``cutout``, ``size_unit``, ``anchor``,
            ``colors``, ``scalars``, ``cmap``, ``clim``, ``opacity``, ``lighting``.

        Returns
        -------
        pvibr.Billboards
            The billboards; their settings can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        FileNotFoundError
            Where there is no such image.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import numpy as np
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> dots = pl.ibr.add_billboards([[0, 0, 0], [1, 0, 0]], np.ones((8, 8)), size=0.5)
        >>> len(dots)
        2
        >>> pl.close()
        """
        from pvibr.billboards.billboards import Billboards

        self._check_open()
        made = Billboards(points, image, name=name, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def add_spheres(
        self,
        points,
        radius=0.5,
        *,
        name=None,
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw spheres, by the million, exact to the pixel.

        Parameters
        ----------
        points : array_like, shape (n, 3), or dataset
            Centres, world units.
        radius : float or array_like, shape (n,)
            Of all or of each, world units.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.Spheres`: ``color``, ``colors``, ``scalars``, ``cmap``, ``clim``,
            ``visible``, ``opacity``, ``lighting``, ``ambient``, ``diffuse``, ``specular``,
            ``specular_power``.

        Returns
        -------
        pvibr.Spheres
            The spheres; their centres, radii and looks can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]], [1.0, 0.5], color='red')
        >>> len(balls)
        2
        >>> pl.close()
        """
        from pvibr.quadrics.spheres import Spheres

        self._check_open()
        made = Spheres(points, radius, name=name, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def add_cylinders(
        self,
        points_a,
        points_b,
        radius=0.5,
        *,
        name=None,
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw cylinders, capsules or tubes, by the million, exact to the pixel.

        Parameters
        ----------
        points_a, points_b : array_like, shape (n, 3), or dataset
            Their ends, world units.
        radius : float or array_like, shape (n,)
            Of all or of each, world units.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.Cylinders`: ``caps``, ``blend``, ``color``, ``colors``, ``scalars``,
            ``cmap``, ``clim``, ``visible``, ``opacity``, ``lighting``, ``ambient``, ``diffuse``,
            ``specular``, ``specular_power``.

        Returns
        -------
        pvibr.Cylinders
            The cylinders; their places, sizes and looks can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> bonds = pl.ibr.add_cylinders([[0, 0, 0]], [[0, 0, 2]], 0.1, caps='round')
        >>> len(bonds)
        1
        >>> pl.close()
        """
        from pvibr.quadrics.cylinders import Cylinders

        self._check_open()
        made = Cylinders(points_a, points_b, radius, name=name, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def add_ellipsoids(
        self,
        points,
        radii=0.5,
        orientation=None,
        *,
        name=None,
        show_scalar_bar=None,
        scalar_bar_args=None,
        reset_camera=None,
        render=False,
        **kwargs,
    ):
        """Draw ellipsoids, by the million, exact to the pixel.

        Parameters
        ----------
        points : array_like, shape (n, 3), or dataset
            Centres, world units.
        radii : float or array_like, shape (n, 3) or (3,)
            Half axes of each or of all, world units.
        orientation : array_like, shape (n, 4), (4,), (n, 3, 3) or (3, 3), optional
            Quaternions (w, x, y, z), or matrices whose columns are the directions of the axes.
        name : str, optional
            What the plotter and reports call it; what had the name before is replaced.
        show_scalar_bar : bool, optional
            As in :meth:`pyvista.Plotter.add_mesh`; by default as the theme has it.
        scalar_bar_args : dict, optional
            As in :meth:`pyvista.Plotter.add_mesh`.
        reset_camera : bool, optional
            Whether the camera moves to show everything; default where it was never moved.
        render : bool, optional
            Draw at once.
        **kwargs
            See :class:`pvibr.Ellipsoids`: ``color``, ``colors``, ``scalars``, ``cmap``, ``clim``,
            ``visible``, ``opacity``, ``lighting``, ``ambient``, ``diffuse``, ``specular``,
            ``specular_power``.

        Returns
        -------
        pvibr.Ellipsoids
            The ellipsoids; their places, sizes and looks can be changed.

        Raises
        ------
        TypeError, ValueError
            Where an argument is not allowed; then nothing is added.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> eggs = pl.ibr.add_ellipsoids([[0, 0, 0], [2, 0, 0]], (0.5, 0.5, 0.8))
        >>> len(eggs)
        2
        >>> pl.close()
        """
        from pvibr.quadrics.ellipsoids import Ellipsoids

        self._check_open()
        made = Ellipsoids(points, radii, orientation, name=name, **kwargs)
        return self._add_thing(made, name, show_scalar_bar, scalar_bar_args, reset_camera, render)

    def _add_thing(self, thing, name, bar, bar_args, reset_camera, render):
        """Add what takes the place of whatever had its name."""
        pipeline = self.pipeline
        for old in [e for e in pipeline.effects if name is not None and e.name == name]:
            pipeline.remove(old)
        pipeline.add(thing)
        self._add_scalar_bar(thing, bar, bar_args)
        self._show(reset_camera, render)
        return thing

    def _add_scalar_bar(self, instances, wanted, options):
        mapper = instances.scalar_mapper()
        if mapper is None or not hasattr(self._plotter, 'add_scalar_bar'):
            return
        if wanted is None:
            wanted = self._plotter.theme.show_scalar_bar
        if wanted:
            options = {'title': instances.scalar_title()} | (options or {})
            self._plotter.add_scalar_bar(mapper=mapper, render=False, **options)

    def _show(self, reset_camera, render):
        renderer = self._plotter.renderer
        if reset_camera or (reset_camera is None and not getattr(renderer, 'camera_set', True)):
            self._plotter.reset_camera(render=False)
        if render:
            self._plotter.render()

    def remove(self, thing):
        """Take an effect or a thing out of its subplot.

        Parameters
        ----------
        thing : pvibr.Effect
            In one of the plotter's subplots.

        Raises
        ------
        ValueError
            Where it is in none.
        """
        for pipeline in self._pipelines:
            if thing in pipeline.effects:
                pipeline.remove(thing)
                return
        self.pipeline.remove(thing)  # says what is there

    def clear(self):
        """Take everything out of the active subplot."""
        self.pipeline.clear()

    def pick(self, x, y):
        """Return what is under a pixel of the active subplot.

        Parameters
        ----------
        x, y : int
            Pixels from the lower left corner of the window.

        Returns
        -------
        object or None
            What the first thing that is hit says of the hit; None where none is.
        """
        for thing in self.pipeline.effects:
            hit = thing.pick(x, y)
            if hit is not None:
                return hit
        return None

    def enable_picking(self, callback, *, side='left'):
        """Call a function with what a click hits.

        Parameters
        ----------
        callback : callable
            Takes what :meth:`pick` returned; it is not called where nothing was hit.
        side : {'left', 'right'}
            The mouse button.

        Raises
        ------
        TypeError
            Where the renderer has no PyVista plotter.
        """
        if not hasattr(self._plotter, 'track_click_position'):
            msg = 'picking by mouse needs a PyVista plotter; call pick(x, y) from your own events'
            raise TypeError(msg)

        def clicked(_point):
            hit = self.pick(*self._plotter.iren.get_event_position())
            if hit is not None:
                callback(hit)

        self._plotter.track_click_position(clicked, side=side)

    def disable_picking(self):
        """Call nothing on clicks any more."""
        self._plotter.untrack_click_position()

    def buffer(self, name):
        """Draw the active subplot and return one of its buffers.

        Normals and ids are those of opaque surfaces: translucent props and volumes are left out.

        Parameters
        ----------
        name : {'depth', 'normal', 'id', 'color'}
            ``'depth'`` is the distance along the view in world units, inf where nothing is;
            ``'normal'`` is in view space, toward the eye, 0 where nothing is or what is there is
            not lit; ``'id'`` is an index into `buffer_objects`, -1 where nothing is; ``'color'``
            is the picture with all effects and without annotations.

        Returns
        -------
        numpy.ndarray
            (height, width) or (height, width, channels) float32, top row first.

        Raises
        ------
        ValueError
            Where there is no such buffer.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
        >>> ball = pl.add_mesh(pv.Sphere())
        >>> ids = pl.ibr.buffer('id')
        >>> ids.shape, float(ids[24, 32]), float(ids[0, 0])
        ((48, 64), 0.0, -1.0)
        >>> pl.ibr.buffer_objects[0] is ball
        True
        >>> pl.close()
        """
        pipeline = self.pipeline
        self._show(None, False)
        tap = pipeline.buffer(name)
        self._numbered = tap.numbered
        return tap.array

    @property
    def buffer_objects(self) -> list:
        """Actors and things that the ids of the last `buffer` are indices into."""
        return list(self._numbered)

    def screenshot(
        self, filename=None, *, scale=None, size=None, transparent_background=None, return_img=True
    ):
        """Take a picture, of any size, in which effects have no seams.

        As ``plotter.screenshot``, but tiles of large pictures overlap by as much as the effects
        look around. Light that spreads over the picture, such as that of :class:`pvibr.Bloom`,
        is computed at the window's size.

        Parameters
        ----------
        filename : path, optional
            Where to; the ending says in which format.
        scale : int, optional
            How many times as large as the window. Lines, points and text have as many pixels as
            in a window as large, as with ``plotter.screenshot(scale=...)``.
        size : tuple of 2 int, optional
            Width and height of the picture in pixels instead; the window has its shape meanwhile,
            and is at most as large as it is now.
        transparent_background : bool, optional
            Whether the background is left out; by default as the theme has it.
        return_img : bool
            Whether the picture is returned.

        Returns
        -------
        numpy.ndarray, shape (h, w, 3 or 4), uint8, or None
            Row 0 at the top.

        Raises
        ------
        ValueError
            Where a number is not allowed, or both are given.
        OSError
            Where the file cannot be written; what was there is as it was.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
        >>> _ = pl.add_mesh(pv.Sphere())
        >>> pl.ibr.screenshot(scale=3).shape
        (144, 192, 3)
        >>> pl.ibr.screenshot(size=(150, 100)).shape
        (100, 150, 3)
        >>> pl.close()
        """
        self._check_open()
        image = self._shots.take(scale, size, transparent_background)
        if filename is not None:
            from pvibr.capture.montage import save

            save(filename, image)
        return image if return_img else None

    def movie(
        self,
        path,
        seconds,
        *,
        fps=30.0,
        start=None,
        speed=1.0,
        each=None,
        resume=True,
        progress=None,
    ):
        """Film what happens: each frame is of its own moment, however long it takes to draw.

        Frames are kept beside the movie until it is whole. What was broken off, by an error, a
        full disk or Ctrl-C, goes on where it stopped when the same call is made again, in another
        run too; time, cameras, settings and the window must be the same, or it begins anew.

        Parameters
        ----------
        path : path
            A movie (``.mp4``, ``.mov``, ``.mkv``, ``.webm``, ``.avi``: the extra ``movie``), a
            ``.gif``, or a folder of PNG files.
        seconds : float
            How long it is.
        fps : float
            Frames a second.
        start : float, optional
            The time at the first frame, seconds; by default :attr:`time`.
        speed : float
            Seconds in a second of those who look; backward below 0.
        each : callable, optional
            Called before each frame with its time, such as to move the camera. Each frame must
            follow from its time alone.
        resume : bool
            Whether frames of an earlier call are used.
        progress : bool, optional
            Whether a bar is shown on standard error; by default where that is a terminal.

        Returns
        -------
        pathlib.Path
            The movie, or the folder. Time and cameras are afterwards what they were.

        Raises
        ------
        ValueError
            Where a number or the ending is not allowed.
        ImportError
            Where the extra ``movie`` is needed and not installed.
        OSError
            Where a file cannot be written.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
        >>> _ = pl.add_mesh(pv.Cone())
        >>> def turn(time):
        ...     pl.view_isometric()
        ...     pl.camera.azimuth = 90 * time
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     pl.ibr.movie(pathlib.Path(folder) / 'cone.gif', 0.5, fps=8, each=turn).name
        'cone.gif'
        >>> pl.close()
        """
        self._check_open()
        self.stop()
        before = self._time
        start = before if start is None else start
        times = frame_times(seconds, fps, start, speed)
        with self._shots.cameras_restored() as marks:
            marks |= {'start': start, 'speed': speed, 'state': self.state()}
            film = Film(path, count=len(times), fps=fps, marks=marks, resume=resume)

            def draw(k):
                self.time = times[k]
                if each is not None:
                    each(float(times[k]))
                return self._shots.take(None, None, False)

            try:
                write_movie(film, draw, progress=progress)
            finally:
                self.time = before
        return film.path

    def inspect(self, on=None, *, levels=True, cells=True, atlas=True, table=True):
        """Show how the active subplot is drawn; called again, stop showing it.

        Parameters
        ----------
        on : bool, optional
            Whether to show it; by default what it is not now.
        levels : bool
            Give each instance the colour of the level that draws it, with a legend.
        cells : bool
            Show what is drawn or left out together as boxes.
        atlas : bool, Instances or Impostor
            Show the images of the first that has any, or of this one, those in use outlined.
        table : bool
            List images that were taken for this frame, and the last frame's milliseconds.

        Returns
        -------
        pvibr.inspection.inspection.Inspection or None
            Its settings can be changed; ``remove()`` ends it. None where it is not shown.

        Raises
        ------
        TypeError
            Where an argument is of another type.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> view = pl.ibr.inspect(cells=False)
        >>> view.table = False
        >>> pl.ibr.inspect() is None
        True
        >>> pl.close()
        """
        from pvibr.inspection.inspection import Inspection

        found = [e for e in self.pipeline.effects if isinstance(e, Inspection)]
        if on is not None and not isinstance(on, bool):
            msg = f'on = {on!r}: must be True, False or None; atlas says whose images are shown'
            raise TypeError(msg)
        switches = {'levels': levels, 'cells': cells, 'atlas': atlas is not False, 'table': table}
        made = Inspection(None if isinstance(atlas, bool) else atlas, **switches)
        for old in found:
            self.pipeline.remove(old)
        wanted = not found if on is None else on
        return self.pipeline.add(made) if wanted else None

    def report(self) -> Report:
        """Return what ran in the active subplot's last frame, what was skipped and why.

        Returns
        -------
        pvibr.core.report.Report
            Printed, a table; ``as_dict()`` for programs.
        """
        return self.pipeline.report()

    def web_report(self, backend='client') -> WebReport:
        """Return what of all subplots a browser shows, and what :meth:`baked` makes of the rest.

        Parameters
        ----------
        backend : str
            As in ``pl.show(jupyter_backend=...)``: 'client', 'html', 'trame' (while the page draws
            by itself), 'server', 'static' or 'none'; or 'vtksz', 'wasm', 'gltf'.

        Returns
        -------
        pvibr.export.web_report.WebReport
            Printed, a table; ``as_dict()`` for programs.

        Raises
        ------
        ValueError
            Where there is no such backend.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pvibr
        >>> pl = pv.Plotter(off_screen=True)
        >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]])
        >>> _ = pl.ibr.add(pvibr.Bloom())
        >>> print(pl.ibr.web_report('html'))
        effect   with 'html'    as what, or why not
        Spheres  after baked()  meshes
        Bloom    lost           works on frames, and a browser draws its own
        >>> pl.close()
        """
        self._check_open()
        renderers = list(getattr(self._plotter, 'renderers', [self._plotter.renderer]))
        subplots = {renderers.index(p.renderer): p.effects for p in self._pipelines}
        return web_report(subplots, backend)

    def baked(self, *, triangles=1_000_000, texture=1024, detail=1 / 1024):
        """Return a plotter of plain actors that shows the same, for browsers and files.

        Draped pictures and shadows become colours or textures of surfaces, figures are posed as
        they are now, instances become meshes and billboard clouds, billboards quads, outlines
        lines. What is lost is named in a warning; see :meth:`web_report`.

        Parameters
        ----------
        triangles : int
            That things may have together in each subplot, and that a surface may be cut into
            where its colours change.
        texture : int
            Texels along a side of textures for projected pictures, where a surface has texture
            coordinates or xatlas is there (``pip install pvibr[uv]``); 0 has them as colours of
            points.
        detail : float
            Shortest edge that surfaces are cut into, as a share of the scene's diagonal.

        Returns
        -------
        pyvista.Plotter
            A new one, with the same subplots, cameras, lights, backgrounds and size. This one
            stays as it is.

        Raises
        ------
        TypeError, ValueError
            Where a number is not allowed.
        ClosedError
            Where the plotter is closed.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]], color='red')
        >>> plain = pl.ibr.baked(triangles=500)
        >>> sum(actor.mapper.dataset.n_cells for actor in plain.actors.values()) <= 500
        True
        >>> plain.close()
        >>> pl.close()
        """
        from pvibr.export.plain_plotter import baked

        self._check_open()
        self._show(None, False)
        numbers = {'triangles': triangles, 'texture': texture, 'detail': detail}
        return baked(self._plotter, self._pipelines, **numbers)

    def export_glb(self, path, **options):
        """Write the active subplot as binary glTF, baked: meshes, colours, textures, the camera.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, which ends in ``.glb``.
        **options
            See :meth:`baked`.

        Raises
        ------
        TypeError, ValueError
            Where a number or the name is not allowed; then nothing is written.
        OSError
            Where the file cannot be written; what was there stays.
        ClosedError
            Where the plotter is closed.

        Notes
        -----
        glTF knows no backgrounds, volumes and text; these are left out. What PyVista's own
        ``export_gltf`` leaves out is there: what alpha cuts out, surfaces without light, textures
        that are not nearest texels, colours of vertices as other programs read them.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]], color='red')
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     pl.ibr.export_glb(pathlib.Path(folder) / 'balls.glb', triangles=1000)
        ...     print(*[p.name for p in pathlib.Path(folder).iterdir()])
        balls.glb
        >>> pl.close()
        """
        from pvibr.export.glb import checked_path, write_glb

        path = checked_path(path)
        number = self._number_of(self._plotter.renderer)
        plain = self.baked(**options)
        try:
            write_glb(plain.renderers[number], path)
        finally:
            plain.close()

    def export_html(self, path, **options):
        """Write all subplots, baked, as a page that draws by itself and needs nothing else.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, which ends in ``.html``.
        **options
            See :meth:`baked`.

        Raises
        ------
        TypeError, ValueError
            Where a number or the name is not allowed; then nothing is written.
        OSError
            Where the file cannot be written; what was there stays.
        ImportError
            Where trame is not there.
        ClosedError
            Where the plotter is closed.

        Notes
        -----
        Cameras of such pages have a view angle of 30 degrees, and perspective: one that has not
        is moved to where its focal point is seen as large.
        """
        from pvibr.export.html import checked_path, write_html

        path = checked_path(path)
        plain = self.baked(**options)
        try:
            write_html(plain, path)
        finally:
            plain.close()

    def _number_of(self, renderer) -> int:
        return list(getattr(self._plotter, 'renderers', [renderer])).index(renderer)

    def _handed_over(self):
        """Warn, once, of what is not in the scene that a browser or a file gets."""
        if self._closed:
            return
        page = Page.of(self._plotter)
        if page is not None and page.shows_pictures:
            if page.viewer is not self._followed:
                self._followed = page.viewer
                page.on_switch(self._handed_over)
            return
        report = self.web_report()
        if report.missing and report.missing != self._told:
            self._told = report.missing
            warn_missing(report)

    @property
    def contents(self) -> dict:
        """Effects and things by subplot (its number, as text) and by name, as the state has them.

        The second of a name is called ``'Name 2'``.
        """
        self._check_open()
        return {key: _named(pipeline) for key, pipeline in self._by_key().items()}

    def state(self) -> dict:
        """Return the settings of everything in every subplot, its own, and the time.

        Returns
        -------
        dict
            Values that JSON keeps; see :meth:`restore`.
        """
        return state_files.state_of(self.contents, _Own(self).state())

    def restore(self, state):
        """Set what is here to the settings that :meth:`state` returned; all of them or none.

        Parameters
        ----------
        state : dict
            Names that are not here are left out, in one warning.

        Raises
        ------
        TypeError, ValueError
            Where a value is not allowed.
        """
        state_files.warn_of(self._restore(state, lenient=False))

    def _restore(self, state, lenient):
        return state_files.restore(self.contents, state, own=_Own(self), lenient=lenient)

    def save_state(self, path):
        """Write the settings of everything in every subplot to a file of JSON.

        Parameters
        ----------
        path : str or os.PathLike
            Where to; its folder is made, and a file that is there is replaced when the new one is
            whole.

        Raises
        ------
        OSError
            Where it cannot be written; a file that was there is as it was.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import pvibr
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> bloom = pl.ibr.add(pvibr.Bloom(threshold=0.5))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     pl.ibr.save_state(pathlib.Path(folder) / 'bright.json')
        ...     bloom.threshold = 0.9
        ...     pl.ibr.load_state(pathlib.Path(folder) / 'bright.json')
        >>> bloom.threshold
        0.5
        >>> pl.close()
        """
        state_files.write(path, state_files.to_text('state', self.state()))

    def load_state(self, path):
        """Set what is here to the settings in a file that :meth:`save_state` wrote.

        What is not known here is left out, in one warning that names it. In a file of another
        version of pvibr's so are values that are not allowed here.

        Parameters
        ----------
        path : str or os.PathLike
            The file.

        Raises
        ------
        OSError
            Where it cannot be read.
        TypeError, ValueError
            Where it holds something else, or a value that is not allowed; nothing is changed.
        """
        state_files.warn_of(self._load(state_files.read(path), str(path)))

    def load_state_text(self, text):
        """Set what is here to the settings in the text of a file, see :meth:`load_state`.

        Parameters
        ----------
        text : str or bytes
            What the file holds.

        Raises
        ------
        TypeError, ValueError
            Where it holds something else, or a value that is not allowed; nothing is changed.
        """
        state_files.warn_of(self._load(text, 'the text'))

    def _load(self, text, name):
        state, version = state_files.from_text('state', text, name)
        return self._restore(state, lenient=version != state_files.VERSION)

    def _by_key(self):
        renderers = list(getattr(self._plotter, 'renderers', [self._plotter.renderer]))
        return {str(renderers.index(p.renderer)): p for p in self._pipelines if p.effects}

    def _check_open(self):
        self.pipeline  # noqa: B018

    def close(self):
        """Release everything; a plotter does so by itself. Calling it again is fine."""
        self._closed = True
        self._clock.stop()
        self._adaptive_quality.release()
        self._numbered = []
        while self._pipelines:
            self._pipelines.pop().release()
        while self._followers:
            self._followers.pop()()

    def on_close(self, function):
        """Call a function when this is closed: for what follows a plotter, such as its panels.

        Parameters
        ----------
        function : callable
            Takes nothing; called once.
        """
        self._followers.append(function)

    def _on_deleted(self, *_):
        self._closed = True  # too late to release: asking a dying window for its context crashes

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def __plotter_close__(self):
        self.close()

    def __plotter_deep_clean__(self):
        self._pipelines.clear()


def _named(pipeline) -> dict:
    """Return effects by name; the second of a name is ``'Name 2'``."""
    named: dict = {}
    for effect in pipeline.effects:
        count = sum(e.name == effect.name for e in named.values())
        named[f'{effect.name} {count + 1}' if count else effect.name] = effect
    return named


class _Own:
    """The settings of a component itself, as those of one more thing."""

    enabled = True

    def __init__(self, component):
        self._component = component

    def state(self):
        """Return time and settings."""
        names = ('time', *params_of(type(self._component)))
        return {name: getattr(self._component, name) for name in names}

    def restore(self, state):
        """Set what is there."""
        for name, value in state.items():
            setattr(self._component, name, value)
        return []


class _Host:
    """What a component asks of a plotter, for a renderer without one."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._on_render_callbacks: set = set()  # as a plotter's: see `clock.has_page`

    def show_by(self, draw):
        """Draw by something else than the window's Render."""
        self._on_render_callbacks = {lambda _: draw()}

    def reset_camera(self, *, render=False):
        """Show everything."""
        self.renderer.ResetCamera()

    def render(self):
        """Draw."""
        if not self._on_render_callbacks:
            self.renderer.GetRenderWindow().Render()
        for tell in self._on_render_callbacks:
            tell(self)


def attach(renderer, draw=None) -> IBRComponent:
    """Return ``ibr`` for a plain renderer: VTK scripts, Qt windows, trame applications.

    Parameters
    ----------
    renderer : vtkRenderer
        The renderer; asked again, the same component is returned.
    draw : callable, optional
        What draws and shows a frame, such as the ``update`` of a view of trame; by default the
        window's ``Render``. It may be given later, by asking again.

    Returns
    -------
    IBRComponent
        Close it before the window goes; it is also a context manager. What is still open when
        the program ends is closed then.

    Raises
    ------
    TypeError
        Where it is no renderer, or `draw` cannot be called.

    Examples
    --------
    >>> from pvibr import attach
    >>> from pvibr.core import _vtk
    >>> window = _vtk.vtkRenderWindow()
    >>> renderer = _vtk.vtkRenderer()
    >>> window.AddRenderer(renderer)
    >>> with attach(renderer) as ibr:
    ...     ibr.effects
    ()
    """
    if not (hasattr(renderer, 'IsA') and renderer.IsA('vtkRenderer')):
        msg = f'renderer = {renderer!r}: must be a vtkRenderer; a plotter has its own plotter.ibr'
        raise TypeError(msg)
    if draw is not None and not callable(draw):
        msg = f'draw = {draw!r}: must be a function without arguments, such as view.update'
        raise TypeError(msg)
    component = _attached.get(id(renderer))
    if component is None or component._closed or component._plotter.renderer is not renderer:
        component = _attach_anew(renderer)
    if draw is not None:
        component._plotter.show_by(draw)
    return component


def _attach_anew(renderer):
    component = IBRComponent(_Host(renderer))
    _attached[id(renderer)] = component
    # An observer keeps the component as long as the renderer lives, in a way that Python's
    # collector of cycles sees, unlike an attribute of a VTK object.
    renderer.AddObserver('DeleteEvent', component._on_deleted)
    return component


@atexit.register
def _close_all():
    for component in list(_attached.values()):
        component.close()
