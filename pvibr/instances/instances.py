"""Many instances of heavy meshes, drawn within an error bound."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.core.arguments import check_one_of
from pvibr.core.errors import warn
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.core.signatures import takes
from pvibr.instances.baked_set import BakedSet
from pvibr.instances.cards import slabs
from pvibr.instances.explain import measured_error
from pvibr.instances.group import SORTED_SEEN
from pvibr.instances.instance_arguments import (
    checked_cache,
    checked_index,
    index_of_phase,
    placed,
    repeated,
)
from pvibr.instances.limits import checked_force, needs_images
from pvibr.instances.memory import checked_share
from pvibr.instances.mesh_sources import Sources
from pvibr.meshes.parts import as_meshes, as_parts, with_own_culling
from pvibr.things import appearance as look
from pvibr.things.appearance import TABLE_OPTIONS
from pvibr.things.draw_order import Stage
from pvibr.things.keywords import OF_MESH_SCALARS
from pvibr.things.picking import joined, nearest_hit


class Instances(BakedSet):
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
        Show a progress bar during the bake; by default in terminals and notebooks.
    views : {'full', 'half'}
        Bake views from all sides, or only from above the horizon at twice the density.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the looks.
    force_level : str or dict of str to (float, float), optional
        Level of detail to draw at every size, or the range of on-screen diameters, in pixels, of
        each level: 'splat', 'flat', 'parallax', 'blended', 'fine', 'mesh', 'mesh1' and on (lighter
        meshes), 'billboard' or 'turntable'. By default levels are chosen by measured error.
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
        'bounds',
        'atlases',
        'force_level',
        'bake',
        'pick',
        'explain',
        'actors',
        'report',
    )
    web = 'baked', 'meshes, far ones billboard clouds'
    presets = {'fine': {'max_error': 0.5}, 'fast': {'max_error': 3.0}}
    _force_level: str | dict | None = None
    #: Whether each near mesh has an actor, because the shaders of batches failed.
    _singly = False

    max_error = Param(
        1.0,
        'Maximum distance of outlines from those of the mesh: raise it for speed, lower it where '
        'the change of levels shows.',
        range='(0, inf)',
        unit='px',
    )
    _noun = 'instances'

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
        views='full',
        theme=None,
        force_level=None,
        **mesh_kwargs,
    ):
        super().__init__(max_error=max_error)
        self.name = name
        self.force_level = force_level
        self._placing = {'orient': orient, 'scale': scale, 'factor': factor}
        meshes, poses, index, scalars = placed(
            mesh,
            poses,
            index,
            scalars,
            pbr=mesh_kwargs.get('pbr'),
            plain=colors is not None or mesh_kwargs.get('color') is not None,
            **self._placing,
        )
        if phase is not None:
            index = index_of_phase(repeated('phase', phase, len(poses)), len(meshes))
            self._required_meshes = frozenset(range(len(meshes)))
        index = checked_index(index, len(poses), len(meshes))
        mesh_kwargs |= {'opacity': opacity, 'cmap': cmap, 'clim': clim}
        self._theme = theme
        mesh_options = self._ask(len(poses), scalars, colors, blend, mesh_kwargs)
        parts = as_meshes(meshes, theme=theme, **mesh_options)
        parts = [with_own_culling(mesh_parts) for mesh_parts in parts]
        self._sources = Sources(meshes, partial(as_parts, theme=theme, **mesh_options), parts)
        check_one_of('views', views, ('full', 'half'))
        baking = {'half': views == 'half', 'cache': checked_cache(cache), 'progress': progress}
        self._bake, self._materials = bake, {}
        self._max_image_bytes = checked_share(gpu_memory, len(meshes))
        self._poses, self._meshes = poses, parts
        self._cull()
        self._begin(poses, index, {}, pickable, parts, baking)
        self._adopt_material()
        self._paint(scalars, colors)

    def _ask(self, count, scalars, colors, blend, mesh_options) -> dict:
        """Check the looks of instances; return the ``add_mesh`` keywords of the mesh."""
        check_one_of('blend', blend, ('replace', 'multiply'))
        self._blend = blend
        self._table_options = {k: mesh_options[k] for k in TABLE_OPTIONS if k in mesh_options}
        if colors is not None:
            self._as_colors(colors, count)
        if scalars is not None and not isinstance(scalars, str):
            for name in OF_MESH_SCALARS.keys() & mesh_options.keys():
                reason = OF_MESH_SCALARS[name]
                raise ValueError(
                    f'{name} must be left out with scalars per instance; it is for scalars of a '
                    f'mesh: {reason}'
                )
            self._table_for(look.as_scalars(scalars, count), self._table_options)
            mesh_options = {k: v for k, v in mesh_options.items() if k not in TABLE_OPTIONS}
        else:
            mesh_options = {'scalars': scalars, **mesh_options}
        return {k: v for k, v in mesh_options.items() if v is not None}

    def _as_colors(self, colors, count=None):
        return look.as_rgba(colors, len(self) if count is None else count)

    def _group(self, *args):
        group = super()._group(*args)
        if self._singly or self._planes is not None:
            group.near.draw_singly()
        group.near.clip(self._planes)
        return group

    def set_clipping_planes(self, planes):
        """Clip the set by a vtkPlaneCollection; each instance is then an actor."""
        self._planes = planes if planes is not None and planes.GetNumberOfItems() else None
        if self._stand_ins is not None:
            self._stand_ins.clip(self._planes)
        self._rebuild()

    def _paint(self, scalars, colors):
        if scalars is not None and not isinstance(scalars, str):
            self.scalars = scalars
        elif colors is not None:
            self.colors = colors

    @property
    def force_level(self) -> str | dict | None:
        """Level drawn at every size, or sizes by level; None chooses by measured error."""
        return self._force_level

    @force_level.setter
    def force_level(self, level):
        forced = checked_force(level)
        if self._models and needs_images(forced):
            self.bake()
        self._forced, self._force_level = forced, level
        self._touch()

    def scalar_mapper(self):
        """Return a mapper with the lookup table of the scalars, None without scalars."""
        if self.table is not None:
            return super().scalar_mapper()
        return self._with_table_of(self._parts())

    def set_scalar_range(self, clim):
        """Set the range of the scalars; images of a mesh do not follow it."""
        super().set_scalar_range(clim)
        if self.table is None and self._set_range_of(self._parts(), clim):
            if self._sources and not any(part.of_actor for part in self._parts()):
                self._sources.set_look(clim=clim)
            self._remake()

    def has_bar(self) -> bool:
        """Return False if its scalars are those of an actor, which has its own bar."""
        return self.table is not None or not all(part.of_actor for part in self._parts())

    def bake_into(self, scene):
        """Add the instances to a scene exported without pvibr."""
        for k, model in self._models.items():
            ids = np.flatnonzero((self._index == k) & self.visible)
            colors = None if self._colors is None else self._colors[ids]
            limits = model.limits(self.max_error) if model.atlas.errors else None
            scene.copies(
                self,
                [level.parts for level in model.levels],
                self._poses[ids],
                largest=limits and tuple(limits.mesh_to.min(1).tolist()),
                colors=colors,
                multiply=self.multiplies,
            )
            scene.strokes(model.levels[0].parts, self._poses[ids], colors=colors)

    def _parts(self):
        return [p for model in self._models.values() for p in model.levels[0].parts]

    # -- the life of an effect ---------------------------------------------------------------

    def _put_in(self, renderer):
        self._put_in_order()
        super()._put_in(renderer)

    def _put_in_order(self):
        """Fix the order of meshes, which may have equal depths, whichever was needed first."""
        meshes = (((Stage.OPAQUE,), actor) for actor in self._mesh_actors())
        self.order = (*meshes, *self._card_order())

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the instances' bounding spheres."""
        centers, radii = np.zeros((len(self), 3)), np.zeros(len(self))
        for group in self.groups:
            centers[group.ids], radii[group.ids] = group.centers(slice(None)), group.radii
        return centers, radii

    def item_mesh(self, index) -> pv.PolyData:
        """Return the mesh of an instance in world space, for VTK's pickers."""
        group, slot = self._group_and_slot(index)
        return joined([(group.parts(slot), group.matrix(slot))])

    def actors(self) -> list:
        """Return the actors that draw the instances, invisible ones included."""
        return self._mesh_actors() + [actor for _, actor in self._card_order()]

    def _mesh_actors(self) -> list:
        return [actor for group in self.groups for actor in group.mesh_actors()]

    def _card_order(self) -> list:
        """Return pairs of sort key and card actor, in drawing order."""
        pairs = (pair for group in self.groups for pair in group.cards.order())
        return sorted(pairs, key=lambda pair: pair[0])

    def depths(self) -> list:
        """Return the actors that draw its depth for lights."""
        cards = [a for group in self.groups for a in group.cards.actors() if a.GetVisibility()]
        return cards + [a for group in self.groups for a in group.near.depths()]

    def deactivate(self):
        """Hide all actors."""
        for group in self.groups:
            group.hide()
        self._content_key = None

    def prepare(self, frame):
        """Choose levels again if the camera, size, settings, meshes or materials changed."""
        self._follow_meshes()
        if self._is_drawn_for_picker(frame):
            return
        self._check_meshes()
        covered = self.covered if frame.own else None
        if covered is not self._applied_cover:
            self._apply_looks(covered)
            self._content_key = None
        self._upload(frame.window)
        camera_key = (frame.view_from_world.tobytes(), frame.clip_from_view.tobytes())
        depth = self._depth_is_read(frame)
        drawing = frame.casting, frame.depth_map, frame.quality, depth
        content_key = (*camera_key, frame.size, self.revision, *drawing)
        self._check_cards()
        if content_key == self._content_key:
            return
        self._content_key = content_key
        group_limits = self._limits_in(frame)
        choices = [
            k.select(frame, limits, depth=depth)
            for k, limits in zip(self.groups, group_limits, strict=True)
        ]
        for shader in self.groups[0].cards.shaders():
            self._show_cards(frame, shader, [c[shader.name] for c in choices])
        needs_sorting = False
        for group, limits in zip(self.groups, group_limits, strict=True):
            new_actors = group.select_meshes(frame, limits)
            needs_sorting |= bool(new_actors) or any(group.near.has_own_actors)
            for actor in new_actors:
                put_inner(frame.renderer, actor)
        if needs_sorting:
            self._put_in_order()

    def _show_cards(self, frame, shader, choices):
        unit = self.groups[0].unit
        if unit > 1 and sum(len(choice.table) for choice in choices) * unit <= SORTED_SEEN:
            pairs = zip(self.groups, choices, strict=True)
            unit, choices = 1, [group.refine(frame, choice) for group, choice in pairs]
        capacity = self.groups[0].cards.chunk // unit
        cuts = slabs([choice.depths for choice in choices], shader.turns, capacity)
        for group, choice, group_cuts in zip(self.groups, choices, cuts, strict=True):
            options = {
                'ranges': choice.ranges,
                'side_ranges': choice.side_ranges,
                'unit': unit,
                'cored': choice.cored,
            }
            group.cards.show(shader.name, choice.table, group_cuts, **options)

    def _check_cards(self):
        """On failure of a card shader, warn and draw meshes from then on."""
        failure = next((k.cards.failure for k in self.groups if k.cards.failure), None)
        if failure and not self._failure:
            self._failure, self._content_key = failure, None
            self._warn(failure, 'instances are drawn as meshes')

    def _check_meshes(self):
        """On failure of a mesh shader, warn and draw plain actors from then on."""
        failure = next((k.near.failure for k in self.groups if k.near.failure), None)
        if failure:
            self._singly = True
            self._rebuild()
            self._warn(failure, 'each instance is drawn by an actor')

    def _warn(self, failure, instead):
        warn(f'{self.name}: {failure}: {instead} instead. Run `pvibr doctor`.')

    def finish(self, frame):
        """Release the texture units, and check that the shaders were drawn."""
        self._binder.unbind()
        if frame.own and not frame.picking:
            for group in self.groups:
                group.near.check()
                group.cards.check()

    def release(self):
        """Free GPU memory; the context is current."""
        for group in self.groups:
            group.release()
        self._uploaded, self._content_key = False, None

    def report(self) -> dict:
        """Return bytes, counts of what was drawn, and the levels and errors of each mesh."""
        draw_counts: dict = {}
        for group in self.groups:
            for key, value in group.counts.items():
                draw_counts[key] = draw_counts.get(key, 0) + value
        details = {
            'bytes': sum(k.cards.nbytes for k in self.groups),
            'instances': len(self),
            'an instance': self._memory(),
            **draw_counts,
            'triangles of meshes': self._triangles_drawn(),
        }
        errors = self._measured_errors()
        for k, model in self._models.items():
            details[f'atlas {k}'] = model.describe(self._limits(model))
            if k in errors:
                details[f'error {k}'] = errors[k]
        return details

    def _triangles_drawn(self) -> int:
        """Return the triangles drawn as meshes in the last frame."""
        level_counts = ((k.levels, np.bincount(k.near.level_of + 1)[1:]) for k in self.groups)
        return sum(
            level.triangles * int(instance_count)
            for levels, counts in level_counts
            for level, instance_count in zip(levels, counts, strict=False)
        )

    def _measured_errors(self) -> dict[int, str]:
        """Return the measured error of the last frame in words, by mesh."""
        if self.pipeline is None or self._forced or self._needs_meshes:
            return {}
        frame = self.pipeline.view()
        messages = {}
        pairs = zip(self._models, self.groups, self._limits_in(frame), strict=True)
        for k, group, limits in pairs:
            if group.atlas.errors and len(group.visible_slots()):
                flip, displaced, blur = measured_error(group, frame, limits)
                messages[k] = (
                    f'FLIP {flip:.2f} of that of the mesh at one sample, outlines within '
                    f'{displaced:.1f} px, up to {blur:.0%} softer'
                )
        return messages

    def _memory(self) -> str:
        count = max(len(self), 1)
        gpu = sum(group.cards.item_nbytes for group in self.groups) / count
        main_memory = sum(group.placement.nbytes for group in self.groups) / count
        return f'{gpu:.0f} B of GPU memory, {main_memory:.0f} B of main memory beside its pose'

    def pick(self, x, y):
        """Return the nearest instance under a pixel."""
        if not self._can_pick():
            return None
        renderer = self.pipeline.renderer
        return nearest_hit(self.groups, renderer, x, y, self.visible, self._planes)
