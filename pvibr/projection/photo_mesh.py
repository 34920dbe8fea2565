"""A mesh under any number of photographs, as one surface."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.cameras.photos import Photo
from pvibr.core import _vtk
from pvibr.core.params import Param
from pvibr.core.plotters import is_dragged
from pvibr.core.progress import baking
from pvibr.gl import Texture, release, set_fragment_uniforms, set_vertex_uniforms, shader_source
from pvibr.gl.feature import Feature, FeatureSet, declared_samplers, sections
from pvibr.maths.arguments import check_one_of, checked_each, naming
from pvibr.meshes.parts import as_parts
from pvibr.projection.photo_bake import data_of, texture_of
from pvibr.projection.photo_choice import SHOWN, Choice, Surface, Visibility, choose
from pvibr.projection.photo_colors import Pairs, alike_corners
from pvibr.projection.photo_cut import finer
from pvibr.projection.photo_pages import Needs, PhotoPages
from pvibr.projection.photo_sources import load_small, sources_of
from pvibr.projection.photo_views import VIEWS, PhotoViews
from pvibr.projection.samples import surface_of, surfaces_of
from pvibr.projection.slide import lens_numbers, plane_from_world
from pvibr.projection.texture_bake import checked_file
from pvibr.scene.picking import nearest_actor
from pvibr.scene.placing import Placed

_SHARP = {'view': 1.0, 'feather': 1.0, 'best': 12.0}
_MIB = 1 << 20
#: Pixels along a triangle below which moving frames have the colours of corners, at quality 1.
_COARSE = 4.0
#: Texels along a row of the shares that photographs of a view have of points.
_ROW = 2048
_NAMES = ('number', 'weight', 'mean', 'point', *(f'change{k}' for k in range(SHOWN)))


class PhotoMesh(Placed):
    """Show a mesh in the colours of photographs, however many, as one surface.

    Each triangle shows the best few photographs that see all of it, by the pixels that they have
    there; exposures are equalized and seams levelled. ``plotter.ibr.add_photos`` makes one.

    Parameters
    ----------
    mesh : pyvista.DataSet
        World units; its surface is shown, and hides itself from cameras.
    photos : Photo or sequence of Photo
        See :func:`pvibr.read_cameras`.
    masks : sequence, optional
        A path, an array or None for each: 0 where the photograph must not be used.
    casters : sequence of pyvista.DataSet, actors or things of pvibr, optional
        Other occluders.
    color : ColorLike, optional
        Colour where no photograph sees the mesh; by default the theme's.
    name : str, optional
        Name in the plotter; what has the same name is replaced.
    **settings
        Values of the settings.

    Raises
    ------
    TypeError
        If `photos` has something that is no photograph.
    ValueError
        If there are no photographs, one has no picture, or the number of `masks` differs.

    Examples
    --------
    >>> import numpy as np
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pyvista import examples
    >>> K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
    >>> camera = pvibr.Pinhole(K, np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 3.0], (2048, 1024))
    >>> photo = pvibr.Photo('a.jpg', camera, examples.mapfile)
    >>> plane = pv.Plane(i_size=2, j_size=2, i_resolution=2, j_resolution=1)
    >>> painted = pvibr.PhotoMesh(plane, [photo])
    >>> painted.bake('cells')['photo'].tolist()
    [0, 0, 0, 0]
    """

    FOR_USERS = ('photos', 'choice', 'found_gains', 'bake')
    web = 'baked', 'a mesh with the colours of its points, or a texture'

    opacity = Param(1.0, 'Opacity of the photographs.', range='[0, 1]')
    lit = Param(False, 'Whether the scene lights the photographs.')
    gain = Param((1.0, 1.0, 1.0), 'Factors of red, green and blue.', range='[0, inf)')
    blend = Param(
        'view',
        'Overlaps: a weighted mean, mostly of those taken from near the eye; one that is the same '
        'from everywhere; or the best photograph, with borders a triangle wide.',
        choices=('view', 'feather', 'best'),
    )
    level = Param(
        'seams',
        'What is levelled between photographs: nothing, their exposures, or their seams too.',
        choices=('none', 'gains', 'seams'),
    )
    max_angle = Param(85.0, 'Maximum angle of incidence.', range='(0, 90]', unit='degrees')
    memory = Param(
        512.0, 'Memory of pictures on the GPU, and of a bake.', range='[1, inf)', unit='MiB'
    )

    def __init__(self, mesh, photos, *, masks=None, casters=(), color=None, name=None, **settings):
        photos = _checked_photos(photos)
        masks = _checked_masks(masks, len(photos))
        super().__init__(**settings)
        self.name, self.photos = name, photos
        self._mesh = _triangles(mesh)
        self._casters = surfaces_of(casters)
        self.sources = sources_of(photos, masks)
        load_small(self.sources)
        self._prepare_actor(color)
        self._cameras = _cameras(self.sources)
        self._attached = FeatureSet()
        self._pages: Any = None
        self._table: Any = None
        self._shares: Any = None
        self._shown: dict = {}
        self._known: tuple = ()
        self._wanted: dict = {}
        self._later = False
        self._bound: tuple = ()
        self._make()

    # -- what is chosen -----------------------------------------------------------------------

    def _make(self):
        """Choose the photographs of all triangles, and level their colours."""
        key = _SHARP[self.blend], self.level, self.max_angle
        if self._known == key:
            return
        cameras = [source.camera for source in self.sources]
        surface = Surface(*finer(self._mesh.points, self._mesh.regular_faces, cameras))
        with Visibility([self._mesh, *self._casters]) as visibility:
            how = self.max_angle, _SHARP[self.blend]
            self.choice: Choice = choose(surface, self.sources, visibility, *how)
        pairs, count = Pairs(self.choice), len(self.sources)
        self.found_gains = np.ones((count, 3)) if self.level == 'none' else self.choice.gains
        colors = pairs.colors(self.choice.points, self.sources) * self.found_gains[pairs.photos]
        changes = np.zeros((len(pairs.keys), 3))
        if self.level == 'seams' and len(pairs.keys):
            changes = pairs.corrections(colors)
        self.pairs = pairs
        # The last is of none.
        self.changes, colors = (np.pad(v / 255, ((0, 1), (0, 0))) for v in (changes, colors))
        colors = np.clip(colors + self.changes, 0, 1)
        self._show(colors)
        self._views = PhotoViews(
            surface, self.choice, self.sources, self.found_gains, pairs.means(255 * colors)
        )
        self._viewed, self._shown = None, {}
        self._known = key

    def _show(self, colors):
        """Give the actor the mesh, its photographs, their weights, corrections and colours."""
        choice, changes = self.choice, self.changes
        numbers = np.repeat(choice.photos[:, None], 3, 1).reshape(-1, SHOWN)
        weights, change = (
            choice.weights.reshape(-1, SHOWN),
            self.pairs.of_corners.reshape(-1, SHOWN),
        )
        rows, faces = alike_corners(choice.faces.ravel(), numbers, weights)
        points = choice.faces.ravel()[rows]
        found = pv.PolyData.from_regular_faces(choice.points[points], faces.reshape(-1, 3))
        mean = np.einsum('nk,nkd->nd', weights[rows], colors[change[rows]])
        mean = np.column_stack([mean, weights[rows].sum(1)])
        corrections = (changes[change[rows, k]] for k in range(SHOWN))
        arrays = [numbers[rows], weights[rows], mean, points, *corrections]
        for name, array in zip(_NAMES, arrays, strict=True):
            data = _vtk.numpy_to_vtk(np.ascontiguousarray(array, np.float32), deep=True)
            data.SetName(f'pvibr {name}')
            found.GetPointData().AddArray(data)
        self.GetMapper().SetInputData(found)
        self._needs = Needs(choice, self.sources)
        self._covered = bool((choice.photos[:, 0] >= 0).all())

    # -- the life of an effect ----------------------------------------------------------------

    def _prepare_actor(self, color):
        """Draw by itself, with arrays of points that the vertex shader reads."""
        mapper = self.GetMapper()
        mapper.SetNumberOfSubPieces(1)
        mapper.ScalarVisibilityOff()
        for name in _NAMES:
            points = _vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS
            mapper.MapDataArrayToVertexAttribute(f'ibr_photos_{name}', f'pvibr {name}', points, -1)
        self.ForceOpaqueOff()
        self.SetPickable(True)
        self.prop.color = pv.Color(color, default_color=pv.global_theme.color)

    def actors(self) -> list:
        """Return itself: it is the actor that draws."""
        return [self]

    solids = actors

    def SetPickable(self, pickable):
        """Set `pickable`, also for VTK's pickers."""
        super().SetPickable(pickable)
        pv.Actor.SetPickable(self, self.pickable)

    def set_clipping_planes(self, planes):
        """Do nothing: its own mapper clips it."""

    def dataset(self):
        """Return the triangles that are drawn, before they are placed."""
        mesh = pv.wrap(self.GetMapper().GetInput()).copy(deep=False)
        mesh.clear_data()
        return mesh

    def pick(self, x, y):
        """Return the hit at a pixel; its ``index`` is the triangle of the surface."""
        if not self.pickable or self.pipeline is None or not self.visibility:
            return None
        hit = nearest_actor([self], self.pipeline.renderer, x, y, cells=True)
        return hit and replace(hit, index=int(self.choice.origin[hit.index]))

    def draws(self, frame, *, depth=False):
        """Return itself; its depth needs no photographs."""
        if not depth:
            self.prepare(frame)
        return [self]

    def bake_into(self, scene):
        """Hand the mesh to a scene without pvibr."""
        if self._mesh.active_texture_coordinates is None:
            mesh = self.bake('points')
            mesh['projected'][:, 3] = 255
            look = {'scalars': 'projected', 'rgb': True}
        else:
            mesh, image = self.bake(size=min(scene.texels, 4096))
            look = {'texture': pv.Texture(np.ascontiguousarray(image[..., :3]))}
        mesh = mesh.transform(self.matrix, inplace=False)
        scene.part(self, as_parts(mesh, lighting=self.lit, **look)[0])

    def needed(self, frame) -> bool | str:
        """Return True if the photographs are visible."""
        if not self.visibility:
            return 'not visible'
        prop = self.prop
        if prop.GetEdgeVisibility() or prop.GetRenderLinesAsTubes():
            return 'edges are shown: their shader hands no photographs on'
        if not self.GetMatrix().Determinant():
            return 'its matrix has no inverse'
        return True if self.opacity else 'opacity is 0'

    def content_key(self) -> tuple:
        """Return a value that changes with what it shows."""
        return self.revision, self.GetMTime(), self._pages and self._pages.loads

    @property
    def unfinished(self) -> bool:
        """Whether larger pictures wait until the view rests."""
        return self._later

    def prepare(self, frame):
        """Load the pictures that the view needs, and bind them."""
        self._make()
        if self._pages is None or self._pages.memory != self.memory * _MIB:
            release(self._pages)
            self._pages = PhotoPages(frame.window, self.sources, self.memory * _MIB)
        if frame.own:
            self._refine(frame)
        coarse = (
            frame.quality < 1 and self._needs.size(frame, self.matrix) < _COARSE / frame.quality
        )
        whole = self._covered and self.opacity == 1
        views = self.blend == 'view' and frame.quality >= 1 and bool(self._shown)
        feature = _feature(self.lit, self._needs.bent, coarse, whole, views)
        self._attached.match([self], lambda _: (feature,))
        uniforms = {'ibr_photos_opacity': float(self.opacity), 'ibr_photos_gain': tuple(self.gain)}
        if not coarse:
            uniforms |= self._bind(frame, views)
        set_fragment_uniforms([self], uniforms)

    def _bind(self, frame, views) -> dict:
        """Bind the photographs; return what the fragment shader is told."""
        if self._table is None:
            self._table = Texture(frame.window)
        self._table.upload(self._rows(frame).astype(np.float32))
        self._bound = self._table, self._pages.sheet.texture, *views * [self._shares]
        table, sheet, *shares = (texture.activate() for texture in self._bound)
        vertex: dict = {'ibr_photos_parallel': int(frame.parallel), 'ibr_photos_table': table}
        if views:
            numbers = (list(self._shown) + VIEWS * [-1])[:VIEWS]
            vertex |= {'ibr_photos_shares': shares[0], 'ibr_photos_shown': numbers}
        set_vertex_uniforms([self], vertex)
        found = {'ibr_photos_looks': table, 'ibr_photos_sheet': sheet}
        return found | {'ibr_photos_fine': int(frame.quality >= 1)}

    def finish(self, frame):
        """Release the texture units."""
        for texture in self._bound:
            texture.deactivate()
        self._bound = ()
        self._attached.leave_shared()

    def deactivate(self):
        """Detach the shader text."""
        self._attached.clear()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.deactivate()
        release(self._pages, self._table, self._shares)
        self._pages = self._table = self._shares = self._viewed = None
        self._shown = {}

    def report(self) -> dict:
        """Return bytes, and how many photographs are held in which size."""
        held = {'bytes': 0} if self._pages is None else self._pages.report()
        triangles = self.choice.photos[:, 0]
        return {
            **held,
            'photos': len(self.photos),
            'used': int((np.bincount(self.choice.photos[self.choice.photos >= 0]) > 0).sum()),
            'bare triangles': int((triangles < 0).sum()),
        }

    # -- pictures that a view needs -----------------------------------------------------------

    def _refine(self, frame):
        if is_dragged(frame.window) or frame.quality < 1:
            self._later = True
            return
        wanted = self._needs.of(frame, self.matrix)
        if self.blend == 'view':
            self._see(frame)
            wanted = self._shown | {k: min(v, self._shown.get(k, v)) for k, v in wanted.items()}
        stale = self._pages.stale(wanted)
        moving = wanted != self._wanted and not frame.window.GetOffScreenRendering()
        self._wanted = wanted
        self._later = bool(stale) and moving
        if stale and not self._later:
            self._pages.refine(stale, wanted)

    def _see(self, frame):
        """Find the photographs that were taken from near the eye, and what they show."""
        view = frame.clip_from_view @ frame.view_from_world @ self.matrix
        if self._viewed is not None and np.array_equal(self._viewed, view):
            return
        self._viewed = view
        self._shown, shares = self._views.of(frame, self.matrix)
        more = -len(shares) % _ROW
        shares = np.pad(shares, ((0, more), (0, 0))).reshape(-1, _ROW, VIEWS)
        self._shares = self._shares or Texture(frame.window)
        self._shares.upload(shares.astype(np.float32))

    def _rows(self, frame) -> np.ndarray:
        """Return the numbers of TABLE in photo_mesh.glsl, (n, 9, 4)."""
        clip = frame.clip_from_view
        seen = np.stack([clip[0], clip[1], clip[2 if frame.parallel else 3], [0, 0, 0, 1.0]])
        world = np.linalg.inv(seen @ frame.view_from_world @ self.matrix)
        table = self._cameras.copy()
        table[:, :3] @= world
        places = self._pages.places()
        size = places[:, 2:, None]
        table[:, 5:7, :3] *= size
        table[:, 5:7, 2] += places[:, :2]
        table[:, 7] = np.concatenate([places[:, :2], places[:, :2] + places[:, 2:]], 1)
        table[:, 8, :3] = self.found_gains
        return table

    # -- as data ------------------------------------------------------------------------------

    def bake(self, to='texture', *, size=2048, quality=False, file=None, progress=None):
        """Return the mesh with the colours of its photographs as data.

        Parameters
        ----------
        to : {'texture', 'points', 'cells'}
            Location of the colours. A texture needs texture coordinates; without them, xatlas
            generates them (``pip install pvibr[uv]``).
        size : int or tuple of 2 int, optional
            Width and height of the texture in pixels.
        quality : bool, optional
            Whether to return, with a texture, the images of a quality map.
        file : str or Path, optional
            A ``.tif`` (``pip install pvibr[geo]``) or ``.npy`` that a texture is written to, tile
            by tile: it may be larger than memory. Images of a quality map are written beside it,
            as ``name_photo.tif``.
        progress : bool, optional
            Show a progress bar; by default in terminals and notebooks.

        Returns
        -------
        pyvista.PolyData
            The triangles of the surface. Unless `to` is a texture, with the arrays ``'projected'``
            (n, 4) uint8, ``'photo'``, the index of the photograph that has most of it or -1,
            ``'resolution'``, world units per pixel of it on the surface, and ``'angle'`` in
            degrees; these are NaN where no photograph sees the surface.
        numpy.ndarray, shape (h, w, 4), uint8
            The texture, row 0 at the top; texels around its parts have their colours. Where no
            photograph sees the surface alpha is 0, and the others are its own colour: drop alpha
            to show it as this does. The path if it was written to a file.
        dict
            If `quality`: the images (h, w) ``'photo'``, ``'resolution'`` and ``'angle'``, or
            their paths.

        Raises
        ------
        ValueError
            If `to`, `size` or the suffix of `file` is invalid.
        ImportError
            If xatlas or rasterio is needed and not installed.
        """
        check_one_of('to', to, ('texture', 'points', 'cells'))
        file = checked_file(file)
        self._make()
        with baking(progress, 'Baking photographs') as advance:
            if to == 'texture':
                return texture_of(self, self._mesh, size, quality, file, advance)
            return data_of(self, self._mesh, to, advance)


def _triangles(mesh) -> pv.PolyData:
    """Return the triangles of a mesh's surface, with its texture coordinates only."""
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(f'mesh is {mesh!r:.60}; it must be a mesh.')
    surface = mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm=None)
    surface = surface.triangulate()
    found = surface_of(surface)
    if surface.active_texture_coordinates is not None:
        found.active_texture_coordinates = surface.active_texture_coordinates
    if not found.n_cells:
        raise ValueError('mesh has no triangles.')
    return found


def _checked_photos(photos) -> tuple:
    photos = checked_each('photos', photos, _is_photo, 'photographs, as of pvibr.read_cameras')
    if not photos:
        raise ValueError('photos is empty; it must have at least one photograph.')
    return photos


def _cameras(sources) -> np.ndarray:
    """Return what TABLE in photo_mesh.glsl has of cameras, for world space, (n, 9, 4)."""
    found = np.zeros((len(sources), 9, 4))
    for row, source in zip(found, sources, strict=True):
        lens, radius, uv = lens_numbers(source.camera)
        row[:3] = plane_from_world(source.camera, 1.0)[[0, 1, 3]]
        row[3:5] = lens.reshape(2, 4)
        row[5:7, :3], row[5, 3] = uv, radius
    return found


def _is_photo(one) -> bool:
    return isinstance(one, Photo)


def _checked_masks(masks, count):
    with naming('masks', masks):
        masks = None if masks is None else list(masks)
    if masks is not None and len(masks) != count:
        raise ValueError(f'masks has {len(masks)} entries; there are {count} photographs.')
    return masks


@lru_cache(maxsize=8)
def _feature(lit, bent, coarse, whole, views) -> Feature:
    """Return the shader text."""
    text = sections(shader_source(__file__))
    start = 'coarse.' if coarse else ''
    samplers = f'#define PHOTOS_WHOLE {int(whole)}\n'
    defines = f'#define PHOTOS_LENS {int(bent)}\n#define PHOTOS_VIEWS {int(views)}\n'
    lens = '' if coarse else defines + text['lens']
    names = () if coarse else ('ibr_photos_looks', 'ibr_photos_sheet')
    samplers += declared_samplers(dict.fromkeys(names, 'sampler2D'))
    light = text['fragment.lit'] + '//VTK::Light::Impl\n' if lit else text['fragment.over']
    fragment = {
        'VTK::CustomUniforms::Dec': samplers + lens + text[f'{start}fragment.declare'],
        # Before the passes of depth peeling end some fragments: derivatives need them all.
        'VTK::UniformFlow::Impl': '//VTK::UniformFlow::Impl\n' + text[f'{start}fragment.find'],
        'VTK::Light::Impl': light,
    }
    tables = [] if coarse else ['ibr_photos_table'] + views * ['ibr_photos_shares']
    sampler = declared_samplers(dict.fromkeys(tables, 'sampler2D'))
    vertex = {
        'VTK::CustomUniforms::Dec': sampler + lens + text[f'{start}vertex.declare'],
        'VTK::PositionVC::Impl': '//VTK::PositionVC::Impl\n' + text[f'{start}vertex.place'],
    }
    return Feature('photos', vertex, fragment)
