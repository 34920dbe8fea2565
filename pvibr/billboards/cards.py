"""Positions, orientation and order of billboards, and ray intersection."""

from __future__ import annotations

import numpy as np

from pvibr.core.frame import Frame
from pvibr.core.params import checked_flag
from pvibr.formats.tables import columns_table
from pvibr.maths.arguments import as_array, check_one_of, checked_lengths, checked_number, naming
from pvibr.maths.blocks import BLOCK, Blocks, morton_order
from pvibr.maths.facing import FACINGS, TOWARDS, azimuths, cards, turned_azimuths
from pvibr.maths.quaternions import from_matrices, multiply
from pvibr.maths.vectors import as_units, unit_vectors
from pvibr.meshes.posed import source_of
from pvibr.scene.draw_order import depths_of
from pvibr.scene.placing import scale_of

ANCHORS = {'center': (0.5, 0.5), 'bottom': (0.5, 0.0), 'top': (0.5, 1.0)}
UNITS = ('world', 'pixel')


class BillboardLayout:
    """Points with a card at each."""

    def __init__(
        self,
        points,
        images,
        size,
        *,
        facing,
        axis,
        towards,
        orientation,
        rotation,
        index,
        size_unit,
        anchor,
        views=1,
        blend_views=False,
        yaw=0.0,
    ):
        self.points = self.own_points = as_points(points)
        check_one_of('facing', facing, FACINGS)
        check_one_of('towards', towards, TOWARDS)
        check_one_of('size_unit', size_unit, UNITS)
        self.facing, self.towards, self.size_unit, self.anchor = facing, towards, size_unit, anchor
        self.views = _checked_views(views, facing, len(images))
        self.blend_views = checked_flag('blend_views', blend_views)
        self._images = images[:: self.views]
        self.yaw = self._own_yaw = _numbers('yaw', yaw, len(self))
        self.given_size = _checked_size(size, len(self))
        self.rotation = _numbers('rotation', rotation, len(self))
        self.turn = self._own_turn = _turn(facing, axis, orientation, len(self))
        self._world: np.ndarray | None = None
        self.own_up = facing == 'spherical' and axis is not None
        self._seer: Frame | None = None  # the camera's last frame
        self.set_index(index)
        self._arrange()

    def __len__(self):
        return len(self.own_points)

    def put(self, world):
        """Place all by a matrix, world from own space; None for the identity."""
        self._world = world
        self._move()
        self.sizes = self._sizes()
        self._arrange()

    def _move(self):
        points, self.turn, self.yaw = self.own_points, self._own_turn, self._own_yaw
        world = self._world
        if world is not None:
            points = points @ world[:3, :3].T + world[:3, 3]
            left, _, right = np.linalg.svd(world[:3, :3])
            if self.facing == 'world':
                self.turn = multiply(from_matrices(left @ right), self.turn)
            elif self.facing == 'cylindrical' or self.own_up:
                self.yaw = self.yaw + turned_azimuths(self.turn[..., :3], left @ right)
                axes = unit_vectors(self.turn[..., :3] @ world[:3, :3].T)
                self.turn = np.concatenate([axes, self.turn[..., 3:]], -1)
        self.points = points

    def _sizes(self):
        sizes = _full_sizes(self.given_size, self._images[self.index])
        if self._world is None or self.size_unit == 'pixel':
            return sizes
        if self.facing != 'cylindrical':
            return sizes * scale_of(self._world)
        up = np.linalg.norm(self._own_turn[..., :3] @ self._world[:3, :3].T, axis=-1)
        across = np.sqrt(scale_of(self._world) ** 3 / up)
        return sizes * np.stack([across, up], -1)

    @property
    def n_images(self) -> int:
        """Number of images, views of one object counted once."""
        return len(self._images)

    def set_index(self, index):
        """Set the image of each."""
        count = self.n_images
        self.index = _checked_index(
            np.arange(len(self)) % count if index is None else index, len(self), count
        )
        self.sizes = self._sizes()

    def resize(self, size):
        """Set the size."""
        self.given_size = _checked_size(size, len(self))
        self.set_index(self.index)
        self._arrange()

    def rotate(self, rotation):
        """Set the rotation in the plane of the card."""
        self.rotation = _numbers('rotation', rotation, len(self))

    def move(self, points):
        """Set the points; their number must not change."""
        points = as_points(points)
        if len(points) != len(self):
            raise ValueError(
                f'points has {len(points)} rows; it must keep its {len(self)} billboards'
            )
        self.own_points = points
        self._move()
        self._arrange()

    def _arrange(self):
        """Sort neighbours into blocks that are culled as one."""
        self.order = morton_order(self.points)
        reach = np.maximum(self.anchor, 1 - self.anchor) * self.sizes
        self.radii = np.hypot(*reach.T) if self.size_unit == 'world' else np.zeros(len(self))
        if len(self):
            self._blocks = Blocks.of(self.points[self.order], self.radii[self.order], BLOCK)
            self.origin = (self.points.min(0) + self.points.max(0)) / 2
        else:
            self.origin = np.zeros(3)

    @property
    def bounds(self) -> np.ndarray:
        """World bounds, shape (6,); if empty (1, -1, 1, -1, 1, -1)."""
        if not len(self):
            return np.array([1.0, -1.0] * 3)
        radii = self.radii[:, None]
        low, high = (self.points - radii).min(0), (self.points + radii).max(0)
        return np.stack([low, high], 1).ravel()

    def reach_bounds(self) -> np.ndarray:
        """Return bounds of the cards for any camera, shape (6,)."""
        if self.size_unit == 'world' or not len(self):
            return self.bounds
        # Cards as large as so many pixels are as large in the world as they are far away.
        length = max(np.ptp(self.points, 0).max(), np.abs(self.origin).max(), 1e-6)
        return self.bounds + np.array([-1e4, 1e4] * 3) * length

    def rows(self) -> np.ndarray:
        """Return the shader's texels, shape (n, 3 or 4, 4), float32, in block order."""
        order = self.order
        local = self.points[order] - self.origin
        each = self.turn.ndim == 2
        out = np.zeros((len(self), 4 if each else 3, 4), np.float32)
        out[:, 0, :3] = local
        out[:, 1, :3] = local - out[:, 0, :3].astype(float)
        out[:, 0, 3] = np.fmod(self.rotation[order], 2 * np.pi)
        out[:, 1, 3] = self.index[order]
        out[:, 2, :2] = self.sizes[order]
        out[:, 2, 2] = np.fmod(self.yaw[order], 2 * np.pi)
        if each:
            out[:, 3] = self.turn[order]
        return out

    def uniforms(self) -> dict:
        """Return the uniforms of all billboards."""
        each = self.turn.ndim == 2
        return {
            'ibr_count': len(self),
            'ibr_texels': 4 if each else 3,
            'ibr_images': self.n_images,
            'ibr_views': self.views,
            'ibr_two_views': int(bool(self.blend_views) and self.views > 1),
            'ibr_facing': FACINGS.index(self.facing),
            'ibr_own_up': int(self.own_up),
            'ibr_plane': int(self.towards == 'plane'),
            'ibr_turn': (1.0, 0.0, 0.0, 0.0) if each else tuple(map(float, self.turn)),
            'ibr_anchor': tuple(map(float, self.anchor)),
        }

    def view_uniforms(self, frame) -> dict:
        """Return the uniforms of a view."""
        eye = -frame.view_from_world[:3, :3].T @ frame.view_from_world[:3, 3] - self.origin
        high = eye.astype(np.float32)
        uniforms = {'ibr_size_scale': 0.0, 'ibr_size_depth': (0.0, 0.0, 0.0, 0.0)}
        if self.size_unit == 'pixel':
            uniforms = self._pixel_uniforms(frame)
        return uniforms | {
            'ibr_eye_high': tuple(map(float, high)),
            'ibr_eye_low': tuple(map(float, eye - high)),
        }

    def _pixel_uniforms(self, frame) -> dict:
        """Return the uniforms of the pixel size: that of the camera, also for a light."""
        if not frame.casting:
            self._seer = frame
        seer = self._seer or frame
        depth = np.zeros(4)
        if frame.casting:
            depth = np.array([0.0, 0, 0, 1]) if seer.parallel else -seer.view_from_world[2]
            depth = np.append(depth[:3], depth[:3] @ self.origin + depth[3])
        return {'ibr_size_scale': self._pixel(seer), 'ibr_size_depth': tuple(depth.tolist())}

    def cast_bounds(self) -> np.ndarray:
        """Return world bounds of the cards in the camera's last frame, shape (6,)."""
        if self.size_unit == 'world' or self._seer is None or not len(self):
            return self.bounds
        reach = np.hypot(*(np.maximum(self.anchor, 1 - self.anchor) * self.sizes).T)
        away = 1.0
        if not self._seer.parallel:
            row = -self._seer.view_from_world[2]
            away = np.maximum(self.points @ row[:3] + row[3], 0.0)
        most = float((reach * away).max()) * self._pixel(self._seer)
        most = 2.0 ** np.ceil(np.log2(most)) if most > 0 else 0.0
        return self.bounds + np.array([-most, most] * 3)

    def seen_as(self) -> tuple:
        """Return a key of the cards' world size, which in pixels depends on the camera."""
        if self.size_unit == 'world' or self._seer is None:
            return ()
        seer = self._seer
        return seer.view_from_world.tobytes(), seer.parallel, self._pixel(seer)

    def _pixel(self, frame) -> float:
        """Return the size of a pixel at distance 1, world units."""
        return frame.scale / frame.pixel_scale

    def chosen(self, frame, fences, *, sort):
        """Return the drawn entries in order, items per entry, and cuts at the fences."""
        if self.size_unit == 'pixel':
            blocks = np.arange(len(self._blocks.centers))
        else:
            blocks = self._blocks.seen(frame)[0][::-1]
        if not sort:
            return blocks, BLOCK, [0, len(blocks)]
        slots = (blocks[:, None] * BLOCK + np.arange(BLOCK)).ravel()
        slots = slots[slots < len(self)]
        depths = self._depths(frame, slots)
        order = np.argsort(-depths, kind='stable')
        cuts = np.searchsorted(-depths[order], -np.asarray(fences, float), side='right')
        return slots[order], 1, [0, *cuts.tolist(), len(slots)]

    def _depths(self, frame, slots):
        points = self.points[self.order[slots]]
        if self.facing == 'screen' or self.towards == 'plane':
            view = frame.view_from_world
            return -(points @ view[2, :3] + view[2, 3])
        return depths_of(frame, points)

    def view_of(self, frame, i) -> int:
        """Return the view that a billboard shows, the nearer one if two are blended."""
        if self.views == 1:
            return 0
        axis = self.turn[i, :3] if self.turn.ndim == 2 else self.turn[:3]
        view, parallel = frame.view_from_world, frame.parallel or self.towards == 'plane'
        (azimuth,) = azimuths(self.points[i], view, axis, parallel=parallel)
        return int(np.rint((azimuth - self.yaw[i]) / (2 * np.pi) * self.views)) % self.views

    def placed(self, frame, near) -> tuple[np.ndarray, np.ndarray]:
        """Return axes, (k, 3, 3), and widths and heights, (k, 2), of some rows."""
        turn = self.turn[near] if self.turn.ndim == 2 else self.turn
        axes = cards(
            self.points[near],
            frame.view_from_world,
            self.facing,
            towards=self.towards,
            axis=turn[..., :3] if self.facing == 'cylindrical' or self.own_up else None,
            orientation=turn if self.facing == 'world' else None,
            rotation=self.rotation[near],
            parallel=frame.parallel,
        )
        sizes = self.sizes[near]
        if self.size_unit == 'pixel':
            z = self.points[near] @ frame.view_from_world[2, :3] + frame.view_from_world[2, 3]
            sizes = sizes * self._pixel(frame) * (1.0 if frame.parallel else -z[:, None])
        return axes, sizes

    def met(self, frame, start, direction) -> list:
        """Return the billboards whose rectangles a ray hits, nearest first."""
        near = np.arange(len(self))
        if self.size_unit == 'world':
            away = self.points - start
            along = np.maximum(away @ direction, 0)
            gaps = np.linalg.norm(away - along[:, None] * direction, axis=1)
            near = np.flatnonzero(gaps <= self.radii)
        axes, sizes = self.placed(frame, near)
        right, up, normal = np.moveaxis(axes, 2, 0)
        away = self.points[near] - start
        with np.errstate(divide='ignore', invalid='ignore'):
            distances = (away * normal).sum(1) / (normal @ direction)
            off = distances[:, None] * direction - away
            uv = np.stack([(off * right).sum(1), (off * up).sum(1)], 1) / sizes + self.anchor
            hit = (distances >= 0) & (uv >= 0).all(1) & (uv <= 1).all(1)
        found = np.flatnonzero(hit)
        found = found[np.argsort(distances[found])]
        return [(int(near[k]), float(distances[k]), uv[k]) for k in found]


def as_points(points, name='points') -> np.ndarray:
    """Return points as a checked float64 array."""
    if columns_table(points) is not None:
        points = source_of(points, argument=name, oriented=False).poses
    array = _floats(name, getattr(points, 'points', points))
    if array.shape not in ((0,), (3,)) and array.shape[1:] != (3,):
        raise ValueError(f'{name} has shape {array.shape}; it must be (n, 3)')
    array = array.reshape(-1, 3)
    bad = np.flatnonzero(~np.isfinite(array).all(1))
    if len(bad):
        raise ValueError(
            f'{name}[{bad[0]}] is {array[bad[0]].tolist()}; it must be finite ({len(bad)} such)'
        )
    return array


def _floats(name, values) -> np.ndarray:
    try:
        return as_array(name, values, float)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} must be numbers, not {values!r}') from error


def as_anchor(anchor) -> np.ndarray:
    """Return the position of the point on the card."""
    named = isinstance(anchor, str)
    values = ANCHORS.get(anchor) if named else anchor
    values = as_array('anchor', () if values is None else values)
    if values.shape != (2,) or values.dtype.kind not in 'iuf' or not np.isfinite(values).all():
        raise ValueError(
            f'anchor is {anchor!r}; it must be one of {", ".join(ANCHORS)} or two shares'
        )
    return np.asarray(values, float)


def checked_cutout(cutout):
    """Return a checked alpha threshold, or None."""
    if cutout is not None and not 0 < checked_number('cutout', cutout) <= 1:
        raise ValueError(
            f'cutout is {cutout!r}; it must be above 0 and at most 1, or None to blend'
        )
    return cutout


def checked_opacity(opacity, count, cut) -> np.ndarray:
    """Return the opacity of all, shape (), or of each, shape (n,)."""
    values = _floats('opacity', opacity)
    if values.shape not in ((), (count,)) or not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f'opacity must be one number or {count}, from 0 to 1')
    if values.ndim and cut:
        raise ValueError('opacity of each needs cutout=None: cut-outs are there or not')
    return values


def _numbers(name, values, count):
    array = _floats(name, values)
    if array.shape not in ((), (count,)) or not np.isfinite(array).all():
        raise ValueError(f'{name} must be one finite number or {count}')
    return np.broadcast_to(array, (count,))


def _checked_views(views, facing, images):
    if isinstance(views, bool) or not isinstance(views, int | np.integer) or views < 1:
        raise ValueError(f'views is {views!r}; it must be 1 or more')
    if views > 1 and facing != 'cylindrical':
        raise ValueError(
            f"views are about the axis of cards with facing='cylindrical', not {facing!r}"
        )
    if images % views:
        raise ValueError(f'views is {views}; it must divide the {images} images')
    return int(views)


def _checked_size(size, count):
    array = _floats('size', size)
    if array.shape not in ((), (count,), (count, 2), (1, 2)):
        raise ValueError(
            f'size has shape {array.shape}; it must be one number, ({count},), ({count}, 2) or '
            '(1, 2)'
        )
    return checked_lengths('size', array)


def _full_sizes(size, images):
    """Return width and height of each; a height alone keeps the image's proportions."""
    if size.ndim == 2:
        return np.broadcast_to(size, (len(images), 2))
    heights = np.broadcast_to(size, (len(images),))
    return np.stack([heights * images[:, 0] / images[:, 1], heights], 1)


def _turn(facing, axis, orientation, count):
    """Return the common axis or quaternion, shape (4,), or one each, shape (n, 4)."""
    if facing != 'world' and orientation is not None:
        raise ValueError(
            f"orientation is of cards with facing='world', not {facing!r}; give axis or rotation"
        )
    if facing in ('world', 'screen') and axis is not None:
        raise ValueError(
            f"axis is of cards with facing='cylindrical' or 'spherical', not {facing!r}"
        )
    if facing == 'world':
        turn = as_units('orientation', (1.0, 0, 0, 0) if orientation is None else orientation)
        return _of_shape('orientation', turn, 4, count)
    axis = _floats('axis', (0.0, 0, 1) if axis is None else axis)
    with naming('axis', axis):
        given = as_units('axis', axis)
    given = _of_shape('axis', given, 3, count)
    return np.concatenate([given, np.zeros((*given.shape[:-1], 1))], -1)


def _of_shape(name, array, width, count):
    if array.shape not in ((width,), (count, width)):
        raise ValueError(
            f'{name} has shape {array.shape}; it must be ({width},) or ({count}, {width})'
        )
    return array


def _checked_index(index, count, images):
    array = as_array('index', index)
    if array.shape not in ((), (count,)) or array.dtype.kind not in 'iu':
        raise ValueError(
            f'index has shape {array.shape}, dtype {array.dtype}; it must be ({count},) integers'
        )
    if ((array < 0) | (array >= images)).any():
        raise ValueError(
            f'index is {int(array.min())} to {int(array.max())}; there are {images} images'
        )
    return np.broadcast_to(array, (count,))
