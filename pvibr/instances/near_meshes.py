"""Instances of a group that are near enough to be drawn as meshes."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import Texture, release
from pvibr.instances.card_layers import at_patches
from pvibr.instances.cards import FADE
from pvibr.instances.mesh_draws import MeshDraws, suits
from pvibr.instances.mesh_pool import MeshPool
from pvibr.instances.one_sided import faces_outward
from pvibr.maths.blocks import ascending, frustum_planes
from pvibr.scene.looks import is_clear
from pvibr.scene.shader_draws import ROW, pack

_SHARE_BITS = 6  # of the share of an instance's pixels, which is dithered
_SHARED = 'ibr_texels', 'ibr_has_looks', 'ibr_multiply', 'ibr_radius'
_OF_FRAME = 'ibr_eye_from_world', 'ibr_clip_from_eye', 'ibr_dither'


class NearMeshes:
    """Meshes by level: light ones many a draw, heavy ones and those with edges an actor each."""

    def __init__(self, levels, translucent=False):
        #: Whether instances have an alpha: all levels are there twice, at last for these.
        self.translucent = translucent
        self.levels = levels * (1 + translucent)
        self._opaque = len(levels)
        self.pools = self._pools()
        for pool in self.pools[self._opaque :]:
            pool.translucent = True
        self.draws: list[MeshDraws] = []
        #: Of each level, whether its instances have an actor each.
        self.single = (True,) * len(self.levels)
        self._matrix = _vtk.vtkMatrix4x4()
        self._entries: Texture | None = None
        #: Level of each slot in the last frame, -1 for those that are no meshes.
        self.level_of = np.zeros(0, np.int8)
        self._slots = np.zeros(0, int)

    def _pools(self) -> list:
        return [MeshPool(level) for level in self.levels]

    def draw_many(self, capacity, center, binder):
        """Draw many instances at once, if that suits the levels."""
        shared = center, self._matrix, binder
        kinds = [k >= self._opaque for k in range(len(self.levels))]
        pairs = zip(self.levels, kinds, strict=True)
        self.draws = [MeshDraws(level, capacity, *shared, alpha) for level, alpha in pairs]
        self.follow_material()

    def bound(self, bounds):
        """Have VTK know where the draws are, as cards do."""
        for axis, middle in enumerate(bounds.mean(0).tolist()):
            self._matrix.SetElement(axis, 3, middle)
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
        """Have an actor for each instance where a material asks for more than surfaces."""
        self.single = tuple(not self.draws or not suits(level) for level in self.levels)

    def clip(self, planes):
        """Cut off the actors of single instances by a vtkPlaneCollection, or None."""
        for pool in self.pools:
            pool.planes = planes

    def draw_singly(self):
        """Have an actor for each instance, of every level."""
        self.draws = []
        self.follow_material()

    # -- what is shown ------------------------------------------------------------------------

    def select(self, group, frame, limits) -> list:
        """Show the instances of a group that are too large for cards; return new actors."""
        slots, centers, sizes, patches = self._large(group, frame, limits)
        least = at_patches(limits.mesh, patches)
        levels = _levels(sizes, at_patches(limits.meshes, patches))
        self.level_of[self._slots] = -1
        self.level_of[slots], self._slots = levels, slots
        if self.translucent:
            levels = levels + self._opaque * is_clear(group.looks[slots]).astype(np.int8)
        for k, pool in enumerate(self.pools):
            key = f'mesh {pool.level.triangles}'
            before = group.counts.get(key, 0) if k >= self._opaque else 0
            group.counts[key] = before + int((levels == k).sum())
        shares = np.ones(len(sizes), np.float32)
        if not frame.casting:
            shares = (sizes - least) / np.maximum(least * (FADE - 1), 1e-6)
        outside = _from_outside(group, frame, slots, centers)
        alone = np.array(self.single)[levels]
        new = self._show_singly(group, slots[alone], levels[alone], shares[alone], outside[alone])
        many = slots, centers, levels, shares, outside
        return new + self._show_draws(group, frame, *(a[..., ~alone] for a in many))

    def _large(self, group, frame, limits):
        """Return slots, eye-space centres and sizes of what is in view, nearest first.

        And the patches that they are seen from.
        """
        slots, _, eye, away, sizes = group.singles(frame, group.large)
        planes = frustum_planes(frame.clip_from_view)[:4].astype(np.float32)
        radii = group.radii[slots]
        inside = (planes[:, :3] @ eye + planes[:, 3:]).min(0) > -radii
        if not frame.parallel:
            inside &= eye[2] < radii
        patches = group.patches(frame, limits, slots, eye, sizes)
        used = inside & (sizes >= at_patches(limits.mesh, patches))
        if group.looks is not None:
            used &= group.looks[slots, 3] > 0
        used = np.flatnonzero(used)
        used = used[ascending((-eye[2] if frame.parallel else away)[used])]
        return slots[used], eye.take(used, 1), sizes[used], patches[used]

    def _show_singly(self, group, slots, levels, shares, outside):
        new = []
        for k, pool in enumerate(self.pools):
            ids = slots[levels == k].tolist()
            new += pool.show(ids, group.matrix, group.look)
            if not (pool.translucent or pool.planes):
                pool.show_sides(set(slots[(levels == k) & outside].tolist()))
            some = zip(ids, shares[levels == k].tolist(), strict=True)
            faded = {slot: share for slot, share in some if share < 1}
            pool.fade(faded, group.cards.uniforms['ibr_dither'])
        return new

    def _show_draws(self, group, frame, slots, centers, levels, shares, outside):
        if any(draws.blends for draws in self.draws):
            slots, centers, levels, shares, outside = (
                a[..., ::-1] for a in (slots, centers, levels, shares, outside)
            )
        order = np.argsort(levels.astype(np.uint8), kind='stable')  # a radix sort
        ends = np.searchsorted(levels[order], np.arange(len(self.draws) + 1))
        if len(slots):
            entries = np.empty((len(slots), 4), np.float32)
            entries[:, :3] = centers.take(order, 1).T
            entries[:, 3] = _with_shares(slots[order], shares[order], len(group))
            self._entries = self._entries or Texture(frame.window)
            self._entries.upload(pack(entries, ROW, 4))
        cards = group.cards
        textures = {name: cards.textures[name] for name in ('ibr_poses', 'ibr_looks')}
        uniforms = {name: cards.uniforms[name] for name in (*_SHARED, *_OF_FRAME)}
        uniforms['ibr_tint'] = (0.0, 0.0, 0.0, 0.0)
        new = []
        for draws, first, end in zip(self.draws, ends.tolist(), ends[1:].tolist(), strict=False):
            draws.set_inputs(self._entries, textures, uniforms)
            new += draws.show(first, end, bool(outside[order[first:end]].all()))
        return new

    def depths(self) -> list:
        """Return the actors that draw the depth of what is shown."""
        single = [actor for pool in self.pools for actor in pool.actors()]
        shown = [actor for actor in single if actor.GetVisibility()]
        return shown + [actor for draws in self.draws for actor in draws.depths()]

    # -- looks --------------------------------------------------------------------------------

    def recolor(self, group, multiply):
        """Update the looks of actors of their own."""
        for pool in self.pools:
            pool.multiply = multiply
            pool.recolor(group.look)

    def tint(self, group, colors):
        """Set one colour for each level."""
        for k, pool in enumerate(self.pools):
            pool.tint(colors.get('lighter mesh' if k % self._opaque else 'mesh'), group.look)
        for k, draws in enumerate(self.draws):
            draws.tint(colors.get('lighter mesh' if k % self._opaque else 'mesh'))

    # -- its life -----------------------------------------------------------------------------

    def actors(self) -> list:
        """Return every actor made so far that draws."""
        return [actor for owner in (*self.draws, *self.pools) for actor in owner.actors()]

    def lend_anew(self, group):
        """Show nothing, whatever a slot holds from now on."""
        self._hide_draws()
        self._hide_pools(group)
        self.level_of, self._slots = np.full(len(group), -1, np.int8), np.zeros(0, int)

    def _hide_draws(self):
        for draws in self.draws:
            draws.hide()

    def _hide_pools(self, group):
        for pool in self.pools:
            pool.show((), group.matrix, group.look)

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
    """Return of which slots the eye is outside, and the triangles are not mirrored."""
    if frame.casting or not faces_outward(frame):  # lights may want the side that is behind
        return np.zeros(len(slots), bool)
    whole = -centers[2] - group.radii[slots] > frame.near
    return whole & ~group.placement.mirrored(slots)


def _levels(sizes, limits) -> np.ndarray:
    """Return the mesh level of each slot: the lightest within the error at its size."""
    # By the view alone: the same one is the same picture, whatever was drawn before.
    return (sizes <= limits[1:]).sum(0, dtype=np.int8)  # a lighter one serves no larger sizes


def _with_shares(slots, shares, count):
    """Return slots, with the share of their pixels that taking over has given them behind them.

    Nothing there is all: of so many slots float32 leaves some bits, or none, for parts of it.
    """
    parts = 2 ** min(_SHARE_BITS, 23 - max(count - 1, 1).bit_length())
    behind = np.ceil(np.maximum(shares, 1 / parts) * parts) / parts
    return slots + np.where(behind < 1, behind, 0.0) if parts > 1 else slots
