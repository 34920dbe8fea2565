"""PyVista's camera with the view of a photograph, and what VTK's cameras cannot show of it."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.errors import warn
from pvibr.maths.orthographic import Orthographic

#: Pixels that a view may be off without a word.
_TOLERANCE = 0.01


def view_camera(photo, size):
    """Return PyVista's camera that shows a photograph's view in a window of a size."""
    camera, calibrated = pv.Camera(), photo.camera
    right, down, ahead = photo.camera_from_world[:3, :3]
    camera.up = -down
    if isinstance(calibrated, Orthographic):
        camera.parallel_projection = True
        camera.parallel_scale = calibrated.height / 2
        center = photo.position + (calibrated.width * right - calibrated.height * down) / 2
        camera.position, camera.focal_point = center - calibrated.height * ahead, center
        extent = np.array([calibrated.width, calibrated.height])
        _stretch(camera, photo.size or extent, size, extent)
        return camera
    camera.position, camera.focal_point = photo.position, photo.position + ahead
    lens = getattr(calibrated, 'lens', None)
    if getattr(lens, 'is_panorama', False):
        camera.view_angle = 90.0
        return camera
    _warn_of_skew(photo)
    focal = calibrated.K.diagonal()[:2] * getattr(lens, 'focus', 1.0)
    camera.view_angle = np.degrees(2 * np.arctan(photo.height / (2 * focal[1])))
    _stretch(camera, photo.size, size, photo.size / focal)
    shift = (2 * calibrated.K[:2, 2] + 1) / photo.size - 1
    width_share = photo.width / photo.height / (size[0] / size[1])
    camera.SetWindowCenter(-shift[0] * width_share, shift[1])
    return camera


def _stretch(camera, picture_size, window_size, extent):
    """Set the aspect ratio of a view whose picture spans `extent`, if its pixels are oblong."""
    pixel_width, pixel_height = extent / picture_size
    stretch = pixel_width / pixel_height
    if abs(stretch - 1) * picture_size[0] > _TOLERANCE:
        camera.SetUseExplicitAspectRatio(True)
        camera.SetExplicitAspectRatio(window_size[0] / window_size[1] * stretch)


def _warn_of_skew(photo):
    """Warn by how many pixels a view without the skew of a photograph is off."""
    (_, skew, _), (_, fy, cy) = photo.K[:2]
    farthest_row = max(cy + 0.5, photo.height - 0.5 - cy)
    offset = abs(skew / fy) * farthest_row
    if offset > _TOLERANCE:
        name = repr(photo.name) if photo.name else 'camera'
        warn(
            f'{name}: the view is off by up to {offset:.3g} px, as cameras of VTK have no skew, '
            f'here {skew:.6g} px; projectors, depth maps and visibility include it'
        )
