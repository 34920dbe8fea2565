"""Many instances of heavy meshes, drawn within an error bound."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.core.errors import warn
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.core.signatures import takes
from pvibr.instances.arguments import (
    checked_blend,
    checked_cache,
    checked_index,
    checked_views,
    index_of_phase,
    placed,
    repeated,
)
from pvibr.instances.baked_set import BakedSet
from pvibr.instances.cards import slabs
from pvibr.instances.explain import measured_error
from pvibr.instances.group import SORTED_SEEN
from pvibr.instances.limits import checked_force, needs_images
from pvibr.instances.memory import checked_share
from pvibr.instances.sources import Sources
from pvibr.meshes.parts import as_meshes, as_parts, with_own_culling
from pvibr.scene import looks as look
from pvibr.scene.draw_order import Stage
from pvibr.scene.keywords import OF_MESH_SCALARS
from pvibr.scene.painted import TABLE_OPTIONS
from pvibr.scene.picking import joined, nearest_hit


class Instances(BakedSet):
    """A mesh, or several, drawn at many poses: near as a mesh, far as images on cards.

    Parameters
    ----------
    mesh : dataset, MultiBlock, actor, FoliageLevels, trimesh object, path, or a list of these
        Meshes to draw. A trimesh scene, a file with a scene graph (glTF, CityJSON), and what
        ``mesh.ibr.glyph()`` returns also have poses.
    poses : array_like, shape (n, 3) or (n, 4, 4), dataset, table or path, optional
        Points or matrices (world from model), world units; also a dataset, a table with columns
        x, y, z (DataFrame, dict, file) or transforms, see :func:`pvibr.matrices`.
    orient : array_like, str, bool or scipy.spatial.transform.Rotation, optional
        Vectors toward which x turns, shape (n, 3), quaternions (w, x, y, z), shape (n, 4),
        matrices, or a name of such an array of the points; by default the vectors of a dataset
        that has one array of them. False turns nothing.
    scale : float, array_like, shape (n,) or (n, 3), str or bool, optional
        Factors, vectors of these lengths, or a name of such an array of the points.
    factor : float
        Factor of all sizes.
    index : array_like of int, shape (n,), optional
        Mesh of each instance if there are several; in turn by default.
    phase : array_like of float, shape (n,), or float, optional
        The same as a fraction of all meshes, modulo 1, for meshes that are phases of a motion.
    max_error : float
        Maximum distance of the outline from that of the mesh, in pixels.
    name : str, optional
        Name in the plotter and in reports.
    scalars : array_like, shape (n,), or str, optional
        Values per instance, coloured by `cmap`; a name selects an array of the points, or else
        one of the mesh, as in ``add_mesh``.
    colors : array_like, shape (n, 3) or (n, 4), optional
        Colours per instance, uint8 or float. Where an alpha is below 1, the set is drawn as
        meshes at every size.
    blend : {'replace', 'multiply'}
        How colours of instances combine with those of the mesh.
    cmap, clim : optional
        As in ``add_mesh``.
    opacity : float or str, optional
        As in ``add_mesh``. Translucent sets are drawn as meshes at every size.
    pickable : bool
        Allow picking.
    bake : bool, optional
        Draw far instances as images. By default only if that pays: light meshes, and a single
        instance, are drawn as meshes at every size, and so is what images cannot show (edges,
        lines, points); the report says why.
    cache : bool or path
        Keep atlases on disk, or the folder to keep them in.
    gpu_memory : float, optional
        Limit on the GPU memory of its images, in MiB. At the limit images have fewer texels, or
        meshes are drawn, and the report says so. All sets together are limited by the environment
        variable ``PVIBR_GPU_MEMORY``, 2048 MiB by default.
    progress : bool, optional
        Show a progress bar while baking; by default in terminals and notebooks.
    views : {'full', 'half'}
        Bake views from all sides, or from above the horizon only at twice the density.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the looks.
    force_level : str or dict of str to (float, float), optional
        Level of detail drawn at every size, or on-screen diameters, in pixels, between which each
        level is drawn: 'splat', 'flat', 'parallax', 'blended', 'fine', 'mesh', 'mesh1' and on
        (lighter meshes), 'billboard' or 'turntable'. By default levels are chosen by their
        measured error.
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
    #: Whether near meshes have an actor each, as their shaders failed.
    _singly = False

    max_error = Param(
        1.0, 'Maximum distance of the outline from that of the mesh.', range='(0, inf)', unit='px'
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
        given = placed(
            mesh,
            poses,
            index,
            scalars,
            pbr=mesh_kwargs.get('pbr'),
            plain=colors is not None or mesh_kwargs.get('color') is not None,
            **self._placing,
        )
        meshes, poses, index, scalars = given.meshes, given.poses, given.index, given.scalars
        if phase is not None:
            index = index_of_phase(repeated('phase', phase, len(poses)), len(meshes))
            self._wanted = frozenset(range(len(meshes)))
        index = checked_index(index, len(poses), len(meshes))
        mesh_kwargs |= {'opacity': opacity, 'cmap': cmap, 'clim': clim}
        self._theme = theme
        asked = self._ask(len(poses), scalars, colors, blend, mesh_kwargs)
        parts = [with_own_culling(found) for found in as_meshes(meshes, theme=theme, **asked)]
        self._sources = Sources(meshes, partial(as_parts, theme=theme, **asked), parts)
        baking = {'half': checked_views(views), 'cache': checked_cache(cache)}
        baking['progress'] = progress
        self._bake, self._materials = bake, {}
        self._share = checked_share(gpu_memory, len(meshes))
        self._poses, self._meshes = poses, parts
        self._cull()
        self._begin(poses, index, {}, pickable, parts, baking)
        self._wear()
        self._paint(scalars, colors)

    def _ask(self, count, scalars, colors, blend, asked) -> dict:
        """Check what is asked of single instances; return what is asked of the mesh."""
        self._blend = checked_blend(blend)
        self._table_options = {k: asked[k] for k in TABLE_OPTIONS if k in asked}
        if colors is not None:
            self._as_colors(colors, count)
        if scalars is not None and not isinstance(scalars, str):
            for name in OF_MESH_SCALARS.keys() & asked.keys():
                why = OF_MESH_SCALARS[name]
                raise ValueError(
                    f'{name} is of scalars of a mesh, and these are of its instances: {why}'
                )
            self._table_for(look.as_scalars(scalars, count), self._table_options)
            asked = {k: v for k, v in asked.items() if k not in TABLE_OPTIONS}
        else:
            asked = {'scalars': scalars, **asked}
        return {k: v for k, v in asked.items() if v is not None}

    def _as_colors(self, colors, count=None):
        return look.as_rgba(colors, len(self) if count is None else count)

    def _group(self, *args):
        group = super()._group(*args)
        if self._singly or self._planes is not None:
            group.near.draw_singly()
        group.near.clip(self._planes)
        return group

    def set_clipping_planes(self, planes):
        """Cut it off by a vtkPlaneCollection: an actor for each is drawn."""
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
        """Level drawn at every size, or a dict of level to sizes; None: by measured error."""
        return self._force_level

    @force_level.setter
    def force_level(self, level):
        forced = checked_force(level)
        if self._models and needs_images(forced):
            self.bake()
        self._forced, self._force_level = forced, level
        self._touch()

    def scalar_mapper(self):
        """Return a mapper with the table of the shown scalars, None without scalars."""
        if self.table is not None:
            return super().scalar_mapper()
        return self._with_table_of(self._parts())

    def set_scalar_range(self, clim):
        """Show the scalars by another range; images of a mesh do not show it."""
        super().set_scalar_range(clim)
        if self.table is None and self._set_range_of(self._parts(), clim):
            if self._sources and not any(part.of_actor for part in self._parts()):
                self._sources.ask(clim=clim)
            self._remake()

    def has_bar(self) -> bool:
        """Return True if it has scalars that are not those of an actor, which has its own bar."""
        return self.table is not None or not all(part.of_actor for part in self._parts())

    def bake_into(self, scene):
        """Add the instances to a scene without pvibr."""
        for k, model in self._models.items():
            ids = np.flatnonzero((self._index == k) & self.visible)
            colors = None if self._colors is None else self._colors[ids]
            found = model.limits(self.max_error) if model.atlas.errors else None
            scene.copies(
                self,
                [level.parts for level in model.levels],
                self._poses[ids],
                largest=found and tuple(found.meshes.min(1).tolist()),
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
        """Have meshes drawn by their place, not as they were first needed: depths may be equal."""
        meshes = (((Stage.OPAQUE,), actor) for actor in self._mesh_actors())
        self.order = (*meshes, *self._card_order())

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the instances' bounding spheres."""
        centers, radii = np.zeros((len(self), 3)), np.zeros(len(self))
        for group in self.groups:
            centers[group.ids], radii[group.ids] = group.centers(slice(None)), group.radii
        return centers, radii

    def item_mesh(self, index) -> pv.PolyData:
        """Return the mesh of an instance in world units, for VTK's pickers."""
        group, slot = self._place_of(index)
        return joined([(group.parts(slot), group.matrix(slot))])

    def actors(self) -> list:
        """Return the actors that draw the instances, invisible ones included."""
        return self._mesh_actors() + [actor for _, actor in self._card_order()]

    def _mesh_actors(self) -> list:
        return [actor for group in self.groups for actor in group.mesh_actors()]

    def _card_order(self) -> list:
        """Return pairs of a key and an actor of all cards, in the order of drawing."""
        pairs = (pair for group in self.groups for pair in group.cards.order())
        return sorted(pairs, key=lambda pair: pair[0])

    def depths(self) -> list:
        """Return the actors that draw its depth, as lights see it."""
        cards = [a for group in self.groups for a in group.cards.actors() if a.GetVisibility()]
        return cards + [a for group in self.groups for a in group.near.depths()]

    def deactivate(self):
        """Hide all actors."""
        for group in self.groups:
            group.hide()
        self._content_key = None

    def prepare(self, frame):
        """Choose levels again if camera, size, settings, meshes or materials changed."""
        self._follow()
        if self._is_drawn_for_picker(frame):
            return
        self._check_meshes()
        covered = self.covered if frame.own else None
        if covered is not self._applied:
            self._apply_looks(covered)
            self._content_key = None
        self._upload(frame.window)
        camera = (frame.view_from_world.tobytes(), frame.clip_from_view.tobytes())
        depth = self._depth_is_read(frame)
        how = frame.casting, frame.depth_map, frame.quality, depth
        content_key = (*camera, frame.size, self.revision, *how)
        self._check_cards()
        if content_key == self._content_key:
            return
        self._content_key = content_key
        limits = self._limits_in(frame)
        chosen = [
            k.select(frame, limit, depth=depth)
            for k, limit in zip(self.groups, limits, strict=True)
        ]
        for shader in self.groups[0].cards.shaders():
            self._show_cards(frame, shader, [c[shader.name] for c in chosen])
        stale = False
        for group, limit in zip(self.groups, limits, strict=True):
            new = group.select_meshes(frame, limit)
            stale |= bool(new) or any(group.near.single)
            for actor in new:
                put_inner(frame.renderer, actor)
        if stale:
            self._put_in_order()

    def _show_cards(self, frame, shader, choices):
        unit = self.groups[0].unit
        if unit > 1 and sum(len(c.table) for c in choices) * unit <= SORTED_SEEN:
            pairs = zip(self.groups, choices, strict=True)
            unit, choices = 1, [group.refine(frame, c) for group, c in pairs]
        capacity = self.groups[0].cards.chunk // unit
        cuts = slabs([c.depths for c in choices], shader.turns, capacity)
        for group, c, cut in zip(self.groups, choices, cuts, strict=True):
            look = {'ranges': c.ranges, 'level': c.level, 'unit': unit, 'cored': c.cored}
            group.cards.show(shader.name, c.table, cut, **look)

    def _check_cards(self):
        """Warn once if a card shader failed, and draw meshes from then on."""
        failure = next((k.cards.failure for k in self.groups if k.cards.failure), None)
        if failure and not self._failure:
            self._failure, self._content_key = failure, None
            self._warn(failure, 'meshes are drawn')

    def _check_meshes(self):
        """Warn once if a shader of meshes failed, and draw plain actors from then on."""
        failure = next((k.near.failure for k in self.groups if k.near.failure), None)
        if failure:
            self._singly = True
            self._rebuild()
            self._warn(failure, 'an actor for each is drawn')

    def _warn(self, failure, instead):
        warn(f'{self.name}: {failure}: {instead} instead. Look at `pvibr doctor`.')

    def finish(self, frame):
        """Release the texture units, and let pickers find instances."""
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
        """Return bytes, what was drawn, and the error tables of the atlases."""
        counts: dict = {}
        for group in self.groups:
            for key, value in group.counts.items():
                counts[key] = counts.get(key, 0) + value
        out = {
            'bytes': sum(k.cards.nbytes for k in self.groups),
            'instances': len(self),
            'an instance': self._memory(),
            **counts,
            'triangles of meshes': self._triangles_drawn(),
        }
        measured = self._measured_errors()
        for k, model in self._models.items():
            out[f'atlas {k}'] = model.describe(self._limits(model))
            if k in measured:
                out[f'error {k}'] = measured[k]
        return out

    def _triangles_drawn(self) -> int:
        """Return the triangles of instances drawn as meshes in the last frame."""
        drawn = ((k.levels, np.bincount(k.near.level_of + 1)[1:]) for k in self.groups)
        return sum(
            level.triangles * int(count)
            for levels, counts in drawn
            for level, count in zip(levels, counts, strict=False)
        )

    def _measured_errors(self) -> dict[int, str]:
        """Return the measured error of what each mesh's instances were drawn by, in words."""
        if self.pipeline is None or self._forced or self._needs_meshes:
            return {}
        frame = self.pipeline.view()
        told = {}
        pairs = zip(self._models, self.groups, self._limits_in(frame), strict=True)
        for k, group, limits in pairs:
            if group.atlas.errors and len(group.visible_slots()):
                flip, displaced, blur = measured_error(group, frame, limits)
                told[k] = (
                    f'FLIP {flip:.2f} of that of the mesh at one sample, outlines within '
                    f'{displaced:.1f} px, up to {blur:.0%} softer'
                )
        return told

    def _memory(self) -> str:
        count = max(len(self), 1)
        gpu = sum(group.cards.item_nbytes for group in self.groups) / count
        held = sum(group.placement.nbytes for group in self.groups) / count
        return f'{gpu:.0f} B of GPU memory, {held:.0f} B of main memory beside its pose'

    def pick(self, x, y):
        """Return the nearest instance under a pixel."""
        if not self._can_pick():
            return None
        renderer = self.pipeline.renderer
        return nearest_hit(self.groups, renderer, x, y, self.visible, self._planes)
