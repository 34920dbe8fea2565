"""Items at poses with images of their meshes if these pay; meshes and materials may change."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.instances.baked_materials import MATERIAL_CHANGED, BakedMaterial
from pvibr.instances.explain import Explanation, explanation
from pvibr.instances.group import InstanceGroup
from pvibr.instances.instance_arguments import checked_ids
from pvibr.instances.levels import make_model, no_images, unbaked
from pvibr.instances.limits import Limits, forced_limits, limits_of, needs_images
from pvibr.instances.memory import available_bytes, hold
from pvibr.instances.mesh_sources import MESH_CHANGED, Sources
from pvibr.instances.posed_set import PosedSet
from pvibr.meshes.materials import culled_faces
from pvibr.meshes.poses import mirror, placed_by


class BakedSet(PosedSet):
    """Items at poses, in groups of one mesh each, with or without images of it.

    Parameters are those of :class:`pvibr.Effect`.
    """

    _bake: bool | None = None
    #: What `_culled` returned when mirroring poses switched its culling off.
    _unculled: list = []
    _forced: dict[str, tuple] = {}
    #: Clipping planes, a vtkPlaneCollection.
    _planes: Any = None
    _models: dict = {}
    _sources: Sources | None = None
    #: Material of each model at the time of its bake.
    _materials: dict[int, BakedMaterial] = {}
    #: Limit on the GPU memory of the images of each mesh, None for the common limit alone.
    _max_image_bytes: float | None

    @property
    def atlases(self) -> list:
        """The atlas of each mesh in use."""
        return [model.atlas for model in self._models.values()]

    @property
    def limits(self) -> list[Limits]:
        """On-screen sizes at which levels change, of each of `groups`."""
        return [self._limits(group.model) for group in self.groups]

    def _limits_in(self, frame) -> list[Limits]:
        if frame.depth_map and not self._forced and not self._needs_meshes:
            low, high = sorted(frame.pixel_scales)
            return [k.model.depth_limits(self.max_error, high / low) for k in self.groups]
        return [self._limits(k.model).coarser(frame.quality) for k in self.groups]

    @property
    def _needs_meshes(self) -> bool:
        """Whether all instances are drawn as meshes, even if there are images."""
        return bool(self._failure) or self.is_translucent or self._planes is not None

    def _limits(self, model) -> Limits:
        level_count = len(model.levels)
        if self._needs_meshes or not model.atlas.errors:
            return limits_of({}, level_count, 1)
        if self._forced:
            return forced_limits(self._forced, level_count)
        return model.limits(self.max_error)

    def _adopt_material(self):
        """Share the material of the only part, or pass changes of the first on to all."""
        parts = [part for mesh_parts in self._meshes for part in mesh_parts]
        self._dressed = (parts[0].actor,) if len(parts) == 1 else ()
        for actor in self._dressed:
            self.SetProperty(actor.GetProperty())
        if len(parts) > 1:
            self._share_material()

    def _materials_of_all(self) -> list:
        return [part.actor.GetProperty() for mesh_parts in self._meshes for part in mesh_parts]

    def _culled(self) -> list:
        """Return the mesh index, property and (back, front) of each part that culls faces."""
        pairs = ((k, part) for k, parts in enumerate(self._meshes) for part in parts)
        properties = ((k, part.actor.GetProperty()) for k, part in pairs)
        return [(k, prop, sides) for k, prop in properties if any(sides := culled_faces(prop))]

    def _cull(self):
        """Cull faces unless a pose mirrors: VTK culls by the winding on the screen."""
        culled = self._unculled or self._culled()
        mirrors = bool(culled) and mirror(self._poses)
        if mirrors == bool(self._unculled):
            return
        for _, prop, (back, front) in culled:
            prop.SetBackfaceCulling(back and not mirrors)
            prop.SetFrontfaceCulling(front and not mirrors)
        self._unculled = culled if mirrors else []
        stale_models = {k for k, *_ in culled}
        self._models = {k: model for k, model in self._models.items() if k not in stale_models}

    def _set_poses(self, poses, index):
        super()._set_poses(poses, index)
        self._cull()

    def _restore(self, before):
        self._poses = before['_poses']
        self._cull()
        super()._restore(before)

    def _can_move(self, all_poses, poses) -> bool:
        if not super()._can_move(all_poses, poses):
            return False
        if self._unculled or not self._culled():
            return True
        return not mirror(poses if self._world is None else placed_by(self._world, poses))

    def _missing_models(self) -> set:
        """Return also the meshes that can now have images."""
        lacking = super()._missing_models()
        if self._bake is not False:
            lacking |= {k for k in self._used_meshes() - lacking if self._may_have_images(k)}
        return lacking

    def _may_have_images(self, k) -> bool:
        model = self._models[k]
        if not model.why_unbaked or _is_changed(model):
            return False
        fits = available_bytes(self._max_image_bytes) >= model.required_bytes
        return fits and not no_images(self._meshes[k], self._count_of(k))

    def _ready_models(self):
        previous = self._models
        super()._ready_models()
        self._take_materials(k for k, m in self._models.items() if m is not previous.get(k))

    def _take_materials(self, meshes):
        self._materials |= {k: BakedMaterial(self._meshes[k]) for k in meshes}

    def _model(self, k):
        """Return the levels of a mesh, baked on request or if that pays."""
        if self._bake is False:
            return unbaked(self._meshes[k], 'bake is False')
        max_bytes, count = available_bytes(self._max_image_bytes), self._count_of(k)
        model = make_model(self._meshes[k], count=count, max_bytes=max_bytes, **self._baking)
        hold(model.atlas)
        return model

    def _count_of(self, k) -> int | None:
        """Return the number of instances of a mesh, None if it is baked for any number."""
        is_baked_anyway = self._bake or needs_images(self._forced)
        return None if is_baked_anyway else int(np.count_nonzero(self._index == k))

    def bake(self):
        """Bake images of the meshes that have none and that images can show."""
        previous, self._bake = self._bake, True
        try:
            baked = {k: self._model(k) for k, model in self._models.items() if model.why_unbaked}
        except BaseException:  # it may be interrupted
            self._bake = previous
            raise
        baked = {
            k: m for k, m in baked.items() if not (m.why_unbaked and _is_changed(self._models[k]))
        }
        self._models |= baked
        self._take_materials(baked)
        if any(not model.why_unbaked for model in baked.values()):
            self._rebuild()

    def _remake(self):
        """Drop the images of all meshes, whose colours were changed."""
        models = self._models.items()
        reasons = {k: model.why_unbaked or MESH_CHANGED for k, model in models}
        self._models = {k: unbaked(self._meshes[k], reason) for k, reason in reasons.items()}
        self._take_materials(self._models)
        self._rebuild()

    def _follow_meshes(self):
        """Follow changes of meshes and materials; outdated images give way to meshes."""
        replaced = {}
        for k, parts in self._sources.changed().items() if self._sources else ():
            for part, old_part in zip(parts, self._meshes[k], strict=False):
                part.actor.SetProperty(old_part.actor.GetProperty())
            self._meshes[k] = parts
            if k in self._models:
                replaced[k] = unbaked(parts, MESH_CHANGED)
                self._materials[k] = BakedMaterial(parts)
        for k, group in zip(self._models, self.groups, strict=True):
            material = self._materials.get(k)
            if material is not None and k not in replaced and material.changed():
                model = self._shown_model(material, self._models[k])
                group.follow_material()
                self._touch()
                if model is not self._models[k] or material.reshaped():
                    replaced[k] = model
        if replaced:
            self._adopt_material()
            self._models |= replaced
            self._rebuild()
            self._show_bar()

    @staticmethod
    def _shown_model(material, model):
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

    def explain(self, index) -> Explanation:
        """Return why an instance is drawn at its level of detail.

        Parameters
        ----------
        index : int
            The instance.

        Returns
        -------
        Explanation
            Its size on the screen, the patch of its view direction, and for each level the sizes
            at which that direction uses it and the rule that ends them, for the current camera.
            `print` shows it as a table.

        Raises
        ------
        IndexError
            If the instance does not exist.
        TypeError
            If `index` is not one number.
        RuntimeError
            If the set is in no plotter.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pvibr
        >>> pl = pv.Plotter(off_screen=True)
        >>> cones = pl.ibr.add_instances(pv.Cone(), [[0, 0, 0], [2, 0, 0]], cache=False)
        >>> cones.explain(1).level
        'mesh'
        >>> pl.close()
        """
        if np.ndim(index) != 0:
            raise TypeError(f'index must be an int, the index of one instance, got {index!r:.80}')
        (index,) = checked_ids(index, len(self)).tolist()
        if self.pipeline is None:
            raise RuntimeError(
                'instances must be in a plotter, whose camera decides the level; add them first'
            )
        group, slot = self._group_and_slot(index)
        return explanation(
            index,
            group,
            slot,
            self.pipeline.view(),
            self._limits(group.model),
            max_error=self.max_error,
            hidden=not (self.visible[index] and self.GetVisibility()),
            always=self._common_rule(),
        )

    def _group_and_slot(self, index) -> tuple[InstanceGroup, int]:
        """Return the group that draws an instance, and its slot there."""
        group = next(group for group in self.groups if index in group.ids)
        return group, int(np.flatnonzero(group.ids == index)[0])

    def _common_rule(self) -> str:
        """Return the rule that overrides errors and costs for all instances, else empty."""
        rules = {
            'shaders failed': self._failure,
            'translucent': self.is_translucent,
            'clipped': self._planes is not None,
            'forced': self._forced,
        }
        return next((rule for rule, applies in rules.items() if applies), '')


def _is_changed(model) -> bool:
    return model.why_unbaked in (MESH_CHANGED, MATERIAL_CHANGED)
