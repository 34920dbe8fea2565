"""Items at poses, each showing one of several meshes; updates need no bake."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array, naming
from pvibr.core.colors import color_rows
from pvibr.core.determinism import is_deterministic
from pvibr.gl.binder import Binder
from pvibr.instances.cards import slab_counts
from pvibr.instances.group import InstanceGroup, unit_of
from pvibr.instances.instance_arguments import (
    checked_ids,
    checked_index,
    index_for,
    index_of_phase,
    repeated,
    same_kind,
)
from pvibr.instances.levels import make_model
from pvibr.instances.placement import centers_of
from pvibr.maths.blocks import BLOCK, members, morton_order
from pvibr.meshes.posed import posed_source, source_of
from pvibr.meshes.poses import placed_by
from pvibr.things import appearance as look
from pvibr.things.item_set import ItemSet
from pvibr.things.scalar_bars import name_of
from pvibr.things.thing import joined_bounds

_SPREAD = 2.0  # growth of most blocks at which instances are sorted into new ones
# What an update replaces, restored if a check or a bake fails.
_REPLACED = (
    *('_poses', '_local_poses', '_owns_poses', '_index', '_order', '_required_meshes', '_models'),
    *('_scalars', '_colors', '_visible', 'covered', '_applied_cover'),
)
_SAMPLED_BLOCKS = 64


class PosedSet(ItemSet):
    """Items at poses, in groups of one mesh each.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('n_instances', 'poses', 'index', 'phase', 'update')
    #: Indices of instances that another thing draws for the scene's own camera.
    covered: np.ndarray | None = None
    #: What draws the instances of each mesh, as cards or meshes.
    groups: list
    #: Slot of each instance in its group, made on demand.
    _slots: np.ndarray | None = None
    _applied_cover: np.ndarray | None = None
    _blend = 'replace'
    #: Meshes that are baked even if no instance shows them.
    _required_meshes: frozenset = frozenset()
    _capacity = 0
    #: Poses in the space of the set, as users pass them; `_poses` are in world space.
    _local_poses: np.ndarray
    #: Whether bounds stay because only the set's transform changes.
    _keeps_bounds = False
    #: The arguments by which poses are turned and scaled.
    _placing: dict = {}

    def _begin(self, poses, index, models, pickable, meshes=(), baking=None):
        """Take checked arguments; bake the models that are missing."""
        self._models, self._meshes, self._baking = models, meshes, baking or {}
        self._binder = Binder()
        self._failure: str | None = None
        self.pickable = pickable
        self._scalars = self._colors = self._visible = self.table = None
        self._poses = self._local_poses = poses
        self._index, self._order = index, np.zeros(0, np.int32)
        self._owns_poses = False  # whether the array of poses is not the user's
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
        """Points (n, 3) or matrices (n, 4, 4) in set space, read-only; see :meth:`update`."""
        return look.read_only(self._local_poses)

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
        """Mesh of each instance as a fraction of all meshes, 0 to 1; set modulo 1."""
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
        """Change all instances, or the given ones; baked images are reused.

        Parameters
        ----------
        ids : array_like of int or bool, or slice, optional
            Instances to change; by default all are replaced, by any number of new ones.
        poses : array_like, shape (k, 3) or (k, 4, 4), optional
            New points or matrices, or one for all `ids`.
        index : array_like of int, shape (k,), or int, optional
            Meshes to show, each baked when first shown. Required with several meshes if the
            number of instances changes.
        phase : array_like of float, shape (k,), or float, optional
            Meshes to show as a fraction of all meshes, modulo 1.
        scalars, colors, visible : optional
            New values. If the number of instances changes, omitted ones are reset.

        Raises
        ------
        IndexError
            If an instance does not exist.
        ValueError
            If the number of values is wrong.
        """
        previous = {name: getattr(self, name) for name in _REPLACED}
        try:
            if phase is not None:
                index = index_of_phase(phase, max(len(self._meshes), 1))
                self._required_meshes = frozenset(range(len(self._meshes)))
            if ids is None:
                looks = self._update_all(poses, index, scalars, colors, visible)
            else:
                ids = checked_ids(ids, len(self))
                looks = self._with_looks(ids, scalars, colors, visible)
                self._update_some(ids, poses, index)
        except BaseException:  # a bake may be interrupted
            self._restore(previous)
            raise
        bar_title = name_of(scalars) if ids is None else self._scalar_name
        for name, values in looks.items():
            if name == 'scalars':
                self._set_scalars(values, bar_title)
            else:
                setattr(self, name, values)
        self._show_bar()  # also if a new number of instances has dropped the scalars

    def _checked_poses(self, poses):
        """Return checked poses; those of datasets and tables are turned and scaled as at first."""
        shared_placing = {k: v for k, v in self._placing.items() if np.ndim(v) == 0}
        source = source_of(poses, *(v for v in shared_placing.values() if isinstance(v, str)))
        return posed_source(source, **({} if source.arrays is None else shared_placing))

    def _restore(self, before):
        """Restore the state before an update that failed."""
        self.__dict__.update(before)

    def _update_all(self, poses, index, scalars, colors, visible) -> dict:
        """Replace poses and meshes; return the looks to set."""
        is_posed = poses is not None or index is not None
        poses = self._local_poses if poses is None else self._checked_poses(poses)
        n_instances, n_meshes = len(poses), max(len(self._meshes), 1)
        if index is not None:
            index = checked_index(repeated('index', index, n_instances), n_instances, n_meshes)
        else:
            index = index_for(n_instances, self._index, n_meshes)
        looks: dict = {}
        if scalars is not None:
            looks['scalars'] = look.as_scalars(scalars, n_instances)
        if colors is not None:
            looks['colors'] = self._as_colors(colors, n_instances)
        if visible is not None:
            look.as_mask(visible, n_instances)
            looks['visible'] = visible
        if is_posed:  # even if it is the same array: its values may have changed
            self._owns_poses = self._owns_poses and poses is self._local_poses
            self._replace(poses, index)
        return looks

    def _update_some(self, ids, poses, index):
        if index is not None:
            index = repeated('index', index, len(ids))
            checked_index(index, len(ids), max(len(self._meshes), 1))
        if poses is not None:
            poses = repeated('poses', self._checked_poses(poses), len(ids))
            all_poses, poses = same_kind(self._local_poses, poses)
            in_place = index is None and self._can_move(all_poses, poses)
            if all_poses is not self._local_poses or not self._owns_poses or not in_place:
                all_poses, self._owns_poses = np.array(all_poses), True
            all_poses[ids] = poses
        else:
            all_poses = self._local_poses
        if index is not None:
            index, new_index = self._index.copy(), index
            index[ids] = new_index
            self._replace(all_poses, index)
        elif poses is not None and in_place:
            self._local_poses = all_poses
            if self._world is None:
                self._poses = all_poses
            else:
                self._poses[ids] = placed_by(self._world, poses)
            self._move(ids)
        elif poses is not None:
            self._replace(all_poses, self._index)

    def _can_move(self, all_poses, poses) -> bool:
        """Return True if the groups can take new poses in place."""
        return all_poses.ndim == self._local_poses.ndim

    def _replace(self, poses, index):
        """Replace poses, any number of them, and meshes."""
        self._set_poses(poses, index)
        if not self._fits():
            self._ready_models()
            self._rebuild()
            return
        if self._are_scattered():
            self._sort()
        else:
            self._fill_groups()
        self._repaint()

    def _put(self):
        self._keeps_bounds = True
        try:
            self._replace(self._local_poses, self._index)
        finally:
            self._keeps_bounds = False

    def _set_poses(self, poses, index):
        n_instances, previous_count = len(poses), len(self._poses)
        self._local_poses, self._index = poses, index
        self._poses = poses if self._world is None else placed_by(self._world, poses)
        if n_instances != previous_count:
            new_ids = np.arange(previous_count, n_instances, dtype=np.int32)
            self._order = np.concatenate([self._order[self._order < n_instances], new_ids])
            self._scalars = self._colors = self._visible = None
            self.covered = self._applied_cover = None

    def _move(self, ids):
        """Update the groups after a change of the poses of `ids`."""
        slots = self._slots
        if slots is None:
            slots = self._slots = np.empty(len(self), np.int32)
            for group in self.groups:
                slots[group.ids] = np.arange(len(group), dtype=np.int32)
        meshes = self._index[ids]
        for k, group in zip(self._models, self.groups, strict=True):
            if len(mesh_ids := ids[meshes == k]):
                group.move(self._poses, slots[mesh_ids])
        if self._are_scattered():
            self._sort()
            self._repaint()
        else:
            self._groups_changed()

    # -- groups of one mesh --------------------------------------------------------------------

    def _fits(self) -> bool:
        """Return True if the existing groups can show the instances."""
        count = len(self._poses)
        same_unit = all(group.unit == unit_of(count) for group in self.groups)
        return same_unit and count <= self._capacity and not self._missing_models()

    def _used_meshes(self) -> set:
        return {*self._required_meshes, *np.flatnonzero(np.bincount(self._index)).tolist()}

    def _missing_models(self) -> set:
        """Return the indices of meshes whose levels are missing."""
        return self._used_meshes() - self._models.keys()

    def _rebuild(self):
        """Rebuild the groups."""
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
        """Make the missing levels of meshes in use."""
        new_models = {k: self._model(k) for k in self._missing_models()}
        self._models = dict(sorted({**self._models, **new_models}.items()))

    def _make_groups(self):
        n_instances = len(self._poses)
        if n_instances > self._capacity:
            self._capacity = max(n_instances, 2 * self._capacity)
        has_turntable = any(model.atlas.turntable is not None for model in self._models.values())
        draw_counts = slab_counts(self._capacity, len(self._models), has_turntable)
        arguments = self._binder, unit_of(n_instances), self._capacity, draw_counts
        self.groups = [self._group(model, *arguments) for model in self._models.values()]
        self._sort()

    def _model(self, k):
        return make_model(self._meshes[k], **self._baking)

    def _group(self, *args):
        return InstanceGroup(*args, translucent=self.is_translucent)

    def _sort(self):
        """Sort the instances so that neighbours are together."""
        centers = self._centers(np.arange(len(self._poses)))
        self._order = morton_order(centers).astype(np.int32)
        self._spread = self._block_spread()
        self._fill_groups()
        self._sorted = True

    def _centers(self, ids):
        """Return the centres of the bounding spheres of instances, shape (n, 3)."""
        if len(self._models) == 1:
            (model,) = self._models.values()
            return centers_of(self._poses, ids, model.atlas)
        centers, meshes = np.empty((len(ids), 3)), self._index[ids]
        for k, model in self._models.items():
            of_mesh = meshes == k
            centers[of_mesh] = centers_of(self._poses, ids[of_mesh], model.atlas)
        return centers

    def _are_scattered(self) -> bool:
        """Return True if instances have moved far from their former neighbours."""
        are_blocks = unit_of(len(self)) > 1  # else each is culled and sorted on its own
        return are_blocks and self._block_spread() > _SPREAD * self._spread

    def _block_spread(self) -> float:
        """Return the 90th percentile of the extent of blocks, from a sample."""
        count = len(self)
        last_block, samples = -(-count // BLOCK) - 1, min(_SAMPLED_BLOCKS, count)
        sampled_blocks = np.linspace(0, last_block, samples).astype(int)
        if not len(sampled_blocks):
            return 0.0
        centers = self._centers(self._order[members(sampled_blocks, BLOCK, count).ravel()])
        return float(np.quantile(np.ptp(centers.reshape(-1, BLOCK, 3), 1).sum(1), 0.9))

    def _fill_groups(self):
        self._slots = None
        index = self._index[self._order] if len(self.groups) > 1 else None
        for k, group in zip(self._models, self.groups, strict=True):
            group.put(self._poses, self._order if index is None else self._order[index == k])
        self._groups_changed()

    def _groups_changed(self):
        self._sorted = self._uploaded = False
        self._touch()
        if not self._keeps_bounds:
            local_poses = None if self._world is None else self._local_poses
            self._set_bounds(joined_bounds([g.tight_bounds(local_poses) for g in self.groups]))

    # -- looks of single instances -------------------------------------------------------------

    @property
    def multiplies(self) -> bool:
        """Whether instance colours multiply those of the mesh."""
        return self._blend == 'multiply'

    def _with_looks(self, ids, scalars, colors, visible) -> dict:
        """Return all looks with those of `ids` changed."""
        changed = {}
        if scalars is not None:
            changed['scalars'] = self._with_scalars(ids, as_array('scalars', scalars))
        if colors is not None:
            color_values = np.atleast_2d(np.asarray(color_rows('colors', colors)))
            new_colors = self._as_colors(color_values, len(color_values))
            all_colors: np.ndarray = self._base_colors(new_colors.shape[1])
            all_colors[ids] = look.with_alpha(new_colors, all_colors.shape[1])
            changed['colors'] = all_colors
        if visible is not None:
            mask = look.as_mask(visible, len(ids))
            changed['visible'] = self.visible.copy()
            changed['visible'][ids] = True if mask is None else mask
        return changed

    def _with_scalars(self, ids, new_scalars):
        """Return all scalars with those of `ids` changed, numbers or words."""
        are_words, previous = new_scalars.dtype.kind in 'UO', self._scalars
        if previous is None:
            previous = np.full(len(self), '' if are_words else np.nan)
        elif are_words != (previous.dtype.kind == 'U'):
            raise ValueError(
                f'scalars must be of dtype {previous.dtype} as the others, got {new_scalars.dtype}'
            )
        changed = previous.astype(np.result_type(previous, new_scalars))
        changed[ids] = new_scalars
        return changed

    def _as_colors(self, colors, count=None) -> np.ndarray:
        return look.as_colors(colors, len(self) if count is None else count)

    @property
    def is_translucent(self) -> bool:
        """Whether instance colours have alpha."""
        return self._colors is not None and self._colors.shape[1] == 4

    def _base_colors(self, width):
        """Return a copy of the colours, with alpha if they have it or `width` is 4."""
        if self._colors is not None:
            return look.with_alpha(self._colors, max(width, self._colors.shape[1]))
        base_colors = np.full((len(self), 3), 255, np.uint8)
        for k, model in self._models.items() if not self.multiplies else ():
            prop = model.levels[0].parts[0].actor.GetProperty()
            base_colors[self._index == k] = np.rint(np.array(prop.GetColor()) * 255)
        return look.with_alpha(base_colors, width)

    def _repaint(self):
        if any(group.near.translucent != self.is_translucent for group in self.groups):
            self._rebuild()
            return
        self._apply_looks(self._applied_cover)
        self._touch()

    def _apply_looks(self, covered):
        """Apply the looks, hiding instances that another thing draws."""
        self._applied_cover = covered
        visible = self._visible
        if covered is not None:
            visible = self.visible.copy()
            visible[covered] = False
        looks = look.merge(len(self), self._colors, visible)
        for group in self.groups:
            group.set_looks(looks, self.multiplies)
        self._uploaded = False

    def _upload(self, window):
        """Upload what has changed; the context is current."""
        if is_deterministic() and not self._sorted:
            self._sort()
            self._repaint()
        if not self._uploaded:
            for group in self.groups:
                group.upload(window)
            self._uploaded = True
