"""Pictures thrown onto surfaces from calibrated cameras, which know what they cannot see."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import MipTexture, Texture, set_fragment_uniforms, shader_source, texture_limit
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, declared_samplers, sections
from pvibr.images.projected import LivePictures, Pictures, is_live
from pvibr.maths import depth_test
from pvibr.maths.cameras import Orthographic, as_camera
from pvibr.maths.draping import blend, border, exposure_gains, sample, weights
from pvibr.maths.image_error import box_reduce
from pvibr.projection.unwrap import texels_of, unwrapped
from pvibr.projection.visibility import (
    Samples,
    bounds_of,
    depth_maps,
    sides_of,
    surface_of,
    view_of,
)
from pvibr.scene.casters import Casters, Surfaces
from pvibr.scene.depth_view import DepthView, receiver_shader

#: Pictures on a surface at once: each takes two of the 16 texture units that OpenGL promises, and
#: the mesh, the light and other effects need some.
MOST = 6
#: Depth views are at least as sharp as this, and at most: texels along a side.
_SIDES = (2048, 4096)
_FLOATS = 24  # for each picture, see projector.glsl
_GRAZING = 1e-3  # the least that a cosine counts, where surfaces may face away
_GAIN_POINTS = 20_000  # on which exposures are compared


class _Slide:
    """A picture and its camera, with what they need on the GPU."""

    def __init__(self, image, camera, mask=None):
        self.live: Any = image if is_live(image) else None
        self.pictures: Any = (LivePictures if self.live is not None else Pictures)(image, mask)
        self.given = camera
        self.camera()
        self.view: Any = None
        self.depth: DepthView | None = None
        self.texture: Texture | None = None
        self.reduced = 1
        self._shown: tuple = ()
        self._released = 0

    def camera(self):
        """Return the camera as it is now: a ``pyvista.Camera`` may have moved."""
        return as_camera(self.given, self.pictures.size)

    @property
    def bakes(self) -> int:
        return self._released + (self.depth.bakes if self.depth else 0)

    @property
    def nbytes(self) -> int:
        own = None if self.live is not None else self.texture
        return sum(owner.nbytes for owner in (own, self.depth) if owner)

    def side(self, resolution) -> int:
        """Return the texels along a side of the depth view."""
        return resolution or int(np.clip(2 * max(self.pictures.size), *_SIDES))

    def show(self, window, k, alpha):
        """Have a picture on the GPU, in levels for whatever is far away or seen at an angle."""
        if self.live is not None:
            self.texture = self.live.shown
            return
        if self._shown == (k, alpha):
            return
        if self.texture is None:
            self.texture = MipTexture(window)
        picture = self.pictures.weighted(k, alpha)
        self.reduced = -(-max(picture.shape[:2]) // texture_limit(window))
        self.texture.upload(_reduced(picture, self.reduced)[::-1])
        self._shown = (k, alpha)

    def look(self, frame, drawer, casters, resolution):
        """Have the depth that the camera sees on the GPU."""
        side = self.side(resolution)
        self.view = view_of(self.camera(), casters.bounds(), side)
        if self.view is None:
            return
        if self.depth is not None and self.depth.resolution != min(side, self._limit(frame)):
            self.drop_depth()
        if self.depth is None:
            self.depth = DepthView(drawer, 1, side)
        self.depth.update(frame, [self.view], casters)

    def _limit(self, frame):
        return texture_limit(frame.window)

    def drop_depth(self):
        if self.depth is not None:
            self._released += self.depth.bakes
            self.depth.release()
            self.depth = None

    def release(self):
        self.drop_depth()
        if self.texture is not None and self.live is None:
            self.texture.release()
        self.texture, self._shown = None, ()
        self.pictures.close()

    # -- the numbers of the shader ------------------------------------------------------------

    def matrices(self, world_from_view, size):
        """Return view space to the picture's plane, and to the depth texture."""
        camera = self.camera()
        plane = _plane_from_world(camera, size) @ world_from_view
        if self.view is None:
            return [plane, np.eye(4)]
        return [plane, self.view.texture_from_world() @ world_from_view]

    def numbers(self, view_from_world, size, gain) -> list:
        """Return what the shader's NUMBER is."""
        camera = self.camera()
        if isinstance(camera, Orthographic):
            lens, radius, uv = np.zeros(8), 0.0, np.eye(2, 3)
            place = np.append(view_from_world[:3, :3] @ camera.toward(np.zeros((1, 3)))[0], 0.0)
        else:
            lens, radius, uv = camera.distortion, camera.valid_radius, camera.uv_from_plane
            place = (view_from_world @ np.append(camera.position, 1.0))[:3]
            place = np.append(place, 1.0)
        texel = 1.0
        if self.view is not None and self.depth is not None:
            texel = depth_test.texel_size(self.view, self.depth.resolution)
        found = [*lens, min(radius, 1e15) ** 2, *uv.ravel(), *place, *gain]
        return [*found, _density(camera, size), texel]


class _Projection(Effect):
    """What one projector and several have in common."""

    web = 'baked', 'colours or textures of surfaces'
    mode = Param(
        'replace',
        'What the picture does: takes the place of the surface, lights it as a slide '
        'projector does, covers it by its alpha, or is added.',
        choices=('replace', 'modulate', 'decal', 'add'),
    )
    lit = Param(
        False,
        'Whether the scene lights the picture; else it is shown as it was photographed. '
        'For replace and decal.',
    )
    occlusion = Param(True, 'Whether what is hidden from the camera stays as it is.')
    opacity = Param(1.0, 'How much of the picture is seen.', range='[0, 1]')
    feather = Param(
        0.0,
        "Width of the picture's border over which it fades, as a share of its sides.",
        range='[0, 0.5]',
    )
    dim = Param(
        1.0, 'What the surface is multiplied by where no picture covers it.', range='[0, 1]'
    )
    facing = Param(
        90.0,
        'Largest angle between a surface and the direction to the camera at which it is '
        'painted: less than 90 leaves out what is seen at a flat angle, 180 paints both sides.',
        range='(0, 180]',
        unit='degrees',
    )
    gain = Param((1.0, 1.0, 1.0), 'What red, green and blue are multiplied by.', range='[0, inf)')
    resolution = Param(
        None,
        'Texels along a side of the depth view; by default two a pixel of the picture, '
        'from 2048 to 4096.',
        range='[16, 16384]',
        kind=int,
    )
    offset = Param(
        0.25,
        'How far a receiver is moved along its normal: less shows holes where surfaces are '
        'concave, more paints what lies just behind an edge.',
        range='[0, 16]',
        unit='texels',
    )
    fps = Param(
        None,
        "Pictures of a sequence per second of pl.ibr.time; by default the film's own.",
        range='(0, inf)',
        kind=float,
    )
    loop = Param(True, 'Whether a sequence begins again after its end, or its last is held.')

    blend: Any = 'feather'
    gains: Any = 'none'

    def __init__(self, slides, actors=None, casters=None, **settings):
        self._slides = [_Slide(*slide) for slide in slides]
        self.actors, self.casters = actors, casters
        self._attached = FeatureSet()
        self._surfaces: Any = None
        self._drawer: Any = None
        self._found_gains: tuple = (None, None)
        self._skipped = 0
        super().__init__(**settings)

    # -- the life of an effect ----------------------------------------------------------------

    #: Tells its names in shaders from those of other projectors.
    number = 0

    def attach(self, pipeline):
        """Take a place in a pipeline."""
        taken = {e.number for e in pipeline.effects if isinstance(e, _Projection)}
        self.number = next(n for n in range(len(taken) + 1) if n not in taken)
        super().attach(pipeline)

    @property
    def lives(self) -> list:
        """The live textures among its pictures."""
        return [slide.live for slide in self._slides if slide.live is not None]

    @property
    def cameras(self) -> tuple:
        """The camera of each picture, as it was given."""
        return tuple(slide.given for slide in self._slides)

    def set_camera(self, camera, view=0):
        """Show a picture from another camera.

        Parameters
        ----------
        camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
            See :func:`pvibr.maths.cameras.as_camera`.
        view : int, optional
            Which picture's.

        Raises
        ------
        IndexError
            Where there is no such picture.
        ValueError
            Where it is no camera, or for another size of picture; then nothing is changed.
        """
        slide = self._slides[view]
        as_camera(camera, slide.pictures.size)
        slide.given = camera

    def size_of(self, view=0) -> tuple[int, int]:
        """Return width and height of a picture.

        Parameters
        ----------
        view : int, optional
            Which picture's.
        """
        return self._slides[view].pictures.size

    def needed(self, frame) -> bool | str:
        """Tell whether anything of the pictures is to be seen."""
        if self.opacity == 0 and self.dim == 1:
            return 'opacity is 0'
        if any(live.shown is None for live in self.lives):
            return 'its live texture is in no subplot, or not drawn yet: add it'
        return True

    def prepare(self, frame):
        """Draw depth where it is stale, show the pictures of this time, tell the receivers."""
        if self._drawer is None or self._drawer.renderer is not frame.renderer:
            self._drawer, self._surfaces = Drawer(frame.renderer), Surfaces(frame.renderer)
        things = [t for t in self.pipeline.things if t.enabled]
        self._surfaces.update(things)
        casters = self._casters(things)
        for slide in self._slides:
            slide.show(frame.window, self._at(slide, frame.time), self.mode != 'replace')
            if self.occlusion:
                slide.look(frame, self._drawer, casters, self.resolution)
            else:
                slide.drop_depth()
        self._attach(frame, casters, things)

    def _at(self, slide, time):
        return slide.pictures.at(time, self.fps, self.loop)

    def _casters(self, things):
        actors, things = self._surfaces.chosen(self.casters, things)
        return Casters([a for a in actors.values() if a.GetVisibility()], things)

    def _receivers(self, things) -> dict:
        self._surfaces.update(things)  # for what things made for the cameras' views
        actors, things = self._surfaces.chosen(self.actors, things)
        return actors | {address(a): a for thing in things for a in thing.actors()}

    def _attach(self, frame, casters, things):
        receivers = self._receivers(things)
        size = _size(casters.bounds())
        uniforms = self._uniforms(frame, size, self._gains(casters))
        actors = list(receivers.values())
        self._attached.match(actors, lambda actor: (self._feature(actor),))
        set_fragment_uniforms(actors, uniforms)

    def _feature(self, actor) -> Feature:
        prop = actor.GetProperty()
        # Edges and tubes are made by a geometry shader, which hands nothing on that is not VTK's.
        between = bool(prop.GetEdgeVisibility() or prop.GetRenderLinesAsTubes())
        lenses = tuple(_has_lens(s.camera()) for s in self._slides)
        seen = tuple(
            self.occlusion and s.depth is not None and s.view is not None for s in self._slides
        )
        lit = self.lit and self.mode in ('replace', 'decal')
        return _feature(self.number, lenses, seen, self.mode, lit, self.blend == 'best', between)

    def _uniforms(self, frame, size, gains) -> dict:
        pre = f'ibr_projector_{self.number}'
        view = frame.view_from_world
        inverse = np.linalg.inv(view)
        matrices = [m for s in self._slides for m in s.matrices(inverse, size)]
        numbers = [
            x
            for s, gain in zip(self._slides, gains, strict=True)
            for x in s.numbers(view, size, gain * self.gain)
        ]
        settings = [
            self.feather,
            np.cos(np.radians(self.facing)),
            self.opacity,
            self.dim,
            self.offset,
        ]
        # In perspective depth is taken from w, in a parallel view from z.
        clip = frame.clip_from_view
        rows = np.stack([clip[0], clip[1], clip[2 if frame.parallel else 3], [0, 0, 0, 1.0]])
        uniforms = {
            'ibr_view_from_clip': np.linalg.inv(rows)[None],
            'ibr_ahead': (1.0, 0.0) if frame.parallel else (0.0, 1.0),
            'ibr_viewport': (*frame.origin, *frame.size),
            f'{pre}_matrix': np.stack(matrices),
            f'{pre}_number': np.reshape(numbers, (-1, 1)),
            f'{pre}_set': np.reshape(settings, (-1, 1)),
        }
        for k, slide in enumerate(self._slides):
            for name, texture in slide_textures(slide).items():
                uniforms[f'{pre}_{name}_{k}'] = texture.activate()
        return uniforms

    def finish(self, frame):
        """Give the texture units back."""
        for slide in self._slides:
            for texture in slide_textures(slide).values():
                texture.deactivate()
        # Another subplot that shows the same actor has other pictures, or none.
        self._attached.leave_shared()

    def deactivate(self):
        """Take the shader text off all receivers."""
        self._attached.clear()

    def detach(self):
        """Leave the pipeline."""
        self.deactivate()
        super().detach()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.deactivate()
        for slide in self._slides:
            slide.release()
        if self._drawer is not None:
            self._drawer.release()
        self._drawer = None

    def report(self) -> dict:
        """Return bytes, pictures, depth views drawn so far, and how much pictures are reduced."""
        return {
            'bytes': sum(s.nbytes for s in self._slides),
            'pictures': len(self._slides),
            'views drawn': sum(s.bakes for s in self._slides),
            'receivers': len(self._attached),
            'reduced': max(s.reduced for s in self._slides),
        }

    # -- exposure -----------------------------------------------------------------------------

    def _gains(self, casters) -> np.ndarray:
        """Return the gains of each picture, (v, 3), solved anew where what is seen changed."""
        if self.gains == 'none':
            return np.ones((len(self._slides), 3))
        key = (casters.key(), [s.camera() for s in self._slides])
        if self._found_gains[0] != key:
            receivers, _ = self._surfaces.chosen(self.actors)
            meshes = [surface_of(a) for a in receivers.values() if a.GetVisibility()]
            others = [surface_of(a) for a in casters.actors]
            self._found_gains = (key, self._solve(meshes, others))
        return self._found_gains[1]

    def _solve(self, meshes, casters):
        parts = [Samples.of(m, 'cells') for m in meshes]
        points = np.concatenate([p.points for p in parts])
        normals = np.concatenate([p.normals for p in parts])
        rows = np.arange(len(points))[:: -(-len(points) // _GAIN_POINTS) or 1]
        samples = Samples(
            points[rows],
            normals[rows],
            np.arange(len(rows)),
            len(rows),
            np.zeros((len(rows), 3), int),
            np.zeros(len(rows)),
        )
        looks = self._looks(samples, casters, 0.0, 0)
        colors, shown = np.stack([k.colors for k in looks]), np.stack([k.cover for k in looks])
        return exposure_gains(np.nan_to_num(colors), shown)

    # -- as data ------------------------------------------------------------------------------

    def bake(self, mesh, to='points', *, size=2048, casters=(), time=0.0):
        """Return a mesh with the pictures on it as data, by the same rules.

        Parameters
        ----------
        mesh : pyvista.DataSet
            World units; it hides parts of itself.
        to : {'points', 'cells', 'texture'}
            Where the colours are put. A texture needs texture coordinates; of a mesh without them
            they are made by xatlas (``pip install pvibr[uv]``).
        size : int or tuple of 2 int, optional
            Width and height of the texture in pixels.
        casters : sequence of pyvista.DataSet or actors, optional
            What else may hide it.
        time : float, optional
            Seconds, for sequences.

        Returns
        -------
        pyvista.DataSet
            A copy with the arrays ``'projected'`` (n, 4) uint8, transparent where no picture
            shows, ``'covered'`` (n,) bool and ``'views'`` (n,) int, how many pictures show each.
        numpy.ndarray, shape (h, w, 4), uint8
            The texture, row 0 at the top; only for ``to='texture'``, whose mesh has no arrays.

        Raises
        ------
        ValueError
            Where `to` is another.
        ImportError
            Where xatlas is needed and not there.

        Examples
        --------
        >>> import numpy as np
        >>> import pyvista as pv
        >>> import pvibr
        >>> red = np.zeros((8, 8, 3), np.uint8) + [255, 0, 0]
        >>> above = pvibr.Orthographic.from_extent(-1, 0, -1, 1, zmax=2)
        >>> plane = pv.Plane(i_size=2, j_size=2, i_resolution=2, j_resolution=1)
        >>> draped = pvibr.Projector(red.astype(np.uint8), above).bake(plane, to='cells')
        >>> draped['covered'].tolist(), draped['projected'][0].tolist()
        ([True, False], [255, 0, 0, 255])
        """
        if to not in ('points', 'cells', 'texture'):
            msg = f"to is {to!r}; it must be 'points', 'cells' or 'texture'."
            raise ValueError(msg)
        surfaces = [surface_of(m) for m in (mesh, *casters)]
        side = 0 if self.facing > 90 else sides_of(mesh, None)
        if to == 'texture':
            mesh = unwrapped(mesh)
            samples, image = texels_of(mesh, size)
            colors, covered, _ = self._mixed(samples, surfaces, time, side)
            return mesh, image.filled(colors, covered)
        samples = Samples.of(mesh, to)
        colors, covered, views = self._mixed(samples, surfaces, time, side)
        found = mesh.copy()
        data = found.point_data if to == 'points' else found.cell_data
        data['projected'], data['covered'], data['views'] = colors, covered, views
        found.set_active_scalars('projected', preference=to[:-1])
        return found

    def bake_into(self, scene):
        """Hand its pictures to a scene without pvibr."""

        def draped(samples, surfaces, side):
            side = 0 if self.facing > 90 else side
            return self._mixed(samples, surfaces, scene.frame.time, side)[0]

        scene.drape(
            draped,
            mode=self.mode,
            lit=self.lit,
            dim=self.dim,
            receives=self.actors,
            casts=self.casters,
        )

    def _mixed(self, samples, surfaces, time, side):
        """Return colours (n, 4) uint8, whether any picture shows there, and how many do."""
        looks = self._looks(samples, surfaces, time, side)
        shares = weights(
            np.stack([k.cosine for k in looks]),
            np.stack([k.texel for k in looks]),
            masks=np.stack([k.cover for k in looks]),
            method=self.blend,
        )
        colors = np.stack([k.colors for k in looks])
        if self.gains == 'auto':
            colors *= exposure_gains(colors, np.stack([k.cover for k in looks]))[:, None]
        mixed = np.nan_to_num(blend(colors * self.gain, shares))
        cover = np.max([k.cover for k in looks], axis=0) * (shares.sum(0) > 0)
        mixed = np.concatenate([mixed, 255 * cover[:, None] * self.opacity], 1)
        mixed = np.rint(np.clip(mixed, 0, 255)).astype(np.uint8)
        return mixed, cover > 0, np.sum([k.cover > 0 for k in looks], axis=0)

    def _looks(self, samples, surfaces, time, side) -> list:
        return [self._look(slide, samples, surfaces, time, side) for slide in self._slides]

    def _look(self, slide, samples, surfaces, time, side):
        """Return what one picture shows of each point or cell."""
        camera, points = slide.camera(), samples.points
        uv, _ = camera.project(points)
        toward = camera.toward(points)
        cosine = samples.facing(toward, side)
        limit = max(float(np.cos(np.radians(self.facing))), 0.0)
        cover = border(uv, self.feather) * (cosine > limit)
        rows = np.flatnonzero(cover)
        picture = slide.pictures.weighted(self._at(slide, time), self.mode != 'replace')
        colors = np.full((len(points), 4), np.nan)
        colors[rows] = sample(picture, uv[rows])
        cover[rows] *= colors[rows, 3] / 255
        if self.occlusion and len(rows):
            texels = slide.side(self.resolution)
            view = view_of(camera, bounds_of(surfaces), texels)
            if view is not None:
                (depth,) = depth_maps([view], surfaces, texels)
                normals = samples.turned(toward)[rows]
                cover[rows] *= depth_test.seen(view, depth, points[rows], normals, self.offset)
        texel = np.where(cover > 0, camera.texel(points), np.inf)
        return _Look(samples, cover, np.maximum(cosine, _GRAZING), texel, colors[:, :3])


class _Look:
    """What one picture shows: how much it covers, angle, width of a pixel, colours."""

    def __init__(self, samples, cover, cosine, texel, colors):
        self.cover = samples.most(cover)
        self.cosine = samples.most(cosine * (cover > 0))
        self.texel = 1 / np.maximum(samples.most(1 / texel), 1e-300)
        self.colors = samples.mean(colors, cover)


class Projector(_Projection):
    """A picture on all that its camera sees.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.images.projected.Pictures`; films and sequences run with ``pl.ibr.time``.
    camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
        From where, see :func:`pvibr.maths.cameras.as_camera`: ``(K, R, t)`` or ``(K, R, t,
        distortion)`` as OpenCV has them, or an orthophoto's extent.
    mask : path or array, optional
        0 where the picture must not be used.
    actors : callable or sequence, optional
        Which actors are painted; by default all.
    casters : callable or sequence, optional
        Which actors and things of pvibr hide what is behind them; by default all that are visible
        and not translucent.
    **settings
        Values of the settings.

    Raises
    ------
    ValueError
        Where the picture cannot be read, or the camera is none or for another size of picture.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pyvista import examples
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(center=(0, 0, 1)))
    >>> _ = pl.add_mesh(pv.Plane(i_size=4, j_size=4))
    >>> camera = pv.Camera()
    >>> camera.position, camera.focal_point, camera.up = (0, -2, 6), (0, 0, 0), (0, 1, 0)
    >>> photo = pl.ibr.add(pvibr.Projector(examples.mapfile, camera))
    >>> pl.show(auto_close=False)
    >>> photo.report()['receivers']
    2
    >>> pl.close()
    """

    def __init__(self, image, camera, *, mask=None, actors=None, casters=None, **settings):
        super().__init__([(image, camera, mask)], actors, casters, **settings)


class Projectors(_Projection):
    """Several pictures on the same surfaces, made to fit each other.

    Parameters
    ----------
    views : sequence of tuple
        Each (image, camera) or (image, camera, mask), see :class:`Projector`; at most 6, since
        each takes two texture units.
    actors : callable or sequence, optional
        Which actors are painted; by default all.
    casters : callable or sequence, optional
        Which actors and things of pvibr hide what is behind them.
    **settings
        Values of the settings.

    Raises
    ------
    ValueError
        Where there are none or too many, or one is not as :class:`Projector` needs it.

    Examples
    --------
    >>> import numpy as np
    >>> import pyvista as pv
    >>> import pvibr
    >>> left = pvibr.Orthographic.from_extent(-1, 0.2, -1, 1, zmax=2)
    >>> right = pvibr.Orthographic.from_extent(-0.2, 1, -1, 1, zmax=2)
    >>> photos = pvibr.Projectors([(np.zeros((9, 9)), left), (np.ones((9, 9)), right)])
    >>> plane = pv.Plane(i_size=2, j_size=2, i_resolution=3, j_resolution=1)
    >>> photos.bake(plane, to='cells')['views'].tolist()
    [1, 2, 1]
    """

    blend = Param(
        'feather',
        'How pictures share a place: by angle, distance and border, or the best alone.',
        choices=('feather', 'best'),
    )
    gains = Param(
        'none',
        'Whether the brightness of the pictures is made alike where they overlap.',
        choices=('none', 'auto'),
    )

    def __init__(self, views, *, actors=None, casters=None, **settings):
        views = [tuple(view) for view in views]
        if not 1 <= len(views) <= MOST or not all(len(v) in (2, 3) for v in views):
            msg = f'views has {len(views)} entries; 1 to {MOST} of (image, camera[, mask]).'
            raise ValueError(msg)
        super().__init__(views, actors, casters, **settings)


def slide_textures(slide) -> dict:
    """Return the textures of a picture by name: itself, and what its camera sees of depth."""
    depth = None if slide.depth is None or slide.view is None else slide.depth.texture
    found = {'picture': slide.texture, 'depth': depth}
    return {name: texture for name, texture in found.items() if texture is not None}


def _size(bounds) -> float:
    """Return a length that the scene is measured in, so that no unit is too large for floats."""
    if not len(bounds):
        return 1.0
    low, high = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
    return float(np.linalg.norm(high - low)) or 1.0


def _has_lens(camera) -> bool:
    return not isinstance(camera, Orthographic) and bool(camera.distortion.any())


def _plane_from_world(camera, size):
    """Return what takes world space to x, y and depth on the plane, times w."""
    if isinstance(camera, Orthographic):
        view = camera.view_from_world
        matrix = np.zeros((4, 4))
        matrix[0], matrix[1] = view[0] / camera.width, view[1] / camera.height
        matrix[2], matrix[3, 3] = _depth_row(view, camera.near, camera.far, size), 1.0
        return matrix
    rows = np.column_stack([camera.R, camera.t]) / size
    return np.stack([rows[0], rows[1], 0.5 * rows[2], rows[2]])


def _depth_row(view, near, far, size):
    """Return the row whose product is 0 to 1 from near to far."""
    ends = np.isfinite([near, far])
    if not ends.any():
        return np.array([0, 0, 0, 0.5])
    if not ends.all():  # a scene is far smaller than this
        near, far = (near, near + 1e4 * size) if ends[0] else (far - 1e4 * size, far)
    return (-view[2] - [0, 0, 0, near]) / (far - near)


def _density(camera, size) -> float:
    """Return pixels per length of the scene, at a distance of that length."""
    if isinstance(camera, Orthographic):
        return size / float(camera.texel(np.zeros((1, 3)))[0])
    return float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))


def _reduced(picture, factor):
    """Return a picture with boxes of pixels averaged; what is left over is cropped by padding."""
    if factor == 1:
        return picture
    high, wide = picture.shape[:2]
    padded = np.pad(picture, ((0, -high % factor), (0, -wide % factor), (0, 0)), mode='edge')
    return np.rint(box_reduce(padded, factor)).astype(np.uint8)


@lru_cache(maxsize=64)
def _feature(number, lenses, seen, mode, lit, best, between) -> Feature:
    """Return the shader text of a projector."""
    pre = f'ibr_projector_{number}'
    text = sections(shader_source(__file__))
    shared = receiver_shader()
    samplers = {f'{pre}_picture_{k}': 'sampler2D' for k in range(len(lenses))}
    samplers |= {f'{pre}_depth_{k}': 'sampler2D' for k, s in enumerate(seen) if s}
    parts = [declared_samplers(samplers), shared['plane'], shared['declare']]
    parts.append(shared['fragment.pixel' if between else 'fragment.clip'])
    parts.append(text['picture'])
    parts.append(f'#define BEST {int(best)}\n#define LIGHT {int(mode == "modulate")}\n')
    body = text['begin']
    for k, (lens, sees) in enumerate(zip(lenses, seen, strict=True)):
        parts.append(f'#define LENS {int(lens)}\n#define OCCLUSION {int(sees)}\n')
        parts.append(text['slide'].replace('VIEW', str(k)))
        parts.append('#undef LENS\n#undef OCCLUSION\n')
        body += text['one'].replace('VIEW', str(k))
    parts += [body, text['end'], '#undef BEST\n#undef LIGHT\n']
    fragment = {'VTK::CustomUniforms::Dec': ''.join(parts)}
    light, color = '//VTK::Light::Impl\n', '//VTK::TCoord::Impl\n'
    if lit:
        fragment['VTK::Light::Impl'] = text['find'] + text['lit'] + light
    elif mode == 'modulate':
        fragment['VTK::Light::Impl'] = text['find'] + light + text['modulate']
    else:
        end = text['add' if mode == 'add' else 'over']
        fragment['VTK::TCoord::Impl'] = color + text['find'] + end
    vertex = {
        'VTK::CustomUniforms::Dec': '//VTK::CustomUniforms::Dec\n' + shared['vertex.declare'],
        'VTK::PositionVC::Impl': '//VTK::PositionVC::Impl\n  ibr_clip = gl_Position;\n',
    }
    fragment = {tag: part.replace('PRE', pre) for tag, part in fragment.items()}
    return Feature(f'projector{number}', {} if between else vertex, fragment)
