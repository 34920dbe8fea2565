"""Instances in groups of one mesh each, sorted into blocks of neighbours."""

from __future__ import annotations

import numpy as np

from pvibr.core.plotters import put_inner
from pvibr.gl.binder import Binder
from pvibr.instances.cards import slab_counts, slabs
from pvibr.instances.choices import Choice, GroupBlocks
from pvibr.instances.group import SORTED_SEEN, InstanceGroup, unit_of
from pvibr.instances.hidden_blocks import HiddenBlocks
from pvibr.instances.placement import centers_of
from pvibr.maths.blocks import BLOCK, members, morton_order
from pvibr.things.draw_order import Stage
from pvibr.things.shader_draws import ShaderDraws
from pvibr.things.thing import joined_bounds

_SPREAD = 2.0  # growth of most blocks at which instances are sorted into new ones
_SAMPLED_BLOCKS = 64


class MeshGroups:
    """A sequence of groups, each of which draws the instances of one mesh."""

    def __init__(self, make_group=InstanceGroup):
        self._make_group, self._binder = make_group, Binder()
        self._hidden_blocks = HiddenBlocks(self._binder)
        #: Index of each group's mesh.
        self.meshes: list[int] = []
        self._groups: list[InstanceGroup] = []
        self._blocks = GroupBlocks()
        self._capacity = 0
        self._poses, self._index = np.zeros((0, 3)), np.zeros(0, int)
        #: All instances, neighbours together.
        self._order = np.zeros(0, np.int32)
        self._spread = 0.0
        #: Slot of each instance in its group, made on demand.
        self._slots: np.ndarray | None = None
        #: Whether no instance has moved since the last sort.
        self.is_sorted = False
        self._is_uploaded = False
        #: Whether each near mesh has an actor, because the shaders of batches failed.
        self._draws_singly = False
        #: Error of a card shader, or None.
        self.card_failure: str | None = None
        self._mesh_failure: str | None = None
        self._checked_draws = 0

    def __len__(self):
        return len(self._groups)

    def __getitem__(self, number):
        return self._groups[number]

    def __iter__(self):
        return iter(self._groups)

    # -- groups and slots --------------------------------------------------------------------

    def have_room(self, count) -> bool:
        """Return True if so many instances fit the groups."""
        unit = unit_of(count)
        return count <= self._capacity and all(group.unit == unit for group in self)

    def build(self, models, poses, index, *, translucent=False, planes=None):
        """Replace the groups by new ones of the models, {mesh: model}, and sort into them."""
        count = len(poses)
        if count > self._capacity:
            self._capacity = max(count, 2 * self._capacity)
        has_turntable = any(model.atlas.turntable is not None for model in models.values())
        draw_counts = slab_counts(self._capacity, len(models), has_turntable)
        arguments = self._binder, unit_of(count), self._capacity, draw_counts
        self._groups = [
            self._make_group(model, *arguments, translucent=translucent)
            for model in models.values()
        ]
        self.meshes = list(models)
        for group in self:
            if self._draws_singly or planes is not None:
                group.near.draw_singly()
            group.near.clip(planes)
        self._adopt(poses, index)
        self.sort()

    def put(self, poses, index):
        """Show any number of instances for which there is room, at new poses and of new meshes."""
        self._adopt(poses, index)
        if self._are_scattered():
            self.sort()
        else:
            self._fill()

    def move(self, poses, ids) -> bool:
        """Move some instances; return True if that has sorted all into new slots."""
        slots = self._slots
        if slots is None:
            slots = self._slots = np.empty(len(poses), np.int32)
            for group in self:
                slots[group.ids] = np.arange(len(group), dtype=np.int32)
        self._poses, meshes = poses, self._index[ids]
        for k, group in zip(self.meshes, self, strict=True):
            if len(mesh_ids := ids[meshes == k]):
                group.move(poses, slots[mesh_ids])
        self.is_sorted = self._is_uploaded = False
        are_scattered = self._are_scattered()
        if are_scattered:
            self.sort()
        return are_scattered

    def sort(self):
        """Sort the instances so that neighbours are together."""
        self._order = morton_order(self._centers(np.arange(len(self._poses)))).astype(np.int32)
        self._spread = self._block_spread()
        self._fill()
        self.is_sorted = True

    def _adopt(self, poses, index):
        count = len(poses)
        self._poses, self._index = poses, index
        if count != len(self._order):
            new_ids = np.arange(len(self._order), count, dtype=np.int32)
            self._order = np.concatenate([self._order[self._order < count], new_ids])

    def _fill(self):
        self._slots = None
        index = self._index[self._order] if len(self) > 1 else None
        for k, group in zip(self.meshes, self, strict=True):
            group.put(self._poses, self._order if index is None else self._order[index == k])
        self.is_sorted = self._is_uploaded = False

    def _centers(self, ids):
        """Return the centres of the bounding spheres of instances, shape (n, 3)."""
        if len(self) == 1:
            return centers_of(self._poses, ids, self[0].atlas)
        centers, meshes = np.empty((len(ids), 3)), self._index[ids]
        for k, group in zip(self.meshes, self, strict=True):
            of_mesh = meshes == k
            centers[of_mesh] = centers_of(self._poses, ids[of_mesh], group.atlas)
        return centers

    def _are_scattered(self) -> bool:
        """Return True if instances have moved far from their former neighbours."""
        are_blocks = unit_of(len(self._poses)) > 1  # else each is culled and sorted on its own
        return are_blocks and self._block_spread() > _SPREAD * self._spread

    def _block_spread(self) -> float:
        """Return the 90th percentile of the extent of blocks, from a sample."""
        count = len(self._poses)
        last_block, samples = -(-count // BLOCK) - 1, min(_SAMPLED_BLOCKS, count)
        sampled_blocks = np.linspace(0, last_block, samples).astype(int)
        if not len(sampled_blocks):
            return 0.0
        centers = self._centers(self._order[members(sampled_blocks, BLOCK, count).ravel()])
        return float(np.quantile(np.ptp(centers.reshape(-1, BLOCK, 3), 1).sum(1), 0.9))

    def slot_of(self, index) -> tuple[InstanceGroup, int]:
        """Return the group that draws an instance, and its slot there."""
        group = next(group for group in self if index in group.ids)
        return group, int(np.flatnonzero(group.ids == index)[0])

    def spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return world-space centres, shape (n, 3), and radii of the bounding spheres."""
        centers, radii = np.zeros((len(self._poses), 3)), np.zeros(len(self._poses))
        for group in self:
            centers[group.ids], radii[group.ids] = group.centers(slice(None)), group.radii
        return centers, radii

    def bounds(self, poses=None) -> tuple[float, ...]:
        """Return the bounds of all instances, optionally at other poses."""
        return joined_bounds([group.tight_bounds(poses) for group in self])

    # -- drawing -----------------------------------------------------------------------------

    def set_looks(self, looks, multiply):
        """Set colours and alphas of all instances, (n, 4) uint8, or None."""
        for group in self:
            group.set_looks(looks, multiply)
        self._is_uploaded = False

    def follow_materials(self, meshes):
        """Apply the current materials of meshes to their images."""
        for k, group in zip(self.meshes, self, strict=True):
            if k in meshes:
                group.follow_material()

    def upload(self, window):
        """Upload what has changed; the context is current."""
        if not self._is_uploaded:
            for group in self:
                group.upload(window)
            self._is_uploaded = True

    def versions(self) -> list[tuple]:
        """Return what changes with the poses of instances."""
        return [(group.placement, group.placement.version) for group in self._groups]

    def choose(self, frame, limits) -> list[Choice]:
        """Return what draws each group in a frame, by their limits."""
        self._blocks = self._blocks.of(self._groups)
        return self._blocks.choose(frame, limits)

    def draw(self, frame, limits, choices, *, depth) -> bool:
        """Draw what was chosen for each group in a frame; return True if actors may be new."""
        for group, choice in zip(self._groups, choices, strict=True):
            group.visible_blocks, group.mesh_blocks = choice.visible, choice.meshes
            group.hidden_count = 0
            group.cards.view(frame, depth=depth)
        cards = [choice.cards for choice in choices]
        if self._groups[0].unit > 1:
            cards = self._refined(frame, cards)
        self._show_cards(self._hidden_blocks.cull(frame, self._groups, cards))
        has_new_actors = False
        for group, group_limits in zip(self._groups, limits, strict=True):
            for actor in group.near.select(group, frame, group_limits):
                put_inner(frame.renderer, actor)
                has_new_actors = True
            has_new_actors |= True in group.near.has_own_actors
        return has_new_actors

    def _refined(self, frame, choices) -> list[dict]:
        """Return choices with single instances in place of the blocks of shaders that draw few."""
        counts: dict[str, int] = {}
        for choice in choices:
            for name, blocks in choice.items():
                counts[name] = counts.get(name, 0) + len(blocks) * blocks.unit
        return [
            {
                name: group.refine(frame, blocks)
                if blocks.unit > 1 and counts[name] <= SORTED_SEEN
                else blocks
                for name, blocks in choice.items()
            }
            for group, choice in zip(self._groups, choices, strict=True)
        ]

    def _show_cards(self, choices):
        """Draw the chosen blocks of each group by the shaders that they are chosen for."""
        drawn: dict[str, list] = {}
        for group, choice in zip(self._groups, choices, strict=True):
            group.shown_cards = choice
            group.cards.show_only(choice)
            for name, blocks in choice.items():
                drawn.setdefault(name, []).append((group.cards, blocks))
        for name, pairs in drawn.items():
            cards, blocks = pairs[0]
            turns, capacity = cards.layers[name].shader.turns, cards.chunk // blocks.unit
            cuts = slabs([blocks for _, blocks in pairs], turns, capacity)
            for (cards, blocks), blocks_cuts in zip(pairs, cuts, strict=True):
                layer = cards.layers[name]
                cored = 0 if layer.core is None else blocks.cored
                options = {'ranges': blocks.ranges, 'unit': blocks.unit, 'cored': cored}
                layer.show(blocks.table, blocks_cuts, **options)

    def draw_order(self) -> tuple:
        """Return pairs of sort key and actor, meshes first, whichever was needed first."""
        mesh_actors = (actor for group in self for actor in group.mesh_actors())
        cards = sorted((p for group in self for p in group.cards.order()), key=lambda p: p[0])
        return (*(((Stage.OPAQUE,), actor) for actor in mesh_actors), *cards)

    def depths(self) -> list:
        """Return the actors that draw the depth of visible instances."""
        cards = [a for group in self for a in group.cards.actors() if a.GetVisibility()]
        return cards + [a for group in self for a in group.near.depths()]

    def hide(self):
        """Hide all instances."""
        for group in self:
            group.hide()

    def finish(self, *, check):
        """Release the texture units, and optionally check that the shaders were drawn."""
        self._binder.unbind()
        if check and self._checked_draws != ShaderDraws.first_draws:
            self._checked_draws = ShaderDraws.first_draws
            for group in self:
                group.near.check()
                group.cards.check()
            self.card_failure = next((g.cards.failure for g in self if g.cards.failure), None)
            self._mesh_failure = next((g.near.failure for g in self if g.near.failure), None)

    @property
    def has_failed(self) -> bool:
        """Whether a shader of cards or of meshes has an error."""
        return self.card_failure is not None or self._mesh_failure is not None

    def mesh_failure(self) -> str | None:
        """Return a new error of a mesh shader, or None; groups built from then on use none."""
        failure, self._mesh_failure = self._mesh_failure, None
        self._draws_singly |= failure is not None
        return failure

    def release(self):
        """Free GPU memory; the context is current."""
        if len(self):
            self._hidden_blocks.release(self[0].cards.window)
        for group in self:
            group.release()
        self._is_uploaded = False

    # -- statistics --------------------------------------------------------------------------

    def counts(self) -> dict[str, int]:
        """Return the number of blocks and instances that each level drew in the last frame."""
        total_counts: dict = {}
        for group in self:
            for key, value in group.counts.items():
                total_counts[key] = total_counts.get(key, 0) + value
        return total_counts

    def triangles_drawn(self) -> int:
        """Return the triangles drawn as meshes in the last frame."""
        level_counts = ((k.levels, np.bincount(k.near.level_of + 1)[1:]) for k in self)
        return sum(
            level.triangles * int(instance_count)
            for levels, counts in level_counts
            for level, instance_count in zip(levels, counts, strict=False)
        )

    def memory_per_item(self) -> str:
        """Return the memory of an instance in words."""
        count = max(len(self._poses), 1)
        gpu = sum(group.cards.item_nbytes for group in self) / count
        main_memory = sum(group.placement.nbytes for group in self) / count
        return f'{gpu:.0f} B of GPU memory, {main_memory:.0f} B of main memory beside its pose'
