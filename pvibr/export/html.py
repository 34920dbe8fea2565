"""A plotter of plain actors as a self-contained page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.files import replacing, with_suffix

#: The view angle of all vtk.js pages, in degrees.
ANGLE = 30.0


def export_html(path, make_plain):
    """Write the plotter that a function makes, which is only called if the path is valid."""
    path = with_suffix(path, '.html')
    plain = make_plain()
    try:
        write_html(plain, path)
    finally:
        plain.close()


def write_html(plotter, path):
    """Write a vtk.js page; the plotter's cameras are changed to ones that it supports."""
    component = getattr(plotter, 'trame', None)
    if component is None:
        raise ImportError("pages need trame: pip install 'pvibr[jupyter]'")
    for camera in {id(r.camera): r.camera for r in plotter.renderers}.values():
        reframe(camera, ANGLE)
    for renderer in plotter.renderers:
        renderer.ResetCameraClippingRange()
    text = component.export_html(None).getvalue()
    with replacing(path) as temporary:
        Path(temporary).write_text(text, encoding='utf-8')


def reframe(camera, angle):
    """Set a camera's view angle, and move it so that its focal point keeps its size."""
    position, focus = np.array(camera.position), np.array(camera.focal_point)
    away = float(np.linalg.norm(position - focus))
    half = away * np.tan(np.radians(camera.view_angle / 2))
    if camera.GetParallelProjection():
        half = camera.parallel_scale
        camera.parallel_projection = False
    elif np.isclose(camera.view_angle, angle):
        return
    camera.view_angle = angle
    further = half / np.tan(np.radians(angle / 2))
    camera.position = tuple(focus + (position - focus) / away * further)
