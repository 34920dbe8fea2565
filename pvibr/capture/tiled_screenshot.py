"""Screenshots larger than the window or the GPU's limit, in overlapping tiles."""

from __future__ import annotations

import math
from contextlib import contextmanager, nullcontext

import numpy as np

from pvibr.capture.annotation_layout import kept_layout, lay_out, scaled_captions
from pvibr.capture.montage import save
from pvibr.core import _vtk
from pvibr.core.arguments import naming
from pvibr.core.errors import ClosedError
from pvibr.core.files import in_a_folder
from pvibr.core.params import checked_flag
from pvibr.core.passes import passes_of
from pvibr.core.plotters import draw_frame, frame_callbacks, is_closed, is_never_shown
from pvibr.effects.accumulation import Accumulation
from pvibr.gl.hidden_window import read_pixels
from pvibr.things.frame import Frame

#: Reach in pixels of VTK's own passes, such as FXAA and EDL.
_NEIGHBOURS = 8
#: Tiles start at multiples of this, so that effects on blocks of pixels see the same blocks.
_GRID = 16
#: Largest overlap as a fraction of a tile's side, at either end.
_MAX_OVERLAP = 0.4


def spans(image_size, tile_size, margin) -> list[tuple[int, int, int]]:
    """Return the start of each tile along an image's side, and the range used of it."""
    grid_step = _GRID if tile_size - 2 * margin > 2 * _GRID else 1
    tile_spans, next_pixel = [], 0
    while next_pixel < image_size:
        on_grid = (next_pixel - margin) // grid_step * grid_step
        tile_start = max(0, min(on_grid, image_size - tile_size))
        tile_end = tile_start + tile_size
        span_end = image_size if tile_end == image_size else tile_end - margin
        tile_spans.append((tile_start, next_pixel, span_end))
        next_pixel = span_end
    return tile_spans


def picture(window, scale, effects, draw, *, transparent=False) -> np.ndarray:
    """Draw a window, magnified in tiles of its size."""
    size = window.GetActualSize()
    if scale == 1:  # by the user's cameras, which keep what the frame sets of them
        draw()
        return read_pixels(window, size, alpha=transparent)[::-1]
    with _own_cameras(window) as cameras, scaled_captions(window, scale):
        window.SetTileScale(scale, scale)
        margins = _margins(window, cameras, effects, size, scale)
        columns, rows = (spans(n * scale, n, m) for n, m in zip(size, margins, strict=True))
        image = np.empty((size[1] * scale, size[0] * scale, 4 if transparent else 3), np.uint8)
        for bottom, low, high in rows:
            for left, first, last in columns:
                _look(window, cameras, (left, bottom), size, scale)
                lay_out(window)
                draw()
                tile = read_pixels(window, size, alpha=transparent)
                inner = tile[low - bottom : high - bottom, first - left : last - left]
                image[low:high, first:last] = inner
    return image[::-1]


def _renderers(window):
    renderers = window.GetRenderers()
    return [renderers.GetItemAsObject(i) for i in range(renderers.GetNumberOfItems())]


@contextmanager
def _own_cameras(window):
    """Give each renderer a copy of its camera; yield the originals, and restore them."""
    cameras = {r: r.GetActiveCamera() for r in _renderers(window) if r.GetDraw()}
    tile_viewport, tile_scale = tuple(window.GetTileViewport()), tuple(window.GetTileScale())
    try:
        for renderer, camera in cameras.items():
            tile_camera = camera.NewInstance()
            tile_camera.ShallowCopy(camera)
            renderer.SetActiveCamera(tile_camera)
        yield cameras
    finally:
        window.SetTileScale(*tile_scale)
        window.SetTileViewport(*tile_viewport)
        for renderer, camera in cameras.items():
            renderer.SetActiveCamera(camera)
            renderer.DrawOn()


def _look(window, cameras, tile_corner, size, scale):
    """Aim window and cameras at a tile."""
    tile_low = np.array(tile_corner) / (np.array(size) * scale)
    tile_rect = np.concatenate([tile_low, tile_low + 1 / scale])
    window.SetTileViewport(*tile_rect)
    for renderer, camera in cameras.items():
        renderer_rect = np.array(renderer.GetViewport()).reshape(2, 2)
        visible_rect = np.clip(renderer_rect, tile_rect[:2], tile_rect[2:])
        # A renderer with fewer pixels here than the overlap is drawn in another tile: VTK's passes
        # would create empty textures.
        min_extent = np.minimum(_NEIGHBOURS / np.array(size), _MAX_OVERLAP) / scale
        min_extent = 0.99 * np.minimum(min_extent, renderer_rect[1] - renderer_rect[0])
        visible_extent = visible_rect[1] - visible_rect[0]
        renderer.SetDraw(bool((visible_extent > min_extent).all()))
        if not renderer.GetDraw():
            continue
        visible_share = visible_extent / (renderer_rect[1] - renderer_rect[0])
        tile_camera = renderer.GetActiveCamera()
        angle_share = visible_share[0] if camera.GetUseHorizontalViewAngle() else visible_share[1]
        half_tangent = math.tan(math.radians(camera.GetViewAngle()) / 2)
        tile_camera.SetViewAngle(math.degrees(2 * math.atan(half_tangent * angle_share)))
        tile_camera.SetParallelScale(camera.GetParallelScale() * visible_share[1])
        aspect_share = visible_share[0] / visible_share[1]
        tile_camera.SetExplicitAspectRatio(camera.GetExplicitAspectRatio() * aspect_share)
        # In half sizes of the tile; the user's window centre is in half sizes of the whole.
        center_shift = (visible_rect.sum(0) - renderer_rect.sum(0)) / visible_extent
        window_center = np.array(camera.GetWindowCenter()) / visible_share + center_shift
        tile_camera.SetWindowCenter(*window_center)
        if camera.GetUseExplicitProjectionTransformMatrix():
            matrix = _cropped(camera, visible_share, center_shift)
            tile_camera.SetExplicitProjectionTransformMatrix(matrix)


def _cropped(camera, visible_share, center_shift):
    """Return the explicit projection matrix of a camera for the part that a tile shows."""
    crop = np.diag([*(1 / visible_share), 1.0, 1.0])
    crop[:2, 3] = -center_shift
    projection = np.reshape(camera.GetExplicitProjectionTransformMatrix().GetData(), (4, 4))
    matrix = _vtk.vtkMatrix4x4()
    matrix.DeepCopy((crop @ projection).ravel().tolist())
    return matrix


def _margins(window, cameras, effects, size, scale):
    """Return the overlap of tiles, in columns and rows."""
    frames = {}
    for renderer in cameras:
        # Each in a tile that shows a part of it: the first may not.
        tile_corner = [
            min(int(low * n * scale), n * (scale - 1))
            for low, n in zip(renderer.GetViewport()[:2], size, strict=True)
        ]
        _look(window, cameras, tile_corner, size, scale)
        if renderer.GetDraw():
            frames[renderer] = Frame.of(renderer)
    reaches = [_reach_of_passes(*item) for item in frames.items()]
    for effect in effects:
        frame = frames.get(effect.pipeline.renderer)
        if frame is not None and effect.enabled:
            reaches.append(effect.reach(frame))
    return [min(math.ceil(max(reaches, default=0)), int(_MAX_OVERLAP * n)) for n in size]


def _reach_of_passes(renderer, frame):
    """Return the reach of VTK's passes in pixels, mainly that of ambient occlusion."""
    occlusion_passes = [p for p in passes_of(renderer) if p.IsA('vtkSSAOPass')]
    # At the near plane, where it is largest.
    scale = frame.pixel_scale / (1 if frame.parallel else frame.near)
    return _NEIGHBOURS + sum(p.GetRadius() * scale for p in occlusion_passes)


class TiledScreenshot:
    """Screenshots of a plotter's window."""

    def __init__(self, plotter, effects, pipelines, full):
        self._plotter, self._effects, self._full = plotter, effects, full
        self._pipelines = pipelines

    def take(
        self, scale=None, size=None, transparent=None, filename=None, *, samples=1, moments=None
    ) -> np.ndarray:
        """Draw an image, and write it to an optional file; see `sampled` for the last two."""
        check_samples(samples)
        if filename is not None:
            filename = in_a_folder('filename', filename)
        window = self._window()
        tile, scale, size = _checked(tuple(window.GetActualSize()), scale, size)
        transparent = checked_flag('transparent_background', transparent, optional=True)
        if transparent is None:
            theme = getattr(self._plotter, 'theme', None)
            transparent = bool(getattr(theme, 'transparent_background', False))
        is_as_shown = scale == 1 and tuple(window.GetActualSize()) == tile
        with (
            nullcontext() if is_as_shown else kept_layout(window),
            _resized(window, tile),
            _transparent(window, transparent),
            self._full(),
        ):
            if scale > 1:
                self._draw()  # light that spreads over the whole image needs a whole frame
            with sampled(self._pipelines(), self._draw, samples, moments) as draw:
                image = picture(window, scale, self._effects(), draw, transparent=transparent)
        if not is_as_shown or samples > 1 or transparent:
            self.draw()
        image = np.ascontiguousarray(image[: size[1], : size[0]])
        if filename is not None:
            with naming('filename', filename):
                save(filename, image)
        return image

    def draw(self):
        """Draw the window without tiles at the current time, for whatever reads it next."""
        with self._full():
            self._draw()

    def _draw(self):
        """Draw a frame, which may be a tile or a sample."""
        draw_frame(self._plotter)

    def call_back(self):
        """Call what the plotter calls after each frame, as its ``write_frame`` does."""
        for callback in frame_callbacks(self._plotter):
            callback(self._plotter)

    def _window(self):
        if is_closed(self._plotter):
            raise ClosedError('the plotter is closed and cannot draw')
        if is_never_shown(self._plotter):
            self._plotter.screenshot(return_img=False)  # initializes camera and window
        return self._plotter.renderer.GetRenderWindow()

    @contextmanager
    def cameras_restored(self):
        """Restore the cameras afterwards; yield cameras and window size as JSON values."""
        window = self._window()
        self.draw()  # whose clipping range is that of the scene as it is now
        cameras = [renderer.GetActiveCamera() for renderer in _renderers(window)]
        copies = [camera.NewInstance() for camera in cameras]
        notes = [dict(vars(camera)) for camera in cameras]  # PyVista's own, such as the azimuth
        for camera, copy in zip(cameras, copies, strict=True):
            copy.DeepCopy(camera)
        try:
            yield {
                'size': list(window.GetActualSize()),
                'cameras': [
                    [
                        *c.GetPosition(),
                        *c.GetFocalPoint(),
                        *c.GetViewUp(),
                        c.GetViewAngle(),
                        c.GetParallelScale(),
                        *c.GetWindowCenter(),
                        c.GetExplicitAspectRatio() if c.GetUseExplicitAspectRatio() else 0.0,
                    ]
                    for c in cameras
                ],
            }
        finally:
            for camera, copy, note in zip(cameras, copies, notes, strict=True):
                camera.DeepCopy(copy)
                camera.Modified()  # or VTK draws the next frame by the matrices of the last one
                vars(camera).update(note)


def _checked(window_size, scale, image_size):
    """Return the size of the window, the scale and the size of the image."""
    if scale is not None and image_size is not None:
        raise ValueError(
            f'scale must be None with a window_size, got {scale!r} and {image_size!r}'
        )
    if image_size is None:
        scale = 1 if scale is None else scale
        if not _is_count(scale):
            raise ValueError(f'scale must be a positive integer, got {scale!r}')
        return window_size, scale, tuple(n * scale for n in window_size)
    if np.shape(image_size) != (2,) or not all(map(_is_count, image_size)):
        raise ValueError(
            f'window_size must be two positive integers, width and height, got {image_size!r}'
        )
    scale = max(-(-n // m) for n, m in zip(image_size, window_size, strict=True))
    return tuple(-(-n // scale) for n in image_size), scale, tuple(image_size)


def check_samples(samples):
    """Raise an error unless samples is a positive integer."""
    if not _is_count(samples):
        raise ValueError(f'samples must be a positive integer, got {samples!r}')


_LARGEST = 1 << 30  # of VTK's integers


def _is_count(number):
    return (
        isinstance(number, int | np.integer)
        and not isinstance(number, bool)
        and 0 < number < _LARGEST
    )


@contextmanager
def _resized(window, new_size):
    old_size = tuple(window.GetActualSize())
    if new_size != old_size:
        window.SetSize(*new_size)
    try:
        yield
    finally:
        if new_size != old_size:
            window.SetSize(*old_size)


@contextmanager
def _transparent(window, is_wanted):
    """Draw with alpha, for which VTK needs alpha planes."""
    old_planes = window.GetAlphaBitPlanes()
    if is_wanted:
        window.SetAlphaBitPlanes(1)
    try:
        yield
    finally:
        window.SetAlphaBitPlanes(old_planes)


@contextmanager
def sampled(pipelines, draw_sample, sample_count, set_moment=None):
    """Yield a function that draws a frame as the mean of many samples in all subplots.

    `set_moment` is called before each sample with its time in the exposure, 0 to 1.
    """
    if sample_count == 1:
        yield draw_sample
        return
    drawing = [pipeline for pipeline in pipelines if pipeline.renderer.GetDraw()]
    old_effects = [
        next((e for e in p.effects if isinstance(e, Accumulation)), None) for p in drawing
    ]
    was_enabled = [old is not None and old.enabled for old in old_effects]
    effects = [old or p.add(Accumulation()) for p, old in zip(drawing, old_effects, strict=True)]

    def draw():
        for k in range(sample_count):
            if set_moment is not None:
                set_moment((k + 0.5) / sample_count)
            for effect in effects:
                effect.enabled = True
                effect.take(k, sample_count)
            draw_sample()

    try:
        yield draw
    finally:
        for k, pipeline in enumerate(drawing):
            if old_effects[k] is None:
                pipeline.remove(effects[k])
            else:
                effects[k].enabled = was_enabled[k]
                effects[k].take(None)
