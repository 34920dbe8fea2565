"""Instances that impostors replace, in blocks."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.instances.mesh_pool import MeshPool, lendable
from pvibr.substitutes.impostor_maths import box_corners, dop_corners
from pvibr.substitutes.impostor_sources import copied, unlit
from pvibr.textures.material_textures import copy_property
from pvibr.things import appearance as look
from pvibr.things.actor_watch import ineligibility, stroke_width

#: Most blocks of a set: each costs time in every frame.
MOST = 4096
# Overhead in seconds of an instance's card beyond its pixels.
_CARD = 1e-6


class InstanceSet:
    """A set of instances in blocks of neighbours, which are leaves of an impostor."""

    def __init__(self, thing, materials):
        self.thing, self.materials = thing, materials
        self.items_per_block = 1
        while len(thing) > MOST * self.items_per_block:
            self.items_per_block *= 2
        self.blocks = [
            Block(self, number, slice(start, start + self.items_per_block))
            for number, group in enumerate(thing.groups)
            for start in range(0, len(group), self.items_per_block)
        ]
        self._counts = [len(group) for group in thing.groups]
        self._content_key: tuple | None = None
        self._image_key = b''
        self._pools: dict = {}
        self.looks: np.ndarray | None = None

    def changed(self) -> bool:
        """Return True if anything changed since the last call."""
        content_key, self._content_key = self._content_key, self.thing.content_key()
        return content_key != self._content_key

    def outgrown(self) -> bool:
        """Return True if the number of instances changed."""
        return [len(group) for group in self.thing.groups] != self._counts

    def update(self):
        """Update positions and looks of the instances."""
        thing = self.thing
        self.looks = look.merge(len(thing), thing.colors, thing.drawn_items())
        set_visible = thing.visibility
        is_visible = self.looks[:, 3] > 0
        for number, group in enumerate(thing.groups):
            blocks = [block for block in self.blocks if block.number == number]
            mesh_reason = next(
                filter(None, map(_ineligibility, group.levels[0].parts)),
                'translucent' if thing.is_translucent else '',
            )
            bounds = _block_bounds(group, self.items_per_block)
            cells_per_item = sum(part.mesh.n_cells for part in group.levels[-1].parts)
            for k, block in enumerate(blocks):
                block.why = mesh_reason
                block.center, block.half, block.corners, block.radius = (b[k] for b in bounds)
                block.slots = np.flatnonzero(is_visible[group.ids[block.span]]) + block.span.start
                block.shown = set_visible and len(block.slots) > 0
                block.cells = cells_per_item * len(block.slots)

    def pool(self, number, texels) -> MeshPool:
        """Return the mesh pool of the level for a size in texels."""
        group = self.thing.groups[number]
        level_limits = self.thing.limits[number].mesh_to.min(1)
        level = max(k for k, limit in enumerate(level_limits) if k == 0 or texels <= limit)
        pool_key = number, level
        if pool_key not in self._pools:
            self._pools[pool_key] = _Pool(group.levels[level], self.materials)
        pool = self._pools[pool_key]
        pool.multiply = self.thing.multiplies
        return pool

    def plain(self, mesh_cost, size_px, card_area, pixel_cost) -> np.ndarray:
        """Return the seconds of blocks drawn by the set itself."""
        group_limits = [limits.mesh_from.min() for limits in self.thing.limits]
        card_limits = np.array([group_limits[block.number] for block in self.blocks])
        card_cost = self.items_per_block * _CARD + pixel_cost * card_area
        # A block of n instances is about n^(1/3) times as large as each.
        has_cards = size_px < card_limits * self.items_per_block ** (1 / 3)
        return np.where(has_cards, np.minimum(card_cost, mesh_cost), mesh_cost)

    def hide(self, as_image) -> bool:
        """Hide the blocks that images show; return True if they changed."""
        image_key = as_image.tobytes()
        if image_key == self._image_key:
            return False
        self._image_key = image_key
        hidden_blocks = [self.blocks[k] for k in np.flatnonzero(as_image)]
        ids = [self.thing.groups[b.number].ids[b.span] for b in hidden_blocks]
        self.thing.covered = np.concatenate(ids) if ids else None
        return True

    def show(self):
        """Show all blocks."""
        self._image_key = b''
        self.thing.covered = None

    def release(self, window):
        """Free GPU memory; the context is current."""
        for pool in self._pools.values():
            for actor in pool.actors():
                actor.SetTexture(None)  # the set's own
                if window is not None:
                    actor.ReleaseGraphicsResources(window)
        self._pools, self._content_key = {}, None


class Block:
    """Neighbouring instances of one mesh, with the interface of :class:`Source`."""

    tries: int = 0
    seconds: float = np.inf
    stroke_px, has_tint, opacity = 0.0, False, 1.0
    planes = ()  # clip all blocks of a set alike

    def __init__(self, owner, number, span):
        self.owner, self.number, self.span = owner, number, span
        self.why, self.shown, self.cells = '', True, 0
        self.center, self.half, self.radius = np.zeros(3), np.zeros((3, 3)), 0.0
        self.corners = np.zeros((80, 3))
        self.slots = np.zeros(0, int)

    def clip(self, planes):
        """Leave the set's own planes."""

    def draw(self, renderer, world_from_view, texel_size, texels_per_pixel, faces=None):
        """Draw the unlit surfaces, see :meth:`Source.draw`."""
        owner = self.owner
        group = owner.thing.groups[self.number]
        for slot in self.slots.tolist():
            pool = owner.pool(self.number, 2 * float(group.radii[slot]) / texel_size)
            shade = tuple(float(v) for v in owner.looks[group.ids[slot]] / 255.0)
            pool.show([slot], group.matrix, lambda _, shade=shade: shade)
            for actor in pool.lent[slot]:
                uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
                uniforms.SetUniformMatrix3x3('ibr_world_from_view', world_from_view)
                actor.RenderOpaqueGeometry(renderer)
            pool.show([], group.matrix, None)


class _Pool(MeshPool):
    """Actors that draw unlit surfaces."""

    def __init__(self, level, materials):
        super().__init__(level)
        self._materials = materials

    def _new_actors(self):
        return [self._double(part) for part in self.level.parts]

    def _double(self, part):
        actor = lendable(part, copied(part.actor.GetMapper(), part.mesh))
        prop = _vtk.vtkProperty()
        copy_property(prop, part.actor.GetProperty())
        actor.SetProperty(prop)
        unlit(actor, self._materials.number(part.actor.GetProperty()))
        return actor


def _ineligibility(part) -> str:
    actor = part.actor
    reason = ineligibility(actor, relit=True)
    has_strokes = not reason and stroke_width(actor, actor.GetMapper().GetInput()) > 0
    return 'edges, lines or points of instances' if has_strokes else reason


def _block_bounds(group, items_per_block):
    """Return centres, half edges, corners and radii of the blocks of a group."""
    points = np.concatenate([part.mesh.points for part in group.levels[0].parts]).astype(float)
    low, high = points.min(0), points.max(0)
    mesh_center = (low + high) / 2
    mesh_radius = np.linalg.norm(points - mesh_center, axis=1).max()
    item_corners = dop_corners(points - mesh_center)
    poses = group.poses[group.ids]
    if poses.ndim == 2:
        poses = np.eye(4) + np.zeros((len(poses), 1, 1))
        poses[:, :3, 3] = group.poses[group.ids]
    item_axes = poses[:, :3, :3]
    item_center = item_axes @ mesh_center + poses[:, :3, 3]
    half_edges = np.diag((high - low) / 2) @ np.swapaxes(item_axes, 1, 2)
    item_corners = item_corners @ np.swapaxes(item_axes, 1, 2)
    item_radius = mesh_radius * np.linalg.norm(item_axes, 2, axis=(1, 2))
    if items_per_block == 1:
        return item_center, half_edges, item_corners, item_radius
    return _joined(item_center, np.abs(item_corners).max(1), items_per_block)


def _joined(center, reach, items_per_block):
    """Return the same for blocks of several instances, as axis-aligned boxes."""
    block_starts = np.arange(0, len(center), items_per_block)
    low = np.minimum.reduceat(center - reach, block_starts)
    high = np.maximum.reduceat(center + reach, block_starts)
    half = ((high - low) / 2)[:, :, None] * np.eye(3)
    corners = np.tile(box_corners(half), (1, 10, 1))
    return (low + high) / 2, half, corners, np.linalg.norm(high - low, axis=1) / 2
