"""Screenshots larger than the window or than the GPU can draw at once, in overlapping tiles."""

from __future__ import annotations

import math
from contextlib import contextmanager

import numpy as np

from pvibr.capture.montage import save
from pvibr.capture.samples import sampled
from pvibr.core.errors import ClosedError
from pvibr.core.files import in_a_folder
from pvibr.core.frame import Frame
from pvibr.core.params import checked_flag
from pvibr.core.passes import passes_of
from pvibr.core.plotters import is_closed, is_never_shown
from pvibr.gl.offscreen import read_pixels
from pvibr.maths.arguments import naming

#: Reach in pixels of VTK's own passes, such as FXAA and EDL.
_NEIGHBOURS = 8
#: Tiles begin at multiples of it, so that effects in blocks of pixels have the same blocks.
_GRID = 16
#: Maximum overlap as a fraction of a tile's side, at either end.
_MOST = 0.4


def spans(whole, tile, margin) -> list[tuple[int, int, int]]:
    """Return the begin of tiles along one side of an image, and the range kept of each."""
    grid = _GRID if tile - 2 * margin > 2 * _GRID else 1
    found, done = [], 0
    while done < whole:
        begin = max(0, min((done - margin) // grid * grid, whole - tile))
        end = whole if begin + tile == whole else begin + tile - margin
        found.append((begin, done, end))
        done = end
    return found


def picture(window, scale, effects, draw, *, transparent=False) -> np.ndarray:
    """Draw a magnified window by a function, in tiles of the window's size."""
    size = window.GetActualSize()
    with _own_cameras(window) as cameras:
        window.SetTileScale(scale, scale)
        margins = _margins(window, cameras, effects, size, scale)
        columns, rows = (spans(n * scale, n, m) for n, m in zip(size, margins, strict=True))
        whole = np.empty((size[1] * scale, size[0] * scale, 4 if transparent else 3), np.uint8)
        for bottom, low, high in rows:
            for left, first, last in columns:
                _look(window, cameras, (left, bottom), size, scale)
                draw(window)
                tile = read_pixels(window, size, alpha=transparent)
                kept = tile[low - bottom : high - bottom, first - left : last - left]
                whole[low:high, first:last] = kept
    return whole[::-1]


def _renderers(window):
    renderers = window.GetRenderers()
    return [renderers.GetItemAsObject(i) for i in range(renderers.GetNumberOfItems())]


@contextmanager
def _own_cameras(window):
    """Give each renderer a copy of its camera; yield the originals, which are restored."""
    cameras = {r: r.GetActiveCamera() for r in _renderers(window) if r.GetDraw()}
    viewport, scale = tuple(window.GetTileViewport()), tuple(window.GetTileScale())
    try:
        for renderer, camera in cameras.items():
            own = camera.NewInstance()
            own.ShallowCopy(camera)
            renderer.SetActiveCamera(own)
        yield cameras
    finally:
        window.SetTileScale(*scale)
        window.SetTileViewport(*viewport)
        for renderer, camera in cameras.items():
            renderer.SetActiveCamera(camera)
            renderer.DrawOn()


def _look(window, cameras, corner, size, scale):
    """Set window and cameras to a tile."""
    low = np.array(corner) / (np.array(size) * scale)
    tile = np.concatenate([low, low + 1 / scale])
    window.SetTileViewport(*tile)
    for renderer, camera in cameras.items():
        whole = np.array(renderer.GetViewport()).reshape(2, 2)
        seen = np.clip(whole, tile[:2], tile[2:])
        # A renderer with fewer pixels here than the overlap is drawn in another tile; VTK's passes
        # would create empty textures for it.
        least = np.minimum(_NEIGHBOURS / np.array(size), _MOST) / scale
        least = 0.99 * np.minimum(least, whole[1] - whole[0])
        renderer.SetDraw(bool((seen[1] - seen[0] > least).all()))
        if not renderer.GetDraw():
            continue
        share = (seen[1] - seen[0]) / (whole[1] - whole[0])
        own = renderer.GetActiveCamera()
        of = share[0] if camera.GetUseHorizontalViewAngle() else share[1]
        half = math.tan(math.radians(camera.GetViewAngle()) / 2)
        own.SetViewAngle(math.degrees(2 * math.atan(half * of)))
        own.SetParallelScale(camera.GetParallelScale() * share[1])
        # In half sizes of the tile; the user's own window centre is in half sizes of the whole.
        shift = (seen.sum(0) - whole.sum(0)) / (seen[1] - seen[0])
        own.SetWindowCenter(*(np.array(camera.GetWindowCenter()) / share + shift))


def _margins(window, cameras, effects, size, scale):
    """Return the overlap of tiles, in columns and rows."""
    frames = {}
    for renderer in cameras:
        # Each in a tile that has some of it: the first may have nothing.
        corner = [
            min(int(low * n * scale), n * (scale - 1))
            for low, n in zip(renderer.GetViewport()[:2], size, strict=True)
        ]
        _look(window, cameras, corner, size, scale)
        if renderer.GetDraw():
            frames[renderer] = Frame.of(renderer)
    reaches = [_reach_of_passes(*item) for item in frames.items()]
    for effect in effects:
        frame = frames.get(effect.pipeline.renderer)
        if frame is not None and effect.enabled:
            reaches.append(effect.reach(frame))
    return [min(math.ceil(max(reaches, default=0)), int(_MOST * n)) for n in size]


def _reach_of_passes(renderer, frame):
    """Return the reach in pixels of VTK's passes, above all of ambient occlusion."""
    found = [p for p in passes_of(renderer) if p.IsA('vtkSSAOPass')]
    # At the near plane, where it is widest.
    scale = frame.pixel_scale / (1 if frame.parallel else frame.near)
    return _NEIGHBOURS + sum(p.GetRadius() * scale for p in found)


class TiledScreenshot:
    """Screenshots of a plotter's window."""

    def __init__(self, plotter, effects, pipelines, full):
        self._plotter, self._effects, self._full = plotter, effects, full
        self._pipelines = pipelines

    def take(
        self, scale=None, size=None, transparent=None, filename=None, *, samples=1, moments=None
    ) -> np.ndarray:
        """Draw an image, and write it if there is a file name; see `sampled` for the last two."""
        check_samples(samples)
        if filename is not None:
            filename = in_a_folder('filename', filename)
        window = self._window()
        tile, scale, size = _checked(tuple(window.GetActualSize()), scale, size)
        transparent = checked_flag('transparent_background', transparent, optional=True)
        if transparent is None:
            theme = getattr(self._plotter, 'theme', None)
            transparent = bool(getattr(theme, 'transparent_background', False))
        with _resized(window, tile), _transparent(window, transparent), self._full():
            if scale > 1:
                window.Render()  # effects spread light over the whole image at the window's size
            with sampled(self._pipelines(), samples, moments) as draw:
                effects = self._effects()
                image = picture(window, scale, effects, draw, transparent=transparent)
        if scale > 1 or samples > 1 or transparent or tuple(window.GetActualSize()) != tile:
            self.draw()
        image = np.ascontiguousarray(image[: size[1], : size[0]])
        if filename is not None:
            with naming('filename', filename):
                save(filename, image)
        return image

    def draw(self):
        """Draw the window as it is: what reads it next finds no tile and no other time."""
        with self._full():
            self._window().Render()

    def _window(self):
        if is_closed(self._plotter):
            raise ClosedError('the plotter was closed: nothing can be drawn')
        if is_never_shown(self._plotter):
            self._plotter.screenshot(return_img=False)  # sets up camera and window
        return self._plotter.renderer.GetRenderWindow()

    @contextmanager
    def cameras_restored(self):
        """Restore the cameras afterwards; yield cameras and window size as JSON values."""
        window = self._window()
        cameras = [renderer.GetActiveCamera() for renderer in _renderers(window)]
        copies = [camera.NewInstance() for camera in cameras]
        notes = [dict(vars(camera)) for camera in cameras]  # of PyVista, such as the azimuth
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
                    ]
                    for c in cameras
                ],
            }
        finally:
            for camera, copy, note in zip(cameras, copies, notes, strict=True):
                camera.DeepCopy(copy)
                vars(camera).update(note)


def _checked(window, scale, size):
    """Return the size of the window, the scale and the size of the image."""
    if scale is not None and size is not None:
        raise ValueError(f'scale = {scale!r} and window_size = {size!r}: give only one of them.')
    if size is None:
        scale = 1 if scale is None else scale
        if not _is_count(scale):
            raise ValueError(f'scale = {scale!r}: must be a positive integer.')
        return window, scale, tuple(n * scale for n in window)
    if np.shape(size) != (2,) or not all(map(_is_count, size)):
        raise ValueError(
            f'window_size = {size!r}: must be two positive integers, width and height in pixels.'
        )
    scale = max(-(-n // m) for n, m in zip(size, window, strict=True))
    return tuple(-(-n // scale) for n in size), scale, tuple(size)


def check_samples(samples):
    """Raise an error unless a number of samples of each pixel is one."""
    if not _is_count(samples):
        raise ValueError(f'samples = {samples!r}: must be a positive integer.')


#: Of what VTK takes as a whole number.
_LARGEST = 1 << 30


def _is_count(number):
    return (
        isinstance(number, int | np.integer)
        and not isinstance(number, bool)
        and 0 < number < _LARGEST
    )


@contextmanager
def _resized(window, size):
    before = tuple(window.GetActualSize())
    if size != before:
        window.SetSize(*size)
    try:
        yield
    finally:
        if size != before:
            window.SetSize(*before)


@contextmanager
def _transparent(window, wanted):
    """Draw with alpha, which VTK keeps only in windows with alpha planes."""
    before = window.GetAlphaBitPlanes()
    if wanted:
        window.SetAlphaBitPlanes(1)
    try:
        yield
    finally:
        window.SetAlphaBitPlanes(before)
