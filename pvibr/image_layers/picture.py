"""The image of a layer: rendered once, warped to each frame while it is valid."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pvibr.core.costs import expected_seconds, timed
from pvibr.gl import Quad, Target, nbytes_of, shader_source, texture_limit
from pvibr.gl import enums as gl
from pvibr.gl.feature import sections
from pvibr.maths.layers import (
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
from pvibr.maths.views import View, corners, may_see

#: A picture is taken again where its texels became so many times as long, or as short.
GROWN, SHRUNK = 1.25, 0.5
#: Seconds that a pixel of a card takes, before any was measured.
PIXEL = 1e-8
#: Blocks of a picture along its longer side; each gives two characteristic points.
BLOCKS = 64
_SIGMAS, _WIDEST = 3.0, 3.0  # of a Gaussian: where it ends, and texels that are blurred at most
_TEXEL_BYTES = 16  # colour, depth, and depth to be filtered; more where colours are floats
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
    """Colour and depth of some actors, as a camera saw them."""

    settings: Settings
    clip_from_view: np.ndarray

    def __init__(self):
        self.alive = self.blurred = False  # taken; low-pass filtered
        self.rect: tuple = (0.0, 0.0, 0.0, 0.0)
        self.crop: tuple = (0.0, 0.0, 0.0, 0.0)
        self.clip_from_view = self.view_from_world = np.eye(4)
        self._size, self._parallel = (0, 0), False
        self._open: tuple = (False,) * 4
        self._beyond = np.zeros((0, 6))
        self._may_go = np.inf
        self._pixels, self._points = np.zeros((0, 2)), np.zeros((0, 3))
        self._view_from_pixel, self._plane = np.eye(3), np.zeros(3)
        self.texels, self.scale, self.pixel = [0, 0], 1.0, PIXEL
        self._targets: dict[str, Target] = {}
        self._quads: dict[str, Quad] = {}

    # -- what it holds ----------------------------------------------------------------------------

    @property
    def empty(self) -> bool:
        """Whether it shows nothing."""
        return not len(self._points)

    @property
    def blends(self) -> bool:
        """Whether its edges are soft: blurred or supersampled."""
        return self.blurred or self.scale > 1

    @property
    def color(self):
        """Texture of colour times coverage, and coverage."""
        return self._targets['down' if self.blurred else 'raw'].colors[0]

    @property
    def depth(self):
        """Texture of filterable depth, 0 to 1; of the mean depth if blurred."""
        found = self._targets['down' if self.blurred else 'spread'].colors
        return found[-1]

    @property
    def area(self) -> float:
        """Pixels of its card when it was rendered."""
        (left, bottom, right, top), (u0, v0, u1, v1) = self.rect, self.crop
        return (right - left) * (top - bottom) * (u1 - u0) * (v1 - v0)

    @property
    def nearest(self) -> float:
        """Distance of its nearest point along the view, world units."""
        return float(-self._points[:, 2].max(initial=-np.inf))

    @property
    def farthest(self) -> float:
        """Distance of its farthest point along the view, world units."""
        return float(-self._points[:, 2].min(initial=np.inf))

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets.values())

    # -- whether it serves ------------------------------------------------------------------------

    def fit(self, frame, motion, kind) -> Fit:
        """Warp it to a frame."""
        world = frame.view_from_world if motion is None else frame.view_from_world @ motion
        turn = world @ np.linalg.inv(self.view_from_world)
        clip = frame.clip_from_view @ turn
        at, ahead = to_screen(self._points @ clip[:, :3].T + clip[:, 3], frame.size)
        seen = ahead & ((at > -1) & (at < np.add(frame.size, 1))).all(1)
        source, at = self._pixels[seen], at[seen]
        warp = self._warp(frame, clip, source, at, kind)
        off = np.linalg.norm(moved(warp, source) - at, axis=1)
        residual = float(off.max(initial=0.0))
        why = self._gone(frame, warp, turn, source, motion)
        return Fit(warp, turn, residual, bool(seen.any()), why)

    def _warp(self, frame, clip, source, at, kind):
        plane = plane_warp(
            clip, self._view_from_pixel, self._plane, frame.size, parallel=self._parallel
        )
        if kind == 'affine' and len(source):
            return fit_affine(source, at)
        left, bottom, right, top = self.rect
        ends = moved(plane, np.array([[x, y] for x in (left, right) for y in (bottom, top)]))
        if not np.isfinite(ends).all():
            return fit_affine(source, at)
        return fit_affine(moved(plane, source), at) @ plane

    def _gone(self, frame, warp, turn, source, motion) -> str:
        """Return why it lacks visible parts, empty if it does not."""
        if frame.size != self._size or frame.parallel != self._parallel:
            return 'window'
        if len(self._beyond) and (motion is not None or _any_seen(frame, self._beyond)):
            return 'visibility'
        inset = _SIGMAS * self.settings.blur
        left, bottom, right, top = self.rect
        within = left + inset, bottom + inset, right - inset, top - inset
        if not reaches(warp, within, self._open, frame.size):
            return 'visibility'
        if np.linalg.norm(turn[:3, 3]) > self._may_go:
            return 'visibility'
        if len(source):
            longest, shortest = stretch(warp, source.mean(0))
            if longest > GROWN or shortest < SHRUNK:
                return 'resolution'
        return ''

    # -- taking it --------------------------------------------------------------------------------

    def aim(self, frame, bounds, settings) -> View | None:
        """Choose the rectangle to render; return its view, None if empty."""
        self.alive, self.settings, self.view_from_world = True, settings, frame.view_from_world
        self._size, self._parallel = frame.size, frame.parallel
        self._pixels, self._points = np.zeros((0, 2)), np.zeros((0, 3))
        self._plane, self._view_from_pixel = np.zeros(3), _view_from_pixel(frame)
        self._open, self._may_go = (False,) * 4, np.inf
        size = np.array(frame.size, float)
        most = np.ceil(settings.overscan * size)
        low, high = -most, size + most
        found = extents(frame.clip_from_view @ frame.view_from_world, bounds, frame.size)
        inside = (found[:, :2] < high).all(1) & (found[:, 2:] > low).all(1)
        inside &= (found[:, :2] <= found[:, 2:]).all(1)
        self._beyond = bounds[~inside]
        if not inside.any():
            self.rect = self.crop = (0.0,) * 4
            return None
        first, last = found[inside, :2].min(0), found[inside, 2:].max(0)
        self._open = (*(first < low).tolist(), *(last > high).tolist())
        if (_depths(frame, bounds[inside]) < frame.near).any():
            self._may_go = frame.near
        pad = 1 + np.ceil(_SIGMAS * settings.blur)
        first = np.floor(np.maximum(first - pad, low - pad))
        last = np.ceil(np.minimum(last + pad, high + pad))
        return self._view(frame, first, last)

    def _view(self, frame, first, last) -> View:
        """Set the rectangle, and return its view."""
        settings = self.settings
        scale = settings.resolution
        if settings.blur:
            scale = min(scale, _WIDEST / settings.blur)
        scale = min(scale, 0.999 * texture_limit(frame.window) / (last - first).max())
        scale = min(scale, (settings.memory / _TEXEL_BYTES / np.prod(last - first)) ** 0.5)
        self.texels = np.ceil((last - first) * scale).astype(int).tolist()
        self.scale = scale
        last = first + np.array(self.texels) / scale
        self.rect = (*first.tolist(), *last.tolist())
        self.clip_from_view = part_of(frame.clip_from_view, frame.size, self.rect)
        return replace(frame.view, clip_from_view=self.clip_from_view)

    def draw(self, drawer, view, actors) -> float:
        """Draw actors into it, in the view that :meth:`aim` returned."""
        window, format = drawer.window, self.settings.format
        expected = sum(expected_seconds(_cells(actor)) for actor in actors)
        with timed(window, expected) as spent:
            target = self._sized(window, 'raw', (format,), depth=True)
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

    def _sized(self, window, name, formats, *, size=None, depth=False) -> Target:
        """Return a target of a size, by default that of the image; kept while it fits."""
        size, old = tuple(size or self.texels), self._targets.get(name)
        if old is not None:
            same = (old.width, old.height) == size
            if same and old.colors[0].is_float == formats[0].endswith('f'):
                return old
            old.release()
        smooth = 'linear' if name != 'ranges' else 'nearest'
        width, height = size
        target = Target(window, width, height, formats, depth=depth, filter=smooth)
        self._targets[name] = target
        return target

    def _spread_depth(self, window, raw):
        """Copy the depth to a filterable texture."""
        for name in self._targets.keys() & {'across', 'down'}:
            self._targets.pop(name).release()
        target, quad = self._sized(window, 'spread', ('r32f',)), self._quad(window, 'spread')
        count = np.prod(self.texels)
        with timed(window, PIXEL * count) as spent:
            target.draw(quad, {}, {'deep': raw.depth})
        # A card asks for about as much.
        self.pixel = spent.seconds / count

    def _soften(self, window, raw):
        """Blur colour and depth."""
        quad = self._quad(window, 'soften')
        color, depth = raw.colors[0], raw.depth
        sigma = float(self.settings.blur * self.scale)
        steps = ('across', (1.0 / self.texels[0], 0.0)), ('down', (0.0, 1.0 / self.texels[1]))
        for k, (name, axis) in enumerate(steps):
            target = self._sized(window, name, (self.settings.format, 'rg32f'))
            uniforms = {'axis': axis, 'sigma': sigma, 'last': k}
            target.draw(quad, uniforms, {'picture': color, 'deep': depth})
            color, depth = target.colors

    def _find_points(self, window, depth):
        """Find characteristic points: the nearest and farthest of each block."""
        side = -(-max(self.texels) // BLOCKS)
        columns, rows = (-(-n // side) for n in self.texels)
        ranges = self._sized(window, 'ranges', ('rg32f',), size=(columns, rows))
        ranges.draw(self._quad(window, 'range'), {'side': side}, {'deep': depth})
        found = ranges.colors[0].download()[..., :2].astype(float)
        row, column = np.nonzero(found[..., 0] < 2)
        self._crop(row, column, side)
        if not len(row):
            return
        middle = np.minimum((np.stack([column, row], 1) + 0.5) * side, np.array(self.texels) - 0.5)
        ndc = np.ones((2, len(row), 4))
        ndc[..., :2] = 2 * middle / self.texels - 1
        ndc[..., 2] = 2 * found[row, column].T - 1
        points = ndc.reshape(-1, 4) @ np.linalg.inv(self.clip_from_view).T
        self._points = points[:, :3] / points[:, 3:]
        self._pixels = np.tile(self.rect[:2] + middle / self.scale, (2, 1))
        away = -self._points[:, 2]
        self._plane = fit_plane(self._pixels, away if self._parallel else 1 / away)
        if np.isfinite(self._may_go):
            self._may_go = max(self._may_go, self.nearest / 4)

    def _crop(self, row, column, side):
        if not len(row):
            self.crop = (0.0,) * 4
            return
        # A texel more for filters, and as far as a blur reaches.
        more = 1 + _SIGMAS * self.settings.blur * self.scale
        low = np.array([column.min(), row.min()]) * side - more
        high = np.array([column.max() + 1, row.max() + 1]) * side + more
        ends = np.concatenate([low, high]) / np.tile(self.texels, 2)
        self.crop = tuple(np.clip(ends, 0, 1).tolist())

    def _quad(self, window, name) -> Quad:
        if name not in self._quads:
            self._quads[name] = Quad(window, _TEXTS[name], f'layers.glsl, {name}')
        return self._quads[name]

    def release(self):
        """Free GPU memory; the context is current."""
        for target in self._targets.values():
            target.release()
        for quad in self._quads.values():
            quad.release()
        self._targets, self._quads, self.alive = {}, {}, False


def _any_seen(frame, bounds) -> bool:
    return bool(may_see(frame.view, bounds).any())


def _depths(frame, bounds) -> np.ndarray:
    """Return the distances of corners along the view."""
    row = frame.view_from_world[2]
    return -(corners(bounds) @ row[:3] + row[3])


def _view_from_pixel(frame) -> np.ndarray:
    """Return the matrix from homogeneous pixels to x and y at distance 1 or in a parallel view."""
    clip, column = frame.clip_from_view, 3 if frame.parallel else 2
    sign = -1.0 if frame.parallel else 1.0
    out = np.eye(3)
    for k, count in enumerate(frame.size):
        out[k, k], out[k, 2] = 2 / count, sign * clip[k, column] - 1
        out[k] /= clip[k, k]
    return out


def _cells(actor) -> int:
    data = actor.GetMapper().GetInputDataObject(0, 0)
    return getattr(data, 'GetNumberOfCells', int)()
