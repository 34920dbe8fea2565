"""Instances of one mesh: atlas, blocks and levels of detail."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE, at_patches
from pvibr.instances.cards import FADE, Cards
from pvibr.instances.materials import copy_light
from pvibr.instances.near_meshes import NearMeshes
from pvibr.instances.placement import Placement, spheres
from pvibr.maths import octahedral
from pvibr.maths.blocks import BLOCK, Blocks, ascending
from pvibr.maths.posed_bounds import PosedShape
from pvibr.meshes.turntable import LEVEL
from pvibr.scene.shared_material import CardMaterial

SORTED = 16_384  # instances up to which each is sorted and culled by itself
# Of a larger set, those of one shader that are still sorted one by one: some milliseconds.
SORTED_SEEN = 131_072
_UNSURE = 1e-4  # what the sine of an angle, or a place in a patch, may be off on the GPU
_UNKNOWN = -1  # patch
_MOST_SAMPLED = 16_384  # of the instances that statistics are of


@dataclass(frozen=True)
class Choice:
    """The blocks of a group that one card shader draws."""

    table: np.ndarray
    depths: np.ndarray
    #: Of their largest instance, on-screen diameters in pixels.
    sizes: np.ndarray
    #: By patch, and where the eye is level with a turntable: from, to, 1 before meshes, 0.
    ranges: np.ndarray
    level: np.ndarray
    #: On-screen diameter up to which they have no core.
    core_size: float
    #: By which single instances of the blocks are chosen.
    limits: Any

    @property
    def cored(self) -> int:
        """The first that may have a core."""
        cored = self.sizes > 0.99 * self.core_size  # the shader decides
        return int(cored.argmax()) if cored.any() else len(cored)

    def fits(self, sizes, patches) -> np.ndarray:
        """Return which sizes may be drawn: a little more than the shader, which decides, draws."""
        spans = (ranges[:, :2].T for ranges in (self.ranges, self.level))
        found = [_fits(span, patches, 0.99 * sizes, 1.01 * sizes) for span in spans]
        return found[0] | found[1]


def unit_of(count) -> int:
    """Return the number of instances that are culled and sorted together."""
    return 1 if count <= SORTED else BLOCK


class InstanceGroup:
    """Instances of one mesh."""

    def __init__(self, model, binder, unit, capacity, draws=None, *, translucent=False):
        self.model, self.levels, self.atlas = model, model.levels, model.atlas
        self.unit, self.poses = unit, np.zeros((0, 3))
        self.placement = Placement(self.atlas, unit)
        self._prop = _card_material(self.levels[0].parts)
        self.cards = Cards(self.atlas, capacity, unit, draws, self._prop, binder)
        self.cards.uniforms['ibr_paint'] = model.paint
        self.near = self._near_meshes(translucent)
        self.near.draw_many(capacity, self.atlas.center, binder)
        self.looks: np.ndarray | None = None
        self.counts: dict[str, int] = {}
        self.seen = np.zeros(0, int)  # of the blocks
        #: Blocks that may have instances too large for cards: origin in eye space, index.
        self.large = np.zeros((0, 4), np.float32)

    def __len__(self):
        return len(self.ids)

    @property
    def ids(self) -> np.ndarray:
        """Index of the instance in each slot."""
        return self.placement.ids

    @property
    def radii(self) -> np.ndarray:
        """Radius of the bounding sphere of each slot, world units."""
        return self.placement.radii

    @property
    def blocks(self) -> Blocks:
        """Slots that are culled and chosen together."""
        return self.placement.blocks

    def follow_material(self):
        """Light images and lighter meshes as the mesh is lit now."""
        copy_light(self._prop, _largest(self.levels[0].parts).actor.GetProperty())
        for level in self.levels[1:]:
            for part, own in zip(level.parts, self.levels[0].parts, strict=False):
                if part.actor.GetProperty() is not own.actor.GetProperty():
                    copy_light(part.actor.GetProperty(), own.actor.GetProperty())
        self.near.follow_material()
        self.cards.uniforms['ibr_paint'] = self.model.paint

    def put(self, poses, ids):
        """Show some of the poses, in an order that keeps neighbours together."""
        self.poses = poses
        self.placement.put(poses, ids)
        self._placed()

    def move(self, poses, slots):
        """Take over new poses of some slots."""
        self.poses = poses
        blocks = np.unique(slots // self.unit)
        self.placement.move(poses, blocks)
        self._placed(self.placement.rows_of(blocks))

    def _placed(self, rows=None):
        self.cards.place(self.placement, rows)
        self.cards.bound(self.bounds if len(self) else np.zeros(6))
        self.near.bound(self.cards.bounds)
        self._lend_anew()

    def _lend_anew(self):
        self.seen = np.zeros(0, int)
        self.near.lend_anew(self)

    def _near_meshes(self, translucent) -> NearMeshes:
        return NearMeshes(self.levels, translucent)

    def parts(self, slot) -> list:
        """Return the meshes of an instance for ray casting, as Parts in model coordinates."""
        return self.levels[0].parts

    def centers(self, slots):
        """Return the centres of the bounding spheres of some slots, world units."""
        return spheres(self.poses, self.ids[slots], self.atlas.center, self.atlas.radius)[0].T

    def visible_slots(self) -> np.ndarray:
        """Return the slots of visible instances in the blocks last seen, or a sample of many."""
        slots = (self.seen[:, None] * self.unit + np.arange(self.unit)).ravel()
        slots = slots[slots < len(self)]
        slots = slots[:: max(1, len(slots) // _MOST_SAMPLED)]
        return slots if self.looks is None else slots[self.looks[slots, 3] > 0]

    def toward_eye(self, slots, frame) -> tuple:
        """Return unit directions to the eye in model space, sines of its elevation, distances.

        The elevation is that over the horizon of a turntable; distances are 1 in parallel views.
        """
        away = np.ones(len(slots))
        if frame.parallel:
            eye = np.tile(frame.view_from_world[2, :3], (len(slots), 1))
        else:
            eye = frame.eye - self.centers(slots)
            away = np.maximum(np.linalg.norm(eye, axis=1), 1e-300)
            eye = eye / away[:, None]
        poses, toward = self.poses[self.ids[slots]], eye
        turntable = self.atlas.turntable
        axis = np.zeros(3) if turntable is None else np.array(turntable.turns.axis)
        upright = np.broadcast_to(axis, eye.shape)
        if poses.ndim == 3:
            toward = np.linalg.solve(poses[:, :3, :3], eye[..., None])[..., 0]
            upright = poses[:, :3, :3] @ axis
        toward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        long = np.maximum(np.linalg.norm(upright, axis=1), 1e-300)
        return toward, np.abs((upright * eye).sum(1)) / long, away

    def matrix(self, slot):
        """Return the pose of a slot as a matrix, shape (4, 4)."""
        pose = self.poses[self.ids[slot]]
        if pose.ndim == 2:
            return pose
        out = np.eye(4)
        out[:3, 3] = pose
        return out

    @cached_property
    def _shape(self) -> PosedShape:
        return PosedShape(self.model.corners, self.atlas.center)

    @property
    def bounds(self):
        """World bounds of all bounding spheres: x, y and z, low and high."""
        if not len(self):
            return np.array([1.0, -1.0] * 3)
        reach = self.blocks.reach + self.blocks.largest
        centers = np.ascontiguousarray(self.blocks.centers.T)
        return np.stack([(centers - reach).min(1), (centers + reach).max(1)], 1).ravel()

    def tight_bounds(self, poses=None) -> tuple:
        """Return the bounds of the points of all instances, or of these at other poses."""
        if not len(self):
            return (1.0, -1.0) * 3
        ids, blocks = self.ids, self.blocks
        if poses is None and self.unit == 1:
            poses, found = self.poses, (np.ascontiguousarray(blocks.centers.T), blocks.largest)
        else:
            if poses is None:
                poses, ids = self.poses, ids[self.placement.outermost()]
            found = spheres(poses, ids, self.atlas.center, self.atlas.radius)
        bounds = self._shape.bounds(poses, ids, found)
        return tuple(bounds.T.ravel().tolist())

    def upload(self, window):
        """Upload what changed; the context is current."""
        self.cards.upload(window)

    def set_looks(self, looks, multiply=False):
        """Set the looks of instances."""
        self.looks = None if looks is None else np.ascontiguousarray(looks[self.ids])
        self.cards.uniforms['ibr_multiply'] = int(multiply)
        self.cards.look(self.looks)
        self.near.recolor(self, multiply)

    def look(self, slot):
        """Return colour and alpha of a slot, as shaders have them."""
        if self.looks is None:
            return (0.0, 0.0, 0.0, 0.5)
        return tuple(float(v) for v in self.looks[slot] / 255.0)

    def tint(self, colors):
        """Set one colour for each level of detail."""
        for name, layer in self.cards.layers.items():
            layer.tint = colors.get(name)
        self.near.tint(self, colors)

    def select(self, frame, limits, *, depth=False):
        """Choose the blocks that each card shader draws."""
        index, origins, small, large = self.blocks.seen(frame)
        self.seen = index
        self.cards.view(frame, depth=depth)
        self.counts = {'blocks': len(index), 'of blocks': len(self.blocks.centers)}
        table = np.empty((len(index), 4), np.float32)
        table[:, :3], table[:, 3] = origins, index
        depths = origins[:, 2] if frame.parallel else -_lengths(origins.T)
        rises = self._rises(frame, index, origins)
        patches = self._patches_of_blocks(frame, limits, index, origins, large)
        chosen = {}
        for name, layer in self.cards.layers.items():
            spans = limits.spans(name)
            fits = [_fits(span, patches, small, large) for span in spans]
            if rises is not None:  # the shader decides about those that are close to the bound
                fits[0] &= rises > LEVEL - _UNSURE
                fits[1] &= rises < LEVEL + _UNSURE
            used = np.flatnonzero(fits[0] | fits[1])
            ranges, level = (_ranges(span, limits.mesh) for span in spans)
            look = ranges, level, layer.core_size
            chosen[name] = Choice(table[used], depths[used], large[used], *look, limits)
            self.counts[name] = min(len(used) * self.unit, len(self))
        self.large = table[large >= at_patches(limits.mesh, patches)]
        return chosen

    def _patches_of_blocks(self, frame, limits, index, origins, large):
        """Return the patch of directions that each block is seen from, as far as that matters."""
        if self.unit > 1:
            return np.full(len(index), _UNKNOWN)
        return self.patches(frame, limits, index, origins.T, large)

    def patches(self, frame, limits, slots, eye, sizes):
        """Return the patches that slots are seen from, -1 where it is not sure or of no matter."""
        out = np.full(len(slots), _UNKNOWN)
        low, high = limits.varying()
        some = np.flatnonzero((sizes >= low) & (sizes < high * FADE))
        if len(some):
            toward = np.array([[0.0], [0.0], [1.0]]) if frame.parallel else -eye[:, some]
            toward = np.einsum('ji,jn->in', frame.view_from_world[:3, :3], toward)
            seen = self.placement.directions(slots[some], toward)
            seen = seen / np.maximum(_lengths(seen.T), 1e-30)[:, None]
            found, inside = octahedral.cells(seen, PATCH_SIDE, self.atlas.half)
            out[some] = np.where(inside > _UNSURE, found, _UNKNOWN)
        return out

    def _rises(self, frame, index, origins):
        """Return the sines of the camera's elevation over instances; None without a turntable."""
        turntable = self.atlas.turntable
        if turntable is None or self.unit > 1:
            return None
        axes = np.broadcast_to(turntable.turns.axis, origins.shape)
        poses = self.poses[self.ids[index]]
        if poses.ndim == 3:
            axes = np.einsum('nij,nj->ni', poses[:, :3, :3], axes)
        axes = axes @ frame.view_from_world[:3, :3].T
        along = axes[:, 2] if frame.parallel else (axes * origins).sum(1)
        away = 1.0 if frame.parallel else _lengths(origins.T)
        return np.abs(along) / np.maximum(_lengths(axes.T) * away, 1e-30)

    def singles(self, frame, table):
        """Return slots, rows of the table, centres, distances and sizes of single instances.

        Centres are in eye space, shape (3, n), sizes diameters in pixels.
        """
        slots = (table[:, 3].astype(int)[:, None] * self.unit + np.arange(self.unit)).ravel()
        rows = np.repeat(np.arange(len(table)), self.unit)[slots < len(self)]
        slots = slots[slots < len(self)]
        turn = frame.view_from_world[:3, :3].astype(np.float32)
        # Not by the threads of a matrix product, which take longer where a machine is busy.
        eye = np.einsum('ij,jn->in', turn, self.placement.local(slots))
        eye += table[:, :3].T.take(rows, 1)
        away = np.maximum(_lengths(eye), 1e-30)
        sizes = 2 * frame.pixel_scale * self.radii[slots] / (1.0 if frame.parallel else away)
        return slots, rows, eye, away, sizes

    def refine(self, frame, choice):
        """Sort the single instances of a choice of blocks, and drop those out of its sizes."""
        slots, rows, eye, away, size = self.singles(frame, choice.table)
        depths = eye[2] if frame.parallel else -away
        patches = self.patches(frame, choice.limits, slots, eye, size)
        used = np.flatnonzero(choice.fits(size, patches))
        used = used[ascending(depths[used])]
        table = np.empty((len(used), 4), np.float32)
        table[:, :3], table[:, 3] = choice.table[rows[used], :3], slots[used]
        depths = np.maximum.accumulate(depths[used])
        return replace(choice, table=table, depths=depths, sizes=size[used])

    def select_meshes(self, frame, limits):
        """Draw instances too large for cards as meshes; return new actors."""
        return self.near.select(self, frame, limits)

    def mesh_actors(self):
        """Return the actors of instances drawn as meshes."""
        return self.near.actors()

    def hide(self):
        """Hide all instances."""
        self.cards.hide()
        self._lend_anew()

    def release(self):
        """Free GPU memory; the context is current."""
        window = self.cards.window
        self.cards.release()
        self.near.release(window)


def _fits(span, patches, small, large):
    """Return which blocks may have instances of a span of sizes."""
    low, high = span
    none = high <= low
    low = at_patches(np.where(none, np.inf, low), patches)
    high = -at_patches(np.where(none, 0.0, -high), patches)
    return (large >= low) & (small < high * FADE)


def _ranges(span, mesh):
    """Return a span as the card shader has it: from, to, whether the mesh is next, and nothing."""
    low, high = span
    low = np.where(high <= low, 1e30, low)
    return np.stack([low, high, high == mesh, np.zeros(len(low))], 1)


def _lengths(columns):
    """Return the lengths of column vectors."""
    return np.sqrt((columns * columns).sum(0))


def _largest(parts):
    return max(parts, key=lambda part: part.mesh.n_cells)


def _card_material(parts):
    """Return the material of the largest part, for cards."""
    material = CardMaterial(_largest(parts).actor.GetProperty())
    if material.GetInterpolation() == 0:
        material.SetInterpolationToGouraud()  # VTK lights no points of a flat material
    return material
