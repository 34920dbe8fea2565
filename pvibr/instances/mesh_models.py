"""The levels of each mesh of a set: baked where that pays, fits, and matches the mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from pvibr.core.determinism import is_deterministic
from pvibr.core.errors import warn
from pvibr.instances.bake_queue import QUEUE, State, can_run
from pvibr.instances.baked_materials import MATERIAL_CHANGED, BakedMaterial
from pvibr.instances.drafts import Draft, draft_of
from pvibr.instances.instance_arguments import checked_cache
from pvibr.instances.levels import BakePlan, LodModel, make_model, no_images, plan_of, unbaked
from pvibr.instances.memory import available_bytes, checked_share, hold
from pvibr.instances.mesh_sources import MESH_CHANGED, Sources
from pvibr.meshes.materials import culled_faces
from pvibr.meshes.parts import as_meshes, as_parts, with_own_culling
from pvibr.meshes.poses import mirror


class MeshModels:
    """Meshes of a set, and the model of each that is in use."""

    def __init__(
        self, meshes=(), sources=None, *, bakes=None, waits=True, max_image_bytes=None, **baking
    ):
        #: Parts of each mesh.
        self.meshes = list(meshes)
        self.by_mesh = {}
        self._is_paused = False
        #: Whether images are baked; None if that pays.
        self.bakes: bool | None = bakes
        #: Whether bakes are waited for, or drafts drawn until they are done.
        self.waits = waits or not can_run()
        #: Whether a level that needs images is forced.
        self.forces_images = False
        #: Meshes that are baked even if no instance shows them.
        self.required_meshes: frozenset = frozenset()
        self._sources, self._max_image_bytes, self._baking = sources, max_image_bytes, baking
        #: Material of each mesh at the time of its bake.
        self._materials: dict[int, BakedMaterial] = {}
        #: What `_culled` returned when mirroring poses switched its culling off.
        self._unculled: list = []

    @classmethod
    def of(cls, meshes, mesh_options, *, gpu_memory, cache, **options) -> MeshModels:
        """Return the models of meshes as passed by the user, none made yet."""
        parts = [with_own_culling(mesh_parts) for mesh_parts in as_meshes(meshes, **mesh_options)]
        sources = Sources(meshes, partial(as_parts, **mesh_options), parts)
        options |= {'max_image_bytes': checked_share(gpu_memory, len(meshes))}
        return cls(parts, sources, cache=checked_cache(cache), **options)

    @property
    def by_mesh(self) -> dict[int, LodModel]:
        """The models, {mesh: model} in ascending order."""
        return self._by_mesh

    @by_mesh.setter
    def by_mesh(self, models):
        self._by_mesh: dict[int, LodModel] = models
        #: Whether bakes are under way, or were stopped.
        self.has_drafts: bool = any(model.is_draft for model in models.values())

    def parts(self) -> list:
        """Return the parts of all meshes."""
        return [part for mesh_parts in self.meshes for part in mesh_parts]

    def shown_parts(self) -> list:
        """Return the parts of the meshes in use."""
        return [part for model in self.by_mesh.values() for part in model.levels[0].parts]

    def state(self) -> tuple:
        """Return what `restore` needs."""
        return self.by_mesh, self.required_meshes, bool(self._unculled)

    def restore(self, state):
        """Restore the state before an update that failed."""
        models, self.required_meshes, mirrors = state
        self._cull(mirrors=mirrors)
        self.by_mesh = models

    # -- models ------------------------------------------------------------------------------

    def follow_poses(self, poses, index) -> bool:
        """Make the levels that instances need and that are missing; return True if any were."""
        self._cull(mirrors=bool(self._unculled or self._culled()) and mirror(poses))
        missing_meshes = self._missing(index)
        new_models = {k: self._made(k, index) for k in missing_meshes}
        self.by_mesh = dict(sorted({**self.by_mesh, **new_models}.items()))
        self._take_materials(new_models)
        return bool(missing_meshes)

    def require_all(self):
        """Bake all meshes, even if no instance shows them."""
        self.required_meshes = frozenset(range(len(self.meshes)))

    def _missing(self, index) -> set:
        """Return the meshes in use without levels, or that can now have images."""
        used_meshes = {*self.required_meshes, *np.flatnonzero(np.bincount(index)).tolist()}
        missing = used_meshes - self.by_mesh.keys()
        if self.bakes is False:
            return missing
        return missing | {k for k in used_meshes - missing if self._may_have_images(k, index)}

    def _may_have_images(self, k, index) -> bool:
        model = self.by_mesh[k]
        if not _lacks_images(model) or _is_changed(model):
            return False
        fits = available_bytes(self._max_image_bytes) >= model.required_bytes
        return fits and not no_images(self.meshes[k], self._count_of(k, index))

    def _made(self, k, index) -> LodModel:
        """Return the levels of a mesh, baked on request or if that pays."""
        if self.bakes is False:
            return unbaked(self.meshes[k], 'bake is False')
        model = self._draft(k, index) or self._baked(k, index)
        hold(model.atlas)
        return model

    def _baked(self, k, index) -> LodModel:
        return make_model(self.meshes[k], **self._limits_of(k, index), **self._baking)

    def _limits_of(self, k, index) -> dict:
        """Return what decides whether a mesh is baked, and how large."""
        pending_bytes = sum(d.plan.nbytes for i, d in self.drafts().items() if i != k)
        max_bytes = available_bytes(self._max_image_bytes) - pending_bytes
        return {'count': self._count_of(k, index), 'max_bytes': max(max_bytes, 0.0)}

    def _count_of(self, k, index) -> int | None:
        """Return the number of instances of a mesh, None if it is baked for any number."""
        is_baked_anyway = self.bakes or self.forces_images
        return None if is_baked_anyway else int(np.count_nonzero(index == k))

    # -- bakes in the background -------------------------------------------------------------

    def drafts(self) -> dict[int, Draft]:
        """Return the models of meshes whose bakes are not done."""
        return {k: model for k, model in self.by_mesh.items() if isinstance(model, Draft)}

    def _draft(self, k, index) -> LodModel | None:
        """Return what is drawn until the bake of a mesh is done, None if it is waited for."""
        if self.waits or is_deterministic():
            return None
        grid = {name: value for name, value in self._baking.items() if name != 'progress'}
        plan = plan_of(self.meshes[k], **self._limits_of(k, index), **grid)
        if not isinstance(plan, BakePlan):
            return plan
        plan = plan.with_key()
        old_draft = self.drafts().get(k)
        if old_draft is not None and old_draft.plan.key == plan.key:
            return old_draft
        try:
            draft = draft_of(plan, int(np.count_nonzero(index == k)))
        except RuntimeError:  # the driver draws no images: the bake says so
            return None
        draft.job = QUEUE.job(plan)
        QUEUE.poll()
        return draft

    @property
    def pending(self) -> bool:
        """Whether bakes are under way."""
        return self.has_drafts and not self._is_paused

    @property
    def has_news(self) -> bool:
        """Whether the bake of a draft is over, or has come to its lighter meshes."""
        if not self.has_drafts or self._is_paused:
            return False
        QUEUE.poll()
        return any(draft.is_over or draft.better_levels for draft in self.drafts().values())

    @property
    def shows_progress(self) -> bool | None:
        """Whether bakes show a progress bar; None in terminals and notebooks."""
        return self._baking.get('progress')

    @property
    def fraction(self) -> float:
        """Fraction done of what is being baked, 0 to 1."""
        fractions = [draft.job.fraction for draft in self.drafts().values() if draft.job]
        return sum(fractions) / max(len(fractions), 1)

    def adopt_bakes(self, index) -> bool:
        """Replace drafts by what their bakes have come to; return True if there is anything."""
        if not self.has_news:
            return False
        drafts = self.drafts()
        over = {k: draft for k, draft in drafts.items() if draft.is_over}
        new_models = {k: self._after(k, draft, index) for k, draft in over.items()}
        new_models |= {
            k: draft.with_levels()
            for k, draft in drafts.items()
            if k not in new_models and draft.better_levels
        }
        for model in new_models.values():
            hold(model.atlas)
        self.by_mesh |= new_models
        self._take_materials(new_models)
        return True

    def _after(self, k, draft, index) -> LodModel:
        """Return the model that follows a draft."""
        job = draft.job
        job.pass_warnings_on()
        if job.state is State.DONE:
            model = replace(draft.plan, cache=job.result).load()
            if model is not None:
                return model
        why = job.failure or 'its result cannot be read'
        warn(f'a bake in another process failed ({why}); it is done in this one instead.')
        return self._baked(k, index)

    @property
    def has_choice(self) -> bool:
        """Whether more than one bake waits to begin."""
        jobs = [draft.job for draft in self.drafts().values() if draft.job is not None]
        return sum(job.state is State.WAITING for job in jobs) > 1

    def rank(self, sizes):
        """Bake the meshes first whose largest instances, {mesh: px}, are largest in view."""
        for k, draft in self.drafts().items():
            if draft.job is not None:
                draft.job.priority = sizes.get(k, 0.0)

    def pause(self):
        """Stop the bakes that no other set waits for, until `resume`."""
        if self.pending:
            self._is_paused = True
            for draft in self.drafts().values():
                draft.job = None
            QUEUE.poll()

    def resume(self):
        """Go on with bakes that were stopped."""
        if self._is_paused:
            self._is_paused = False
            for draft in self.drafts().values():
                draft.job = QUEUE.job(draft.plan)

    def bake(self, index) -> bool:
        """Bake images of meshes without; return True if any now has images."""
        previous, self.bakes = self.bakes, True
        models = self.by_mesh.items()
        try:
            baked = {k: self._made(k, index) for k, model in models if _lacks_images(model)}
        except BaseException:  # it may be interrupted
            self.bakes = previous
            raise
        baked = {
            k: m for k, m in baked.items() if not (m.why_unbaked and _is_changed(self.by_mesh[k]))
        }
        self.by_mesh |= baked
        self._take_materials(baked)
        return any(model.is_draft or not model.why_unbaked for model in baked.values())

    def remake(self, index):
        """Drop the images of all meshes, whose colours were changed."""
        models = self.by_mesh.items()
        self.by_mesh = {k: self._changed(k, model, index) for k, model in models}
        self._take_materials(self.by_mesh)

    def _changed(self, k, model, index) -> LodModel:
        """Return the model of a mesh that has changed: only bakes under way begin again."""
        if model.is_draft:
            return self._made(k, index)
        return unbaked(self.meshes[k], model.why_unbaked or MESH_CHANGED)

    def set_clim(self, clim):
        """Use a range of scalars for meshes that change, unless these are actors."""
        if self._sources and not any(part.of_actor for part in self.shown_parts()):
            self._sources.set_look(clim=clim)

    def _take_materials(self, meshes):
        self._materials |= {k: BakedMaterial(self.meshes[k]) for k in meshes}

    # -- changes of meshes and materials -----------------------------------------------------

    def time_getters(self) -> list:
        """Return what returns the times of all that `follow_meshes` follows."""
        sources = [] if self._sources is None else self._sources.time_getters
        shown_materials = [self._materials[k] for k in self._by_mesh if k in self._materials]
        return [*sources, *(get for m in shown_materials for get in m.time_getters())]

    def follow_meshes(self, index) -> tuple[list[int], bool]:
        """Follow changes of meshes and materials; outdated images give way to meshes.

        Returns the meshes whose materials have changed, and whether models were replaced.
        """
        replaced, relit_meshes = {}, []
        for k, parts in self._sources.changed().items() if self._sources else ():
            for part, old_part in zip(parts, self.meshes[k], strict=False):
                part.actor.SetProperty(old_part.actor.GetProperty())
            self.meshes[k] = parts
            if k in self.by_mesh:
                replaced[k] = self._changed(k, self.by_mesh[k], index)
                self._materials[k] = BakedMaterial(parts)
        models, materials = self._by_mesh, self._materials
        for k, model in models.items():
            if k in materials and k not in replaced and (material := materials[k]).changed():
                is_draft = model.is_draft
                shown_model = self._made(k, index) if is_draft else _shown_model(material, model)
                relit_meshes.append(k)
                if shown_model is not model or material.reshaped():
                    replaced[k] = shown_model
                if is_draft and shown_model is not model:
                    self._materials[k] = BakedMaterial(self.meshes[k])
        if replaced:
            self.by_mesh |= replaced
        return relit_meshes, bool(replaced)

    # -- culling of faces --------------------------------------------------------------------

    def can_move(self, poses) -> bool:
        """Return True if the models remain as they are when some instances move to poses."""
        return bool(self._unculled) or not self._culled() or not mirror(poses)

    def _culled(self) -> list:
        """Return the mesh index, property and (back, front) of each part that culls faces."""
        pairs = ((k, part) for k, parts in enumerate(self.meshes) for part in parts)
        properties = ((k, part.actor.GetProperty()) for k, part in pairs)
        return [(k, prop, sides) for k, prop in properties if any(sides := culled_faces(prop))]

    def _cull(self, *, mirrors):
        """Cull faces unless a pose mirrors: VTK culls by the winding on the screen."""
        if mirrors == bool(self._unculled):
            return
        culled = self._unculled or self._culled()
        for _, prop, (back, front) in culled:
            prop.SetBackfaceCulling(back and not mirrors)
            prop.SetFrontfaceCulling(front and not mirrors)
        self._unculled = culled if mirrors else []
        stale_meshes = {k for k, *_ in culled}
        self.by_mesh = {k: m for k, m in self.by_mesh.items() if k not in stale_meshes}


def _shown_model(material, model) -> LodModel:
    """Return a model with images if they match its material, else one without."""
    baked = material.stale_model or model
    is_shown, color = material.compared()
    baked.paint = (*color, 1.0) if color else (0.0,) * 4
    if is_shown:
        material.stale_model = None
        return baked
    if material.stale_model is None and not model.why_unbaked:
        material.stale_model = model
        return unbaked(material.parts, MATERIAL_CHANGED)
    return model


def _lacks_images(model) -> bool:
    """Return True if a mesh has no images, and none are being baked."""
    return bool(model.why_unbaked) and not model.is_draft


def _is_changed(model) -> bool:
    return model.why_unbaked in (MESH_CHANGED, MATERIAL_CHANGED)
