"""Taking pictures of plotters, and comparing them."""

import io

import numpy as np
import pyvista as pv
from PIL import Image

from pvibr.core import _vtk


def damaged_jpeg():
    """Return the bytes of a white picture whose description breaks off: Pillow warns of it."""
    file = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), 255, np.uint8)).save(file, 'JPEG')
    start, described = file.getvalue()[:2], file.getvalue()[20:]  # 18 bytes tell the density
    broken = b'Exif\0\0II*\0\x08\0\0\0\x05\0\x1a\x01'
    return start + b'\xff\xe1' + (len(broken) + 2).to_bytes(2, 'big') + broken + described


def plotter(size=(120, 90), **options):
    """Return a plotter without anything that smooths edges."""
    pl = pv.Plotter(off_screen=True, window_size=size, **options)
    pl.disable_anti_aliasing()
    pl.render_window.SetMultiSamples(0)
    return pl


def places(size):
    """Return the centres of pixels as shares of the window, (h, w, 2), row 0 at the top."""
    u, v = (np.arange(size[0]) + 0.5) / size[0], 1 - (np.arange(size[1]) + 0.5) / size[1]
    return np.stack(np.meshgrid(u, v), -1)


def place(pl, eye, focus=(0, 0, 0), up=(0, 0, 1), angle=30.0, parallel=None, clip=None):
    """Put the camera somewhere, with a half height of the view where it is parallel."""
    camera = pl.camera
    camera.position, camera.focal_point, camera.up = eye, focus, up
    camera.view_angle = angle
    if parallel is not None:
        camera.parallel_projection = True
        camera.parallel_scale = parallel
    if clip is None:
        pl.renderer.ResetCameraClippingRange()
    else:
        camera.clipping_range = clip
    return pl


def shown(pl):
    """Show a plotter, and return the screenshot."""
    pl.show(auto_close=False)
    return shot(pl)


def shot(pl, **how):
    """Return a screenshot of a new frame, whole numbers from 0 to 255, top row first."""
    pl.render()
    return pl.screenshot(None, return_img=True, **how).astype(int)


def uncut(pl):
    """Return a screenshot of a new frame that no clipping plane cuts."""
    pl.renderer.ResetCameraClippingRange()
    return shot(pl)


def read(window):
    """Return the colours that a window holds, (h, w, 3), whole numbers to 255, top row first."""
    width, height = window.GetSize()
    pixels = _vtk.vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    return _vtk.vtk_to_numpy(pixels).reshape(height, width, 3)[::-1].astype(int)


def grab(pl):
    """Return the colours of a new frame, (h, w, 3) 0 to 1, top row first."""
    pl.render_window.Render()
    return read(pl.render_window) / 255.0


def depth_buffer(pl):
    """Return the depths of what was drawn last, 0 to 1, top row first."""
    window = pl.render_window
    width, height = window.GetSize()
    values = _vtk.vtkFloatArray()
    window.GetZbufferData(0, 0, width - 1, height - 1, values)
    return _vtk.vtk_to_numpy(values).reshape(height, width)[::-1].astype(float)


def depths(pl):
    """Return distances along the view's axis of what was drawn last, NaN where nothing was."""
    z = depth_buffer(pl)
    near, far = pl.camera.clipping_range
    if pl.camera.parallel_projection:
        away = near + z * (far - near)
    else:
        away = near * far / (far - z * (far - near))
    return np.where(z < 1, away, np.nan)


def rgba(pl):
    """Return colours times coverage, and coverage: from a frame on black and one on white."""
    pl.set_background('black')
    dark = grab(pl)
    pl.set_background('white')
    light = grab(pl)
    coverage = 1 - (light - dark).mean(2, keepdims=True)
    return np.concatenate([dark, coverage], 2)


def off(one, other):
    """Return how far pixels are off, in the colour that is furthest off."""
    return np.abs(one - other).max(axis=2)


def reduce(picture, factor):
    """Average squares of pixels."""
    h, w = (n // factor for n in picture.shape[:2])
    return picture.reshape(h, factor, w, factor, -1).mean((1, 3))


def centroid(coverage):
    """Return the middle of what is covered, in pixels: x, y."""
    y, x = np.indices(coverage.shape)
    return np.array([(coverage * x).sum(), (coverage * y).sum()]) / coverage.sum()


def pixel_of(pl, point):
    """Return the pixel of a point of the world."""
    pl.renderer.SetWorldPoint(*point, 1.0)
    pl.renderer.WorldToDisplay()
    return tuple(int(v) for v in pl.renderer.GetDisplayPoint()[:2])
