"""A plotter of plain actors as a self-contained page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.files import replacing, with_suffix
from pvibr.things.clipping_range import is_cut, reset_clipping_range

#: View angle of all vtk.js pages in degrees.
ANGLE = 30.0
#: Least ratio of near to far plane.
_NEAREST = 1e-3


def export_html(path, make_plain):
    """Write the plotter that a function makes once the path is valid."""
    path = with_suffix(path, '.html')
    plain_plotter = make_plain()
    try:
        write_html(plain_plotter, path)
    finally:
        plain_plotter.close()


def write_html(plotter, path):
    """Write a vtk.js page; changes the plotter's cameras to supported ones."""
    trame_component = getattr(plotter, 'trame', None)
    if trame_component is None:
        raise ImportError("pages require trame: pip install 'pvibr[jupyter]'")
    for camera in {id(r.camera): r.camera for r in plotter.renderers}.values():
        reframe(camera, ANGLE)
    for renderer in plotter.renderers:
        if not is_cut(renderer):
            reset_clipping_range(renderer)
    page_text = trame_component.export_html(None).getvalue()
    with replacing(path) as temporary_path:
        Path(temporary_path).write_text(page_text, encoding='utf-8')


def reframe(camera, view_angle):
    """Set a camera's view angle, and move it so that the focal point keeps its size.

    The clipping planes stay where they are in the scene.
    """
    position, focal_point = np.array(camera.position), np.array(camera.focal_point)
    old_distance = float(np.linalg.norm(position - focal_point))
    half_height = old_distance * np.tan(np.radians(camera.view_angle / 2))
    if camera.GetParallelProjection():
        half_height = camera.parallel_scale
        camera.parallel_projection = False
    elif np.isclose(camera.view_angle, view_angle):
        return
    camera.view_angle = view_angle
    new_distance = half_height / np.tan(np.radians(view_angle / 2))
    near, far = np.array(camera.clipping_range) + new_distance - old_distance
    camera.position = tuple(focal_point + (position - focal_point) / old_distance * new_distance)
    far = max(far, new_distance)
    camera.clipping_range = max(near, _NEAREST * far), far
