"""A mesh textured by any number of photographs."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import check_one_of, checked_each, naming
from pvibr.core.params import Param
from pvibr.core.plotters import is_dragged
from pvibr.core.progress import baking
from pvibr.gl import Texture, release, set_fragment_uniforms, set_vertex_uniforms, shader_source
from pvibr.gl.feature import Feature, FeatureSet, declared_samplers, sections
from pvibr.meshes.parts import as_parts
from pvibr.meshes.surfaces import check_points
from pvibr.photos.photo_bake import data_of, texture_of
from pvibr.photos.photo_choice import FACE_PHOTOS, Choice, Surface, Visibility, choose
from pvibr.photos.photo_colors import Pairs, unique_corners
from pvibr.photos.photo_cut import finer
from pvibr.photos.photo_pages import Needs, PhotoPages
from pvibr.photos.photo_sources import load_small, sources_of
from pvibr.photos.photo_views import VIEWS, PhotoViews
from pvibr.photos.photos import Photo
from pvibr.photos.slide import lens_numbers, plane_from_world
from pvibr.photos.texture_bake import checked_file
from pvibr.things.picking import nearest_actor
from pvibr.things.thing import Thing
from pvibr.visibility.surface_samples import polydata_of, surface_of, surfaces_of

_SHARPNESS = {'view': 1.0, 'feather': 1.0, 'best': 12.0}
_MIB = 1 << 20
#: Triangle size in pixels below which moving frames use corner colours, at quality 1.
_COARSE_PIXELS = 4.0
#: Width of the texture of point shares, texels.
_SHARES_WIDTH = 2048
_ATTRIBUTES = ('number', 'weight', 'mean', 'point', *(f'change{k}' for k in range(FACE_PHOTOS)))


class PhotoMesh(Thing):
    """Texture a mesh with any number of photographs.

    Each triangle blends the few photographs that see it whole and in most detail; exposures are
    equalized and seams levelled. Created by ``plotter.ibr.add_photos``.

    Parameters
    ----------
    mesh : pyvista.DataSet
        Mesh in world units; its surface is shown, and occludes itself.
    photos : Photo or sequence of Photo
        See :func:`pvibr.read_cameras`.
    masks : sequence, optional
        A path, an array or None for each photograph: 0 where it must not be used.
    casters : sequence of pyvista.DataSet, actors or things of pvibr, optional
        Other occluders.
    color : ColorLike, optional
        Colour where no photograph sees the mesh; by default the theme's.
    name : str, optional
        Name in the plotter; replaces whatever has the same name.
    **settings
        Values of the settings.

    Raises
    ------
    TypeError
        If an item of `photos` is not a photograph.
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
    moved_by = None
    web = 'baked', 'a mesh with the colours of its points, or a texture'

    opacity = Param(1.0, 'Opacity of the photographs over the colour of the mesh.', range='[0, 1]')
    lit = Param(
        False, 'Shade the photographs with the lights of the scene; for overcast photographs.'
    )
    gain = Param((1.0, 1.0, 1.0), 'RGB factors of all photographs.', range='[0, inf)')
    blend = Param(
        'view',
        'How overlapping photographs blend: favouring those taken from near the eye, which adds '
        'gloss and parallax; by a mean independent of the view; or the best photograph only.',
        choices=('view', 'feather', 'best'),
    )
    level = Param(
        'seams',
        'Colour correction between photographs: none, exposures, or exposures and seams.',
        choices=('none', 'gains', 'seams'),
    )
    max_angle = Param(
        85.0,
        'Maximum angle of incidence; lower it to leave out oblique, blurred views.',
        range='(0, 90]',
        unit='degrees',
    )
    memory = Param(
        512.0,
        'Memory of pictures on the GPU, and of a bake; more keeps larger pictures.',
        range='[1, 1048576]',
        unit='MiB',
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
        self._view_photos: dict = {}
        self._choice_key: tuple = ()
        self._halvings: dict = {}
        self._is_deferred = False
        self._bound: tuple = ()
        self._choose()

    # -- choice of photographs ----------------------------------------------------------------

    def _choose(self):
        """Choose the photographs of all triangles and level their colours."""
        choice_key = _SHARPNESS[self.blend], self.level, self.max_angle
        if self._choice_key == choice_key:
            return
        cameras = [source.camera for source in self.sources]
        surface = Surface(*finer(self._mesh.points, self._mesh.regular_faces, cameras))
        with Visibility([self._mesh, *self._casters]) as visibility:
            criteria = self.max_angle, _SHARPNESS[self.blend]
            self.choice: Choice = choose(surface, self.sources, visibility, *criteria)
        pairs, photo_count = Pairs(self.choice), len(self.sources)
        self.found_gains = np.ones((photo_count, 3)) if self.level == 'none' else self.choice.gains
        colors = pairs.colors(self.choice.points, self.sources) * self.found_gains[pairs.photos]
        seam_changes = np.zeros((len(pairs.keys), 3))
        if self.level == 'seams' and len(pairs.keys):
            seam_changes = pairs.corrections(colors)
        self.pairs = pairs
        # Index -1, no photograph, reads the padding.
        self.changes, colors = (np.pad(v / 255, ((0, 1), (0, 0))) for v in (seam_changes, colors))
        colors = np.clip(colors + self.changes, 0, 1)
        self._upload(colors)
        means = pairs.means(255 * colors)
        self._views = PhotoViews(surface, self.choice, self.sources, self.found_gains, means)
        self._view_key, self._view_photos = None, {}
        self._choice_key = choice_key

    def _upload(self, colors):
        """Set the mapper's mesh with photographs, weights, corrections and colours as arrays."""
        choice, changes = self.choice, self.changes
        numbers = np.repeat(choice.photos[:, None], 3, 1).reshape(-1, FACE_PHOTOS)
        weights = choice.weights.reshape(-1, FACE_PHOTOS)
        change_rows = self.pairs.of_corners.reshape(-1, FACE_PHOTOS)
        corners, faces = unique_corners(choice.faces.ravel(), numbers, weights)
        points = choice.faces.ravel()[corners]
        drawn_mesh = pv.PolyData.from_regular_faces(choice.points[points], faces.reshape(-1, 3))
        weights, change_rows = weights[corners], change_rows[corners]
        mean_colors = np.einsum('nk,nkd->nd', weights, colors[change_rows])
        mean_colors = np.column_stack([mean_colors, weights.sum(1)])
        corrections = (changes[change_rows[:, k]] for k in range(FACE_PHOTOS))
        arrays = [numbers[corners], weights, mean_colors, points, *corrections]
        for name, array in zip(_ATTRIBUTES, arrays, strict=True):
            data = _vtk.numpy_to_vtk(np.ascontiguousarray(array, np.float32), deep=True)
            data.SetName(f'pvibr {name}')
            drawn_mesh.GetPointData().AddArray(data)
        self.GetMapper().SetInputData(drawn_mesh)
        self._needs = Needs(choice, self.sources)
        self._covered = bool((choice.photos[:, 0] >= 0).all())

    # -- the life of an effect ----------------------------------------------------------------

    def _prepare_actor(self, color):
        """Map the point arrays to vertex attributes of the shader."""
        mapper = self.GetMapper()
        mapper.SetNumberOfSubPieces(1)
        mapper.ScalarVisibilityOff()
        for name in _ATTRIBUTES:
            points = _vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS
            mapper.MapDataArrayToVertexAttribute(f'ibr_photos_{name}', f'pvibr {name}', points, -1)
        self.ForceOpaqueOff()
        self.SetPickable(True)
        self.prop.color = pv.Color(color, default_color=pv.global_theme.color)

    def actors(self) -> list:
        """Return itself, the actor that draws."""
        return [self]

    solids = actors

    def SetPickable(self, pickable):
        """Set `pickable`, for VTK's pickers as well."""
        super().SetPickable(pickable)
        pv.Actor.SetPickable(self, self.pickable)

    def set_clipping_planes(self, planes):
        """Do nothing: its mapper already clips it."""

    def dataset(self):
        """Return the drawn triangles, before its matrix."""
        mesh = pv.wrap(self.GetMapper().GetInput()).copy(deep=False)
        mesh.clear_data()
        return mesh

    def pick(self, x, y):
        """Return the hit at a pixel; ``index`` is the triangle of the surface."""
        if not self.pickable or self.pipeline is None or not self.visibility:
            return None
        hit = nearest_actor([self], self.pipeline.renderer, x, y, cells=True)
        return hit and replace(hit, index=int(self.choice.origin[hit.index]))

    def draws(self, frame, *, depth=False):
        """Return itself; prepare photographs unless only depth is drawn."""
        if not depth:
            self.prepare(frame)
        return [self]

    def bake_into(self, scene):
        """Export the mesh to a scene without pvibr."""
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
            return 'edges are shown, and their shader passes no photographs on'
        if not self.GetMatrix().Determinant():
            return 'its matrix has no inverse'
        return True if self.opacity else 'opacity is 0'

    def content_key(self) -> tuple:
        """Return a value that changes with its appearance."""
        return self.revision, self.GetMTime(), self._pages and self._pages.loads

    @property
    def unfinished(self) -> bool:
        """Whether larger pictures load once the view rests."""
        return self._is_deferred

    def prepare(self, frame):
        """Load and bind the pictures that the view needs."""
        self._choose()
        if self._pages is None or self._pages.memory != self.memory * _MIB:
            release(self._pages)
            self._pages = PhotoPages(frame.window, self.sources, self.memory * _MIB)
        if frame.own:
            self._refine(frame)
        coarse_size = _COARSE_PIXELS / max(frame.quality, 1e-9)
        coarse = frame.quality < 1 and self._needs.size(frame, self.matrix) < coarse_size
        is_opaque = self._covered and self.opacity == 1
        by_view = self.blend == 'view' and frame.quality >= 1 and bool(self._view_photos)
        feature = _feature(self.lit, self._needs.bent, coarse, is_opaque, by_view)
        self._attached.match([self], lambda _: (feature,))
        uniforms = {'ibr_photos_opacity': float(self.opacity), 'ibr_photos_gain': tuple(self.gain)}
        if not coarse:
            uniforms |= self._bind(frame, by_view)
        set_fragment_uniforms([self], uniforms)

    def _bind(self, frame, by_view) -> dict:
        """Bind the photographs; return the uniforms of the fragment shader."""
        if self._table is None:
            self._table = Texture(frame.window)
        self._table.upload(self._table_rows(frame).astype(np.float32))
        self._bound = self._table, self._pages.sheet.texture, *by_view * [self._shares]
        table, sheet, *shares = (texture.activate() for texture in self._bound)
        vertex: dict = {'ibr_photos_parallel': int(frame.parallel), 'ibr_photos_table': table}
        if by_view:
            numbers = (list(self._view_photos) + VIEWS * [-1])[:VIEWS]
            vertex |= {'ibr_photos_shares': shares[0], 'ibr_photos_shown': numbers}
        set_vertex_uniforms([self], vertex)
        uniforms = {'ibr_photos_looks': table, 'ibr_photos_sheet': sheet}
        return uniforms | {'ibr_photos_fine': int(frame.quality >= 1)}

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
        self._pages = self._table = self._shares = self._view_key = None
        self._view_photos = {}

    def report(self) -> dict:
        """Return bytes, and the number of photographs held at each size."""
        photos = self.choice.photos
        return {
            **({'bytes': 0} if self._pages is None else self._pages.report()),
            'photos': len(self.photos),
            'used': len(np.unique(photos[photos >= 0])),
            'bare triangles': int((photos[:, 0] < 0).sum()),
        }

    # -- pictures for the view ---------------------------------------------------------------

    def _refine(self, frame):
        if is_dragged(frame.window) or frame.quality < 1:
            self._is_deferred = True
            return
        halvings = self._needs.of(frame, self.matrix)
        if self.blend == 'view':
            self._update_view(frame)
            view = self._view_photos
            halvings = view | {k: min(v, view.get(k, v)) for k, v in halvings.items()}
        stale = self._pages.stale(halvings)
        is_moving = halvings != self._halvings and not frame.window.GetOffScreenRendering()
        self._halvings = halvings
        self._is_deferred = bool(stale) and is_moving
        if stale and not self._is_deferred:
            self._pages.refine(stale, halvings)

    def _update_view(self, frame):
        """Select the photographs taken from near the eye, and upload their shares."""
        clip_from_mesh = frame.clip_from_view @ frame.view_from_world @ self.matrix
        if self._view_key is not None and np.array_equal(self._view_key, clip_from_mesh):
            return
        self._view_key = clip_from_mesh
        self._view_photos, shares = self._views.of(frame, self.matrix)
        row_padding = -len(shares) % _SHARES_WIDTH
        shares = np.pad(shares, ((0, row_padding), (0, 0))).reshape(-1, _SHARES_WIDTH, VIEWS)
        self._shares = self._shares or Texture(frame.window)
        self._shares.upload(shares.astype(np.float32))

    def _table_rows(self, frame) -> np.ndarray:
        """Return TABLE of photo_mesh.glsl, (n, 9, 4)."""
        view_from_mesh = frame.view_from_world @ self.matrix
        mesh_from_pixel = np.linalg.inv(frame.pixel_from_view @ view_from_mesh)
        table = self._cameras.copy()
        table[:, :3] @= mesh_from_pixel
        sheet_places = self._pages.places()
        sizes = sheet_places[:, 2:, None]
        table[:, 5:7, :3] *= sizes
        table[:, 5:7, 2] += sheet_places[:, :2]
        table[:, 7] = np.concatenate(
            [sheet_places[:, :2], sheet_places[:, :2] + sheet_places[:, 2:]], 1
        )
        table[:, 8, :3] = self.found_gains
        return table

    # -- as data ------------------------------------------------------------------------------

    def bake(self, to='texture', *, size=2048, quality=False, file=None, progress=None):
        """Return the mesh with photograph colours as data.

        Parameters
        ----------
        to : {'texture', 'points', 'cells'}
            Location of the colours. A texture needs texture coordinates; without them, xatlas
            generates them (``pip install pvibr[uv]``).
        size : int or tuple of 2 int, optional
            Width and height of the texture in pixels.
        quality : bool, optional
            Also return the images of a quality map, with a texture.
        file : str or Path, optional
            A ``.tif`` (``pip install pvibr[geo]``) or ``.npy`` to write the texture to, tile by
            tile: it may exceed memory. Images of a quality map are written beside it, as
            ``name_photo.tif``.
        progress : bool, optional
            Show a progress bar; by default in terminals and notebooks.

        Returns
        -------
        pyvista.PolyData
            The triangles of the surface. Unless `to` is a texture, with the arrays ``'projected'``
            (n, 4) uint8, ``'photo'``, the index of the photograph with the largest weight or -1,
            ``'resolution'``, world units per pixel of it on the surface, and ``'angle'`` of
            incidence in degrees; these are NaN where no photograph sees the surface.
        numpy.ndarray, shape (h, w, 4), uint8
            The texture, row 0 at the top, padded around charts. Where no photograph sees the
            surface alpha is 0 and RGB its own colour; drop alpha to show it as here. The path if
            written to a file.
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
        self._choose()
        with baking(progress, 'Baking photographs') as advance:
            if to == 'texture':
                return texture_of(self, self._mesh, size, quality, file, advance)
            return data_of(self, self._mesh, to, advance)


def _triangles(mesh) -> pv.PolyData:
    """Return the triangles of a mesh's surface with texture coordinates, without other data."""
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(f'mesh must be a pyvista.DataSet, got {mesh!r:.60}')
    if mesh.n_points:
        check_points(mesh)
    surface = polydata_of(mesh).triangulate()
    triangles = surface_of(surface)
    if surface.active_texture_coordinates is not None:
        triangles.active_texture_coordinates = surface.active_texture_coordinates
    if not triangles.n_cells:
        raise ValueError('mesh must have triangles, got none')
    return triangles


def _checked_photos(photos) -> tuple:
    allowed = 'photographs, as of pvibr.read_cameras'
    photos = checked_each('photos', photos, lambda p: isinstance(p, Photo), allowed)
    if not photos:
        raise ValueError('photos must have at least one photograph, got none')
    return photos


def _cameras(sources) -> np.ndarray:
    """Return the part of TABLE in photo_mesh.glsl that depends on cameras only, (n, 9, 4)."""
    table = np.zeros((len(sources), 9, 4))
    for row, source in zip(table, sources, strict=True):
        lens, radius, uv = lens_numbers(source.camera)
        row[:3] = plane_from_world(source.camera, 1.0)[[0, 1, 3]]
        row[3:5] = lens.reshape(2, 4)
        row[5:7, :3], row[5, 3] = uv, radius
    return table


def _checked_masks(masks, count):
    with naming('masks', masks):
        masks = None if masks is None else list(masks)
    if masks is not None and len(masks) != count:
        raise ValueError(f'masks must have {count} entries, one per photograph, got {len(masks)}')
    return masks


@lru_cache(maxsize=8)
def _feature(lit, has_lens, coarse, is_opaque, by_view) -> Feature:
    """Return the shader text."""
    text = sections(shader_source(__file__))
    prefix = 'coarse.' if coarse else ''
    samplers = f'#define PHOTOS_WHOLE {int(is_opaque)}\n'
    defines = f'#define PHOTOS_LENS {int(has_lens)}\n#define PHOTOS_VIEWS {int(by_view)}\n'
    lens = '' if coarse else defines + text['lens']
    fragment_samplers = () if coarse else ('ibr_photos_looks', 'ibr_photos_sheet')
    samplers += declared_samplers(dict.fromkeys(fragment_samplers, 'sampler2D'))
    light = text['fragment.lit'] + '//VTK::Light::Impl\n' if lit else text['fragment.over']
    fragment = {
        'VTK::CustomUniforms::Dec': samplers + lens + text[f'{prefix}fragment.declare'],
        # Before depth peeling discards fragments: derivatives need them all.
        'VTK::UniformFlow::Impl': '//VTK::UniformFlow::Impl\n' + text[f'{prefix}fragment.find'],
        'VTK::Light::Impl': light,
    }
    vertex_samplers = [] if coarse else ['ibr_photos_table'] + by_view * ['ibr_photos_shares']
    sampler = declared_samplers(dict.fromkeys(vertex_samplers, 'sampler2D'))
    vertex = {
        'VTK::CustomUniforms::Dec': sampler + lens + text[f'{prefix}vertex.declare'],
        'VTK::PositionVC::Impl': '//VTK::PositionVC::Impl\n' + text[f'{prefix}vertex.place'],
    }
    return Feature('photos', vertex, fragment)
