"""Many instances of heavy meshes, drawn within an error bound."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np

from pvibr.core.errors import PvibrWarning
from pvibr.core.params import Param
from pvibr.core.signatures import takes
from pvibr.instances.arguments import (
    checked_blend,
    checked_index,
    checked_views,
    index_of_phase,
    meshes_and_poses,
    poses_and_scalars,
    repeated,
)
from pvibr.instances.cards import slabs
from pvibr.instances.group import SORTED_SEEN
from pvibr.instances.levels import make_model, no_images, unbaked
from pvibr.instances.limits import Limits, checked_force, forced_limits, limits_of, needs_images
from pvibr.instances.materials import MATERIAL_CHANGED, Material
from pvibr.instances.memory import checked_share, hold, room
from pvibr.instances.posed_set import PosedSet
from pvibr.instances.sources import MESH_CHANGED, Sources
from pvibr.meshes.parts import as_meshes, as_parts, culled_faces, with_own_culling
from pvibr.meshes.poses import as_poses, mirror
from pvibr.scene import looks as look
from pvibr.scene.painted import TABLE_OPTIONS
from pvibr.scene.picking import nearest_hit


class Instances(PosedSet):
    """A mesh, or several, drawn at many poses: near as a mesh, far as images on cards.

    Parameters
    ----------
    mesh : dataset, MultiBlock, actor, FoliageLevels, trimesh object, path, or a list of these
        Meshes to draw. A trimesh scene, or a file with a scene graph (glTF, CityJSON), also has
        poses.
    poses : array_like, shape (n, 3) or (n, 4, 4), or path, optional
        Points or matrices (world from model), world units, or a file for
        :func:`pvibr.read_poses`.
    index : array_like of int, shape (n,), optional
        Mesh of each instance if there are several; in turn by default.
    phase : array_like of float, shape (n,), or float, optional
        The same as a fraction of all meshes, modulo 1, for meshes that are phases of a motion.
    max_error : float
        Maximum distance of the outline from that of the mesh, in pixels.
    name : str, optional
        Name in the plotter and in reports.
    scalars : array_like, shape (n,), or str, optional
        Values per instance, coloured by `cmap`; a name selects a column of the pose file, or
        else an array of the mesh, as in ``add_mesh``.
    colors : array_like, shape (n, 3), optional
        Colours per instance, uint8 or float.
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
        level is drawn: 'splat', 'flat', 'parallax', 'blended', 'mesh', 'mesh1' and on (lighter
        meshes), 'billboard' or 'turntable'. By default levels are chosen by their measured error.
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
        'instance_of',
        'actors',
        'report',
    )
    web = 'baked', 'meshes, far ones billboard clouds'
    presets = {'fine': {'max_error': 0.5}, 'fast': {'max_error': 3.0}}
    moved_by = 'set its poses'
    _bake: bool | None = None
    _force_level: str | dict | None = None
    #: Whether near meshes have an actor each, as their shaders failed.
    _singly = False
    #: What culls faces but for poses that mirror.
    _unculled: list = []
    _forced: dict[str, tuple] = {}
    _models: dict = {}
    _sources: Sources | None = None
    #: How the material of each model was when it was made.
    _materials: dict[int, Material] = {}

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
        poses, scalars = poses_and_scalars(poses, scalars)
        meshes, poses, index = meshes_and_poses(mesh, poses, index, mesh_kwargs.get('pbr'))
        poses = as_poses(poses)
        if phase is not None:
            index = index_of_phase(repeated('phase', phase, len(poses)), len(meshes))
            self._wanted = frozenset(range(len(meshes)))
        index = checked_index(index, len(poses), len(meshes))
        mesh_kwargs |= {'opacity': opacity, 'cmap': cmap, 'clim': clim}
        asked = self._ask(len(poses), scalars, colors, blend, mesh_kwargs)
        parts = [with_own_culling(found) for found in as_meshes(meshes, theme=theme, **asked)]
        self._sources = Sources(meshes, partial(as_parts, theme=theme, **asked), parts)
        baking = {'half': checked_views(views), 'cache': cache, 'progress': progress}
        self._bake, self._materials = bake, {}
        self._share = checked_share(gpu_memory, len(meshes))
        self._poses, self._meshes = poses, parts
        self._cull()
        self._begin(poses, index, {}, pickable, parts, baking)
        self._wear()
        self._paint(scalars, colors)

    def _wear(self):
        """Have the material of the only part, if there is one, and give it new ones."""
        parts = [part for found in self._meshes for part in found]
        self._dressed = (parts[0].actor,) if len(parts) == 1 else ()
        for actor in self._dressed:
            self.SetProperty(actor.GetProperty())

    def _culled(self) -> list:
        """Return the number of each mesh that culls faces, its property and which faces."""
        pairs = ((k, part) for k, parts in enumerate(self._meshes) for part in parts)
        found = ((k, part.actor.GetProperty()) for k, part in pairs)
        return [(k, prop, sides) for k, prop in found if any(sides := culled_faces(prop))]

    def _cull(self):
        """Cull faces as asked, but none if a pose mirrors: VTK culls by the winding it sees."""
        culled = self._unculled or self._culled()
        mirrors = bool(culled) and mirror(self._poses)
        if mirrors == bool(self._unculled):
            return
        for _, prop, (back, front) in culled:
            prop.SetBackfaceCulling(back and not mirrors)
            prop.SetFrontfaceCulling(front and not mirrors)
        self._unculled = culled if mirrors else []
        stale = {k for k, *_ in culled}
        self._models = {k: model for k, model in self._models.items() if k not in stale}

    def _take_over(self, poses, index):
        super()._take_over(poses, index)
        self._cull()

    def _take_back(self, before):
        self._poses = before['_poses']
        self._cull()
        super()._take_back(before)

    def _may_move(self, kept, poses) -> bool:
        turned = not self._unculled and self._culled() and mirror(poses)
        return super()._may_move(kept, poses) and not turned

    def _ask(self, count, scalars, colors, blend, asked) -> dict:
        """Check what is asked of single instances; return what is asked of the mesh."""
        self._blend = checked_blend(blend)
        self._table_options = {k: asked[k] for k in TABLE_OPTIONS if k in asked}
        if colors is not None:
            look.as_colors(colors, count)
        if scalars is not None and not isinstance(scalars, str):
            look.color_table(look.as_scalars(scalars, count), **self._table_options)
            asked = {k: v for k, v in asked.items() if k not in TABLE_OPTIONS}
        else:
            asked = {'scalars': scalars, **asked}
        return {k: v for k, v in asked.items() if v is not None}

    def _lacking(self) -> set:
        """Return also the meshes without images that may have them now."""
        found = super()._lacking()
        if self._bake is not False:
            found |= {k for k in self._used() - found if self._may_have_images(k)}
        return found

    def _may_have_images(self, k) -> bool:
        model = self._models[k]
        if not model.unbaked or _is_changed(model) or room(self._share) < model.needs:
            return False
        return not no_images(self._meshes[k], self._count_of(k))

    def _ready_models(self):
        before = self._models
        super()._ready_models()
        self._take_materials(k for k, m in self._models.items() if m is not before.get(k))

    def _take_materials(self, meshes):
        self._materials |= {k: Material(self._meshes[k]) for k in meshes}

    def _model(self, k):
        """Return the levels of a mesh, baked if that is wanted or pays."""
        if self._bake is False:
            return unbaked(self._meshes[k], 'bake is False')
        left = room(self._share)
        model = make_model(self._meshes[k], count=self._count_of(k), room=left, **self._baking)
        hold(model.atlas)
        return model

    def _group(self, *args):
        group = super()._group(*args)
        if self._singly:
            group.near.draw_singly()
        return group

    def _count_of(self, k) -> int | None:
        """Return how many instances show a mesh, None if it has images for any number."""
        always = self._bake or needs_images(self._forced)
        return None if always else int(np.count_nonzero(self._index == k))

    def bake(self):
        """Bake images of the meshes that have none; what images cannot show stays as it is."""
        before, self._bake = self._bake, True
        try:
            new = {k: self._model(k) for k, model in self._models.items() if model.unbaked}
        except BaseException:  # it may be interrupted
            self._bake = before
            raise
        new = {k: m for k, m in new.items() if not (m.unbaked and _is_changed(self._models[k]))}
        self._models |= new
        self._take_materials(new)
        if any(not model.unbaked for model in new.values()):
            self._rebuild()

    def _follow(self):
        """Take over changes of meshes and materials; what images do not show becomes meshes."""
        new = {}
        for k, parts in self._sources.changed().items() if self._sources else ():
            for part, old in zip(parts, self._meshes[k], strict=False):
                part.actor.SetProperty(old.actor.GetProperty())
            self._meshes[k] = parts
            if k in self._models:
                new[k] = unbaked(parts, MESH_CHANGED)
                self._materials[k] = Material(parts)
        for k, group in zip(self._models, self.groups, strict=True):
            material = self._materials.get(k)
            if material is not None and k not in new and material.changed():
                model = self._shown_model(material, self._models[k])
                group.follow_material()
                self._touch()
                if model is not self._models[k] or material.reshaped():
                    new[k] = model
        if new:
            self._wear()
            self._models |= new
            self._rebuild()

    @staticmethod
    def _shown_model(material, model):
        """Return a model with pictures if these show its material, else one without."""
        baked = material.baked or model
        fits, color = material.compared()
        baked.paint = (*color, 1.0) if color else (0.0,) * 4
        if fits:
            material.baked = None
            return baked
        if material.baked is None and not model.unbaked:
            material.baked = model
            return unbaked(material.parts, MATERIAL_CHANGED)
        return model

    def _paint(self, scalars, colors):
        if scalars is not None and not isinstance(scalars, str):
            self.scalars = scalars
        elif colors is not None:
            self.colors = colors

    @property
    def atlases(self) -> list:
        """The atlas of each mesh that is used."""
        return [model.atlas for model in self._models.values()]

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

    @property
    def limits(self) -> list[Limits]:
        """On-screen sizes at which levels change, for each of `groups`."""
        return [self._limits(group.model) for group in self.groups]

    def _limits_in(self, frame) -> list[Limits]:
        if frame.depth_map and not self._forced and not self._failure:
            low, high = sorted(frame.pixel_scales)
            return [k.model.cast_limits(self.max_error, high / low) for k in self.groups]
        return [found.coarser(frame.quality) for found in self.limits]

    def _limits(self, model) -> Limits:
        count = len(model.levels)
        if self._failure or not model.atlas.errors:
            return limits_of({}, count, 1)
        return forced_limits(self._forced, count) if self._forced else model.limits(self.max_error)

    def scalar_mapper(self):
        """Return a mapper with the table of the shown scalars, None without scalars."""
        if self.table is not None:
            return super().scalar_mapper()
        return self._with_table_of(self._parts())

    def has_bar(self) -> bool:
        """Return True if it has scalars that are not those of an actor, which has its own bar."""
        return self.table is not None or not all(part.of_actor for part in self._parts())

    def bake_into(self, scene):
        """Add the instances to a scene without pvibr."""
        for k, model in self._models.items():
            ids = np.flatnonzero((self._index == k) & self.visible)
            scene.copies(
                self,
                [level.parts for level in model.levels],
                self._poses[ids],
                largest=model.limits(self.max_error).meshes if model.atlas.errors else None,
                colors=None if self._colors is None else self._colors[ids],
                multiply=self.multiplies,
            )

    def _parts(self):
        return [p for model in self._models.values() for p in model.levels[0].parts]

    # -- the life of an effect ---------------------------------------------------------------

    def _put_in(self, renderer):
        self.order = tuple(self._card_order())
        super()._put_in(renderer)
        for actor in self.props[1:]:
            renderer.AddViewProp(actor)

    def _take_out(self, renderer):
        super()._take_out(renderer)
        for actor in self.props[1:]:
            renderer.RemoveViewProp(actor)

    @property
    def props(self) -> tuple:
        """The actor that stands for it, and those that only pickers see."""
        return (self, *(actor for group in self.groups for actor in group.near.picked()))

    def actors(self) -> list:
        """Return the actors that draw the instances, invisible ones included."""
        meshes = [a for group in self.groups for a in group.mesh_actors()]
        return meshes + [actor for _, actor in self._card_order()]

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
        self._check_meshes()
        covered = self.covered if frame.own and not frame.picking else None
        if covered is not self._applied:
            self._apply_looks(covered)
            self._content_key = None
        self._upload(frame.window)
        camera = (frame.view_from_world.tobytes(), frame.clip_from_view.tobytes())
        depth = self._depth_is_read(frame)
        how = frame.picking, frame.casting, frame.depth_map, frame.quality, depth
        content_key = (*camera, frame.size, self.revision, *how)
        self._check_cards()
        if content_key == self._content_key:
            self._offer(frame.picking)
            return
        self._content_key = content_key
        limits = self._limits_in(frame)
        chosen = [
            k.select(frame, limit, depth=depth)
            for k, limit in zip(self.groups, limits, strict=True)
        ]
        for shader in self.groups[0].cards.shaders():
            self._show_cards(frame, shader, [c[shader.name] for c in chosen])
        for group, limit in zip(self.groups, limits, strict=True):
            for actor in group.select_meshes(frame, limit):
                frame.renderer.AddViewProp(actor)
        self._offer(frame.picking)

    def _offer(self, there):
        """Let VTK's pickers find instances that are drawn as meshes."""
        for group in self.groups:
            group.near.offer(bool(self.pickable), there)

    def _depth_is_read(self, frame) -> bool:
        """Return True if an effect reads the depth of the frame after it is drawn."""
        renderer = frame.renderer
        own = renderer.GetPass() is not None or bool(renderer.GetUseSSAO())
        effects = self.pipeline.effects
        return frame.own and (own or any(e.is_image_effect and e.enabled for e in effects))

    def _show_cards(self, frame, shader, choices):
        unit = self.groups[0].unit
        if unit > 1 and sum(len(c.table) for c in choices) * unit <= SORTED_SEEN:
            pairs = zip(self.groups, choices, strict=True)
            unit, choices = 1, [group.refine(frame, c) for group, c in pairs]
        cuts = slabs([c.depths for c in choices], shader.turns, unit)
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
        msg = f'{self.name}: {failure}: {instead} instead. Look at `pvibr doctor`.'
        warnings.warn(msg, PvibrWarning, stacklevel=3)

    def finish(self, frame):
        """Release the texture units, have depth written, and let pickers find instances."""
        self._binder.unbind()
        frame.window.GetState().vtkglDepthMask(True)
        if frame.own:
            self._offer(True)
        if frame.own and not frame.picking:
            for group in self.groups:
                group.near.check()

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
        }
        for k, model in self._models.items():
            out[f'atlas {k}'] = model.describe(self._limits(model))
        return out

    def _memory(self) -> str:
        count = max(len(self), 1)
        gpu = sum(group.cards.item_nbytes for group in self.groups) / count
        held = sum(group.placement.nbytes for group in self.groups) / count
        return f'{gpu:.0f} B of GPU memory, {held:.0f} B of main memory beside its pose'

    def pick(self, x, y):
        """Return the nearest instance under a pixel."""
        if not self._can_pick():
            return None
        return nearest_hit(self.groups, self.pipeline.renderer, x, y, self.visible)

    def instance_of(self, actor):
        """Return the index of the instance that a picked actor shows, or None.

        Parameters
        ----------
        actor : vtkActor
            Actor that PyVista's mesh picking returned.
        """
        return next((i for k in self.groups if (i := k.instance_of(actor)) is not None), None)


def _is_changed(model) -> bool:
    return model.unbaked in (MESH_CHANGED, MATERIAL_CHANGED)
