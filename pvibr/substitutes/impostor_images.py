"""Images of objects, several per object, in a pool of tiles, and their errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.core.passes import supersampling_of
from pvibr.gl import Target, texture_limit
from pvibr.gl.drawer import Drawer
from pvibr.substitutes.impostor_limits import LARGEST, LAYERS, Plan, plan, room
from pvibr.substitutes.impostor_maths import Card, card_view, displacement, stretch_of

_VIEW_FIELDS = (
    *('alive', 'is_cut', 'parallel', 'texel', 'drawn_px', 'opacity'),
    *('rows', 'planes', 'tile', 'size'),
)
# Distances of layers from the middle, in shares of the extent.
_NEARNESS = -1.0, -0.5, 0.5, 1.0
# Layers of translucent surfaces, the first ones first: faces, and whether the last of these.
_LAYERS = ('front', False), ('back', False), ('front', True), ('back', True)
_SHAPES: tuple = ((3,), (3,), (3, 3), (2,), (2,), (), ())  # of a card's fields


class Images:
    """Images of n objects, `views` each."""

    _pool: TilePool  # while `_is_open`
    _is_open = False
    _largest_side, _room = 0, 1.0

    def __init__(self, count, views, drawer: Drawer):
        self.count, self.views = count, views
        view_count = count * views
        self.card = Card(*(np.zeros((view_count, *shape)) for shape in _SHAPES))
        self.alive = np.zeros(view_count, bool)
        self.is_cut = np.zeros(view_count, bool)
        self.cut_objects = np.zeros(count, bool)  # of which whole images wait
        self.parallel = np.zeros(view_count, bool)
        self.texel = np.zeros(view_count)
        self.opacity = np.ones(view_count)
        self.rows = np.ones(view_count, int)  # rows and columns of layers
        self.drawn_px = np.zeros(view_count)  # drawn pixels per texel when rendered
        self.planes = np.zeros((view_count, 2))
        self.tile = np.zeros((view_count, 3), int)  # corner and side
        self.size = np.zeros((view_count, 2), int)
        self.shown_frame = np.full(view_count, -1)  # last frame that showed it
        self.rendered_frame = np.full(view_count, -1)  # frame that rendered it
        self.drawer = drawer

    def grow(self, objects):
        """Insert places for new objects before the given ones."""
        insert_at = np.repeat(objects, self.views) * self.views
        self.count += len(objects)
        self.cut_objects = np.insert(self.cut_objects, objects, False)
        self.card = Card(*(np.insert(field, insert_at, 0, axis=0) for field in self.card))
        for name in _VIEW_FIELDS:
            setattr(self, name, np.insert(getattr(self, name), insert_at, 0, axis=0))
        self.shown_frame, self.rendered_frame = (
            np.insert(a, insert_at, -1) for a in (self.shown_frame, self.rendered_frame)
        )

    @property
    def current(self) -> np.ndarray:
        """Which images show an object as cut as it is now."""
        return self.alive & (self.is_cut == np.repeat(self.cut_objects, self.views))

    @property
    def has_current(self) -> np.ndarray:
        """Which objects have any such image."""
        return np.any(self.current.reshape(self.count, -1), axis=1)

    @property
    def largest(self) -> int:
        """The largest side of an image in texels."""
        return min(LARGEST, self._pool.largest) if self._is_open else LARGEST

    # -- errors ----------------------------------------------------------------------------------

    def errors(self, objects, eyes, limits):
        """Return each object's best image, -1 if none, its displacement and texel size in px."""
        view_ids = objects[:, None] * self.views + np.arange(self.views)
        usable = self.current[view_ids] & (self.parallel[view_ids] == eyes.parallel)
        errors = np.full((2, *view_ids.shape), np.inf)  # displacement, texel size
        if usable.any():
            card = self.card.rows(view_ids[usable])
            px_per_radian = eyes.pixels(card.center, np.maximum(card.depth, 0.0))
            errors[0, usable] = displacement(card, eyes.eye, eyes.toward) * px_per_radian
            texel_angle = self.texel[view_ids[usable]] / eyes.away(card.center)
            errors[1, usable] = texel_angle * px_per_radian
            drawn_px = eyes.supersampling * errors[1, usable]
            growth = np.abs(drawn_px / self.drawn_px[view_ids[usable]] - 1)
            image_limits = limits.rows(np.nonzero(usable)[0])
            errors[0, usable] += image_limits.widened(growth)
        excess = limits.rows((slice(None), None)).excess(*errors)
        best = np.arange(len(objects)), excess.argmin(axis=1)
        displaced, texel_px = errors[:, best[0], best[1]]
        has_image = np.isfinite(np.maximum(displaced, texel_px))
        return np.where(has_image, view_ids[best], -1), displaced, texel_px

    # -- rendering -------------------------------------------------------------------------------

    @property
    def pool(self) -> TilePool | None:
        """The tiles on the GPU; None before the first image."""
        return self._pool if self._is_open else None

    def open(self, window, area, *, grow, tinted) -> TilePool:
        """Return the pool, created on first use, and again for edges that are tinted.

        A larger one is made if it has to grow.
        """
        if self._is_open:
            may_grow = grow and self._pool.side < self._pool.largest
            if may_grow or (tinted and not self._pool.tinted):
                self.close_pool()
        if not self._is_open:
            self._pool = TilePool(window, area, self._largest_side, tinted)
            self._is_open = True
        return self._pool

    def fit(self, window, memory, card_areas, limits):
        """Choose how fine new images are, given the cards of this frame, areas in pixels."""
        self._largest_side = largest_side(window, memory)
        self._room = room(self._largest_side**2, card_areas, limits)

    def plan(self, card, eyes, limits) -> Plan:
        """Return the sizes of new images."""
        # The larger of the sizes seen now and from the image's own eye.
        eye_distance = np.minimum(eyes.away(card.center), np.linalg.norm(card.eye, axis=1))
        pixels_per_unit = eyes.pixels(card.center, card.depth) / eye_distance
        return plan((card.high - card.low) * pixels_per_unit[:, None], limits, self._room)

    def reserve(self, obj, side, frame_index) -> int | None:
        """Return the index of a new image with a tile, None if the pool is full."""
        own_views = obj * self.views + np.arange(self.views)
        free_views = own_views[~self.alive[own_views]]
        oldest_view = own_views[self.shown_frame[own_views].argmin()]
        view = int(free_views[0] if len(free_views) else oldest_view)
        if self.alive[view]:
            self.drop([view])
        tiles = self._pool.tiles
        side = tiles.fits(side)
        corner = tiles.take(side)
        while corner is None:
            older_views = np.flatnonzero(self.alive & (self.shown_frame < frame_index))
            if not len(older_views) or side > tiles.side:
                return None
            self.drop([older_views[self.shown_frame[older_views].argmin()]])
            corner = tiles.take(side)
        self.tile[view] = *corner, side
        return view

    def drop(self, views):
        """Discard images and free their tiles."""
        for view in views:
            if self.alive[view]:
                x, y, side = self.tile[view].tolist()
                self._pool.tiles.give((x, y), side)
                self.alive[view] = False

    def drop_objects(self, objects):
        """Discard all images of some objects."""
        self.drop((np.asarray(objects, int)[:, None] * self.views + np.arange(self.views)).ravel())

    def follow_planes(self, changed_objects, is_cut):
        """Discard the images that other planes cut; whole ones serve again once none cuts."""
        view_ids = changed_objects[:, None] * self.views + np.arange(self.views)
        self.drop(view_ids[self.is_cut[view_ids]])
        self.cut_objects[: len(is_cut)] = is_cut
        self.cut_objects[len(is_cut) :] = True  # nodes, which planes rid of leaves

    def draw(self, view, card, index, plan, sources, eyes):
        """Render an image, within ``pool.target.drawing()``."""
        image_size, margin = plan.size[index], plan.margin[index]
        texel_size = (card.high[index] - card.low[index]) / (image_size - 2 * margin)
        image_view = card_view(card, index, margin * texel_size, parallel=eyes.parallel)
        center = card.center[index : index + 1]
        texels_per_px = eyes.away(center) / (eyes.mean_pixels(center) * texel_size.mean())
        texels_per_px /= eyes.supersampling  # which has thinner lines
        scales = float(texel_size.min()), float(texels_per_px[0])
        layers = _LAYERS if plan.rows[index] > 1 else [(None, False)]
        for layer, (faces, is_last) in enumerate(layers):
            x, y = self.tile[view, :2] + image_size * (layer % 2, layer // 2)
            self.drawer.look(image_view, (int(x), int(y), *image_size.tolist()))
            self.drawer.have_a_light()
            self.drawer.fill((0.0, 0.0, 0.0, 0.0))
            # GL reads columns, so the rows of view from world give its transpose.
            world_from_view = image_view.view_from_world[:3, :3].ravel().tolist()
            with self.drawer.farthest(is_last):
                for source in sources:
                    source.draw(self.drawer.inner, world_from_view, *scales, faces)
        self.opacity[view], self.rows[view] = sources[0].opacity, plan.rows[index]
        for field, new_field in zip(self.card, card, strict=True):
            field[view] = new_field[index]
        self.card.low[view] -= margin * texel_size
        self.card.high[view] += margin * texel_size
        self.texel[view], self.size[view] = texel_size.max(), image_size
        texel_angle = self.texel[view] / eyes.away(center)
        px_per_radian = eyes.pixels(center, np.maximum(card.depth[index], 0.0))
        self.drawn_px[view] = eyes.supersampling * (texel_angle * px_per_radian)[0]
        self.planes[view] = image_view.near, image_view.far
        self.parallel[view], self.alive[view] = eyes.parallel, True
        self.is_cut[view] = self.cut_objects[view // self.views]

    # -- drawing ---------------------------------------------------------------------------------

    def card_rows(self, frame, views) -> CardRows:
        """Return the texels of some images for :meth:`ImpostorCards.show`."""
        card, view_rotation = self.card.rows(views), frame.view_from_world[:3, :3]
        card_center = _in_view(frame, card.center)
        right, up, back = (card.axes[:, k] @ view_rotation.T for k in range(3))
        card_width, card_height = (card.high - card.low).T
        is_parallel = self.parallel[views]
        table = np.zeros((len(views), 5, 4))
        table[:, 0, :3] = card_center + card.low[:, :1] * right + card.low[:, 1:] * up
        table[:, 0, 3] = np.where(is_parallel, self.planes[views].mean(1), card.away)
        table[:, 1, :3], table[:, 2, :3] = card_width[:, None] * right, card_height[:, None] * up
        table[:, 1:3, 3] = self.planes[views]
        image_eye = card_center + card.eye @ view_rotation.T
        table[:, 3, :3] = np.where(is_parallel[:, None], -back, image_eye)
        table[:, 3, 3] = is_parallel
        table[:, 4, :2], table[:, 4, 2:] = self.tile[views, :2], self.size[views]
        is_clear = self.rows[views] > 1
        clear = self._layer_rows(table[is_clear], views[is_clear], card_center[is_clear])
        return CardRows(table[~is_clear], clear)

    def _layer_rows(self, table, views, card_center):
        """Return the texels of all layers of some images, from back to front."""
        layer = np.tile(np.arange(LAYERS), len(views))
        rows = np.pad(np.repeat(table, LAYERS, axis=0), ((0, 0), (0, 1), (0, 0)))
        shift = np.repeat(self.size[views], LAYERS, axis=0)
        shift *= np.stack([layer % 2, layer // 2], 1)
        rows[:, 4, :2] += shift
        rows[:, 5, 0] = np.repeat(self.opacity[views], LAYERS)
        # Where the first layer of the same faces is: what both show counts once.
        rows[:, 5, 1] = np.where(layer >= 2, shift[:, 1], 0)
        away = -card_center[:, 2]
        extent = np.repeat(self.card.depth[views], LAYERS)
        order = np.repeat(away, LAYERS) + extent * np.array(_NEARNESS)[layer]
        return rows[np.argsort(-order, kind='stable')]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._pool.target.nbytes if self._is_open else 0

    def close_pool(self):
        """Discard all images and free the pool; the context is current."""
        if self._is_open:
            self._pool.target.release()
        self._is_open = False
        self.alive[:] = False

    def release(self):
        """Free GPU memory; the context is current."""
        self.close_pool()
        self.drawer.release()


class CardRows(NamedTuple):
    """Texels of the cards of opaque images, and of the layers of translucent ones in order."""

    opaque: np.ndarray  # (n, 5, 4)
    clear: np.ndarray  # (n, 6, 4)


class Eyes:
    """The camera of a frame, and projected sizes."""

    def __init__(self, frame):
        self.frame, self.eye, self.parallel = frame, frame.eye, frame.parallel
        self.up = frame.view_from_world[1, :3]
        self.supersampling = supersampling_of(frame.renderer)
        self.toward = frame.view_from_world[2, :3] if frame.parallel else None
        clip = frame.clip_from_view
        half_widths = [(1 + abs(clip[k, 2])) / clip[k, k] for k in range(2)]
        self._corner = float(np.hypot(*half_widths))

    def away(self, places) -> np.ndarray:
        """Return the distances of points, 1 in a parallel view."""
        if self.parallel:
            return np.ones(len(places))
        return np.linalg.norm(places - self.eye, axis=1)

    def pixels(self, places, radius) -> np.ndarray:
        """Return pixels per radian at points; in a parallel view, per world unit."""
        scale = self.frame.pixel_scale
        if self.parallel:
            return np.full(len(places), scale)
        return scale * stretch_of(_in_view(self.frame, places), radius, self._corner)

    def mean_pixels(self, places) -> np.ndarray:
        """Return the same as the mean over directions, at the points alone."""
        scale = self.frame.pixel_scale
        # The magnification is 1 + t^2 away from the screen's middle, and its root across.
        return scale * (self.pixels(places, 0.0) / scale) ** 0.75


def _in_view(frame, places):
    # Subtract the eye first for precision far from the origin.
    return (places - frame.eye) @ frame.view_from_world[:3, :3].T


# Colour and coverage, normal and material, unlit colour of edges; depth beside them.
_SAMPLERS = 'ibr_albedo', 'ibr_shape', 'ibr_tint'
TEXEL_BYTES = 16


class Tiles:
    """A buddy allocator of squares in a larger one."""

    def __init__(self, side, smallest_side=8):
        self.side, self.smallest_side = side, smallest_side
        self._free: dict[int, set] = {side: {(0, 0)}}

    def fits(self, size) -> int:
        """Return the side of the tile that holds an image."""
        return max(self.smallest_side, 1 << (int(size) - 1).bit_length())

    def take(self, side) -> tuple[int, int] | None:
        """Take a free tile; return its corner, None if there is none."""
        free_side = side
        while not self._free.get(free_side):
            free_side *= 2
            if free_side > self.side:
                return None
        x, y = min(self._free[free_side])
        self._free[free_side].remove((x, y))
        while free_side > side:
            free_side //= 2
            other_quarters = {
                (x + free_side, y),
                (x, y + free_side),
                (x + free_side, y + free_side),
            }
            self._free.setdefault(free_side, set()).update(other_quarters)
        return x, y

    def give(self, corner, side):
        """Free a tile and merge it with its free buddies."""
        while side < self.side:
            x, y = (c // (2 * side) * 2 * side for c in corner)
            buddies = {(x + i * side, y + j * side) for i in (0, 1) for j in (0, 1)} - {corner}
            free = self._free.setdefault(side, set())
            if not buddies <= free:
                break
            free -= buddies
            corner, side = (x, y), 2 * side
        self._free.setdefault(side, set()).add(corner)


def largest_side(window, memory) -> int:
    """Return the largest side of a pool, a power of two."""
    affordable_side = int(min((memory / TEXEL_BYTES) ** 0.5, texture_limit(window)))
    return max(8, 1 << (affordable_side.bit_length() - 1))


class TilePool:
    """Tiles on the GPU, limited by memory."""

    def __init__(self, window, area, largest, tinted):
        self.tinted, self.largest = tinted, largest
        side = 256
        while side < self.largest and side * side < 2 * area:
            side *= 2
        self.side = min(side, self.largest)
        self.tiles = Tiles(self.side)
        formats = ('rgba8',) * (2 + tinted)
        self.target = Target(window, self.side, self.side, formats, depth=True)

    @property
    def textures(self) -> dict:
        """Textures by sampler name."""
        colors = dict(zip(_SAMPLERS, self.target.colors, strict=False))
        return colors | {'ibr_depth': self.target.depth}
