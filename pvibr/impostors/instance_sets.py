"""Instances that impostors stand for, in blocks."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.impostors.sources import copied, unlit
from pvibr.instances.mesh_pool import MeshPool, lendable
from pvibr.maths.impostors import box_corners, dop_corners
from pvibr.meshes.materials import copy_property
from pvibr.scene import looks as look
from pvibr.scene.actor_watch import ineligibility

#: Blocks of a set at most: what is asked of each in a frame takes its time.
MOST = 4096
#: Seconds that a card of an instance takes beside its pixels.
_CARD = 1e-6


class InstanceSet:
    """A set of instances, in blocks of neighbours that are the leaves of an impostor."""

    def __init__(self, thing, materials):
        self.thing, self.materials = thing, materials
        self.per = 1
        while len(thing) > MOST * self.per:
            self.per *= 2
        self.blocks = [
            Block(self, number, slice(first, first + self.per))
            for number, group in enumerate(thing.groups)
            for first in range(0, len(group), self.per)
        ]
        self._counts = [len(group) for group in thing.groups]
        self._content_key: tuple | None = None
        self._imaged = b''
        self._pools: dict = {}
        self.looks: np.ndarray | None = None

    def changed(self) -> bool:
        """Return True if anything changed since the last call."""
        content_key, self._content_key = self._content_key, self.thing.content_key()
        return content_key != self._content_key

    def outgrown(self) -> bool:
        """Return True if the set has other instances in its blocks."""
        return [len(group) for group in self.thing.groups] != self._counts

    def update(self):
        """Update positions and looks of the instances."""
        thing = self.thing
        self.looks = look.merge(len(thing), thing.colors, thing.visible)
        shown = thing.visibility
        visible = self.looks[:, 3] > 0
        for number, group in enumerate(thing.groups):
            blocks = [block for block in self.blocks if block.number == number]
            why = next(
                (w for p in group.levels[0].parts if (w := ineligibility(p.actor, relit=True))),
                'translucent' if thing.is_translucent else '',
            )
            fields = _placed(group, self.per)
            cells = sum(part.mesh.n_cells for part in group.levels[-1].parts)
            for k, block in enumerate(blocks):
                block.why = why
                block.center, block.half, block.corners, block.radius = (f[k] for f in fields)
                block.slots = np.flatnonzero(visible[group.ids[block.span]]) + block.span.start
                block.shown = shown and len(block.slots) > 0
                block.cells = cells * len(block.slots)

    def pool(self, number, texels) -> MeshPool:
        """Return the mesh pool of the level that is within the error at a size."""
        group = self.thing.groups[number]
        limits = self.thing.limits[number].mesh_to.min(1)
        level = max(k for k, limit in enumerate(limits) if k == 0 or texels <= limit)
        key = number, level
        if key not in self._pools:
            self._pools[key] = _Pool(group.levels[level], self.materials)
        pool = self._pools[key]
        pool.multiply = self.thing.multiplies
        return pool

    def plain(self, meshes, pixels, area, pixel) -> np.ndarray:
        """Return the seconds of blocks drawn by the set itself."""
        limits = [limit.mesh_from.min() for limit in self.thing.limits]
        limit = np.array([limits[block.number] for block in self.blocks])
        cards = self.per * _CARD + pixel * area
        # The larger a block is beside its instances, the smaller these are.
        return np.where(pixels < limit * self.per ** (1 / 3), np.minimum(cards, meshes), meshes)

    def hide(self, imaged) -> bool:
        """Hide the blocks that images show."""
        key = imaged.tobytes()
        if key == self._imaged:
            return False
        self._imaged = key
        chosen = [b for b, yes in zip(self.blocks, imaged.tolist(), strict=True) if yes]
        ids = [self.thing.groups[b.number].ids[b.span] for b in chosen]
        self.thing.covered = np.concatenate(ids) if ids else None
        return True

    def show(self):
        """Show all blocks."""
        self._imaged = b''
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
    """Some instances of one mesh, with the interface of :class:`Source`."""

    tries: int = 0
    seconds: float = np.inf

    def __init__(self, owner, number, span):
        self.owner, self.number, self.span = owner, number, span
        self.why, self.shown, self.cells = '', True, 0
        self.center, self.half, self.radius = np.zeros(3), np.zeros((3, 3)), 0.0
        self.corners = np.zeros((80, 3))
        self.slots = np.zeros(0, int)

    def draw(self, renderer, world_from_view, texel):
        """Draw its surface, see :meth:`Source.draw`."""
        owner = self.owner
        group = owner.thing.groups[self.number]
        for slot in self.slots.tolist():
            pool = owner.pool(self.number, 2 * float(group.radii[slot]) / texel)
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

    def _made(self):
        return [self._double(part) for part in self.level.parts]

    def _double(self, part):
        actor = lendable(part, copied(part.actor.GetMapper(), part.mesh))
        prop = _vtk.vtkProperty()
        copy_property(prop, part.actor.GetProperty())
        actor.SetProperty(prop)
        unlit(actor, self._materials.number(part.actor.GetProperty()))
        return actor


def _placed(group, per):
    """Return centres, half edges, corners and radii of blocks of a group."""
    parts = group.levels[0].parts
    points = np.concatenate([part.mesh.points for part in parts]).astype(float)
    low, high = points.min(0), points.max(0)
    middle = (low + high) / 2
    length = np.linalg.norm(points - middle, axis=1).max()
    corners = dop_corners(points - middle)
    poses = group.poses[group.ids]
    if poses.ndim == 2:
        poses = np.eye(4) + np.zeros((len(poses), 1, 1))
        poses[:, :3, 3] = group.poses[group.ids]
    axes = poses[:, :3, :3]
    center = axes @ middle + poses[:, :3, 3]
    half = np.diag((high - low) / 2) @ np.swapaxes(axes, 1, 2)
    corners = corners @ np.swapaxes(axes, 1, 2)
    radius = length * np.linalg.norm(axes, 2, axis=(1, 2))
    if per == 1:
        return center, half, corners, radius
    return _joined(center, np.abs(corners).max(1), per)


def _joined(center, reach, per):
    """Return the same for blocks of several instances, as axis-aligned boxes."""
    first = np.arange(0, len(center), per)
    low = np.minimum.reduceat(center - reach, first)
    high = np.maximum.reduceat(center + reach, first)
    half = ((high - low) / 2)[:, :, None] * np.eye(3)
    corners = np.tile(box_corners(half), (1, 10, 1))
    return (low + high) / 2, half, corners, np.linalg.norm(high - low, axis=1) / 2
