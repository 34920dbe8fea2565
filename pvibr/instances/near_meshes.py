"""Instances near enough to be drawn as meshes, in batches or an actor each."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import Texture, release
from pvibr.instances.card_layers import at_patches
from pvibr.instances.cards import FADE
from pvibr.instances.mesh_draws import MeshDraws, can_batch
from pvibr.instances.mesh_pool import MeshPool
from pvibr.instances.one_sided import faces_outward
from pvibr.maths.blocks import ascending
from pvibr.things.appearance import is_clear
from pvibr.things.shader_draws import ROW, pack

_SHARE_BITS = 6  # of the dithered share of an instance's pixels
_SHARED = 'ibr_texels', 'ibr_has_looks', 'ibr_multiply', 'ibr_radius'
_OF_FRAME = 'ibr_eye_from_world', 'ibr_clip_from_eye', 'ibr_dither'


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
        self._matrix = _vtk.vtkMatrix4x4()
        self._entries: Texture | None = None
        #: Mesh level of each slot in the last frame, -1 if it was no mesh.
        self.level_of = np.zeros(0, np.int8)
        self._slots = np.zeros(0, int)
        self._no_counts = dict.fromkeys((f'mesh {level.triangles}' for level in self.levels), 0)

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
        self.has_own_actors = tuple(not (self.draws and can_batch(k)) for k in self.levels)

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
        if not (len(group.mesh_blocks) or len(self._slots)):
            group.counts |= self._no_counts
            return []
        slots, centers, sizes, patches = self._large(group, frame, limits)
        mesh_from = at_patches(limits.mesh_from, patches)
        mesh_levels = _levels(sizes, at_patches(limits.mesh_to, patches))
        self.level_of[self._slots] = -1
        self.level_of[slots], self._slots = mesh_levels, slots
        if self.translucent:
            clear_slots = is_clear(group.looks[slots]).astype(np.int8)
            mesh_levels = mesh_levels + self._n_opaque * clear_slots
        for k, pool in enumerate(self.pools):
            key = f'mesh {pool.level.triangles}'
            opaque_count = group.counts.get(key, 0) if k >= self._n_opaque else 0
            group.counts[key] = opaque_count + int((mesh_levels == k).sum())
        fade_shares = np.ones(len(sizes), np.float32)
        if not frame.casting:
            fade_shares = (sizes - mesh_from) / np.maximum(mesh_from * (FADE - 1), 1e-6)
        outside = _from_outside(group, frame, slots, centers)
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
        planes = frame.view.side_planes.astype(np.float32)
        radii = group.radii[slots]
        in_view = (planes[:, :3] @ centers + planes[:, 3:]).min(0) > -radii
        if not frame.parallel:
            in_view &= centers[2] < radii
        patches = group.patches(frame, limits, slots, centers, sizes)
        is_near = in_view & (sizes >= at_patches(limits.mesh_from, patches))
        if group.looks is not None:
            is_near &= group.looks[slots, 3] > 0
        (near,) = is_near.nonzero()
        near = near[ascending((-centers[2] if frame.parallel else distances)[near])]
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
            pool.fade(fading, group.cards.uniforms['ibr_dither'])
        return new_actors

    def _show_batches(self, group, frame, slots, centers, levels, shares, outside):
        if any(draws.blends for draws in self.draws):
            slots, centers, levels, shares, outside = (
                a[..., ::-1] for a in (slots, centers, levels, shares, outside)
            )
        level_order = np.argsort(levels.astype(np.uint8), kind='stable')  # a radix sort
        level_starts = np.searchsorted(levels[level_order], np.arange(len(self.draws) + 1))
        if len(slots):
            entries = np.empty((len(slots), 4), np.float32)
            entries[:, :3] = centers.take(level_order, 1).T
            entries[:, 3] = _with_shares(slots[level_order], shares[level_order], len(group))
            self._entries = self._entries or Texture(frame.window)
            self._entries.upload(pack(entries, ROW, 4))
        cards = group.cards
        textures = {name: cards.textures[name] for name in ('ibr_poses', 'ibr_looks')}
        uniforms = {name: cards.uniforms[name] for name in (*_SHARED, *_OF_FRAME)}
        uniforms['ibr_tint'] = (0.0, 0.0, 0.0, 0.0)
        new_actors = []
        spans = pairwise(level_starts.tolist())
        for draws, (first, end) in zip(self.draws, spans, strict=True):
            draws.set_inputs(self._entries, textures, uniforms)
            new_actors += draws.show(first, end, bool(outside[level_order[first:end]].all()))
        return new_actors

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
    if frame.casting or not faces_outward(frame):  # lights may need the far side
        return np.zeros(len(slots), bool)
    is_outside = -centers[2] - group.radii[slots] > frame.near
    return is_outside & ~group.placement.mirrored(slots)


def _levels(sizes, limits) -> np.ndarray:
    """Return the lightest accurate mesh level of each slot."""
    # From the view alone, without hysteresis: a picture does not depend on earlier ones.
    return (sizes <= limits[1:]).sum(0, dtype=np.int8)  # limits fall from level to level


def _with_shares(slots, shares, count):
    """Return slots plus the share of their pixels drawn during a fade as the fraction, 0 for all.

    The number of slots decides how many bits float32 has left for it, perhaps none.
    """
    steps = 2 ** min(_SHARE_BITS, 23 - max(count - 1, 1).bit_length())
    fraction = np.ceil(np.maximum(shares, 1 / steps) * steps) / steps
    return slots + np.where(fraction < 1, fraction, 0.0) if steps > 1 else slots
