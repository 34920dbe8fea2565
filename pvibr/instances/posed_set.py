"""Items at poses, each showing one of several meshes: any of it changes without baking."""

from __future__ import annotations

import numpy as np

from pvibr.core.colors import color_rows
from pvibr.core.determinism import is_deterministic
from pvibr.gl.binder import Binder
from pvibr.instances.arguments import (
    checked_ids,
    checked_index,
    index_for,
    index_of_phase,
    repeated,
    same_kind,
)
from pvibr.instances.cards import slab_counts
from pvibr.instances.group import InstanceGroup, unit_of
from pvibr.instances.levels import make_model
from pvibr.instances.placement import centers_of
from pvibr.maths.arguments import as_array, naming
from pvibr.maths.blocks import BLOCK, members, morton_order
from pvibr.meshes.posed import posed_source, source_of
from pvibr.meshes.poses import placed_by
from pvibr.scene import looks as look
from pvibr.scene.item_set import ItemSet
from pvibr.scene.scalar_bars import name_of
from pvibr.scene.thing import joined_bounds

_SPREAD = 2.0  # growth of most blocks at which their instances are no neighbours any more
# What an update replaces; it comes back if a check or a bake fails.
_REPLACED = (
    *('_poses', '_given', '_owned', '_index', '_order', '_wanted', '_models'),
    *('_scalars', '_colors', '_visible', 'covered', '_applied'),
)
_SAMPLE = 64  # blocks that are asked


class PosedSet(ItemSet):
    """Items at poses, in groups of one mesh each.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('n_instances', 'poses', 'index', 'phase', 'update')
    #: Indices of instances that another thing draws in frames of the scene's own camera.
    covered: np.ndarray | None = None
    #: What draws the instances of each mesh: its cards, its meshes, what is seen of them.
    groups: list
    #: Slot of each instance in its group, once asked for.
    _slots: np.ndarray | None = None
    _applied: np.ndarray | None = None
    _blend = 'replace'
    #: Meshes to be baked whether or not an instance shows them.
    _wanted: frozenset = frozenset()
    _capacity = 0
    #: Poses in the space of the set, as users give them; `_poses` are those in the world.
    _given: np.ndarray
    #: Whether bounds stay, as nothing but the place of the whole changes.
    _keeps_bounds = False
    #: How poses were asked to be turned and scaled.
    _placing: dict = {}

    def _begin(self, poses, index, models, pickable, meshes=(), baking=None):
        """Take over checked arguments; models that lack are baked of the meshes."""
        self._models, self._meshes, self._baking = models, meshes, baking or {}
        self._binder = Binder()
        self._failure: str | None = None
        self.pickable = pickable
        self._scalars = self._colors = self._visible = self.table = None
        self._poses = self._given = poses
        self._index, self._order = index, np.zeros(0, np.int32)
        self._owned = False  # whether the poses are no array of the user's
        self._ready_models()
        self._make_groups()

    # -- poses and meshes ----------------------------------------------------------------------

    @property
    def n_instances(self) -> int:
        """Number of instances."""
        return len(self._poses)

    def __len__(self):
        return len(self._poses)

    def _places(self) -> np.ndarray:
        return self._poses[:, :3, 3] if self._poses.ndim == 3 else self._poses

    @property
    def poses(self) -> np.ndarray:
        """Points (n, 3) or matrices (n, 4, 4) in its own space, read-only; see :meth:`update`."""
        return look.read_only(self._given)

    @poses.setter
    def poses(self, poses):
        self.update(poses=poses)

    @property
    def index(self) -> np.ndarray:
        """Mesh of each instance, shape (n,), read-only; see :meth:`update`."""
        return look.read_only(self._index)

    @index.setter
    def index(self, index):
        self.update(index=index)

    @property
    def phase(self) -> np.ndarray:
        """Mesh of each instance as a fraction of all meshes, 0 to 1; setting it repeats them."""
        return look.read_only(self._index / max(len(self._meshes), 1))

    @phase.setter
    def phase(self, phase):
        with naming('phase', phase):
            self.update(phase=phase)

    def update(
        self,
        ids=None,
        *,
        poses=None,
        index=None,
        phase=None,
        scalars=None,
        colors=None,
        visible=None,
    ):
        """Change all instances, or some; what is baked is kept.

        Parameters
        ----------
        ids : array_like of int or bool, or slice, optional
            Instances to change; without, all are replaced, by any number of them.
        poses : array_like, shape (k, 3) or (k, 4, 4), optional
            New points or matrices, or one for all `ids`.
        index : array_like of int, shape (k,), or int, optional
            Meshes to show. A mesh is baked when an instance first shows it. For another number
            of instances it is required, unless there is one mesh.
        phase : array_like of float, shape (k,), or float, optional
            The same as a fraction of all meshes, modulo 1.
        scalars, colors, visible : optional
            New values. If the number of instances changes, those that are not given are reset.

        Raises
        ------
        IndexError
            If an instance does not exist.
        ValueError
            If the number of values is wrong.
        """
        before = {name: getattr(self, name) for name in _REPLACED}
        try:
            if phase is not None:
                index = index_of_phase(phase, max(len(self._meshes), 1))
                self._wanted = frozenset(range(len(self._meshes)))
            if ids is None:
                looks = self._update_all(poses, index, scalars, colors, visible)
            else:
                ids = checked_ids(ids, len(self))
                looks = self._with_looks(ids, scalars, colors, visible)
                self._update_some(ids, poses, index)
        except BaseException:  # a bake may be interrupted
            self._take_back(before)
            raise
        named = name_of(scalars) if ids is None else self._scalar_name
        for name, values in looks.items():
            if name == 'scalars':
                self._set_scalars(values, named)
            else:
                setattr(self, name, values)
        self._show_bar()  # also where another number of instances has no scalars

    def _posed(self, poses):
        """Return checked poses; those of datasets and tables turned and scaled as the first."""
        alike = {k: v for k, v in self._placing.items() if np.ndim(v) == 0}
        given = source_of(poses, *(v for v in alike.values() if isinstance(v, str)))
        return posed_source(given, **({} if given.arrays is None else alike))

    def _take_back(self, before):
        """Have what there was before an update that failed."""
        self.__dict__.update(before)

    def _update_all(self, poses, index, scalars, colors, visible) -> dict:
        """Have other poses and meshes; return the looks to be set."""
        moved = poses is not None or index is not None
        poses = self._given if poses is None else self._posed(poses)
        count, meshes = len(poses), max(len(self._meshes), 1)
        if index is not None:
            index = checked_index(repeated('index', index, count), count, meshes)
        else:
            index = index_for(count, self._index, meshes)
        looks: dict = {}
        if scalars is not None:
            looks['scalars'] = look.as_scalars(scalars, count)
        if colors is not None:
            looks['colors'] = self._as_colors(colors, count)
        if visible is not None:
            look.as_mask(visible, count)
            looks['visible'] = visible
        if moved:  # also by the same array: it may hold other numbers now
            self._owned = self._owned and poses is self._given
            self._replace(poses, index)
        return looks

    def _update_some(self, ids, poses, index):
        if index is not None:
            index = repeated('index', index, len(ids))
            checked_index(index, len(ids), max(len(self._meshes), 1))
        if poses is not None:
            poses = repeated('poses', self._posed(poses), len(ids))
            kept, poses = same_kind(self._given, poses)
            moved = index is None and self._may_move(kept, poses)
            if kept is not self._given or not self._owned or not moved:
                kept, self._owned = np.array(kept), True
            kept[ids] = poses
        else:
            kept = self._given
        if index is not None:
            index, new = self._index.copy(), index
            index[ids] = new
            self._replace(kept, index)
        elif poses is not None and moved:
            self._given = kept
            if self._world is None:
                self._poses = kept
            else:
                self._poses[ids] = placed_by(self._world, poses)
            self._move(ids)
        elif poses is not None:
            self._replace(kept, self._index)

    def _may_move(self, kept, poses) -> bool:
        """Return True if new poses among those kept are shown by the groups as they are."""
        return kept.ndim == self._given.ndim

    def _replace(self, poses, index):
        """Have other poses, any number of them, and meshes."""
        self._take_over(poses, index)
        if not self._fits():
            self._ready_models()
            self._rebuild()
            return
        if self._are_scattered():
            self._sort()
        else:
            self._put_groups()
        self._repaint()

    def _put(self):
        self._keeps_bounds = True
        try:
            self._replace(self._given, self._index)
        finally:
            self._keeps_bounds = False

    def _take_over(self, poses, index):
        count, before = len(poses), len(self._poses)
        self._given, self._index = poses, index
        self._poses = poses if self._world is None else placed_by(self._world, poses)
        if count != before:
            new = np.arange(before, count, dtype=np.int32)
            self._order = np.concatenate([self._order[self._order < count], new])
            self._scalars = self._colors = self._visible = None
            self.covered = self._applied = None

    def _move(self, ids):
        """Take over changed poses of some instances."""
        slots = self._slots
        if slots is None:
            slots = self._slots = np.empty(len(self), np.int32)
            for group in self.groups:
                slots[group.ids] = np.arange(len(group), dtype=np.int32)
        meshes = self._index[ids]
        for k, group in zip(self._models, self.groups, strict=True):
            if len(some := ids[meshes == k]):
                group.move(self._poses, slots[some])
        if self._are_scattered():
            self._sort()
            self._repaint()
        else:
            self._moved_groups()

    # -- groups of one mesh --------------------------------------------------------------------

    def _fits(self) -> bool:
        """Return True if the groups can show the instances as they are."""
        count = len(self._poses)
        same_unit = all(group.unit == unit_of(count) for group in self.groups)
        return same_unit and count <= self._capacity and not self._lacking()

    def _used(self) -> set:
        return {*self._wanted, *np.flatnonzero(np.bincount(self._index)).tolist()}

    def _lacking(self) -> set:
        """Return the meshes whose levels are to be made."""
        return self._used() - self._models.keys()

    def _rebuild(self):
        """Build the groups again."""
        pipeline = self.pipeline
        if pipeline is not None:
            pipeline.make_current()
        for group in self.groups:
            group.release()
        if pipeline is not None:
            self._take_out(pipeline.renderer)
        self._make_groups()
        self._repaint()
        if pipeline is not None:
            self._put_in(pipeline.renderer)

    def _ready_models(self):
        """Have the levels of each mesh that is used."""
        new = {k: self._model(k) for k in self._lacking()}
        self._models = dict(sorted({**self._models, **new}.items()))

    def _make_groups(self):
        count = len(self._poses)
        if count > self._capacity:
            self._capacity = max(count, 2 * self._capacity)
        turned = any(model.atlas.turntable is not None for model in self._models.values())
        draws = slab_counts(self._capacity, len(self._models), turned)
        how = self._binder, unit_of(count), self._capacity, draws
        self.groups = [self._group(model, *how) for model in self._models.values()]
        self._sort()

    def _model(self, k):
        return make_model(self._meshes[k], **self._baking)

    def _group(self, *args):
        return InstanceGroup(*args, translucent=self.is_translucent)

    def _sort(self):
        """Place the instances in an order that keeps neighbours together."""
        centers = self._centers(np.arange(len(self._poses)))
        self._order = morton_order(centers).astype(np.int32)
        self._spread = self._spread_now()
        self._put_groups()
        self._sorted = True

    def _centers(self, ids):
        """Return the centres of the spheres of some instances, shape (n, 3)."""
        if len(self._models) == 1:
            (model,) = self._models.values()
            return centers_of(self._poses, ids, model.atlas)
        centers, meshes = np.empty((len(ids), 3)), self._index[ids]
        for k, model in self._models.items():
            these = meshes == k
            centers[these] = centers_of(self._poses, ids[these], model.atlas)
        return centers

    def _are_scattered(self) -> bool:
        """Return True if instances have gone far from those that were their neighbours."""
        several = unit_of(len(self)) > 1  # else each one is culled and sorted by itself
        return several and self._spread_now() > _SPREAD * self._spread

    def _spread_now(self) -> float:
        """Return the length of most blocks of neighbours, by some of them."""
        count = len(self)
        some = np.linspace(0, -(-count // BLOCK) - 1, min(_SAMPLE, count)).astype(int)
        if not len(some):
            return 0.0
        centers = self._centers(self._order[members(some, BLOCK, count).ravel()])
        return float(np.quantile(np.ptp(centers.reshape(-1, BLOCK, 3), 1).sum(1), 0.9))

    def _put_groups(self):
        self._slots = None
        index = self._index[self._order] if len(self.groups) > 1 else None
        for k, group in zip(self._models, self.groups, strict=True):
            group.put(self._poses, self._order if index is None else self._order[index == k])
        self._moved_groups()

    def _moved_groups(self):
        self._sorted = self._uploaded = False
        self._touch()
        if not self._keeps_bounds:
            own = None if self._world is None else self._given
            self._set_bounds(joined_bounds([g.tight_bounds(own) for g in self.groups]))

    # -- looks of single instances -------------------------------------------------------------

    @property
    def multiplies(self) -> bool:
        """Whether colours of instances multiply those of the mesh."""
        return self._blend == 'multiply'

    def _with_looks(self, ids, scalars, colors, visible) -> dict:
        """Return all looks with those of some instances changed."""
        changed = {}
        if scalars is not None:
            changed['scalars'] = self._with_scalars(ids, as_array('scalars', scalars))
        if colors is not None:
            rows = np.atleast_2d(np.asarray(color_rows('colors', colors)))
            new = self._as_colors(rows, len(rows))
            kept: np.ndarray = self._base_colors(new.shape[1])
            kept[ids] = look.with_alpha(new, kept.shape[1])
            changed['colors'] = kept
        if visible is not None:
            mask = look.as_mask(visible, len(ids))
            changed['visible'] = self.visible.copy()
            changed['visible'][ids] = True if mask is None else mask
        return changed

    def _with_scalars(self, ids, new):
        """Return all scalars with those of some instances changed, to words if these are words."""
        words, before = new.dtype.kind in 'UO', self._scalars
        if before is None:
            before = np.full(len(self), '' if words else np.nan)
        elif words != (before.dtype.kind == 'U'):
            raise ValueError(
                f'scalars has dtype {new.dtype}; those of the others are of {before.dtype}'
            )
        changed = before.astype(np.result_type(before, new))
        changed[ids] = new
        return changed

    def _as_colors(self, colors, count=None) -> np.ndarray:
        return look.as_colors(colors, len(self) if count is None else count)

    @property
    def is_translucent(self) -> bool:
        """Whether colours of instances are translucent."""
        return self._colors is not None and self._colors.shape[1] == 4

    def _base_colors(self, width):
        """Return a copy of the colours, with alpha for a width of 4 or if they have it."""
        if self._colors is not None:
            return look.with_alpha(self._colors, max(width, self._colors.shape[1]))
        colors = np.full((len(self), 3), 255, np.uint8)
        for k, model in self._models.items() if not self.multiplies else ():
            prop = model.levels[0].parts[0].actor.GetProperty()
            colors[self._index == k] = np.rint(np.array(prop.GetColor()) * 255)
        return look.with_alpha(colors, width)

    def _repaint(self):
        if any(group.near.translucent != self.is_translucent for group in self.groups):
            self._rebuild()
            return
        self._apply_looks(self._applied)
        self._touch()

    def _apply_looks(self, covered):
        """Take over the looks, without what others draw."""
        self._applied = covered
        shown = self._visible
        if covered is not None:
            shown = self.visible.copy()
            shown[covered] = False
        merged = look.merge(len(self), self._colors, shown)
        for group in self.groups:
            group.set_looks(merged, self.multiplies)
        self._uploaded = False

    def _upload(self, window):
        """Upload what changed; the context is current."""
        if is_deterministic() and not self._sorted:
            self._sort()
            self._repaint()
        if not self._uploaded:
            for group in self.groups:
                group.upload(window)
            self._uploaded = True
