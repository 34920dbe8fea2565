"""The picture of a layer: taken once, warped to each frame for as long as it serves."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pvibr.core.determinism import elapsed
from pvibr.gl import Quad, Target, shader_source, texture_limit
from pvibr.gl import enums as gl
from pvibr.gl.feature import sections
from pvibr.impostors.costs import ACTOR, CELL
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
    """How a picture is taken."""

    resolution: float
    blur: float
    overscan: float
    format: str
    memory: float


class Fit(NamedTuple):
    """A picture in a frame."""

    warp: np.ndarray
    turn: np.ndarray
    residual: float
    seen: bool
    why: str


class LayerPicture:
    """Colour and depth of some actors, as an eye saw them."""

    def __init__(self):
        self.settings: Any = None
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
        self._target: Any = None
        self._spread: Any = None
        self._soft: list = []
        self._ranges: Any = None
        self._quads: dict[str, Quad] = {}

    # -- what it holds ----------------------------------------------------------------------------

    @property
    def alive(self) -> bool:
        """Whether it was taken."""
        return self.settings is not None

    @property
    def empty(self) -> bool:
        """Whether it shows nothing."""
        return not len(self._points)

    @property
    def blurred(self) -> bool:
        """Whether it was low-pass filtered."""
        return bool(self._soft)

    @property
    def blends(self) -> bool:
        """Whether its edges are soft: blurred, or of several texels a pixel."""
        return self.blurred or self.scale > 1

    @property
    def color(self):
        """Texture of colour times coverage, and coverage."""
        return (self._soft[-1] if self._soft else self._target).colors[0]

    @property
    def depth(self):
        """Texture of depth, 0 to 1, to be filtered; where it is blurred, of the mean depth."""
        return self._soft[-1].colors[1] if self._soft else self._spread.colors[0]

    @property
    def area(self) -> float:
        """Pixels of its card when it was taken."""
        (left, bottom, right, top), (u0, v0, u1, v1) = self.rect, self.crop
        return (right - left) * (top - bottom) * (u1 - u0) * (v1 - v0)

    @property
    def nearest(self) -> float:
        """Distance of the nearest that it shows along the view, world units."""
        return float(-self._points[:, 2].max(initial=-np.inf))

    @property
    def farthest(self) -> float:
        """Distance of the farthest that it shows along the view, world units."""
        return float(-self._points[:, 2].min(initial=np.inf))

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        targets = self._target, self._spread, self._ranges, *self._soft
        return sum(target.nbytes for target in targets if target is not None)

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
        """Return why it does not show what is to be seen, or nothing."""
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
        """Choose what it shows in the view of a frame."""
        self.settings, self.view_from_world = settings, frame.view_from_world
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
        """Return the view of a rectangle, and take it."""
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
        window = drawer.window
        window.WaitForCompletion()
        start = time.perf_counter()
        self._target = self._sized(self._target, window, (self.settings.format,), depth=True)
        state = window.GetState()
        with self._target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            drawer.look(view, (0, 0, *self.texels))
            state.SetEnumState(gl.BLEND, True)
            state.vtkglBlendFuncSeparate(*gl.OVER)
            drawer.inner.UpdateLightsGeometryToFollowCamera()
            drawer.inner.UpdateLights()
            drawer.draw(actors)
        window.WaitForCompletion()
        seconds = elapsed(start, sum(ACTOR + CELL * _cells(actor) for actor in actors))
        if self.settings.blur:
            self._soften(window)
        else:
            self._spread_depth(window)
        self._find_points(window)
        return seconds

    def _sized(self, target, window, formats, *, depth=False):
        if target is not None:
            same = (target.width, target.height) == tuple(self.texels)
            if same and target.colors[0].is_float == formats[0].endswith('f'):
                return target
            target.release()
        width, height = self.texels
        return Target(window, width, height, formats, depth=depth, filter='linear')

    def _spread_depth(self, window):
        """Have depth that can be filtered."""
        for target in self._soft:
            target.release()
        self._soft = []
        self._spread = self._sized(self._spread, window, ('r32f',))
        quad, start = self._quad(window, 'spread'), time.perf_counter()
        self._spread.draw(quad, {}, {'deep': self._target.depth})
        window.WaitForCompletion()
        # A card asks for about as much.
        self.pixel = elapsed(start, PIXEL * np.prod(self.texels)) / np.prod(self.texels)

    def _soften(self, window):
        """Blur colour and depth."""
        formats = (self.settings.format, 'rg32f')
        old = self._soft or [None, None]
        self._soft = [self._sized(target, window, formats) for target in old]
        quad = self._quad(window, 'soften')
        color, depth = self._target.colors[0], self._target.depth
        sigma = float(self.settings.blur * self.scale)
        for k, target in enumerate(self._soft):
            axis = (1.0 / self.texels[0], 0.0) if k == 0 else (0.0, 1.0 / self.texels[1])
            uniforms = {'axis': axis, 'sigma': sigma, 'last': k}
            target.draw(quad, uniforms, {'picture': color, 'deep': depth})
            color, depth = target.colors

    def _find_points(self, window):
        """Take characteristic points: the nearest and farthest of each block."""
        side = -(-max(self.texels) // BLOCKS)
        columns, rows = (-(-n // side) for n in self.texels)
        if self._ranges is None or (self._ranges.width, self._ranges.height) != (columns, rows):
            if self._ranges is not None:
                self._ranges.release()
            self._ranges = Target(window, columns, rows, ('rg32f',), filter='nearest')
        quad = self._quad(window, 'range')
        self._ranges.draw(quad, {'side': side}, {'deep': self._target.depth})
        found = self._ranges.colors[0].download()[..., :2].astype(float)
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

    def forget(self):
        """Count as not taken."""
        self.settings = None

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        targets = self._target, self._spread, self._ranges, *self._soft
        for owner in (*targets, *self._quads.values()):
            if owner is not None:
                owner.release()
        self._target = self._spread = self._ranges = None
        self._soft, self._quads = [], {}
        self.forget()


def _any_seen(frame, bounds) -> bool:
    return bool(may_see(frame.view, bounds).any())


def _depths(frame, bounds) -> np.ndarray:
    """Return the distances of corners along the view."""
    row = frame.view_from_world[2]
    return -(corners(bounds) @ row[:3] + row[3])


def _view_from_pixel(frame) -> np.ndarray:
    """Return what takes homogeneous pixels to x and y at distance 1, or of a parallel view."""
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
