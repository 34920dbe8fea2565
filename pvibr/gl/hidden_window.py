"""Off-screen windows, and actors rasterized in them."""

from __future__ import annotations

from contextlib import contextmanager
from weakref import WeakKeyDictionary

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.drawer import Drawer
from pvibr.gl.target import Target
from pvibr.gl.texture import texture_limit

#: Renderers whose frames may be interrupted by off-screen drawing, and the threads of them.
RENDERERS: WeakKeyDictionary = WeakKeyDictionary()
#: Weights of red, green and blue in a triangle's index.
_DIGITS = np.array([1, 1 << 8, 1 << 16], np.int32)


@contextmanager
def hidden_window(width=64, height=64):
    """Yield a small off-screen window with a live context; restore the previous one afterwards."""
    here = [r for r, thread in RENDERERS.items() if thread.is_here()]
    windows = [w for r in here if (w := r.GetRenderWindow()) is not None]
    # Every window of EGL says that it is the current one: within a frame, it is the one drawn.
    windows = [w for w in windows if w.CheckInRenderStatus()] or windows
    current_window = next((w for w in windows if not w.GetNeverRendered() and w.IsCurrent()), None)
    renderer = _vtk.vtkOpenGLRenderer()  # first: it loads VTK's OpenGL for the window
    window = _vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(1)
    window.SetSize(width, height)
    window.AddRenderer(renderer)
    window.Render()
    try:
        yield window, renderer
    finally:
        window.RemoveRenderer(renderer)
        window.Finalize()
        if current_window is not None:
            current_window.MakeCurrent()


def rasterize(actors, view, size, formats=('rgba8',), *, samples=1, blend=False) -> list:
    """Draw actors in a view off screen; return an array per format, bottom row first.

    Each side has `samples` times as many pixels as `size`, or fewer at the driver's limit.
    """
    return next(rasterize_views(actors, [view], size, formats, samples=samples, blend=blend))


def triangles_seen(mesh, views, size):
    """Yield the triangle at each pixel centre, (h, w), bottom row first; -1 for none."""
    index_bytes = np.arange(1, mesh.GetNumberOfCells() + 1)[:, None] >> [0, 8, 16] & 255
    mesh.GetCellData().SetScalars(_vtk.numpy_to_vtk(index_bytes.astype(np.uint8), deep=True))
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(mesh)
    mapper.SetScalarModeToUseCellData()
    actor = _vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    for (picture,) in rasterize_views([actor], views, size):
        yield np.einsum('hwc,c->hw', picture[..., :3], _DIGITS) - 1


def rasterize_views(actors, views, size, formats=('rgba8',), *, samples=1, blend=False):
    """Yield what :func:`rasterize` returns for one view after the other."""
    with hidden_window() as (window, renderer):
        while max(size) * samples > texture_limit(window) and samples > 1:
            samples //= 2
        pixel_width, pixel_height = (samples * int(n) for n in size)
        drawer = Drawer(renderer)
        target = Target(window, pixel_width, pixel_height, formats, depth=True)
        try:
            for view in views:
                window.MakeCurrent()  # the consumer may draw elsewhere in between
                with target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
                    drawer.look(view, (0, 0, pixel_width, pixel_height))
                    if blend:
                        window.GetState().SetEnumState(gl.BLEND, True)
                        window.GetState().vtkglBlendFuncSeparate(*gl.OVER)
                    drawer.draw(actors)
                yield [color.download() for color in target.colors]
        finally:
            window.MakeCurrent()
            for actor in actors:
                actor.ReleaseGraphicsResources(window)
            target.release()
            drawer.release()


def read_pixels(window, size=None, *, alpha=False, displayed=True) -> np.ndarray:
    """Return a frame's pixels, bottom row first, as displayed or as means of samples."""
    width, height = window.GetSize() if size is None else size
    pixel_array = _vtk.vtkUnsignedCharArray()
    # The front buffer is as displayed; VTK averages the back buffer's samples without gamma.
    area = 0, 0, width - 1, height - 1, int(displayed), pixel_array
    if alpha:
        window.GetRGBACharPixelData(*area)
    else:
        window.GetPixelData(*area, 0)
    return _vtk.vtk_to_numpy(pixel_array).reshape(height, width, -1)
