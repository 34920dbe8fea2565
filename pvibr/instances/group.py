"""Instances of one mesh, drawn as cards or meshes by their size on the screen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pvibr.instances.baked_materials import copy_light
from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.card_spans import CardSpan
from pvibr.instances.cards import FADE, Cards
from pvibr.instances.near_meshes import NearMeshes
from pvibr.instances.placement import Placement, spheres
from pvibr.instances.posed_bounds import PosedShape
from pvibr.maths import octahedral
from pvibr.maths.blocks import BLOCK, Blocks, ascending
from pvibr.meshes.turntable import SIDE_ELEVATION
from pvibr.things.shared_material import CardMaterial

SORTED = 16_384  # instances up to which each is sorted and culled on its own
# In larger sets, visible instances up to which one shader still sorts each: some milliseconds.
SORTED_SEEN = 131_072
_UNSURE = 1e-4  # error of the sine of an angle, or of a position in a patch, on the GPU
_UNKNOWN = -1  # patch
_MAX_SAMPLED = 16_384  # instances that statistics look at
_BY_BLOCK = 'table', 'depths', 'sizes', 'centers', 'radii'  # arrays of chosen blocks


@dataclass(frozen=True)
class CardBlocks:
    """The blocks of a group that one card shader draws."""

    table: np.ndarray
    depths: np.ndarray
    #: On-screen diameter of the largest instance of each, in pixels.
    sizes: np.ndarray
    #: The sizes that the shader draws, and those near a turntable's horizon.
    spans: tuple[CardSpan, CardSpan]
    #: On-screen diameter up to which cards have no core.
    core_size: float
    #: Centres in eye space and radii of bounding spheres.
    centers: np.ndarray
    radii: np.ndarray
    #: Instances in a block.
    unit: int
    #: What chooses single instances of the blocks.
    limits: Any

    def __len__(self):
        return len(self.table)

    def where(self, mask) -> CardBlocks:
        """Return some of the blocks, by a mask or their rows."""
        return replace(self, **{name: getattr(self, name)[mask] for name in _BY_BLOCK})

    @property
    def ranges(self) -> tuple:
        """The spans as the shader reads them."""
        above, side = self.spans
        return above.ranges, side.ranges

    @property
    def cored(self) -> int:
        """The first block that may have a core."""
        (may_have_core,) = (self.sizes > 0.99 * self.core_size).nonzero()  # the shader decides
        return int(may_have_core[0]) if may_have_core.size else self.sizes.size

    def fits(self, sizes, patches) -> np.ndarray:
        """Return which sizes may be drawn, a little generously: the shader decides."""
        above, side = (span.fits(patches, 0.99 * sizes, 1.01 * sizes) for span in self.spans)
        return above | side


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
        self.counts: dict[str, int] = {}
        self._no_cards = dict.fromkeys(self.cards.layers, 0)
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

    def select(self, frame, limits, *, depth=False):
        """Return the blocks that each card shader draws, by its name, where there are any."""
        blocks = self.placement.blocks
        seen = visible_blocks, origins, _, largest, _ = blocks.seen(frame)
        self.visible_blocks, block_count = visible_blocks, visible_blocks.size
        self.cards.view(frame, depth=depth)
        total = {'blocks': block_count, 'of blocks': blocks.reach.size}
        self.counts = total | {'hidden': 0} | self._no_cards | self.near.no_counts
        block_table = np.empty((block_count, 4), np.float32)
        block_table[:, :3], block_table[:, 3] = origins, visible_blocks
        patches: Any = _UNKNOWN
        if self.unit == 1:
            patches = self.patches(frame, limits, visible_blocks, origins.T, largest)
        self.mesh_blocks = block_table[largest >= limits.mesh_from_at[patches]]
        if not limits.drawn_cards or not block_count:
            return {}
        return self._card_blocks(frame, limits, seen, block_table, patches)

    def _card_blocks(self, frame, limits, seen, block_table, patches):
        """Return the blocks of each card shader that draws any."""
        visible_blocks, origins, smallest, largest, depths = seen
        elevations = None
        if self.atlas.turntable is not None and self.unit == 1:
            elevations = self._elevations(frame, visible_blocks, origins)
        radii, choices = self.blocks.bounding_radii[visible_blocks], {}
        extreme_sizes = np.minimum.reduce(smallest), np.maximum.reduce(largest)
        layers = self.cards.layers
        for name, spans in limits.drawn_between(*extreme_sizes):
            if name in layers:
                layer = layers[name]
                in_span = _which_fit(spans, elevations, patches, smallest, largest)
                if in_span.size:
                    choices[name] = CardBlocks(
                        table=block_table[in_span],
                        depths=depths[in_span],
                        sizes=largest[in_span],
                        spans=spans,
                        core_size=layer.core_size,
                        centers=origins[in_span],
                        radii=radii[in_span],
                        unit=self.unit,
                        limits=limits,
                    )
        return self._counted(choices)

    def without_hidden(self, choices, are_behind) -> dict:
        """Return chosen blocks without those behind others, and leave out meshes that are."""
        masks = {name: are_behind(b.centers, b.radii) for name, b in choices.items()}
        hidden_count = sum(mask.sum() * choices[name].unit for name, mask in masks.items())
        self.counts['hidden'] = min(int(hidden_count), len(self))
        origins, blocks = self.mesh_blocks[:, :3].astype(float), self.mesh_blocks[:, 3].astype(int)
        is_behind = are_behind(origins, self.blocks.bounding_radii[blocks])
        self.mesh_blocks = self.mesh_blocks[~is_behind]
        shown = {name: choices[name].where(~mask) for name, mask in masks.items()}
        return self._counted({name: blocks for name, blocks in shown.items() if len(blocks)})

    def _counted(self, choices):
        self.counts |= self._no_cards
        item_count = self.placement.ids.size
        for name, blocks in choices.items():
            count = blocks.depths.size * blocks.unit
            self.counts[name] = count if count < item_count else item_count
        return choices

    def patches(self, frame, limits, slots, centers, sizes):
        """Return the patch of each slot's view direction, -1 where unsure or irrelevant."""
        min_size, max_size = limits.varying
        patches = np.zeros(slots.shape, np.intp) + _UNKNOWN
        if min_size > max_size:
            return patches
        (undecided,) = ((sizes >= min_size) & (sizes < max_size * FADE)).nonzero()
        if undecided.size:
            view = frame.view
            toward = np.array([[0.0], [0.0], [1.0]]) if view.parallel else -centers[:, undecided]
            toward = view.view_from_world[:3, :3].T @ toward
            directions = self.placement.directions(slots[undecided], toward)
            directions = directions / np.maximum(_lengths(directions.T), 1e-30)[:, None]
            cells, cell_margin = octahedral.cells(directions, PATCH_SIDE, self.atlas.half)
            patches[undecided] = np.where(cell_margin > _UNSURE, cells, _UNKNOWN)
        return patches

    def _elevations(self, frame, index, origins):
        """Return sines of the eye's elevation over the horizons of instances' turntables."""
        turntable_axes = np.broadcast_to(self.atlas.turntable.turns.axis, origins.shape)
        poses = self.poses[self.ids[index]]
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
        of_blocks = table, depths, sizes[in_span], centers.T[in_span], self.radii[slots[in_span]]
        return replace(choice, unit=1, **dict(zip(_BY_BLOCK, of_blocks, strict=True)))

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


def _which_fit(spans, elevations, patches, smallest, largest) -> np.ndarray:
    """Return the blocks that may have instances within spans, from above and from the side."""
    above, side = spans
    fits = above.fits(patches, smallest, largest)
    if side is not above:
        fits_side = side.fits(patches, smallest, largest)
        if elevations is not None:  # close to the limit, the shader decides
            fits &= elevations > SIDE_ELEVATION - _UNSURE
            fits_side &= elevations < SIDE_ELEVATION + _UNSURE
        fits |= fits_side
    return fits.nonzero()[0]


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
