"""Positions, orientation and order of billboards, and ray intersection."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.core.arguments import as_array, check_one_of, checked_lengths, checked_number, naming
from pvibr.core.nan_rows import filled
from pvibr.core.params import checked_flag
from pvibr.maths.blocks import BLOCK, Blocks, morton_order
from pvibr.maths.facing import FACINGS, TOWARDS, azimuths, cards, turned_azimuths
from pvibr.maths.quaternions import from_matrices, multiply
from pvibr.maths.vectors import as_units, unit_vectors
from pvibr.points.point_arguments import as_floats, as_points
from pvibr.things.draw_order import depths_of
from pvibr.things.frame import Frame
from pvibr.things.placing import scale_of

ANCHORS = {'center': (0.5, 0.5), 'bottom': (0.5, 0.0), 'top': (0.5, 1.0)}
UNITS = ('world', 'pixel')
#: Corners of cards in shares of width and height.
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


class Neighbours(NamedTuple):
    """Cards in the order of blocks of neighbours, which are culled together."""

    points: np.ndarray
    radii: np.ndarray
    order: np.ndarray
    blocks: Blocks

    @classmethod
    def of(cls, points, radii):
        """Return points with reaches, sorted along a curve."""
        order = morton_order(points)
        return cls(points, radii, order, Blocks.of(points[order], radii[order], BLOCK))

    def are(self, points, radii) -> bool:
        """Return True if these are points with these reaches."""
        return np.array_equal(self.points, points) and np.array_equal(self.radii, radii)


class BillboardLayout:
    """Cards at points: size, orientation and order."""

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
        nan_rows=None,
        neighbours=None,
    ):
        self.points = self.own_points = as_points('points', points, nan_rows)
        check_one_of('facing', facing, FACINGS)
        check_one_of('towards', towards, TOWARDS)
        check_one_of('size_unit', size_unit, UNITS)
        self.facing, self.towards, self.size_unit = facing, towards, size_unit
        self.anchor = _as_anchor(anchor)
        self.views = _checked_views(views, facing, len(images))
        self.blend_views = checked_flag('blend_views', blend_views)
        self._images = images[:: self.views]
        self.yaw = self._own_yaw = _numbers('yaw', yaw, len(self), nan_rows)
        self.size = _checked_size(size, len(self), nan_rows)
        self.rotation = _numbers('rotation', rotation, len(self), nan_rows)
        self.turn = self._own_turn = _turn(facing, axis, orientation, len(self), nan_rows)
        self._world: np.ndarray | None = None
        self.own_up = facing == 'spherical' and axis is not None
        self._camera_frame: Frame | None = None  # the camera's last frame, for sizes in pixels
        if index is None:
            index = np.arange(len(self)) % self.n_images
        self.index = _checked_index(index, len(self), self.n_images)
        #: Cards in blocks, of this layout or of one before.
        self.neighbours: Neighbours | None = neighbours
        self._measure()

    def __len__(self):
        return len(self.own_points)

    def place(self, world):
        """Set the matrix from local to world space; None for the identity."""
        self._world = world
        self._move()
        self._measure()

    def _move(self):
        points, self.turn, self.yaw = self.own_points, self._own_turn, self._own_yaw
        world = self._world
        if world is not None:
            points = points @ world[:3, :3].T + world[:3, 3]
            left_vectors, _, right_vectors = np.linalg.svd(world[:3, :3])
            rotation = left_vectors @ right_vectors
            if self.facing == 'world':
                self.turn = multiply(from_matrices(rotation), self.turn)
            elif self.facing == 'cylindrical' or self.own_up:
                self.yaw = self.yaw + turned_azimuths(self.turn[..., :3], rotation)
                axes = unit_vectors(self.turn[..., :3] @ world[:3, :3].T)
                self.turn = np.concatenate([axes, self.turn[..., 3:]], -1)
        self.points = points

    def _sizes(self):
        sizes = _full_sizes(self.size, self._images[self.index])
        if self._world is None or self.size_unit == 'pixel':
            return sizes
        if self.facing != 'cylindrical':
            return sizes * scale_of(self._world)
        up_scale = np.linalg.norm(self._own_turn[..., :3] @ self._world[:3, :3].T, axis=-1)
        width_scale = np.sqrt(scale_of(self._world) ** 3 / up_scale)
        return sizes * np.stack([width_scale, up_scale], -1)

    @property
    def n_images(self) -> int:
        """Number of images; views of one object count once."""
        return len(self._images)

    def _measure(self):
        """Adopt the sizes and reach of cards."""
        self.sizes, self._is_sorted = self._sizes(), False
        card_reach = np.maximum(self.anchor, 1 - self.anchor) * self.sizes
        self.radii = np.hypot(*card_reach.T) if self.size_unit == 'world' else np.zeros(len(self))
        self.origin = np.zeros(3)
        if len(self):
            self.origin = (self.points.min(0) + self.points.max(0)) / 2

    def _sorted(self) -> Neighbours:
        """Return the cards in blocks, as before if they have neither moved nor grown."""
        neighbours = self.neighbours
        if not self._is_sorted or neighbours is None:
            if neighbours is None or not neighbours.are(self.points, self.radii):
                neighbours = self.neighbours = Neighbours.of(self.points, self.radii)
            self._is_sorted = True
        return neighbours

    @property
    def order(self) -> np.ndarray:
        """Order of the cards on the GPU, neighbours together, shape (n,)."""
        return self._sorted().order

    @property
    def _blocks(self) -> Blocks:
        return self._sorted().blocks

    @property
    def bounds(self) -> np.ndarray:
        """World bounds, shape (6,), inverted if empty."""
        if not len(self):
            return np.array([1.0, -1.0] * 3)
        radii = self.radii[:, None]
        low, high = (self.points - radii).min(0), (self.points + radii).max(0)
        return np.stack([low, high], 1).ravel()

    def reach_bounds(self) -> np.ndarray:
        """Return bounds of the cards for any camera, shape (6,)."""
        if self.size_unit == 'world' or not len(self):
            return self.bounds
        # The world size of cards in pixels grows with their distance.
        scene_length = max(np.ptp(self.points, 0).max(), np.abs(self.origin).max(), 1e-6)
        return self.bounds + np.array([-1e4, 1e4] * 3) * scene_length

    def texels(self) -> np.ndarray:
        """Return the shader's texels in block order, shape (n, 3 or 4, 4), float32."""
        order = self.order
        local_points = self.points[order] - self.origin
        has_own_turn = self.turn.ndim == 2
        texels = np.zeros((len(self), 4 if has_own_turn else 3, 4), np.float32)
        texels[:, 0, :3] = local_points
        texels[:, 1, :3] = local_points - texels[:, 0, :3].astype(float)
        texels[:, 0, 3] = np.fmod(self.rotation[order], 2 * np.pi)
        texels[:, 1, 3] = self.index[order]
        texels[:, 2, :2] = self.sizes[order]
        texels[:, 2, 2] = np.fmod(self.yaw[order], 2 * np.pi)
        if has_own_turn:
            texels[:, 3] = self.turn[order]
        return texels

    def uniforms(self) -> dict:
        """Return the uniforms of all billboards."""
        has_own_turn = self.turn.ndim == 2
        return {
            'ibr_count': len(self),
            'ibr_texels': 4 if has_own_turn else 3,
            'ibr_images': self.n_images,
            'ibr_views': self.views,
            'ibr_two_views': int(bool(self.blend_views) and self.views > 1),
            'ibr_facing': FACINGS.index(self.facing),
            'ibr_own_up': int(self.own_up),
            'ibr_plane': int(self.towards == 'plane'),
            'ibr_turn': (1.0, 0.0, 0.0, 0.0) if has_own_turn else tuple(map(float, self.turn)),
            'ibr_anchor': tuple(map(float, self.anchor)),
        }

    def view_uniforms(self, frame) -> dict:
        """Return the uniforms of a view."""
        eye = -frame.view_from_world[:3, :3].T @ frame.view_from_world[:3, 3] - self.origin
        eye_high = eye.astype(np.float32)
        uniforms = {'ibr_size_scale': 0.0, 'ibr_size_depth': (0.0, 0.0, 0.0, 0.0)}
        if self.size_unit == 'pixel':
            uniforms = self._pixel_uniforms(frame)
        return uniforms | {
            'ibr_eye_high': tuple(map(float, eye_high)),
            'ibr_eye_low': tuple(map(float, eye - eye_high)),
        }

    def _pixel_uniforms(self, frame) -> dict:
        """Return the uniforms of sizes in pixels of the camera, also when a light draws."""
        if not frame.casting:
            self._camera_frame = frame
        camera_frame = self._camera_frame or frame
        depth_plane = np.zeros(4)
        if frame.casting:
            axis = -camera_frame.view_from_world[2]
            depth_plane = np.array([0.0, 0, 0, 1]) if camera_frame.parallel else axis
            depth_plane[3] += depth_plane[:3] @ self.origin
        return {
            'ibr_size_scale': self._pixel(camera_frame),
            'ibr_size_depth': tuple(depth_plane.tolist()),
        }

    def cast_bounds(self) -> np.ndarray:
        """Return world bounds of shadow casters in the camera's last frame, shape (6,)."""
        if self.size_unit == 'world' or self._camera_frame is None or not len(self):
            return self.bounds
        card_reach = np.hypot(*(np.maximum(self.anchor, 1 - self.anchor) * self.sizes).T)
        eye_depth = 1.0
        if not self._camera_frame.parallel:
            view_axis = -self._camera_frame.view_from_world[2]
            eye_depth = np.maximum(self.points @ view_axis[:3] + view_axis[3], 0.0)
        greatest_reach = float((card_reach * eye_depth).max()) * self._pixel(self._camera_frame)
        greatest_reach = 2.0 ** np.ceil(np.log2(greatest_reach)) if greatest_reach > 0 else 0.0
        return self.bounds + np.array([-greatest_reach, greatest_reach] * 3)

    def size_key(self) -> tuple:
        """Return a key of the cards' world size, which depends on the camera for pixels."""
        if self.size_unit == 'world' or self._camera_frame is None:
            return ()
        camera_frame = self._camera_frame
        view = camera_frame.view_from_world.tobytes()
        return view, camera_frame.parallel, self._pixel(camera_frame)

    def _pixel(self, frame) -> float:
        """Return the size of a pixel at distance 1, world units."""
        return frame.scale / frame.pixel_scale

    def entries_in_view(self, frame, fence_depths, *, sort):
        """Return the entries in view in order, items per entry, and cuts at depths."""
        if self.size_unit == 'pixel':
            blocks = np.arange(len(self._blocks.centers))
        else:
            blocks = self._blocks.seen(frame)[0][::-1]
        if not sort:
            return blocks, BLOCK, [0, len(blocks)]
        slots = (blocks[:, None] * BLOCK + np.arange(BLOCK)).ravel()
        slots = slots[slots < len(self)]
        depths = self._depths(frame, slots)
        far_to_near = np.argsort(-depths, kind='stable')
        depths, fences = depths[far_to_near], np.asarray(fence_depths, float)
        cuts = np.searchsorted(-depths, -fences, side='right')
        return slots[far_to_near], 1, [0, *cuts.tolist(), len(slots)]

    def _depths(self, frame, slots):
        points = self.points[self.order[slots]]
        if self.facing == 'screen' or self.towards == 'plane':
            view = frame.view_from_world
            return -(points @ view[2, :3] + view[2, 3])
        return depths_of(frame, points)

    def view_of(self, frame, i) -> int:
        """Return the view that a card shows, the nearer of two blended ones."""
        if self.views == 1:
            return 0
        axis = self.turn[i, :3] if self.turn.ndim == 2 else self.turn[:3]
        view, is_parallel = frame.view_from_world, frame.parallel or self.towards == 'plane'
        (azimuth,) = azimuths(self.points[i], view, axis, parallel=is_parallel)
        return int(np.rint((azimuth - self.yaw[i]) / (2 * np.pi) * self.views)) % self.views

    def placed(self, frame, indices) -> tuple[np.ndarray, np.ndarray]:
        """Return axes, (k, 3, 3), and widths and heights, (k, 2), of some cards."""
        card_turn = self.turn[indices] if self.turn.ndim == 2 else self.turn
        card_axes = cards(
            self.points[indices],
            frame.view_from_world,
            self.facing,
            towards=self.towards,
            axis=card_turn[..., :3] if self.facing == 'cylindrical' or self.own_up else None,
            orientation=card_turn if self.facing == 'world' else None,
            rotation=self.rotation[indices],
            parallel=frame.parallel,
        )
        card_sizes = self.sizes[indices]
        if self.size_unit == 'pixel':
            z = self.points[indices] @ frame.view_from_world[2, :3] + frame.view_from_world[2, 3]
            card_sizes = card_sizes * self._pixel(frame) * (1.0 if frame.parallel else -z[:, None])
        return card_axes, card_sizes

    def corners(self, frame, indices) -> np.ndarray:
        """Return the corners of some cards, shape (k, 4, 3)."""
        axes, sizes = self.placed(frame, indices)
        offsets = (CORNERS - self.anchor) * sizes[:, None]
        return self.points[indices, None] + offsets @ axes[..., :2].swapaxes(1, 2)

    def hits(self, frame, start, direction) -> list:
        """Return index, distance and texture coordinates of cards hit by a ray, nearest first."""
        indices = np.arange(len(self))
        if self.size_unit == 'world':
            offsets = self.points - start
            ray_distance = np.maximum(offsets @ direction, 0)
            gap_to_ray = np.linalg.norm(offsets - ray_distance[:, None] * direction, axis=1)
            indices = np.flatnonzero(gap_to_ray <= self.radii)
        card_axes, card_sizes = self.placed(frame, indices)
        right, up, normal = np.moveaxis(card_axes, 2, 0)
        offsets = self.points[indices] - start
        with np.errstate(divide='ignore', invalid='ignore'):
            distances = (offsets * normal).sum(1) / (normal @ direction)
            in_plane = distances[:, None] * direction - offsets
            at_card = np.stack([(in_plane * right).sum(1), (in_plane * up).sum(1)], 1)
            uv = at_card / card_sizes + self.anchor
            is_hit = (distances >= 0) & (uv >= 0).all(1) & (uv <= 1).all(1)
        hit_order = np.flatnonzero(is_hit)
        hit_order = hit_order[np.argsort(distances[hit_order])]
        return [(int(indices[k]), float(distances[k]), uv[k]) for k in hit_order]


def _as_anchor(anchor) -> np.ndarray:
    """Return the position of the point on the card, in shares of its sides."""
    is_name = isinstance(anchor, str)
    values = ANCHORS.get(anchor) if is_name else anchor
    values = as_array('anchor', () if values is None else values)
    if values.shape != (2,) or values.dtype.kind not in 'iuf' or not np.isfinite(values).all():
        raise ValueError(f'anchor must be {", ".join(ANCHORS)} or two shares, got {anchor!r}')
    return np.asarray(values, float)


def checked_cutout(cutout):
    """Return a checked alpha threshold, or None."""
    if cutout is not None and not 0 < checked_number('cutout', cutout) <= 1:
        raise ValueError(f'cutout must be in (0, 1], or None to blend, got {cutout!r}')
    return cutout


def _numbers(name, values, count, nan_rows):
    number_array = filled(nan_rows, name, as_floats(name, values))
    if number_array.shape not in ((), (count,)) or not np.isfinite(number_array).all():
        raise ValueError(f'{name} must be one finite number or {count}, got {number_array}')
    return np.broadcast_to(number_array, (count,))


def _checked_views(views, facing, image_count):
    if isinstance(views, bool) or not isinstance(views, int | np.integer) or views < 1:
        raise ValueError(f'views must be 1 or more, got {views!r}')
    if views > 1 and facing != 'cylindrical':
        raise ValueError(f"views above 1 requires facing='cylindrical', got {facing!r}")
    if image_count % views:
        raise ValueError(f'views must divide the number of images, {image_count}, got {views}')
    return int(views)


def _checked_size(size, count, nan_rows):
    size_array = as_floats('size', size)
    if size_array.shape not in ((), (count,), (count, 2), (1, 2)):
        raise ValueError(
            f'size must be one number or of shape ({count},), ({count}, 2) or (1, 2), got shape '
            f'{size_array.shape}'
        )
    if len(size_array.shape) and len(size_array) == count:
        size_array = filled(nan_rows, 'size', size_array)
    return checked_lengths('size', size_array)


def _full_sizes(size, image_sizes):
    """Return widths and heights; a height alone keeps the image's proportions."""
    if size.ndim == 2:
        return np.broadcast_to(size, (len(image_sizes), 2))
    heights = np.broadcast_to(size, (len(image_sizes),))
    return np.stack([heights * image_sizes[:, 0] / image_sizes[:, 1], heights], 1)


def _turn(facing, axis, orientation, count, nan_rows):
    """Return the axis or quaternion of all cards, shape (4,), or of each, (n, 4)."""
    if facing != 'world' and orientation is not None:
        raise ValueError(
            f"orientation requires facing='world', got {facing!r}: use axis or rotation"
        )
    if facing in ('world', 'screen') and axis is not None:
        raise ValueError(f"axis requires facing='cylindrical' or 'spherical', got {facing!r}")
    if facing == 'world':
        turn = (1.0, 0, 0, 0) if orientation is None else orientation
        return as_units('orientation', _of_shape('orientation', turn, 4, count, nan_rows))
    axis = _of_shape('axis', (0.0, 0, 1) if axis is None else axis, 3, count, nan_rows)
    with naming('axis', axis):
        unit_axis = as_units('axis', axis)
    return np.concatenate([unit_axis, np.zeros((*unit_axis.shape[:-1], 1))], -1)


def _of_shape(name, values, width, count, nan_rows):
    array = as_floats(name, values)
    if array.shape not in ((width,), (count, width)):
        raise ValueError(
            f'{name} must be of shape ({width},) or ({count}, {width}), got {array.shape}'
        )
    return filled(nan_rows, name, array) if array.ndim > 1 else array


def _checked_index(index, count, image_count):
    array = as_array('index', index)
    if array.shape not in ((), (count,)) or array.dtype.kind not in 'iu':
        raise ValueError(
            f'index must be integers of shape ({count},), got {array.dtype} of shape {array.shape}'
        )
    if ((array < 0) | (array >= image_count)).any():
        raise ValueError(
            f'index must be below the number of images, {image_count}, and not negative, got '
            f'{int(array.min())} to {int(array.max())}'
        )
    return np.broadcast_to(array, (count,))
