"""Images of objects, several views of each, in a pool of tiles, and their errors."""

from __future__ import annotations

import numpy as np

from pvibr.gl.drawer import Drawer
from pvibr.impostors.tile_pool import TilePool
from pvibr.maths.impostors import Card, card_view, displacement, stretch_of

#: Texels of an image for each that the screen needs: room to come nearer.
RESERVE = 1.15
#: An image is drawn again where this many of its texels or more fall on a pixel, along a side.
FINEST = 4.0
_SHAPES: tuple = ((3,), (3,), (3, 3), (2,), (2,), (), ())  # of a card's fields


class Images:
    """The views of n objects."""

    _pool: TilePool  # while `_is_open`
    _is_open = False

    def __init__(self, count, views, drawer: Drawer):
        self.count, self.views = count, views
        total = count * views
        self.card = Card(*(np.zeros((total, *shape)) for shape in _SHAPES))
        self.alive = np.zeros(total, bool)
        self.parallel = np.zeros(total, bool)
        self.texel = np.zeros(total)
        self.planes = np.zeros((total, 2))
        self.tile = np.zeros((total, 3), int)  # corner and side
        self.size = np.zeros((total, 2), int)
        self.used = np.full(total, -1)  # the last frame that showed it
        self.taken = np.full(total, -1)  # the frame that drew it
        self.drawer = drawer

    def grow(self, objects):
        """Have places for more objects, before which others have theirs."""
        at = np.repeat(objects, self.views) * self.views
        self.count += len(objects)
        self.card = Card(*(np.insert(field, at, 0, axis=0) for field in self.card))
        for name in ('alive', 'parallel', 'texel', 'planes', 'tile', 'size'):
            setattr(self, name, np.insert(getattr(self, name), at, 0, axis=0))
        self.used, self.taken = (np.insert(a, at, -1) for a in (self.used, self.taken))

    # -- how wrong they are ----------------------------------------------------------------------

    def errors(self, objects, eyes):
        """Return the best image of each of some objects, and its errors."""
        every = objects[:, None] * self.views + np.arange(self.views)
        flat = every[self.alive[every] & (self.parallel[every] == eyes.parallel)]
        moved = np.full(every.shape, np.inf)
        coarse = np.full(every.shape, np.inf)
        if len(flat):
            place = np.flatnonzero(self.alive[every] & (self.parallel[every] == eyes.parallel))
            card = self.card.rows(flat)
            scale = eyes.pixels(card.center, np.maximum(card.depth, 0.0))
            moved.flat[place] = displacement(card, eyes.eye, eyes.toward) * scale
            away = eyes.away(card.center)
            coarse.flat[place] = self.texel[flat] * scale / away
        worst = np.maximum(moved, coarse)
        best = worst.argmin(axis=1)
        rows = np.arange(len(objects))
        none = ~np.isfinite(worst[rows, best])
        view = np.where(none, -1, every[rows, best])
        return view, moved[rows, best], coarse[rows, best]

    # -- making them -----------------------------------------------------------------------------

    @property
    def pool(self) -> TilePool | None:
        """The tiles on the GPU, None before they are needed."""
        return self._pool if self._is_open else None

    def open(self, frame, area, memory) -> TilePool:
        """Return the pool, created if needed."""
        if not self._is_open:
            self._pool, self._is_open = TilePool(frame.window, area, memory), True
        return self._pool

    def sizes(self, card, eyes, max_error) -> np.ndarray:
        """Return the texels of cards at screen resolution, shape (n, 2), with margins."""
        # As large as they are now, or will be where the image is taken from.
        away = np.minimum(eyes.away(card.center), np.linalg.norm(card.eye, axis=1))
        scale = eyes.pixels(card.center, card.depth) / away
        sides = (card.high - card.low) * scale[:, None]
        return np.ceil(np.minimum(sides * RESERVE / max_error, 1e6)).astype(int) + 2

    def room(self, obj, side, now) -> int | None:
        """Return the index of a new image of an object with a tile, None without room."""
        own = obj * self.views + np.arange(self.views)
        free = own[~self.alive[own]]
        view = int(free[0] if len(free) else own[self.used[own].argmin()])
        if self.alive[view]:
            self.drop([view])
        tiles = self._pool.tiles
        side = tiles.fits(side)
        corner = tiles.take(side)
        while corner is None:
            alive = np.flatnonzero(self.alive & (self.used < now))
            if not len(alive) or side > tiles.side:
                return None
            self.drop([alive[self.used[alive].argmin()]])
            corner = tiles.take(side)
        self.tile[view] = *corner, side
        return view

    def drop(self, views):
        """Forget images and free their tiles."""
        for view in views:
            if self.alive[view]:
                x, y, side = self.tile[view].tolist()
                self._pool.tiles.give((x, y), side)
                self.alive[view] = False

    def drop_objects(self, objects):
        """Forget all images of some objects."""
        self.drop((np.asarray(objects, int)[:, None] * self.views + np.arange(self.views)).ravel())

    def draw(self, view, card, k, size, sources, *, parallel):
        """Draw an image; within ``pool.target.drawing()``."""
        size = np.asarray(size)
        texel = (card.high[k] - card.low[k]) / (size - 2)
        seen = card_view(card, k, texel, parallel=parallel)
        x, y, _ = self.tile[view].tolist()
        self.drawer.look(seen, (x, y, *size.tolist()))
        self.drawer.have_a_light()
        self.drawer.fill((0.0, 0.0, 0.0, 0.0))
        # GL reads columns: the rows of view from world are those of its inverse.
        turned = seen.view_from_world[:3, :3].ravel().tolist()
        for source in sources:
            source.draw(self.drawer.inner, turned, float(texel.min()))
        for mine, made in zip(self.card, card, strict=True):
            mine[view] = made[k]
        self.card.low[view] -= texel
        self.card.high[view] += texel
        self.texel[view], self.size[view] = texel.max(), size
        self.planes[view] = seen.near, seen.far
        self.parallel[view], self.alive[view] = parallel, True

    # -- showing them ----------------------------------------------------------------------------

    def rows(self, frame, views) -> np.ndarray:
        """Return the table of some images, see :meth:`ImpostorCards.show`."""
        card, turn = self.card.rows(views), frame.view_from_world[:3, :3]
        middle = _in_view(frame, card.center)
        right, up, back = (card.axes[:, k] @ turn.T for k in range(3))
        wide, high = (card.high - card.low).T
        parallel = self.parallel[views]
        rows = np.zeros((len(views), 5, 4))
        rows[:, 0, :3] = middle + card.low[:, :1] * right + card.low[:, 1:] * up
        rows[:, 0, 3] = np.where(parallel, self.planes[views].mean(1), card.away)
        rows[:, 1, :3], rows[:, 2, :3] = wide[:, None] * right, high[:, None] * up
        rows[:, 1:3, 3] = self.planes[views]
        rows[:, 3, :3] = np.where(parallel[:, None], -back, middle + card.eye @ turn.T)
        rows[:, 3, 3] = parallel
        rows[:, 4, :2], rows[:, 4, 2:] = self.tile[views, :2], self.size[views]
        return rows

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._pool.nbytes if self._is_open else 0

    def close_pool(self):
        """Forget all images and free the pool; the context is current."""
        if self._is_open:
            self._pool.release()
        self._is_open = False
        self.alive[:] = False

    def release(self):
        """Free GPU memory; the context is current."""
        self.close_pool()
        self.drawer.release()


class Eyes:
    """The camera of a frame, and sizes on its screen."""

    def __init__(self, frame):
        self.frame, self.eye, self.parallel = frame, frame.eye, frame.parallel
        self.up = frame.view_from_world[1, :3]
        self.toward = frame.view_from_world[2, :3] if frame.parallel else None
        clip = frame.clip_from_view
        across = [(1 + abs(clip[k, 2])) / clip[k, k] for k in range(2)]
        self._corner = float(np.hypot(*across))

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


def _in_view(frame, places):
    # Less the eye first: places may be far from the origin.
    return (places - frame.eye) @ frame.view_from_world[:3, :3].T
