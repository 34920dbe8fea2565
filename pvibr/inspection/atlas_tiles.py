"""The atlas or tile pool of a thing, and its tiles in use."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.cards import FADE
from pvibr.maths import octahedral
from pvibr.meshes.turntable import SIDE_ELEVATION

#: Colour of images rendered for this frame.
FLASH = (1.0, 0.0, 1.0)
_SINGLE = ('splat', 'flat', 'parallax')  # shaders that show one view


@runtime_checkable
class ImageTree(Protocol):
    """A thing that draws nodes of a tree as images: an impostor."""

    images: Any
    nodes: Any


class Sheet:
    """The image texture of a thing, and the tiles to outline."""

    def __init__(self, thing, frame):
        if isinstance(thing, ImageTree):
            self._of_pool(thing.images, frame)
        else:
            self._of_atlas(thing.groups[0], frame)

    def _of_atlas(self, group, frame):
        self.texture = group.cards.textures['ibr_albedo']
        width, height = self.texture.size
        # Level 0 fills the left two thirds.
        self.part = (1.0, 1.0) if group.atlas.animated else (2 / 3, 1.0)
        self.ratio = height / (width * self.part[0])
        corners = used_views(group, frame) if not group.atlas.animated else np.zeros((0, 2))
        self.low, self.high = corners / group.atlas.views, (corners + 1) / group.atlas.views
        self.colors = np.tile((255, 255, 255, 255), (len(corners), 1))

    def _of_pool(self, images, frame):
        self.texture, self.part, self.ratio = images.pool.textures['ibr_albedo'], (1.0, 1.0), 1.0
        alive = np.flatnonzero(images.alive)
        tile_rects, pool_side = images.tile[alive], images.pool.side
        self.low = tile_rects[:, :2] / pool_side
        self.high = (tile_rects[:, :2] + tile_rects[:, 2:]) / pool_side
        self.colors = np.tile((128, 128, 128, 255), (len(alive), 1))
        self.colors[images.shown_frame[alive] == frame.index, :3] = 255
        self.colors[images.rendered_frame[alive] == frame.index, :3] = as_bytes(FLASH)


def has_images(thing) -> bool:
    """Return True if there are images to show."""
    if isinstance(thing, ImageTree):
        return thing.images is not None and thing.images.pool is not None
    return bool(thing.groups) and 'ibr_albedo' in thing.groups[0].cards.textures


def as_bytes(color) -> tuple[int, ...]:
    """Return a colour as bytes."""
    return tuple(round(255 * c) for c in color)


def used_views(group, frame) -> np.ndarray:
    """Return the atlas views that the cards of a frame use."""
    slots = group.visible_slots()
    if not len(slots):
        return np.zeros((0, 2), int)
    eye_direction, eye_height, eye_distance = group.toward_eye(slots, frame)
    size = 2 * group.radii[slots] * frame.pixel_scale / eye_distance
    cells = octahedral.cells(eye_direction, PATCH_SIDE, group.atlas.half)[0]
    blends_three = _drawn(group, 'blended', cells, size) | _drawn(group, 'fine', cells, size)
    single_layers = [_drawn(group, name, cells, size) for name in _SINGLE]
    if group.atlas.turntable is not None:
        single_layers = [drawn & (eye_height >= SIDE_ELEVATION) for drawn in single_layers]
        blends_three &= eye_height >= SIDE_ELEVATION
    views = group.atlas.views
    grid = (octahedral.encode(eye_direction, group.atlas.half) * 0.5 + 0.5) * (views - 1)
    nearest_views = np.rint(grid[np.any(single_layers, 0)])
    used_cells = np.concatenate([_blended(grid[blends_three], views), nearest_views])
    is_used = np.zeros((views, views), bool)
    is_used[tuple(used_cells.astype(int).T)] = True
    return np.argwhere(is_used)


def _drawn(group, name, cells, size):
    """Return which instances a shader draws, by the patch they are seen from and their size."""
    least_size, greatest_size = group.cards.layers[name].ranges[cells, :2].T
    return (size >= least_size) & (size < greatest_size * FADE)


def _blended(grid, views):
    """Return the three views around each point of the grid."""
    cell = np.clip(np.floor(grid), 0, views - 2)
    fraction = grid - cell
    in_lower_half = fraction[:, :1] > fraction[:, 1:]
    return np.concatenate([cell, cell + np.where(in_lower_half, (1, 0), (0, 1)), cell + 1])
