"""Many instances of heavy meshes, drawn within an error bound."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core.arguments import check_one_of, naming
from pvibr.core.determinism import is_deterministic
from pvibr.core.nan_rows import NanRows
from pvibr.core.params import Param, checked_flag
from pvibr.core.signatures import takes
from pvibr.instances import explain as explaining
from pvibr.instances import model_changes, plain_copies, shared_choices, updates
from pvibr.instances.instance_arguments import mesh_looks, placed
from pvibr.instances.limits import LevelChoice, Limits, checked_force, needs_images
from pvibr.instances.mesh_groups import MeshGroups
from pvibr.instances.mesh_models import MeshModels
from pvibr.instances.posed_items import PosedItems
from pvibr.instances.shared_choices import SharedChoices
from pvibr.meshes.parts import as_parts
from pvibr.things import appearance as look
from pvibr.things.appearance import TABLE_OPTIONS
from pvibr.things.item_set import ItemSet
from pvibr.things.picking import joined, nearest_hit


class Instances(ItemSet):
    """One or more meshes drawn at many poses: near ones as meshes, far ones as image cards.

    Parameters
    ----------
    mesh : dataset, MultiBlock, actor, FoliageLevels, trimesh object, path, or a list of these
        Meshes to draw. A trimesh scene, a file with a scene graph (glTF, CityJSON) and the result
        of ``mesh.ibr.glyph()`` also provide the poses.
    poses : array_like, shape (n, 3) or (n, 4, 4), dataset, table or path, optional
        Points or matrices (world from model), world units; also a dataset, a table with columns
        x, y, z (DataFrame, dict, file) or transforms, see :func:`pvibr.matrices`.
    orient : array_like, str, bool or scipy.spatial.transform.Rotation, optional
        Vectors toward which x turns, shape (n, 3), quaternions (w, x, y, z), shape (n, 4),
        matrices, or the name of such a point array; by default the vectors of a dataset that has
        a single array of them. False turns nothing.
    scale : float, array_like, shape (n,) or (n, 3), str or bool, optional
        Factors, vectors of these lengths, or the name of such a point array.
    factor : float
        Factor applied to all sizes.
    index : array_like of int, shape (n,), optional
        Mesh of each instance; by default the meshes take turns.
    phase : array_like of float, shape (n,), or float, optional
        Mesh of each instance as a fraction of the list, modulo 1, for meshes that are phases of a
        motion.
    max_error : float
        Maximum distance of outlines from those of the mesh, in pixels.
    name : str, optional
        Name in the plotter and in reports.
    scalars : array_like, shape (n,), or str, optional
        Values per instance, coloured by `cmap`; a name selects a point array of `poses` or, as in
        ``add_mesh``, an array of the mesh.
    colors : array_like, shape (n, 3) or (n, 4), optional
        Colours per instance, uint8 or float. With alpha below 1, the whole set is drawn as meshes
        at every size.
    blend : {'replace', 'multiply'}
        How instance colours combine with those of the mesh.
    cmap, clim : optional
        As in ``add_mesh``.
    opacity : float or str, optional
        As in ``add_mesh``. Translucent sets are drawn as meshes at every size.
    pickable : bool
        Allow picking.
    bake : bool, optional
        Draw far instances as images. By default only if that pays: light meshes, a single instance
        and what images cannot show (edges, lines, points) are drawn as meshes at every size; the
        report says why.
    cache : bool or path
        Cache atlases on disk, or the folder of the cache.
    gpu_memory : float, optional
        Limit on the GPU memory of the set's images, in MiB. At the limit, images have fewer texels
        or meshes are drawn, and the report says so. The environment variable ``PVIBR_GPU_MEMORY``
        limits all sets together, 2048 MiB by default.
    progress : bool, optional
        Show a progress bar while a bake is waited for; by default in terminals and notebooks.
    wait : bool, optional
        Wait for the bake. Otherwise another process bakes, and until it is done, drafts are drawn:
        random triangles, enlarged, and a few small images; screenshots, movies and exports wait.
        By default off screen, but not in windows and notebooks.
    views : {'full', 'half'}
        Bake views from all sides, or only from above the horizon at twice the density.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the looks.
    force_level : str or dict of str to (float, float), optional
        Level of detail to draw at every size, or the range of on-screen diameters, in pixels, of
        each level: 'splat', 'flat', 'parallax', 'blended', 'fine', 'mesh', 'mesh1' and on (lighter
        meshes), 'billboard' or 'turntable'. By default levels are chosen by measured error.
    nan : {'raise', 'hide'}
        Refuse instances with NaN among their poses, vectors and scales, or hide them. NaN scalars
        have ``nan_color`` and ``nan_opacity``.
    **mesh_kwargs
        As in :meth:`pyvista.Plotter.add_mesh`, for the mesh itself.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> cones = pl.ibr.add(pvibr.Instances(pv.Cone(), [[0, 0, 0], [2, 0, 0]], cache=False))
    >>> cones.n_instances
    2
    >>> pl.close()
    """

    FOR_USERS: tuple[str, ...] = (
        *('n_instances', 'poses', 'index', 'phase', 'update', 'bounds', 'atlases', 'limits'),
        *('force_level', 'bake', 'pick', 'explain', 'actors', 'report'),
    )
    web = 'baked', 'meshes, far ones billboard clouds'
    presets = {'fine': {'max_error': 0.5}, 'fast': {'max_error': 3.0}}
    #: Indices of instances that another thing draws for the scene's own camera.
    covered: np.ndarray | None = None
    _items: PosedItems
    _models: MeshModels
    #: Whether the number of instances may change.
    _can_grow = True
    _applied_cover: np.ndarray | None = None
    #: Whether instance colours multiply those of the mesh.
    multiplies = False
    _force_level: str | dict | None = None
    _forced: dict[str, tuple] = {}
    #: Clipping planes, a vtkPlaneCollection.
    _planes: Any = None
    #: Error of a card shader.
    _failure: str | None = None
    _limits_key: tuple = ()

    max_error = Param(
        1.0,
        'Maximum distance of outlines from those of the mesh: raise it for speed, lower it where '
        'the change of levels shows.',
        range='(0, inf)',
        unit='px',
    )
    mends_shaders, _noun = True, 'instances'

    @takes(mesh_kwargs=as_parts)
    def __init__(
        self,
        mesh,
        poses=None,
        *,
        orient=None,
        scale=None,
        factor=1.0,
        index=None,
        phase=None,
        max_error=1.0,
        name=None,
        scalars=None,
        colors=None,
        blend='replace',
        cmap=None,
        clim=None,
        opacity=None,
        pickable=True,
        bake=None,
        cache=True,
        gpu_memory=None,
        progress=None,
        wait=None,
        views='full',
        theme=None,
        force_level=None,
        nan='raise',
        **mesh_kwargs,
    ):
        super().__init__(max_error=max_error)
        self.name = name
        self._forced, self._force_level = checked_force(force_level), force_level
        placing, nan_rows = {'orient': orient, 'scale': scale, 'factor': factor}, NanRows(nan)
        is_plain = colors is not None or mesh_kwargs.get('color') is not None
        options: dict = {'pbr': mesh_kwargs.get('pbr'), 'plain': is_plain, 'nan_rows': nan_rows}
        arguments = mesh, poses, index, phase, scalars
        meshes, poses, index, scalars = placed(*arguments, **options | placing)
        self._theme = theme
        mesh_kwargs |= {'opacity': opacity, 'cmap': cmap, 'clim': clim}
        mesh_options = self._begin_looks_of(len(poses), scalars, colors, blend, mesh_kwargs)
        check_one_of('views', views, ('full', 'half'))
        waits = checked_flag('wait', wait, optional=True) is not False
        baking = {'half': views == 'half', 'cache': cache, 'progress': progress, 'waits': waits}
        looks = {'theme': theme, **mesh_options}
        models = MeshModels.of(meshes, looks, bakes=bake, gpu_memory=gpu_memory, **baking)
        models.forces_images = needs_images(self._forced)
        if phase is not None:
            models.require_all()
        self.pickable = pickable
        mesh_count = max(len(meshes), 1)
        items = PosedItems(poses, poses, index, mesh_count, placing, nan_rows=nan_rows)
        self._begin(items, models, MeshGroups(), scalars, colors)

    def _begin_looks_of(self, count, scalars, colors, blend, mesh_options) -> dict:
        """Check the looks of instances; return the ``add_mesh`` keywords of the mesh."""
        check_one_of('blend', blend, ('replace', 'multiply'))
        self.multiplies = blend == 'multiply'
        self._table_options = {k: mesh_options[k] for k in TABLE_OPTIONS if k in mesh_options}
        if colors is not None:
            self._as_colors(colors, count)
        mesh_options = mesh_looks(scalars, mesh_options)
        if scalars is not None and not isinstance(scalars, str):
            self._table_for(look.as_scalars(scalars, count), self._table_options)
        return {k: v for k, v in mesh_options.items() if v is not None}

    def _begin(self, items, models, groups, scalars, colors):
        """Draw items in their looks; bake the models that are missing."""
        self._scalars = self._colors = self._visible = self.table = None
        self._items, self._models = items, models
        self.groups: MeshGroups = groups  # what draws the instances of each mesh
        models.follow_poses(items.poses, items.index)
        self._rebuild()
        self._adopt_material()
        if scalars is not None and not isinstance(scalars, str):
            self.scalars = scalars
        elif colors is not None:
            self.colors = colors

    # -- methods by subject: each module says more ---------------------------------------------

    update = updates.update
    _base_colors = updates.base_colors
    bake_into = plain_copies.bake_into
    bake = model_changes.bake
    wait = model_changes.wait
    _remake = model_changes.remake
    _adopt_material = model_changes.adopt_material
    _follow_meshes = model_changes.follow_meshes
    _time_getters = model_changes.time_getters
    is_prepared = model_changes.is_prepared
    _show_models = model_changes.show_models
    _rank_bakes = model_changes.rank_bakes
    _check_shaders = model_changes.check_shaders
    lacks_choice = shared_choices.lacks_choice
    version = shared_choices.version
    _choose = shared_choices.choose
    report = explaining.report
    explain = explaining.explain

    # -- poses and meshes ----------------------------------------------------------------------

    _nan_rows = property(lambda self: self._items.nan_rows)

    def __len__(self):
        return len(self._items.index)

    @property
    def n_instances(self) -> int:
        """Number of instances."""
        return len(self._items)

    @property
    def poses(self) -> np.ndarray:
        """Points (n, 3) or matrices (n, 4, 4) in set space, read-only; see :meth:`update`."""
        return look.read_only(self._items.given_poses())

    @poses.setter
    def poses(self, poses):
        self.update(poses=poses)

    @property
    def index(self) -> np.ndarray:
        """Mesh of each instance, shape (n,), read-only; see :meth:`update`."""
        return look.read_only(self._items.index)

    @index.setter
    def index(self, index):
        self.update(index=index)

    @property
    def phase(self) -> np.ndarray:
        """Mesh of each instance as a fraction of all meshes, 0 to 1; set modulo 1."""
        return look.read_only(self._items.index / self._items.mesh_count)

    @phase.setter
    def phase(self, phase):
        with naming('phase', phase):
            self.update(phase=phase)

    def _places(self) -> np.ndarray:
        return self._items.centers()

    def _put(self):
        updates.show_items(self, self._items.placed(self._world), keeps_bounds=True)

    def _bound(self):
        local_poses = None if self._world is None else self._items.local_poses
        self._set_bounds(self.groups.bounds(local_poses))

    def _rebuild(self, *, keeps_bounds=False):
        """Replace the groups."""
        pipeline = self.pipeline
        if pipeline is not None:
            pipeline.make_current()
        self.groups.release()
        if pipeline is not None:
            self._take_out(pipeline.renderer)
        items, options = self._items, {'translucent': self.is_translucent, 'planes': self._planes}
        self.groups.build(self._models.by_mesh, items.poses, items.index, **options)
        if not keeps_bounds:
            self._bound()
        self._repaint()
        if pipeline is not None:
            self._put_in(pipeline.renderer)

    # -- levels of detail ----------------------------------------------------------------------

    @property
    def atlases(self) -> list:
        """The atlas of each mesh in use."""
        return [model.atlas for model in self._models.by_mesh.values()]

    @property
    def limits(self) -> list[Limits]:
        """On-screen sizes at which levels change, of each of `groups`."""
        choice = self._level_choice()
        return [choice.limits(group.model) for group in self.groups]

    def _level_choice(self) -> LevelChoice:
        rule = 'forced' if self._forced else ''
        if self._planes is not None:
            rule = 'clipped'
        if self._colors is not None and self.is_translucent:
            rule = 'translucent'
        if self._failure:
            rule = 'shaders failed'
        return LevelChoice(self.max_error, self._forced, rule)

    @property
    def force_level(self) -> str | dict | None:
        """Level drawn at every size, or sizes by level; None chooses by measured error."""
        return self._force_level

    @force_level.setter
    def force_level(self, level):
        forced = checked_force(level)
        if self._models.by_mesh and needs_images(forced):
            self.bake()
        self._models.forces_images = needs_images(forced)
        self._forced, self._force_level = forced, level
        self._touch()

    def _materials_of_all(self) -> list:
        return [part.actor.GetProperty() for part in self._models.parts()]

    def set_clipping_planes(self, planes):
        """Clip the set by a vtkPlaneCollection; each instance is then an actor."""
        self._planes = planes if planes is not None and planes.GetNumberOfItems() else None
        if self._stand_ins is not None:
            self._stand_ins.clip(self._planes)
        self._rebuild()

    # -- looks ---------------------------------------------------------------------------------

    @property
    def is_translucent(self) -> bool:
        """Whether instance colours have alpha."""
        return look.blend(self._colors)

    def _as_colors(self, colors, count=None):
        return look.as_rgba(colors, len(self) if count is None else count)

    def _repaint(self):
        if any(group.near.translucent != self.is_translucent for group in self.groups):
            self._rebuild()
            return
        self._apply_looks(self._applied_cover)
        self._touch()

    def _apply_looks(self, covered):
        """Apply the looks, hiding instances that another thing draws."""
        self._applied_cover = covered
        drawn = self.drawn_items()
        if covered is not None:
            drawn[covered] = False
        looks = look.merge(len(self), self._colors, None if drawn.all() else drawn)
        self.groups.set_looks(looks, self.multiplies)

    def scalar_mapper(self):
        """Return a mapper with the lookup table of the scalars, None without scalars."""
        if self.table is not None:
            return super().scalar_mapper()
        return self._with_table_of(self._models.shown_parts())

    def set_scalar_range(self, clim):
        """Set the range of the scalars; images of a mesh do not follow it."""
        super().set_scalar_range(clim)
        if self.table is None and self._set_range_of(self._models.shown_parts(), clim):
            self._models.set_clim(clim)
            self._remake()

    def has_bar(self) -> bool:
        """Return False if its scalars are those of an actor, which has its own bar."""
        parts = self._models.shown_parts()
        return self.table is not None or not all(part.of_actor for part in parts)

    # -- the life of an effect -----------------------------------------------------------------

    pending = property(attrgetter('_models.pending'))
    is_draft = property(attrgetter('_models.has_drafts'))
    unfinished = property(attrgetter('_models.has_news'))

    def detach(self):
        """Leave the scene, and stop what is baked for it alone."""
        self._models.pause()
        super().detach()

    def _put_in(self, renderer):
        self._models.resume()
        self.order = self.groups.draw_order()
        super()._put_in(renderer)
        self._shared_choices = SharedChoices.of(self.pipeline)
        self._shared_choices.sets.append(self)

    def _take_out(self, renderer):
        super()._take_out(renderer)
        self._shared_choices.sets.remove(self)

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the instances' bounding spheres."""
        return self.groups.spheres()

    def item_mesh(self, index) -> pv.PolyData:
        """Return the mesh of an instance in world space, for VTK's pickers."""
        group, slot = self.groups.slot_of(index)
        return joined([(group.parts(slot), group.matrix(slot))])

    def actors(self) -> list:
        """Return the actors that draw the instances, invisible ones included."""
        return [actor for _, actor in self.groups.draw_order()]

    def depths(self) -> list:
        """Return the actors that draw its depth for lights."""
        return self.groups.depths()

    def deactivate(self):
        """Hide all actors."""
        self.groups.hide()
        self._content_key = None

    def prepare(self, frame):
        """Choose levels again if the camera, size, settings, meshes or materials changed."""
        models = self._models
        if models.has_drafts and is_deterministic():
            self.wait()
        if self._unchanged_in is not frame:
            self._follow_meshes()
        super().prepare(frame)
        if models.pending and frame.own:
            self._rank_bakes(frame)

    def _upload(self, frame):
        if self.groups.has_failed:
            self._check_shaders()
        covered = self.covered if frame.own else None
        if covered is not self._applied_cover:
            self._apply_looks(covered)
            self._content_key = None
        if is_deterministic() and not self.groups.is_sorted:
            self.groups.sort()
            self._bound()
            self._repaint()
        self.groups.upload(frame.window)

    def _choice_key(self, frame) -> tuple:
        key = super()._choice_key(frame)
        return *key, frame.depth_map, frame.quality, self._depth_is_read(frame)

    def finish(self, frame):
        """Release the texture units, and check that the shaders were drawn."""
        self.groups.finish(check=frame.own and not frame.picking)

    def release(self):
        """Free GPU memory; the context is current."""
        self.groups.release()
        self._content_key = None

    def pick(self, x, y):
        """Return the nearest instance under a pixel."""
        if not self._can_pick():
            return None
        renderer, drawn = self.pipeline.renderer, self.drawn_items()
        return nearest_hit(self.groups, renderer, x, y, drawn, self._planes)
