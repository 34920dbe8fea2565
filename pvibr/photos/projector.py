"""Images projected on surfaces from calibrated cameras, with occlusion."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.arguments import check_one_of
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.core.progress import baking
from pvibr.gl import nbytes_of, release, set_fragment_uniforms, shader_source
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, declared_samplers, sections
from pvibr.maths.cameras import as_camera
from pvibr.photos.painting import SlidePainter, solved_gains
from pvibr.photos.slide import Slide, checked_slides
from pvibr.photos.texture_bake import baked_texture, checked_file
from pvibr.textures.projected import NO_LIVE_PICTURE
from pvibr.things.casters import Choice
from pvibr.things.depth_view import (
    receiver_declarations,
    receiver_shader,
    receiver_stages,
    set_receiver_uniforms,
)
from pvibr.visibility.surface_samples import Samples, sides_of, surface_of

#: Texels along a side of the tiles that are baked.
_TILE = 512

#: Cosine below which rounding decides to which side a surface faces.
_GRAZING = 1e-3


class Projector(Effect):
    """Project one or several images on the surfaces that their cameras see.

    Parameters
    ----------
    image : Photo, path, array, pyvista.Texture, LiveTexture, or a sequence of them
        Photographs of :func:`read_cameras`, which have cameras; or a path, array or texture. Films
        and sequences play with ``pl.ibr.time``. A list of images if `camera` is a list.
    camera : pyvista.Camera, Pinhole, Orthographic, Photo, dict, tuple, or list of them, optional
        See :func:`pvibr.maths.cameras.as_camera`: ``(K, R, t)`` or ``(K, R, t, distortion)`` as in
        OpenCV, or the extent of an orthophoto; omit it for photographs. A list has one camera per
        image, at most 6, as each image takes two texture units.
    mask : path or array, optional
        0 where the image must not be used. A list, with None for no mask, if `camera` is one.
    actors : callable or sequence, optional
        Actors to paint, or a function that returns True for them; by default all.
    casters : callable or sequence, optional
        Occluding actors and things of pvibr; by default all visible and opaque ones.
    **settings
        Values of the settings.

    Raises
    ------
    ValueError
        If an image is unreadable, a camera is invalid or for another image size, or lists differ
        in length.

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

    Two overlapping images, blended:

    >>> left = pvibr.Orthographic.from_extent(-1, 0.2, -1, 1, zmax=2)
    >>> right = pvibr.Orthographic.from_extent(-0.2, 1, -1, 1, zmax=2)
    >>> photos = pvibr.Projector([np.zeros((9, 9)), np.ones((9, 9))], [left, right])
    >>> plane = pv.Plane(i_size=2, j_size=2, i_resolution=3, j_resolution=1)
    >>> photos.bake(plane, to='cells')['views'].tolist()
    [1, 2, 1]
    """

    web = 'baked', 'colours or textures of surfaces'
    mode = Param(
        'replace',
        'How images combine with the surface colour: replace it, modulate its lighting as a slide '
        'projector does, cover it by their alpha, or add to it.',
        choices=('replace', 'modulate', 'decal', 'add'),
    )
    lit = Param(
        False, 'Shade the image with the lights of the scene; modes replace and decal only.'
    )
    occlusion = Param(
        True, 'Leave surfaces hidden from the camera unpainted; turn off to save the depth map.'
    )
    opacity = Param(1.0, 'Opacity of the image.', range='[0, 1]')
    feather = Param(
        0.0,
        'Width of the fade at image borders, as a fraction of the sides; hides seams.',
        range='[0, 0.5]',
    )
    outside_brightness = Param(
        1.0,
        'Brightness of surfaces outside the images; lower it to show coverage.',
        range='[0, 1]',
    )
    max_angle = Param(
        90.0,
        'Maximum angle of incidence; lower it to leave out oblique views, 180 paints both sides.',
        range='(0, 180]',
        unit='degrees',
    )
    gain = Param((1.0, 1.0, 1.0), 'RGB factors of all images.', range='[0, inf)')
    resolution = Param(
        None,
        'Texels along a side of the depth map; by default twice the image size, 2048 to 4096.',
        range='[16, 16384]',
        kind=int,
    )
    normal_bias = Param(
        0.25,
        'Offset of receivers along their normal: raise it if concave surfaces have holes, lower '
        'it if paint leaks behind edges.',
        range='[0, 16]',
        unit='texels',
    )
    fps = Param(
        None, "Frames per second; by default the film's rate.", range='(0, inf)', kind=float
    )
    loop = Param(True, 'Repeat a sequence; otherwise its last image stays.')

    blend = Param(
        'feather',
        'Overlaps show a weighted mean, or the best image only, which is sharper.',
        choices=('feather', 'best'),
    )
    gains = Param(
        'none', 'Equalize exposures of overlapping images (auto).', choices=('none', 'auto')
    )

    def __init__(self, image, camera=None, *, mask=None, actors=None, casters=None, **settings):
        self._slides = [Slide(*slide) for slide in checked_slides(image, camera, mask)]
        self.actors, self.casters = actors, casters
        self._attached = FeatureSet()
        self._drawer: Any = None
        self._found_gains: tuple = (None, None)
        self._skipped = 0
        super().__init__(**settings)

    # -- the life of an effect ----------------------------------------------------------------

    actors, casters = Choice(), Choice()
    #: Makes its shader names unique among projectors.
    number = 0

    def attach(self, pipeline):
        """Add it to a pipeline."""
        used_numbers = {e.number for e in pipeline.effects if isinstance(e, Projector)}
        self.number = next(n for n in range(len(used_numbers) + 1) if n not in used_numbers)
        super().attach(pipeline)

    @property
    def lives(self) -> list:
        """The live textures among its images."""
        return [slide.live for slide in self._slides if slide.live is not None]

    @property
    def slides(self) -> tuple:
        """Its images with their cameras and depth maps."""
        return tuple(self._slides)

    @property
    def cameras(self) -> tuple:
        """The camera of each image, as given."""
        return tuple(slide.given_camera for slide in self._slides)

    @property
    def found_gains(self) -> np.ndarray:
        """RGB factors of each image, (n, 3), in the last frame."""
        gains = self._found_gains[1] if self.gains == 'auto' else None
        return np.ones((len(self._slides), 3)) if gains is None else gains.copy()

    def set_camera(self, camera, view=0):
        """Set the camera of an image.

        Parameters
        ----------
        camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
            See :func:`pvibr.maths.cameras.as_camera`.
        view : int, optional
            Index of the image.

        Raises
        ------
        IndexError
            If there is no such image.
        ValueError
            If the camera is invalid or for another image size; the current one is kept.
        """
        slide = self._slides[view]
        as_camera(camera, slide.pictures.size)
        slide.given_camera = camera

    def size_of(self, view=0) -> tuple[int, int]:
        """Return width and height of an image.

        Parameters
        ----------
        view : int, optional
            Index of the image.
        """
        return self._slides[view].pictures.size

    def needed(self, frame) -> bool | str:
        """Return True if any image is visible."""
        if self.opacity == 0 and self.outside_brightness == 1:
            return 'opacity is 0'
        if any(live.shown is None for live in self.lives):
            return NO_LIVE_PICTURE
        return True

    def content_key(self) -> object:
        """Return a value that changes with its images and cameras."""
        return self.revision, [slide.content_key(self) for slide in self._slides]

    def prepare(self, frame):
        """Redraw stale depth maps, upload the current images, and bind them for receivers."""
        if self._drawer is None or self._drawer.renderer is not frame.renderer:
            self._drawer = Drawer(frame.renderer)
        things = [t for t in self.pipeline.things if t.enabled]
        casters = self.pipeline.surfaces.casters(self.casters, things)
        for slide in self._slides:
            slide.show(frame.window, frame.time, self)
            if self.occlusion:
                slide.update_depth(frame, self._drawer, casters, self.resolution)
            else:
                slide.drop_depth()
        self._attach(frame, casters, things)

    def _receivers(self, chosen) -> dict:
        actors, chosen = self.pipeline.surfaces.chosen(self.actors, chosen, handles=False)
        return actors | {address(a): a for item in chosen for a in item.actors()}

    def _attach(self, frame, casters, things):
        receivers = self._receivers(things)
        size = _size(casters.bounds())
        gains = self._gains(casters, things)
        uniforms = self._uniforms(frame.view_from_world, size, gains) | self._units()
        actors = list(receivers.values())
        feature = self.feature(frame.window.GetMultiSamples() > 1)
        self._attached.match(actors, lambda _: (feature,))
        set_receiver_uniforms(actors, frame)
        set_fragment_uniforms(actors, uniforms)

    def feature(self, multisampled) -> Feature:
        """Return the shader text of receivers."""
        lenses = tuple(slide.has_lens for slide in self._slides)
        has_depth = tuple(self.occlusion and 'depth' in slide.textures() for slide in self._slides)
        is_lit = self.lit and self.mode in ('replace', 'decal')
        best = self.blend == 'best'
        return _feature(self.number, lenses, has_depth, self.mode, is_lit, best, multisampled)

    @property
    def prefix(self) -> str:
        """What the names of its uniforms start with."""
        return f'ibr_projector_{self.number}'

    def world_uniforms(self) -> dict:
        """Return the uniforms of receivers whose positions are in world space."""
        things = [t for t in self.pipeline.things if t.enabled]
        casters = self.pipeline.surfaces.casters(self.casters, things)
        gains = self._gains(casters, things)
        return self._uniforms(np.eye(4), _size(casters.bounds()), gains)

    def _uniforms(self, view, size, gains) -> dict:
        prefix = self.prefix
        world_from_view = np.linalg.inv(view)
        matrices = [m for s in self._slides for m in s.matrices(world_from_view, size)]
        numbers = [
            x
            for s, gain in zip(self._slides, gains, strict=True)
            for x in s.numbers(view, size, gain * self.gain)
        ]
        settings = [
            self.feather,
            # Surfaces along the direction of view are on neither side.
            np.cos(np.radians(self.max_angle)) + (_GRAZING if self.max_angle <= 90 else 0.0),
            self.opacity,
            self.outside_brightness,
            self.normal_bias,
        ]
        return {
            f'{prefix}_matrix': np.stack(matrices),
            f'{prefix}_number': np.reshape(numbers, (-1, 1)),
            f'{prefix}_set': np.reshape(settings, (-1, 1)),
        }

    def _units(self) -> dict:
        """Return the texture units of its textures."""
        return {
            f'{self.prefix}_{name}_{k}': texture.activate()
            for k, slide in enumerate(self._slides)
            for name, texture in slide.textures().items()
        }

    def finish(self, frame):
        """Release the texture units."""
        for slide in self._slides:
            for texture in slide.textures().values():
                texture.deactivate()
        # The same actor in another subplot may have other images, or none.
        self._attached.leave_shared(self.pipeline.surfaces.plain_actors.prop_of)

    def deactivate(self):
        """Detach the shader text from all receivers."""
        self._attached.clear()

    def detach(self):
        """Remove it from the pipeline."""
        self.deactivate()
        super().detach()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.deactivate()
        release(*self._slides, self._drawer)
        self._drawer = None

    def report(self) -> dict:
        """Return bytes, counts of images, depth maps drawn and receivers, and the reduction."""
        return {
            'bytes': nbytes_of(*self._slides),
            'pictures': len(self._slides),
            'views drawn': sum(s.bakes for s in self._slides),
            'receivers': len(self._attached),
            'reduced': max(s.reduced for s in self._slides),
        }

    # -- exposure -----------------------------------------------------------------------------

    def _gains(self, casters, things) -> np.ndarray:
        """Return the RGB gains of each image, (v, 3), cached until cameras or casters change."""
        if self.gains == 'none' or len(self._slides) == 1:
            return np.ones((len(self._slides), 3))
        gains_key = (casters.key(), [s.camera() for s in self._slides])
        if self._found_gains[0] != gains_key:
            receivers, _ = self.pipeline.surfaces.chosen(self.actors, things, handles=False)
            meshes = [surface_of(a) for a in receivers.values() if a.GetVisibility()]
            caster_meshes = [surface_of(a) for a in casters.actors]
            gains = solved_gains(self._slides, self, meshes, caster_meshes)
            self._found_gains = gains_key, gains
        return self._found_gains[1]

    # -- as data ------------------------------------------------------------------------------

    def bake(
        self, mesh, to='points', *, size=2048, casters=(), time=0.0, file=None, progress=None
    ):
        """Return a mesh with the projected colours as data.

        Parameters
        ----------
        mesh : pyvista.DataSet
            World units; it occludes itself.
        to : {'points', 'cells', 'texture'}
            Location of the colours. A texture needs texture coordinates; without them, xatlas
            generates them (``pip install pvibr[uv]``).
        size : int or tuple of 2 int, optional
            Width and height of the texture in pixels.
        casters : sequence of pyvista.DataSet or actors, optional
            Other occluders.
        time : float, optional
            Seconds, for sequences.
        file : str or Path, optional
            A ``.tif`` (``pip install pvibr[geo]``) or ``.npy`` to write the texture to, tile by
            tile: it may exceed memory.
        progress : bool, optional
            Show a progress bar; by default in terminals and notebooks.

        Returns
        -------
        pyvista.DataSet
            A copy with the arrays ``'projected'`` (n, 4) uint8, transparent outside the images,
            ``'covered'`` (n,) bool and ``'views'`` (n,) int, the number of images there.
        numpy.ndarray, shape (h, w, 4), uint8
            The texture, row 0 at the top; only for ``to='texture'``, whose mesh has no arrays.
            The path if written to a file.

        Raises
        ------
        ValueError
            If `to`, `size` or the suffix of `file` is invalid.
        ImportError
            If xatlas or rasterio is needed and not installed.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pvibr
        >>> red = np.zeros((8, 8, 3), np.uint8) + [255, 0, 0]
        >>> above = pvibr.Orthographic.from_extent(-1, 0, -1, 1, zmax=2)
        >>> plane = pv.Plane(i_size=2, j_size=2, i_resolution=2, j_resolution=1)
        >>> draped = pvibr.Projector(red.astype(np.uint8), above).bake(plane, to='cells')
        >>> draped['covered'].tolist(), draped['projected'][0].tolist()
        ([True, False], [255, 0, 0, 255])
        """
        check_one_of('to', to, ('points', 'cells', 'texture'))
        file = checked_file(file)
        surfaces = [surface_of(m) for m in (mesh, *casters)]
        outer_side = 0 if self.max_angle > 90 else sides_of(mesh, None)
        painter = SlidePainter(self._slides, self, surfaces, time, outer_side)
        if to == 'texture':
            painter.solve_gains(mesh)
            with baking(progress, 'Baking pictures') as advance:
                return baked_texture(mesh, size, painter.of_tiles, file, advance, side=_TILE)
        samples = Samples.of(mesh, to)
        colors, covered, views = painter.at(samples)
        if to == 'points':
            colors[:, :3] = samples.filled(colors[:, :3], covered)
        baked_mesh = mesh.copy()
        data = baked_mesh.point_data if to == 'points' else baked_mesh.cell_data
        data['projected'], data['covered'], data['views'] = colors, covered, views
        baked_mesh.set_active_scalars('projected', preference=to[:-1])
        return baked_mesh

    def bake_into(self, scene):
        """Export its images to a scene without pvibr."""

        def draped(samples, surfaces, side):
            side = 0 if self.max_angle > 90 else side
            painter = SlidePainter(self._slides, self, surfaces, scene.frame.time, side)
            return painter.at(samples)[0]

        scene.drape(
            draped,
            mode=self.mode,
            lit=self.lit,
            dim=self.outside_brightness,
            receives=self.actors,
            casts=self.casters,
        )


def _size(bounds) -> float:
    """Return the diagonal of the scene, the unit of length in shaders."""
    if not len(bounds):
        return 1.0
    lower, upper = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
    return float(np.linalg.norm(upper - lower)) or 1.0


@lru_cache(maxsize=64)
def _feature(number, lenses, has_depth, mode, is_lit, best, multisampled) -> Feature:
    """Return the shader text of a projector."""
    prefix = f'ibr_projector_{number}'
    text = sections(shader_source(__file__))
    shared = receiver_shader()
    samplers = {f'{prefix}_picture_{k}': 'sampler2D' for k in range(len(lenses))}
    samplers |= {f'{prefix}_depth_{k}': 'sampler2D' for k, s in enumerate(has_depth) if s}
    parts = [declared_samplers(samplers)]
    parts += [receiver_declarations(multisampled), shared['plane'], shared['seen']]
    parts.append(text['picture'])
    parts.append(f'#define BEST {int(best)}\n#define LIGHT {int(mode == "modulate")}\n')
    loop_body = text['begin']
    for k, (lens, is_occluded) in enumerate(zip(lenses, has_depth, strict=True)):
        parts.append(f'#define LENS {int(lens)}\n#define OCCLUSION {int(is_occluded)}\n')
        parts.append(text['slide'].replace('VIEW', str(k)))
        parts.append('#undef LENS\n#undef OCCLUSION\n')
        loop_body += text['one'].replace('VIEW', str(k))
    parts += [loop_body, text['end'], '#undef BEST\n#undef LIGHT\n']
    fragment = {'VTK::CustomUniforms::Dec': ''.join(parts)}
    light, color = '//VTK::Light::Impl\n', '//VTK::TCoord::Impl\n'
    if is_lit:
        fragment['VTK::Light::Impl'] = text['find'] + text['lit'] + light
    elif mode == 'modulate':
        fragment['VTK::Light::Impl'] = text['find'] + light + text['modulate']
    else:
        end = text['add' if mode == 'add' else 'over']
        fragment['VTK::TCoord::Impl'] = color + text['find'] + end
    fragment = {tag: part.replace('PRE', prefix) for tag, part in fragment.items()}
    return Feature(f'projector{number}', fragment=fragment, **receiver_stages())
