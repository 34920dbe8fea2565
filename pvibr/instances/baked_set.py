"""Items at poses whose meshes have images if these pay: they follow meshes and materials."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.instances.arguments import checked_ids
from pvibr.instances.explain import Explanation, explanation
from pvibr.instances.group import InstanceGroup
from pvibr.instances.levels import make_model, no_images, unbaked
from pvibr.instances.limits import Limits, forced_limits, limits_of, needs_images
from pvibr.instances.materials import MATERIAL_CHANGED, Material
from pvibr.instances.memory import hold, room
from pvibr.instances.posed_set import PosedSet
from pvibr.instances.sources import MESH_CHANGED, Sources
from pvibr.meshes.materials import culled_faces
from pvibr.meshes.poses import mirror, placed_by


class BakedSet(PosedSet):
    """Items at poses, in groups of one mesh each, with images of these or without.

    Parameters are those of :class:`pvibr.Effect`.
    """

    _bake: bool | None = None
    #: What culls faces but for poses that mirror.
    _unculled: list = []
    _forced: dict[str, tuple] = {}
    #: What cuts it off, a vtkPlaneCollection.
    _planes: Any = None
    _models: dict = {}
    _sources: Sources | None = None
    #: How the material of each model was when it was made.
    _materials: dict[int, Material] = {}
    #: Bytes of GPU memory that its images may have, None for no bound of its own.
    _share: float | None

    @property
    def atlases(self) -> list:
        """The atlas of each mesh that is used."""
        return [model.atlas for model in self._models.values()]

    @property
    def limits(self) -> list[Limits]:
        """On-screen sizes at which levels change, for each of `groups`."""
        return [self._limits(group.model) for group in self.groups]

    def _limits_in(self, frame) -> list[Limits]:
        if frame.depth_map and not self._forced and not self._needs_meshes:
            low, high = sorted(frame.pixel_scales)
            return [k.model.cast_limits(self.max_error, high / low) for k in self.groups]
        return [self._limits(k.model).coarser(frame.quality) for k in self.groups]

    @property
    def _needs_meshes(self) -> bool:
        """Whether all are drawn as meshes, whatever images there are."""
        return bool(self._failure) or self.is_translucent or self._planes is not None

    def _limits(self, model) -> Limits:
        count = len(model.levels)
        if self._needs_meshes or not model.atlas.errors:
            return limits_of({}, count, 1)
        if self._forced:
            return forced_limits(self._forced, count)
        return model.limits(self.max_error)

    def _wear(self):
        """Have the material of the only part, or that of the first with changes for all."""
        parts = [part for found in self._meshes for part in found]
        self._dressed = (parts[0].actor,) if len(parts) == 1 else ()
        for actor in self._dressed:
            self.SetProperty(actor.GetProperty())
        if len(parts) > 1:
            self._share_material()

    def _materials_of_all(self) -> list:
        return [part.actor.GetProperty() for found in self._meshes for part in found]

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
        if not super()._may_move(kept, poses):
            return False
        if self._unculled or not self._culled():
            return True
        return not mirror(poses if self._world is None else placed_by(self._world, poses))

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

    def _remake(self):
        """Draw meshes whose colours were changed, without their images."""
        models = self._models.items()
        why = {k: model.unbaked or MESH_CHANGED for k, model in models}
        self._models = {k: unbaked(self._meshes[k], reason) for k, reason in why.items()}
        self._take_materials(self._models)
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
            self._show_bar()

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

    def explain(self, index) -> Explanation:
        """Return why an instance is drawn by the level that draws it.

        Parameters
        ----------
        index : int
            The instance.

        Returns
        -------
        Explanation
            Its size on the screen, the patch of directions that it is seen from, and for each
            level the sizes at which it is used from there and the rule that ends them, for the
            camera as it is now. `print` shows it as a table.

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
            raise TypeError(f'index must be an int, the number of one instance, got {index!r:.80}')
        (index,) = checked_ids(index, len(self)).tolist()
        if self.pipeline is None:
            raise RuntimeError(
                'instances must be in a plotter to be explained: its camera decides'
            )
        group, slot = self._place_of(index)
        return explanation(
            index,
            group,
            slot,
            self.pipeline.view(),
            self._limits(group.model),
            max_error=self.max_error,
            hidden=not (self.visible[index] and self.GetVisibility()),
            always=self._rule_of_all(),
        )

    def _place_of(self, index) -> tuple[InstanceGroup, int]:
        """Return the group that draws an instance, and its slot there."""
        group = next(group for group in self.groups if index in group.ids)
        return group, int(np.flatnonzero(group.ids == index)[0])

    def _rule_of_all(self) -> str:
        """Return the rule by which the levels of all are chosen, empty for errors and costs."""
        rules = {
            'shaders failed': self._failure,
            'translucent': self.is_translucent,
            'clipped': self._planes is not None,
            'forced': self._forced,
        }
        return next((rule for rule, applies in rules.items() if applies), '')


def _is_changed(model) -> bool:
    return model.unbaked in (MESH_CHANGED, MATERIAL_CHANGED)
