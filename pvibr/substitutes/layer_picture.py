"""The image of a layer: rendered once, warped to each frame while valid."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pvibr.gl import Quad, Target, nbytes_of, release, shader_source, texture_limit
from pvibr.gl import enums as gl
from pvibr.gl.driver import driver_of, timed
from pvibr.gl.feature import sections
from pvibr.gl.texture import PendingTexels
from pvibr.maths.views import View, corners, may_see
from pvibr.substitutes.layer_maths import (
    extents,
    fit_affine,
    fit_plane,
    moved,
    part_of,
    plane_warp,
    reaches,
    stretch,
    to_screen,
)

#: Greatest and least stretch of texels; beyond them an image is rendered again.
GROWN, SHRUNK = 1.25, 0.5
#: Blocks along an image's longer side; each gives two characteristic points.
BLOCKS = 64
_SIGMAS, _WIDEST = 3.0, 3.0  # Gaussian: cut-off in sigmas, and greatest sigma in texels
_TEXEL_BYTES = 16  # colour, depth and filterable depth; more with float colours
_TEXTS = sections(shader_source(__file__, 'image_layers'))


class Settings(NamedTuple):
    """Settings of an image."""

    resolution: float
    blur: float
    overscan: float
    format: str
    memory: float


class Fit(NamedTuple):
    """An image warped to a frame."""

    warp: np.ndarray
    turn: np.ndarray
    residual: float
    seen: bool
    why: str


class LayerPicture:
    """Colour and depth of a layer's actors, rendered by one camera."""

    settings: Settings
    clip_from_view: np.ndarray

    def __init__(self):
        self.alive = self.blurred = False
        self.rect: tuple = (0.0, 0.0, 0.0, 0.0)
        self.crop: tuple = (0.0, 0.0, 0.0, 0.0)
        self.clip_from_view = self.view_from_world = np.eye(4)
        self._size, self._parallel = (0, 0), False
        self._is_cropped: tuple = (False,) * 4
        self._depth_range = np.zeros(2)
        self._boxes_outside = np.zeros((0, 6))
        self._allowed_motion = np.inf
        self._pixels, self._points = np.zeros((0, 2)), np.zeros((0, 3))
        self._view_from_pixel, self._plane = np.eye(3), np.zeros(3)
        self._pending: PendingTexels | None = None  # depth ranges, on their way from the GPU
        self.texels, self.scale, self.pixel = [0, 0], 1.0, 0.0
        self._targets: dict[str, Target] = {}
        self._quads: dict[str, Quad] = {}

    # -- contents ---------------------------------------------------------------------------------

    @property
    def empty(self) -> bool:
        """Whether the image shows nothing."""
        return not len(self._points)

    @property
    def blends(self) -> bool:
        """Whether edges are soft: blurred or supersampled."""
        return self.blurred or self.scale > 1

    @property
    def color(self):
        """Texture of colour times coverage, and coverage."""
        return self._targets['down' if self.blurred else 'raw'].colors[0]

    @property
    def depth(self):
        """Texture of filterable depth, 0 to 1; of the mean depth if blurred."""
        return self._targets['down' if self.blurred else 'spread'].colors[-1]

    @property
    def area(self) -> float:
        """Pixels of the card when rendered."""
        (low_x, low_y, high_x, high_y), (u0, v0, u1, v1) = self.rect, self.crop
        return (high_x - low_x) * (high_y - low_y) * (u1 - u0) * (v1 - v0)

    @property
    def nearest(self) -> float:
        """Least depth along the view, world units."""
        return float(-self._points[:, 2].max(initial=-np.inf))

    @property
    def farthest(self) -> float:
        """Greatest depth along the view, world units."""
        return float(-self._points[:, 2].min(initial=np.inf))

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets.values())

    # -- warping ----------------------------------------------------------------------------------

    def fit(self, frame, motion, kind) -> Fit:
        """Warp the image to a frame."""
        view = frame.view_from_world if motion is None else frame.view_from_world @ motion
        view_from_image = view @ np.linalg.inv(self.view_from_world)
        clip_from_image = frame.clip_from_view @ view_from_image
        clip_points = self._points @ clip_from_image[:, :3].T + clip_from_image[:, 3]
        target, in_front = to_screen(clip_points, frame.size)
        on_screen = in_front & ((target > -1) & (target < np.add(frame.size, 1))).all(1)
        source, target = self._pixels[on_screen], target[on_screen]
        warp = self._warp(frame, clip_from_image, source, target, kind)
        errors = np.linalg.norm(moved(warp, source) - target, axis=1)
        why = self._invalid_reason(frame, warp, view_from_image, source, motion)
        residual, is_seen = float(errors.max(initial=0.0)), bool(on_screen.any())
        return Fit(warp, view_from_image, residual, is_seen, why)

    def _warp(self, frame, clip_from_image, source, target, kind):
        if kind == 'affine' and len(source):
            return fit_affine(source, target)
        plane = plane_warp(
            clip_from_image,
            self._view_from_pixel,
            self._plane,
            frame.size,
            parallel=self._parallel,
        )
        low_x, low_y, high_x, high_y = self.rect
        image_corners = np.array([[x, y] for x in (low_x, high_x) for y in (low_y, high_y)])
        if not np.isfinite(moved(plane, image_corners)).all():
            return fit_affine(source, target)
        return fit_affine(moved(plane, source), target) @ plane

    def _invalid_reason(self, frame, warp, view_from_image, source, motion) -> str:
        """Return why the warped image does not serve, empty if it does."""
        if frame.size != self._size or frame.parallel != self._parallel:
            return 'window'
        hidden_boxes = self._boxes_outside
        if len(hidden_boxes) and (motion is not None or may_see(frame.view, hidden_boxes).any()):
            return 'visibility'
        blur_reach = _SIGMAS * self.settings.blur
        low, high = np.reshape(self.rect, (2, 2))
        valid_rect = *(low + blur_reach), *(high - blur_reach)
        if not reaches(warp, valid_rect, self._is_cropped, frame.size):
            return 'visibility'
        if np.linalg.norm(view_from_image[:3, 3]) > self._allowed_motion:
            return 'visibility'
        if len(source):
            longest, shortest = stretch(warp, source.mean(0))
            if longest > GROWN or shortest < SHRUNK:
                return 'resolution'
        return ''

    # -- rendering --------------------------------------------------------------------------------

    def aim(self, frame, bounds, settings) -> View | None:
        """Choose the rectangle to render; return its view, None if empty."""
        release(self._pending)  # of an image that was never shown again
        self._pending = None
        self.alive, self.settings, self.view_from_world = True, settings, frame.view_from_world
        self._size, self._parallel = frame.size, frame.parallel
        self._pixels, self._points = np.zeros((0, 2)), np.zeros((0, 3))
        self._plane, self._view_from_pixel = np.zeros(3), _view_from_pixel(frame)
        self._is_cropped, self._allowed_motion = (False,) * 4, np.inf
        size = np.array(frame.size, float)
        overscan_px = np.ceil(settings.overscan * size)
        low, high = -overscan_px, size + overscan_px
        box_extents = extents(frame.clip_from_view @ frame.view_from_world, bounds, frame.size)
        is_inside = (box_extents[:, :2] < high).all(1) & (box_extents[:, 2:] > low).all(1)
        is_inside &= (box_extents[:, :2] <= box_extents[:, 2:]).all(1)
        self._boxes_outside = bounds[~is_inside]
        if not is_inside.any():
            self.rect = self.crop = (0.0,) * 4
            return None
        low_px, high_px = box_extents[is_inside, :2].min(0), box_extents[is_inside, 2:].max(0)
        self._is_cropped = (*(low_px < low).tolist(), *(high_px > high).tolist())
        depths = _depths(frame, bounds[is_inside])
        self._depth_range = np.clip([depths.min(), depths.max()], frame.near, frame.far)
        if (depths < frame.near).any():
            self._allowed_motion = frame.near
        blur_margin = 1 + np.ceil(_SIGMAS * settings.blur)
        low_px = np.floor(np.maximum(low_px - blur_margin, low - blur_margin))
        high_px = np.ceil(np.minimum(high_px + blur_margin, high + blur_margin))
        return self._view(frame, low_px, high_px)

    def _view(self, frame, low_px, high_px) -> View:
        """Set the rectangle and return its view."""
        settings, size = self.settings, high_px - low_px
        scale = min(
            settings.resolution,
            _WIDEST / settings.blur if settings.blur else np.inf,
            0.999 * texture_limit(frame.window) / size.max(),
            (settings.memory / _TEXEL_BYTES / np.prod(size)) ** 0.5,
        )
        self.texels = np.ceil(size * scale).astype(int).tolist()
        self.scale = scale
        high_px = low_px + np.array(self.texels) / scale
        self.rect = (*low_px.tolist(), *high_px.tolist())
        self.clip_from_view = part_of(frame.clip_from_view, frame.size, self.rect)
        return replace(frame.view, clip_from_view=self.clip_from_view)

    def draw(self, drawer, view, actors) -> float:
        """Render actors in the view that :meth:`aim` returned; return the seconds spent."""
        window, format = drawer.window, self.settings.format
        expected = sum(driver_of(window).expected_seconds(_cells(actor)) for actor in actors)
        with timed(window, expected) as spent:
            target = self._target(window, 'raw', (format,), depth=True)
            state = window.GetState()
            with target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
                drawer.look(view, (0, 0, *self.texels))
                state.SetEnumState(gl.BLEND, True)
                state.vtkglBlendFuncSeparate(*gl.OVER)
                drawer.inner.UpdateLightsGeometryToFollowCamera()
                drawer.inner.UpdateLights()
                drawer.draw(actors)
        self.blurred = bool(self.settings.blur)
        (self._soften if self.blurred else self._spread_depth)(window, target)
        self._find_points(window, target.depth)
        return spent.seconds

    def _target(self, window, name, formats, *, size=None, depth=False) -> Target:
        """Return a target of a size, by default the image's, reused while it fits."""
        size, old_target = tuple(size or self.texels), self._targets.get(name)
        if old_target is not None:
            same_size = (old_target.width, old_target.height) == size
            if same_size and old_target.colors[0].is_float == formats[0].endswith('f'):
                return old_target
            old_target.release()
        filter_mode = 'linear' if name != 'ranges' else 'nearest'
        width, height = size
        target = Target(window, width, height, formats, depth=depth, filter=filter_mode)
        self._targets[name] = target
        return target

    def _spread_depth(self, window, raw):
        """Copy the depth to a filterable texture."""
        for name in self._targets.keys() & {'across', 'down'}:
            self._targets.pop(name).release()
        target, quad = self._target(window, 'spread', ('r32f',)), self._quad(window, 'spread')
        texel_count = np.prod(self.texels)
        nominal = 1e-9 * driver_of(window).card_pixel_ns * texel_count
        with timed(window, nominal) as spent:
            target.draw(quad, {}, {'deep': raw.depth})
        # Drawing a card costs about as much.
        self.pixel = spent.seconds / texel_count

    def _soften(self, window, raw):
        """Blur colour and depth."""
        quad = self._quad(window, 'soften')
        color, depth = raw.colors[0], raw.depth
        sigma = float(self.settings.blur * self.scale)
        passes = ('across', (1.0 / self.texels[0], 0.0)), ('down', (0.0, 1.0 / self.texels[1]))
        for k, (name, axis) in enumerate(passes):
            target = self._target(window, name, (self.settings.format, 'rg32f'))
            uniforms = {'axis': axis, 'sigma': sigma, 'last': k}
            target.draw(quad, uniforms, {'picture': color, 'deep': depth})
            color, depth = target.colors

    def _find_points(self, window, depth):
        """Find characteristic points: the nearest and farthest of each block."""
        block_side = -(-max(self.texels) // BLOCKS)
        column_count, row_count = (-(-n // block_side) for n in self.texels)
        ranges = self._target(window, 'ranges', ('rg32f',), size=(column_count, row_count))
        ranges.draw(self._quad(window, 'range'), {'side': block_side}, {'deep': depth})
        if driver_of(window).is_software:
            self._take_points(ranges.colors[0].download(), block_side)
        else:  # waiting would take longer than drawing
            self._pending = ranges.colors[0].fetch()
            self._take_points(self._expected_ranges((row_count, column_count)), block_side)

    def _expected_ranges(self, block_counts) -> np.ndarray:
        """Return the depths between which all is, in each block, until the GPU has found them."""
        low, high = self._depth_range
        z, w = (row[2] * -np.array([low, high]) + row[3] for row in self.clip_from_view[2:])
        return np.broadcast_to((z / w + 1) / 2, (*block_counts, 2))

    def settle(self):
        """Take the characteristic points that the GPU has found since the image was rendered."""
        if self._pending is not None:
            pending, self._pending = self._pending, None
            self._take_points(pending.texels(), -(-max(self.texels) // BLOCKS))

    def _take_points(self, texels, block_side):
        depth_ranges = texels[..., :2].astype(float)
        row, column = np.nonzero(depth_ranges[..., 0] < 2)
        self._crop(row, column, block_side)
        if not len(row):
            self._pixels, self._points = np.zeros((0, 2)), np.zeros((0, 3))
            return
        block_centers = (np.stack([column, row], 1) + 0.5) * block_side
        block_centers = np.minimum(block_centers, np.array(self.texels) - 0.5)
        ndc = np.ones((2, len(row), 4))
        ndc[..., :2] = 2 * block_centers / self.texels - 1
        ndc[..., 2] = 2 * depth_ranges[row, column].T - 1
        homogeneous = ndc.reshape(-1, 4) @ np.linalg.inv(self.clip_from_view).T
        self._points = homogeneous[:, :3] / homogeneous[:, 3:]
        self._pixels = np.tile(self.rect[:2] + block_centers / self.scale, (2, 1))
        point_depths = -self._points[:, 2]
        self._plane = fit_plane(self._pixels, point_depths if self._parallel else 1 / point_depths)
        if np.isfinite(self._allowed_motion):
            self._allowed_motion = max(self._allowed_motion, self.nearest / 4)

    def _crop(self, row, column, side):
        if not len(row):
            self.crop = (0.0,) * 4
            return
        # One texel for filters, and the reach of the blur.
        margin_texels = 1 + _SIGMAS * self.settings.blur * self.scale
        low = np.array([column.min(), row.min()]) * side - margin_texels
        high = np.array([column.max() + 1, row.max() + 1]) * side + margin_texels
        ends = np.concatenate([low, high]) / np.tile(self.texels, 2)
        self.crop = tuple(np.clip(ends, 0, 1).tolist())

    def _quad(self, window, name) -> Quad:
        if name not in self._quads:
            self._quads[name] = Quad(window, _TEXTS[name], f'image_layers.glsl, {name}')
        return self._quads[name]

    def release(self):
        """Free GPU memory; the context is current."""
        release(*self._targets.values(), *self._quads.values(), self._pending)
        self._pending = None
        self._targets, self._quads, self.alive = {}, {}, False


def _depths(frame, bounds) -> np.ndarray:
    """Return the distances of corners along the view."""
    view_axis = frame.view_from_world[2]
    return -(corners(bounds) @ view_axis[:3] + view_axis[3])


def _view_from_pixel(frame) -> np.ndarray:
    """Return the matrix from homogeneous pixels to x and y at distance 1 or in a parallel view."""
    clip, column = frame.clip_from_view, 3 if frame.parallel else 2
    sign = -1.0 if frame.parallel else 1.0
    view_from_pixel = np.eye(3)
    for k, count in enumerate(frame.size):
        view_from_pixel[k, k], view_from_pixel[k, 2] = 2 / count, sign * clip[k, column] - 1
        view_from_pixel[k] /= clip[k, k]
    return view_from_pixel


def _cells(actor) -> int:
    data = actor.GetMapper().GetInputDataObject(0, 0)
    return getattr(data, 'GetNumberOfCells', int)()
