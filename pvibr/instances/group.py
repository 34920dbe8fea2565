"""Instances of one mesh, drawn as cards or meshes by their size on the screen."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pvibr.instances.baked_materials import copy_light
from pvibr.instances.cards import FADE, Cards
from pvibr.instances.choices import UNKNOWN, CardBlocks, SeenBlocks, view_patches
from pvibr.instances.near_meshes import NearMeshes
from pvibr.instances.placement import Placement, spheres
from pvibr.instances.posed_bounds import PosedShape
from pvibr.maths.blocks import BLOCK, Blocks, ascending
from pvibr.things.shared_material import CardMaterial

SORTED = 16_384  # instances up to which each is sorted and culled on its own
# In larger sets, visible instances up to which one shader still sorts each: some milliseconds.
SORTED_SEEN = 131_072
_MAX_SAMPLED = 16_384  # instances that statistics look at


def unit_of(count) -> int:
    """Return the number of instances that are culled and sorted together."""
    return 1 if count <= SORTED else BLOCK


class InstanceGroup:
    """Instances of one mesh."""

    def __init__(self, model, binder, unit, capacity, draws=None, *, translucent=False):
        self.model, self.levels, self.atlas = model, model.levels, model.atlas
        self.unit, self.poses = unit, np.zeros((0, 3))
        self.placement = Placement(self.atlas, unit)
        self.card_prop = _card_material(self.levels[0].parts)
        self.cards = Cards(self.atlas, capacity, unit, draws, self.card_prop, binder)
        self.cards.set(ibr_paint=model.paint)
        self.near = self._near_meshes(translucent)
        self.near.draw_many(capacity, self.atlas.center, binder)
        self.looks: np.ndarray | None = None
        #: What cards drew in the last frame by shader, and how many instances others hid.
        self.shown_cards: dict[str, CardBlocks] = {}
        self.hidden_count = 0
        self.visible_blocks = np.zeros(0, int)
        #: Blocks that may have instances too large for cards: origin in eye space, index.
        self.mesh_blocks = np.zeros((0, 4), np.float32)

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
        """Slots that are culled and selected together."""
        return self.placement.blocks

    def follow_material(self):
        """Apply the current lighting of the mesh to images and lighter meshes."""
        copy_light(self.card_prop, _largest(self.levels[0].parts).actor.GetProperty())
        for level in self.levels[1:]:
            for part, mesh_part in zip(level.parts, self.levels[0].parts, strict=False):
                if part.actor.GetProperty() is not mesh_part.actor.GetProperty():
                    copy_light(part.actor.GetProperty(), mesh_part.actor.GetProperty())
        self.near.follow_material()
        self.cards.set(ibr_paint=self.model.paint)

    def put(self, poses, ids):
        """Show the poses of `ids`, ordered so that neighbours are together."""
        self.poses = poses
        self.placement.put(poses, ids)
        self._placed()

    def move(self, poses, slots):
        """Update the poses of some slots."""
        self.poses = poses
        blocks = np.unique(slots // self.unit)
        self.placement.move(poses, blocks)
        self._placed(self.placement.texture_rows(blocks))

    def _placed(self, texture_rows=None):
        self.cards.place(self.placement, texture_rows)
        self.cards.bound(self.bounds if len(self) else np.zeros(6))
        self.near.bound(self.cards.bounds)
        self._hide_meshes()

    def _hide_meshes(self):
        self.visible_blocks = np.zeros(0, int)
        self.near.hide(self)

    def _near_meshes(self, translucent) -> NearMeshes:
        return NearMeshes(self.levels, translucent)

    def parts(self, slot) -> list:
        """Return the parts of an instance in model space, for ray casting."""
        return self.levels[0].parts

    def centers(self, slots):
        """Return the centres of the bounding spheres of some slots, world units."""
        return spheres(self.poses, self.ids[slots], self.atlas.center, self.atlas.radius)[0].T

    def visible_slots(self) -> np.ndarray:
        """Return the slots of instances in the visible blocks, sampled if there are many."""
        slots = (self.visible_blocks[:, None] * self.unit + np.arange(self.unit)).ravel()
        slots = slots[slots < len(self)]
        slots = slots[:: max(1, len(slots) // _MAX_SAMPLED)]
        return slots if self.looks is None else slots[self.looks[slots, 3] > 0]

    def toward_eye(self, slots, frame) -> tuple:
        """Return unit directions to the eye in model space, sines of elevation and distances.

        Elevations are over a turntable's horizon; distances are 1 in parallel views.
        """
        distances = np.ones(len(slots))
        if frame.parallel:
            eye_directions = np.tile(frame.view_from_world[2, :3], (len(slots), 1))
        else:
            eye_directions = frame.eye - self.centers(slots)
            distances = np.maximum(np.linalg.norm(eye_directions, axis=1), 1e-300)
            eye_directions = eye_directions / distances[:, None]
        poses, model_directions = self.poses[self.ids[slots]], eye_directions
        turntable = self.atlas.turntable
        axis = np.zeros(3) if turntable is None else np.array(turntable.turns.axis)
        axes = np.broadcast_to(axis, eye_directions.shape)
        if poses.ndim == 3:
            model_directions = np.linalg.solve(poses[:, :3, :3], eye_directions[..., None])[..., 0]
            axes = poses[:, :3, :3] @ axis
        model_directions = model_directions / _lengths(model_directions.T)[:, None]
        axis_lengths = np.maximum(_lengths(axes.T), 1e-300)
        return model_directions, np.abs((axes * eye_directions).sum(1)) / axis_lengths, distances

    def matrix(self, slot):
        """Return the pose of a slot as a matrix, shape (4, 4)."""
        return self.matrices(slice(slot, slot + 1))[0]

    def matrices(self, slots):
        """Return the poses of slots as matrices, shape (n, 4, 4)."""
        poses = self.poses[self.ids[slots]]
        if poses.ndim == 3:
            return poses
        matrices = np.tile(np.eye(4), (len(poses), 1, 1))
        matrices[:, :3, 3] = poses
        return matrices

    @cached_property
    def _shape(self) -> PosedShape:
        return PosedShape(self.model.corners, self.atlas.center)

    @property
    def bounds(self):
        """World bounds of all bounding spheres: low and high x, y and z."""
        if not len(self):
            return np.array([1.0, -1.0] * 3)
        reach = self.blocks.reach + self.blocks.largest
        centers = np.ascontiguousarray(self.blocks.centers.T)
        return np.stack([(centers - reach).min(1), (centers + reach).max(1)], 1).ravel()

    def tight_bounds(self, poses=None) -> tuple:
        """Return the bounds of the points of all instances, optionally at other poses."""
        if not len(self):
            return (1.0, -1.0) * 3
        ids, blocks = self.ids, self.blocks
        if poses is None and self.unit == 1:
            poses = self.poses
            bounding_spheres = np.ascontiguousarray(blocks.centers.T), blocks.largest
        else:
            if poses is None:
                poses, ids = self.poses, ids[self.placement.outermost()]
            bounding_spheres = spheres(poses, ids, self.atlas.center, self.atlas.radius)
        bounds = self._shape.bounds(poses, ids, bounding_spheres)
        return tuple(bounds.T.ravel().tolist())

    def upload(self, window):
        """Upload what has changed; the context is current."""
        self.cards.upload(window)

    def set_looks(self, looks, multiply=False):
        """Set colour and alpha of instances, uint8; with `multiply`, times those of the mesh."""
        self.looks = None if looks is None else np.ascontiguousarray(looks[self.ids])
        self.cards.set(ibr_multiply=int(multiply))
        self.cards.look(self.looks)
        self.near.recolor(self, multiply)

    def look(self, slot):
        """Return colour and alpha of a slot as shaders encode them."""
        if self.looks is None:
            return (0.0, 0.0, 0.0, 0.5)
        return tuple(float(v) for v in self.looks[slot] / 255.0)

    def tint(self, colors):
        """Paint each level of detail in one colour, or none."""
        for name, layer in self.cards.layers.items():
            layer.tint = colors.get(name)
            layer.refresh()
        self.near.tint(self, colors)

    @property
    def counts(self) -> dict[str, int]:
        """Blocks, and instances of each level, in the last frame."""
        total = {'blocks': self.visible_blocks.size, 'of blocks': self.blocks.reach.size}
        of_cards = {n: min(len(b) * b.unit, len(self)) for n, b in self.shown_cards.items()}
        no_cards = dict.fromkeys(self.cards.layers, 0)
        return total | {'hidden': self.hidden_count} | no_cards | of_cards | self.near.counts

    def without_hidden(self, choices, are_behind) -> dict:
        """Return chosen blocks without those behind others, and leave out meshes that are."""
        masks = {name: are_behind(b.centers, b.radii) for name, b in choices.items()}
        hidden_count = sum(mask.sum() * choices[name].unit for name, mask in masks.items())
        self.hidden_count = min(int(hidden_count), len(self))
        origins, blocks = self.mesh_blocks[:, :3].astype(float), self.mesh_blocks[:, 3].astype(int)
        is_behind = are_behind(origins, self.blocks.bounding_radii[blocks])
        self.mesh_blocks = self.mesh_blocks[~is_behind]
        shown = {name: choices[name].where(~mask) for name, mask in masks.items()}
        return {name: blocks for name, blocks in shown.items() if len(blocks)}

    def patches(self, frame, limits, slots, centers, sizes):
        """Return the patch of each slot's view direction, UNKNOWN where it does not matter."""
        patches = np.full(slots.shape, UNKNOWN)
        least, most = limits.varying
        if least <= most:
            (undecided,) = ((sizes >= least) & (sizes < most * FADE)).nonzero()
            if undecided.size:
                axes = self.placement.axes(slots[undecided])
                patches[undecided] = view_patches(
                    frame, centers[:, undecided], axes, self.atlas.half
                )
        return patches

    def elevations(self, frame, slots, origins):
        """Return sines of the eye's elevation over the horizons of instances' turntables."""
        turntable_axes = np.broadcast_to(self.atlas.turntable.turns.axis, origins.shape)
        poses = self.poses[self.ids[slots]]
        if poses.ndim == 3:
            turntable_axes = np.einsum('nij,nj->ni', poses[:, :3, :3], turntable_axes)
        turntable_axes = turntable_axes @ frame.view_from_world[:3, :3].T
        heights = turntable_axes[:, 2] if frame.parallel else (turntable_axes * origins).sum(1)
        distances = 1.0 if frame.parallel else _lengths(origins.T)
        return np.abs(heights) / np.maximum(_lengths(turntable_axes.T) * distances, 1e-30)

    def instances_of(self, frame, table):
        """Return slots, table rows, centres, distances and sizes of the instances of blocks.

        Centres are in eye space, shape (3, n); sizes are diameters in pixels.
        """
        if self.unit == 1:
            table_rows, slots = np.arange(len(table)), table[:, 3].astype(int)
            centers = np.ascontiguousarray(table[:, :3].T)
        else:
            table_rows, slots, centers = self._members_of(frame, table)
        distances = np.maximum(_lengths(centers), 1e-30)
        sizes = 2 * frame.pixel_scale * self.placement.radii[slots]
        if not frame.view.parallel:
            sizes /= distances
        return slots, table_rows, centers, distances, sizes

    def _members_of(self, frame, table):
        """Return table rows, slots and eye-space centres, (3, n), of the instances of blocks."""
        slots = (table[:, 3].astype(int)[:, None] * self.unit + np.arange(self.unit)).ravel()
        table_rows = np.repeat(np.arange(len(table)), self.unit)[slots < len(self)]
        slots = slots[slots < len(self)]
        rotation = frame.view_from_world[:3, :3].astype(np.float32)
        # Not a threaded matrix product, which is slower on a busy machine.
        centers = np.einsum('ij,jn->in', rotation, self.placement.local(slots))
        return table_rows, slots, centers + table[:, :3].T.take(table_rows, 1)

    def refine(self, frame, choice):
        """Return selected blocks as single sorted instances, without those of other sizes."""
        slots, table_rows, centers, distances, sizes = self.instances_of(frame, choice.table)
        depths = centers[2] if frame.parallel else -distances
        patches = self.patches(frame, choice.limits, slots, centers, sizes)
        (in_span,) = choice.fits(sizes, patches).nonzero()
        in_span = in_span[ascending(depths[in_span])]
        table = np.empty((len(in_span), 4), np.float32)
        table[:, :3], table[:, 3] = choice.table[table_rows[in_span], :3], slots[in_span]
        depths = np.maximum.accumulate(depths[in_span])
        columns = table, depths, sizes[in_span], centers.T[in_span], self.radii, slots[in_span]
        options = choice.spans, choice.core_size, 1, choice.limits
        return CardBlocks(SeenBlocks(*columns), np.arange(len(in_span)), *options)

    def mesh_actors(self):
        """Return the actors of instances drawn as meshes."""
        return self.near.actors()

    def hide(self):
        """Hide all instances."""
        self.cards.hide()
        self._hide_meshes()

    def release(self):
        """Free GPU memory; the context is current."""
        window = self.cards.window
        self.cards.release()
        self.near.release(window)


def _lengths(columns):
    """Return the lengths of column vectors."""
    return np.sqrt(np.add.reduce(columns * columns))


def _largest(parts):
    return max(parts, key=lambda part: part.mesh.n_cells)


def _card_material(parts):
    """Return the material of the largest part, for cards."""
    material = CardMaterial(_largest(parts).actor.GetProperty())
    if material.GetInterpolation() == 0:
        material.SetInterpolationToGouraud()  # VTK lights no points of a flat material
    return material
