"""Small windows without a screen, for baking and measuring."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from pvibr.core import _vtk


@contextmanager
def hidden_window(width=64, height=64):
    """Yield a small off-screen window with a live context, finalized afterwards."""
    renderer = _vtk.vtkOpenGLRenderer()  # first: it loads VTK's OpenGL, which the window needs
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


def read_rgba(window) -> np.ndarray:
    """Return the picture of a window that was just rendered."""
    width, height = window.GetSize()
    pixels = _vtk.vtkUnsignedCharArray()
    window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, pixels)
    return _vtk.vtk_to_numpy(pixels).reshape(height, width, 4).copy()
