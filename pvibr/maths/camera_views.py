"""Views of calibrated cameras, with planes around what is drawn."""

from __future__ import annotations

import numpy as np

from pvibr.maths.orthographic import Orthographic
from pvibr.maths.views import View, corners

#: Texels of margin around a picture in its depth map, for comparisons at its edge.
_EDGE = 4.0
#: Smallest ratio of near to far plane.
_NEAREST = 1e-3


def view_of(camera, bounds, resolution) -> View | None:
    """Return a camera's view with planes around all bounds, None if all is behind it."""
    view_from_world = camera.view_from_world
    eye_depth = -(corners(bounds) @ view_from_world[2, :3] + view_from_world[2, 3])
    if not eye_depth.size:
        return None
    low, high = float(eye_depth.min()), float(eye_depth.max())
    margin = _EDGE / resolution
    if not isinstance(camera, Orthographic):
        if high <= 0:
            return None
        near, far = max(0.999 * low, _NEAREST * high), 1.001 * high
        return View(view_from_world, camera.clip_from_view(near, far, margin), near, far, False)
    low = max(low, camera.near)
    if low >= high and camera.near >= high:
        return None
    clearance = max(1e-3 * (high - low), 1e-3 * max(camera.width, camera.height))
    low, high = low - (clearance if low > camera.near else 0.0), high + clearance
    # Move the eye back, as near and far planes must be in front of it.
    eye_shift = np.eye(4)
    eye_shift[2, 3] = low - (high - low)
    near, far = high - low, 2 * (high - low)
    return View(
        eye_shift @ view_from_world, camera.clip_from_view(near, far, margin), near, far, True
    )
