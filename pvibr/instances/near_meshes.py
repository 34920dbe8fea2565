"""Instances near enough to be drawn as meshes, in batches or an actor each."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import Texture, release
from pvibr.instances.cards import FADE
from pvibr.instances.mesh_draws import MeshDraws, can_batch
from pvibr.instances.mesh_pool import MeshPool
from pvibr.maths.blocks import ascending
from pvibr.things.appearance import is_clear
from pvibr.things.shader_draws import ROW

_SHARE_BITS = 6  # of the dithered share of an instance's pixels
#: Those of the cards that meshes need, too.
_TEXTURES = 'ibr_poses', 'ibr_looks'
_UNIFORMS = 'ibr_texels', 'ibr_has_looks', 'ibr_multiply', 'ibr_radius'
NO_TINT = {'ibr_tint': (0.0, 0.0, 0.0, 0.0)}


class NearMeshes:
    """Meshes by level: light ones in batches, heavy ones and those with edges an actor each."""

    def __init__(self, levels, translucent=False):
        #: Whether instances have an alpha: then all levels occur twice, last the translucent ones.
        self.translucent = translucent
        self.levels = levels * (1 + translucent)
        self._n_opaque = len(levels)
        self.pools = self._pools()
        for pool in self.pools[self._n_opaque :]:
            pool.translucent = True
        self.draws: list[MeshDraws] = []
        #: By level, whether each instance has an actor.
        self.has_own_actors = (True,) * len(self.levels)
        self._may_need_own_actors = True
        self._matrix = _vtk.vtkMatrix4x4()
        self._entries: Texture | None = None
        #: Mesh level of each slot in the last frame, -1 if it was no mesh.
        self.level_of = np.zeros(0, np.int8)
        self._slots = np.zeros(0, int)
        self._level_names = [f'mesh {level.triangles}' for level in self.levels]
        self._no_counts = dict.fromkeys(self._level_names, 0)
        #: Instances in the last frame, by the name of each level.
        self.counts = self._no_counts

    def _pools(self) -> list:
        return [MeshPool(level) for level in self.levels]

    def draw_many(self, capacity, center, binder):
        """Prepare batches for the levels that allow it."""
        shared = center, self._matrix, binder
        is_translucent = [k >= self._n_opaque for k in range(len(self.levels))]
        pairs = zip(self.levels, is_translucent, strict=True)
        self.draws = [
            MeshDraws(level, capacity, *shared, translucent) for level, translucent in pairs
        ]
        self.follow_material()

    def bound(self, bounds):
        """Set the bounds by which VTK culls batches."""
        for axis, center in enumerate(bounds.mean(0).tolist()):
            self._matrix.SetElement(axis, 3, center)
        for draws in self.draws:
            draws.bound(np.ptp(bounds, axis=0) / 2)

    @property
    def nbytes(self) -> int:
        """Bytes of the entries on the GPU."""
        return 0 if self._entries is None else self._entries.nbytes

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self.draws if draws.failure), None)

    def check(self):
        """Note shaders that the frame was not drawn with."""
        for draws in self.draws:
            draws.check()

    def follow_material(self):
        """Use an actor per instance where a material needs more than surfaces."""
        self._set_own_actors([not (self.draws and can_batch(level)) for level in self.levels])

    def _set_own_actors(self, by_level, *, elsewhere=False):
        """Set in which levels each instance has an actor, and whether some elsewhere have."""
        self.has_own_actors = tuple(by_level)
        self._may_need_own_actors = elsewhere or True in by_level
        for pool in () if self._may_need_own_actors else self.pools:
            pool.lend((), None)

    def clip(self, planes):
        """Clip the actors of instances by a vtkPlaneCollection, or None."""
        for pool in self.pools:
            pool.planes = planes

    def draw_singly(self):
        """Use an actor per instance at every level."""
        self.draws = []
        self.follow_material()

    # -- what is shown ------------------------------------------------------------------------

    def select(self, group, frame, limits) -> list:
        """Draw the instances too large for cards; return new actors."""
        if not (group.mesh_blocks.size or self._slots.size):
            self.counts = self._no_counts
            return []
        slots, centers, sizes, patches = self._large(group, frame, limits)
        # From the view alone, without hysteresis: a picture does not depend on earlier ones.
        is_accurate = sizes <= limits.lighter_to_at[:, patches]  # falls from level to level
        mesh_levels = np.add.reduce(is_accurate, dtype=np.int8)
        self.level_of[self._slots] = -1
        self.level_of[slots], self._slots = mesh_levels, slots
        if self.translucent:
            clear_slots = is_clear(group.looks[slots]).astype(np.int8)
            mesh_levels = mesh_levels + self._n_opaque * clear_slots
        level_counts = np.bincount(mesh_levels, minlength=len(self._level_names)).tolist()
        self.counts = dict(self._no_counts)
        for name, count in zip(self._level_names, level_counts, strict=True):
            self.counts[name] += count
        if frame.casting:
            fade_shares = np.ones(len(sizes), np.float32)
        else:
            mesh_from = limits.mesh_from_at[patches]
            fade_shares = (sizes - mesh_from) / np.maximum(mesh_from * (FADE - 1), 1e-6)
        outside = _from_outside(group, frame, slots, centers)
        if not self._may_need_own_actors:
            return self._show_batches(
                group, frame, slots, centers, mesh_levels, fade_shares, outside
            )
        is_single = self._need_own_actors(group, slots, mesh_levels)
        single = (a[is_single] for a in (slots, mesh_levels, fade_shares, outside))
        batch = (a[..., ~is_single] for a in (slots, centers, mesh_levels, fade_shares, outside))
        return self._show_singly(group, *single) + self._show_batches(group, frame, *batch)

    def _need_own_actors(self, _group, _slots, mesh_levels) -> np.ndarray:
        """Return whether instances need actors of their own."""
        return np.array(self.has_own_actors)[mesh_levels]

    def _large(self, group, frame, limits):
        """Return slots, eye-space centres, sizes and patches of visible meshes, nearest first."""
        slots, _, centers, distances, sizes = group.instances_of(frame, group.mesh_blocks)
        patches = group.patches(frame, limits, slots, centers, sizes)
        is_near = sizes >= limits.mesh_from_at[patches]
        if group.unit > 1:  # else the blocks in view are the instances in view
            radii, planes = group.radii[slots], frame.view.side_planes.astype(np.float32)
            is_near &= (planes[:, :3] @ centers + planes[:, 3:]).min(0) > -radii
            if not frame.view.parallel:
                is_near &= centers[2] < radii
        if group.looks is not None:
            is_near &= group.looks[slots, 3] > 0
        (near,) = is_near.nonzero()
        near = near[ascending((-centers[2] if frame.view.parallel else distances)[near])]
        return slots[near], centers.take(near, 1), sizes[near], patches[near]

    def _show_singly(self, group, slots, levels, shares, outside):
        new_actors = []
        for k, pool in enumerate(self.pools):
            level_slots = slots[levels == k].tolist()
            new_actors += pool.show(level_slots, group.matrix, group.look)
            if not (pool.translucent or pool.planes):
                pool.show_sides(set(slots[(levels == k) & outside].tolist()))
            slot_shares = zip(level_slots, shares[levels == k].tolist(), strict=True)
            fading = {slot: share for slot, share in slot_shares if share < 1}
            pool.fade(fading, group.cards.view_uniforms['ibr_dither'])
        return new_actors

    def _show_batches(self, group, frame, slots, centers, levels, shares, outside):
        if self._blends():
            slots, centers, levels, shares, outside = (
                a[..., ::-1] for a in (slots, centers, levels, shares, outside)
            )
        level_order = levels.argsort(kind='stable')  # a radix sort
        if count := len(slots):
            entries = np.zeros((-(-count // ROW), ROW, 4), np.float32)
            rows = entries.reshape(-1, 4)[:count]
            rows[:, :3] = centers.take(level_order, 1).T
            rows[:, 3] = _with_shares(slots[level_order], shares[level_order], len(group.ids))
            self._entries = self._entries or Texture(frame.window)
            self._entries.upload(entries)
        textures = {name: group.cards.textures[name] for name in _TEXTURES}
        uniforms = {name: group.cards.uniforms[name] for name in _UNIFORMS} | NO_TINT
        inputs = textures, group.cards.view_uniforms, uniforms
        new_actors, end = [], 0
        level_counts = np.bincount(levels, minlength=len(self.draws)).tolist()
        for draws, count in zip(self.draws, level_counts, strict=True):
            first, end = end, end + count
            if count:
                draws.set_inputs(self._entries, *inputs)
                are_outside = np.logical_and.reduce(outside[level_order[first:end]])
                new_actors += draws.show(first, end, are_outside)
            elif draws.is_shown:
                draws.hide()
        return new_actors

    def _blends(self) -> bool:
        """Return whether any batch is translucent."""
        for draws in self.draws:  # noqa: SIM110, a generator takes longer
            if draws.blends:
                return True
        return False

    def depths(self) -> list:
        """Return the actors that draw the depth of visible instances."""
        pooled = [actor for pool in self.pools for actor in pool.actors()]
        visible = [actor for actor in pooled if actor.GetVisibility()]
        return visible + [actor for draws in self.draws for actor in draws.depths()]

    # -- looks --------------------------------------------------------------------------------

    def recolor(self, group, multiply):
        """Update the looks of instances with an actor each."""
        for pool in self.pools:
            pool.multiply = multiply
            pool.recolor(group.look)

    def tint(self, group, colors):
        """Paint each level in one colour, or none."""
        for k, pool in enumerate(self.pools):
            pool.tint(colors.get('lighter mesh' if k % self._n_opaque else 'mesh'), group.look)
        for k, draws in enumerate(self.draws):
            draws.tint(colors.get('lighter mesh' if k % self._n_opaque else 'mesh'))

    # -- its life -----------------------------------------------------------------------------

    def actors(self) -> list:
        """Return all actors so far, invisible ones included."""
        return [actor for owner in (*self.draws, *self.pools) for actor in owner.actors()]

    def hide(self, group):
        """Draw nothing, and forget what slots hold."""
        for draws in self.draws:
            draws.hide()
        for pool in self.pools:
            pool.show((), group.matrix, group.look)
        self.level_of, self._slots = np.full(len(group), -1, np.int8), np.zeros(0, int)

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self.draws:
            draws.release(window)
        release(self._entries)
        self._entries = None
        if window is None:
            return
        for actor in self.actors():
            actor.ReleaseGraphicsResources(window)
        for pool in self.pools:
            for part in pool.level.parts:
                part.actor.ReleaseGraphicsResources(window)


def _from_outside(group, frame, slots, centers) -> np.ndarray:
    """Return the slots that are not mirrored and that the eye is outside of."""
    if frame.casting or frame.view.is_mirrored:  # lights may need the far side
        return np.zeros(len(slots), bool)
    is_outside = -centers[2] - group.placement.radii[slots] > frame.view.near
    return is_outside & ~group.placement.mirrored(slots)


def _with_shares(slots, shares, count):
    """Return slots plus the share of their pixels drawn during a fade as the fraction, 0 for all.

    The number of slots decides how many bits float32 has left for it, perhaps none.
    """
    steps = 2 ** min(_SHARE_BITS, 23 - max(count - 1, 1).bit_length())
    fraction = np.ceil(np.maximum(shares, 1 / steps) * steps) / steps
    return slots + np.where(fraction < 1, fraction, 0.0) if steps > 1 else slots
