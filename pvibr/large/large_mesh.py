"""One large mesh, fluent while it moves and exact when it rests."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import checked_number
from pvibr.core.child_processes import can_start
from pvibr.core.determinism import is_deterministic
from pvibr.core.params import Param, checked_flag
from pvibr.core.signatures import takes
from pvibr.large.baked_cut import bake_cut
from pvibr.large.build_job import BuildJob
from pvibr.large.colouring import Coloring, fade_edges
from pvibr.large.cut import ModelView
from pvibr.large.cut_mesh import CutLook, CutMesh
from pvibr.large.draft import build_draft
from pvibr.large.drawn_surface import DrawnSurface, checked_part
from pvibr.large.full_picking import nearest_triangle
from pvibr.large.left_out import leave_out_unused
from pvibr.large.solid_cut import SolidCut
from pvibr.large.sources import NO_COORDINATES, checked_texture
from pvibr.large.stored import built, cache_of, hierarchy_key, opened
from pvibr.large.tolerance import Tolerance
from pvibr.meshes.parts import as_parts
from pvibr.textures.material_textures import copy_property
from pvibr.things.clipping import ClippingPlanes, set_planes
from pvibr.things.picking import Hit, pixel_ray
from pvibr.things.thing import Thing

#: Triangles up to which a mesh is built at once, even in a window.
_SMALL = 100_000

#: Arguments of add_mesh that have no effect here, or are not there.
REFUSED = (
    *('style', 'point_size', 'render_points_as_spheres', 'render_lines_as_tubes'),
    *('split_sharp_edges', 'feature_angle', 'use_transparency'),
)


class LargeMesh(Thing):
    """Draw a mesh of millions of triangles by simplified patches, within an error in pixels.

    Parameters
    ----------
    mesh : pyvista.DataSet, pyvista.MultiBlock, trimesh mesh or scene, or path
        The mesh; its surface is drawn, by its materials. Also a ``.pvl`` file that ``pvibr build``
        or ``mesh.ibr.large`` wrote, which is mapped into memory.
    max_error : float
        Maximum distance of the drawn surface from the mesh, in pixels.
    moving : float, optional
        Frame time in ms that is met while the view moves, by a larger error.
    detail : {'normals', 'none'}
        Draw at rest as many triangles as normals and colours need, or only those of `max_error`.
    scalars : str or array_like, shape (n,), (n, 3) or (n, 4), optional
        Values of points or cells that `cmap` colours, or colours with ``rgb=True``; by default
        the active scalars. Simplified patches show means by area, or what most of it has if they
        are words, truth values or `categories`. Cells of some pixels show their own values.
    cmap, clim : optional
        As in ``add_mesh``.
    smooth_shading : bool, optional
        Interpolate normals, by default as the theme says. Flat shading shows the facets of the
        triangles that are drawn, a few pixels wide: smooth looks more like a fine mesh.
    opacity : float, str or array_like
        Opacity of the whole, 0 to 1; or as in ``add_mesh`` that of each of the scalars: an array
        or its name, or a transfer function such as ``'linear'``.
    name : str, optional
        Name in the plotter and in reports.
    pickable : bool
        Allow picking.
    cache : bool or path
        Keep the hierarchy on disk, or the folder of the cache.
    progress : bool, optional
        Show a progress bar while the hierarchy is built; by default in terminals and notebooks.
    wait : bool, optional
        Wait until the hierarchy is built. Otherwise another process builds it, and a coarse draft
        is drawn; screenshots, movies and exports wait. By default off screen, but not in windows
        and notebooks.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the looks.
    user_matrix : array_like, shape (4, 4), optional
        Its transform, as of any actor.
    part : (int, int), optional
        Draw only what is in box `index` of `count` that divide the mesh: for shards of a cluster.
        All parts together are the mesh.
    **look
        As in :meth:`pyvista.Plotter.add_mesh`.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> sphere = pv.Sphere(theta_resolution=200, phi_resolution=200)
    >>> pl = pv.Plotter(off_screen=True)
    >>> ball = pl.ibr.add(pvibr.LargeMesh(sphere, max_error=2.0, cache=False))
    >>> ball.n_triangles
    79200
    >>> pl.show(auto_close=False)
    >>> ball.report()['triangles'] < ball.n_triangles
    True
    >>> pl.close()
    """

    FOR_USERS = ('n_triangles', 'refined', 'set_scalars', 'cut', 'pick')
    moved_by = None
    web = 'baked', 'the mesh of the current view'
    keeps_arguments = False

    max_error = Param(
        1.0,
        'Maximum distance of the drawn surface from the mesh at rest: raise it for speed; 0 draws '
        'the mesh itself.',
        range='[0, inf)',
        unit='px',
    )
    moving = Param(
        None,
        'Frame time that is met while the view moves, by a larger error; by default that of the '
        'plotter, `interactive_frame_ms`. The least of all applies; 0 keeps `max_error`.',
        range='[0, inf)',
        unit='ms',
        kind=float,
    )

    detail = Param(
        'normals',
        'Whether a view at rest is refined where normals or colours would be blurred, to about a '
        'vertex per pixel; none draws fewer triangles: for movies and shapes without relief.',
        choices=('normals', 'none'),
    )

    frame_ms: Any = property(attrgetter('moving'))

    @takes(look=as_parts, without=REFUSED)
    def __init__(
        self,
        mesh,
        *,
        max_error=1.0,
        moving=None,
        detail='normals',
        scalars=None,
        cmap=None,
        clim=None,
        smooth_shading=None,
        opacity=1.0,
        name=None,
        pickable=True,
        cache=True,
        progress=None,
        wait=None,
        theme=None,
        user_matrix=None,
        part=None,
        **look,
    ):
        super().__init__(max_error=max_error, moving=moving, detail=detail)
        self._part = checked_part(part)
        if user_matrix is not None:
            self.user_matrix = user_matrix
        self.name, self.pickable = name, pickable
        look |= {'cmap': cmap, 'clim': clim, 'smooth_shading': smooth_shading, 'theme': theme}
        is_number = np.ndim(opacity) == 0 and not isinstance(opacity, str)
        look['opacity'] = checked_number('opacity', opacity, 0, 1) if is_number else opacity
        cache = cache_of(cache)
        waits = checked_flag('wait', wait, optional=True) is not False
        self._job: BuildJob | None = None
        self._changes = 0
        self._own_view: Any = None
        self._tolerance = Tolerance(max_error)
        self._cut, self._other_cut = CutMesh(), CutMesh()
        self._other_actor = pv.Actor()
        self._solid = SolidCut()
        hierarchy, self._source, look = opened(mesh, look | {'scalars': scalars})
        scalars = look.pop('scalars', None)
        self._look = look
        self._coloring = Coloring.of(self._source, scalars, look)
        has_texture = self._coloring.has_texture
        if hierarchy is None:
            self._source = checked_texture(self._source, has_texture)
            hierarchy = self._first_hierarchy(cache, progress, waits)
        elif has_texture and not len(hierarchy.texture_coordinates):
            raise ValueError(NO_COORDINATES)
        self._prepare_actors()
        self._adopt(hierarchy)

    def _first_hierarchy(self, cache, progress, waits):
        """Return the hierarchy of the mesh, or a draft while another process builds it."""
        mesh: Any = self._source.mesh
        if waits or len(mesh.faces) <= _SMALL or not can_start():
            return built(mesh, cache, progress)
        key = hierarchy_key(mesh)
        if cache is not None and key in cache:
            return built(mesh, cache, progress)
        self._job = BuildJob(mesh, key, cache)
        return build_draft(mesh)

    def _prepare_actors(self):
        """Let this actor, and one for other views, draw the meshes of cuts."""
        self.GetMapper().SetNumberOfSubPieces(1)
        copy_property(self.prop, self._coloring.part.actor.prop)
        self.SetBackfaceProperty(self._coloring.part.actor.GetBackfaceProperty())
        self.SetPickable(True)
        other = self._other_actor
        other.SetMapper(_vtk.vtkPolyDataMapper())
        other.SetProperty(self.prop)
        other.VisibilityOff()
        other.PickableOff()
        other.UseBoundsOff()
        self._dressed = (other,)
        self._dress_mappers()

    def _dress_mappers(self):
        """Let the mappers have the look of the colouring."""
        for actor, cut in ((self, self._cut), (self._other_actor, self._other_cut)):
            self._coloring.dress(actor)
            mapper = actor.GetMapper()
            planes = list(mapper.GetClippingPlanes() or ())
            mapper.ShallowCopy(self._coloring.part.actor.mapper)
            mapper.SetInputDataObject(cut.data)
            set_planes(mapper, planes)
        self._scalar_name, self.has_names = self._coloring.title, self._coloring.has_names

    def _adopt(self, hierarchy):
        """Draw a hierarchy from now on."""
        self._built = hierarchy
        self._surface = DrawnSurface(hierarchy, self._coloring, self.prop, self._part)
        self._changes += 1
        self._empty()

    def _empty(self):
        """Draw no patches."""
        #: Patches of the last cut, those out of view included: they cast its shadows.
        self._whole = self._built.full_patches[:0]
        for cut in (self._cut, self._other_cut):
            cut.show(self._built, self._whole, CutLook())

    # -- what users call ---------------------------------------------------------------------

    @property
    def n_triangles(self) -> int:
        """Number of triangles of the mesh."""
        return self._source.triangle_count or self._built.n_triangles

    @property
    def refined(self) -> bool:
        """Whether the last frame kept `max_error`."""
        return self._job is None and self._tolerance == Tolerance(self.max_error)

    def set_scalars(self, scalars, *, clim=None, preference='point'):
        """Colour by other values of points or cells.

        Parameters
        ----------
        scalars : str or array_like, shape (n,), (n, 3) or (n, 4)
            Values of points or cells, or the name of an array; colours if it has ``rgb=True``.
        clim : sequence of 2 float, optional
            Range of the colours; by default that of the values.
        preference : {'point', 'cell'}
            What values are of that could be of both.

        Raises
        ------
        KeyError
            If there is no such array.
        ValueError
            If there is not one value per point or cell.
        """
        look = {k: v for k, v in self._look.items() if k not in ('clim', 'color', 'texture')}
        look |= {'clim': clim, 'preference': preference}
        self._coloring = Coloring.of(self._source, scalars, look)
        self._dress_mappers()
        self._surface = DrawnSurface(self._built, self._coloring, self.prop)
        self._changes += 1
        self._show_bar()

    def cut(self, max_error=None) -> pv.PolyData:
        """Return the mesh that draws the current view.

        Parameters
        ----------
        max_error : float, optional
            Error in pixels; by default `max_error`.

        Returns
        -------
        pyvista.PolyData
            Its triangles in world units, without those out of view.

        Raises
        ------
        RuntimeError
            If it is in no plotter.
        """
        if self.pipeline is None:
            raise RuntimeError(f'{self.name} must be in a plotter, whose view the cut is of')
        if max_error is None:
            max_error = self.max_error
        max_error = checked_number('max_error', max_error, 0)
        self.wait()
        self._take_result()
        cut, surface = CutMesh(), self._surface
        view = self._view(self.pipeline.view())
        _, patches = surface.cut(self, view, Tolerance(max_error))
        cut.show(surface.hierarchy, patches, surface.look_of_export(patches, view, max_error))
        mesh = pv.wrap(cut.data)
        mesh.regular_faces = mesh.regular_faces[:-2]
        return mesh.clean(point_merging=False).transform(self.matrix, inplace=False)

    def pick(self, x, y) -> Hit | None:
        """Return where the ray through a pixel meets the full mesh; ``index`` is its cell."""
        if not self.pickable or self.pipeline is None or not self.visibility:
            return None
        start, direction = pixel_ray(self.pipeline.renderer, x, y)
        first, last = ClippingPlanes(self.GetMapper().GetClippingPlanes()).reach(start, direction)
        model_from_world = np.linalg.inv(self._matrix())
        axes, shift = model_from_world[:3, :3], model_from_world[:3, 3]
        found = nearest_triangle(self._built, axes @ start + shift, axes @ direction, first, last)
        if found is None:
            return None
        index, distance = found
        return Hit(index, tuple((start + distance * direction).tolist()), distance)

    def wait(self, timeout=None) -> bool:
        """Wait until the hierarchy is built."""
        super().wait(timeout)
        return self._job is None or self._job.wait(timeout)

    def report(self) -> dict:
        """Return bytes, triangles and patches of the last frame, and its error in pixels."""
        cuts = self._cut, self._other_cut
        return {
            'bytes': 0 if self.pipeline is None else sum(cut.nbytes for cut in cuts),
            'triangles': self._cut.n_triangles,
            'triangles of the mesh': self.n_triangles,
            'patches': len(self._cut.patches),
            'error': 'draft' if self.is_draft else round(self._tolerance.error, 3),
        }

    # -- as a thing ----------------------------------------------------------------------------

    def _contents(self) -> str:
        return f'{self.n_triangles} triangles'

    def actors(self) -> list:
        """Return this actor, and the one that draws other views."""
        return [self, self._other_actor]

    def SetPickable(self, pickable):
        """Set `pickable`, for VTK's pickers as well."""
        super().SetPickable(pickable)
        pv.Actor.SetPickable(self, self.pickable)

    def solids(self) -> list:
        """Return an actor with the triangles of the last cut, or of the mesh before a frame."""
        actor, hierarchy = self._solid.actor, self._surface.hierarchy
        self._solid.show(hierarchy, self._whole if len(self._whole) else hierarchy.full_patches)
        actor.SetProperty(self.prop)
        actor.SetUserMatrix(self.GetMatrix())
        set_planes(actor.GetMapper(), list(self.GetMapper().GetClippingPlanes() or ()))
        return [actor]

    def set_clipping_planes(self, planes):
        """Clip what other views see, too; this actor's mapper clips itself."""
        set_planes(self._other_actor.GetMapper(), planes or ())

    def dataset(self):
        """Return the mesh that is drawn, before its matrix."""
        return pv.wrap(self._cut.data)

    def scalar_mapper(self):
        """Return the mapper if it has a lookup table."""
        return self.GetMapper() if self._coloring.has_table else None

    def set_scalar_range(self, clim):
        """Change the range of the scalars."""
        self._other_actor.GetMapper().SetScalarRange(*clim)
        self.GetMapper().GetLookupTable().SetTableRange(*clim)
        self._changes += 1

    def content_key(self) -> tuple:
        """Return a value that changes with its appearance."""
        return self._changes, self.revision, self.GetMTime()

    def bake_into(self, scene):
        """Export the mesh of the current view, at `max_error`."""
        bake_cut(scene, self, self._coloring.part, self.cut())

    # -- building in the background --------------------------------------------------------------

    @property
    def pending(self) -> bool:
        """Whether another process builds the hierarchy."""
        return self._job is not None and not self._job.is_over

    @property
    def is_draft(self) -> bool:
        """Whether a draft is drawn."""
        return self._job is not None

    @property
    def unfinished(self) -> bool:
        """Whether a hierarchy or a finer draft was built that no frame shows yet."""
        return self._job is not None and self._job.has_news

    def _take_result(self):
        """Draw what another process has built."""
        job = self._job
        if job is None:
            return
        if job.is_over:
            self._job = None  # which removes its files
        hierarchy = job.newest(self.name)
        if hierarchy is not None:
            self._adopt(hierarchy)

    # -- the life of an effect -------------------------------------------------------------------

    def _put_in(self, renderer):
        super()._put_in(renderer)
        if self._job is not None:
            self._job.start()

    def _take_out(self, renderer):
        super()._take_out(renderer)
        if self._job is not None and not self._job.is_over:
            self._job.stop()

    def needed(self, frame) -> bool | str:
        """Return True if it is visible, and its matrix has an inverse."""
        if self.visibility and not self.GetMatrix().Determinant():
            return 'its matrix has no inverse'
        return super().needed(frame)

    def prepare(self, frame):
        """Choose the patches of the view, and gather them if they are others."""
        if self._job is not None and is_deterministic():
            self.wait()
        self._take_result()
        if not frame.own:  # VTK draws a shadow map
            self._surface.show(self._cut, self._whole)
            return
        self._tolerance, self._own_view = self._tolerance_of(frame.quality), frame.view
        whole, patches = self._surface.cut(self, self._view(frame), self._tolerance)
        self._surface.show(self._cut, patches)
        leave_out_unused(*self.actors())
        fade_edges(self, frame, np.inf if self.is_draft else self._tolerance.error)
        if not np.array_equal(whole, self._whole):
            self._whole = whole
            self._changes += 1

    def _tolerance_of(self, quality) -> Tolerance:
        return Tolerance.of(1.0 if self.moving == 0 else quality, self.max_error)

    def triangles_of(self, frame):
        """Return the triangles in view as a function of the quality, counted when it is called."""
        count = self._surface.triangles_by_tolerance(self, lambda: self._view(frame))
        return lambda quality: count(self._tolerance_of(quality))

    def _matrix(self) -> np.ndarray:
        """Return the world from the space about the hierarchy's origin."""
        matrix = np.array(self.matrix)
        matrix[:3, 3] += matrix[:3, :3] @ self._built.origin
        return matrix

    def _view(self, frame) -> ModelView:
        return ModelView.of(frame, self._matrix())

    def draws(self, frame, *, depth=False) -> list:
        """Return the actor that draws it in a frame of another view."""
        if frame.view is self._own_view:
            return [self]
        # Shadows fall from what is drawn: between two cuts they would be of one on the other.
        patches = self._whole
        if not frame.depth_map:
            tolerance = Tolerance(self.max_error, np.inf if depth else 1.0)
            _, patches = self._surface.cut(self, self._view(frame), tolerance)
        self._surface.show(self._other_cut, patches)
        fade_edges(self._other_actor, frame, np.inf if self.is_draft else self.max_error)
        self._other_actor.SetUserMatrix(self.GetMatrix())
        return [self._other_actor]

    def deactivate(self):
        """Draw nothing."""
        self._empty()
