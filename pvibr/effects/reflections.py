"""Views of flat mirrors in parallel projection."""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import View, look_along

_OFFSET = 1e-3  # of the size of the scene, so that a mirror does not reflect itself


def through_rectangle(rectangle, sight, bounds) -> View | None:
    """Return the parallel view from behind a mirror, its rectangle filling it, sides swapped.

    `rectangle` is corner, right, up as seen from the front; None if nothing is in front.
    """
    corner, right, up = (np.asarray(vector, float) for vector in rectangle)
    side_lengths = np.linalg.norm(right), np.linalg.norm(up)
    normal = np.cross(right / side_lengths[0], up / side_lengths[1])
    sight = np.asarray(sight, float) / np.linalg.norm(sight)
    reflected = sight - 2 * (sight @ normal) * normal
    if not len(bounds):
        return None
    low, high = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
    far = float((np.where(normal > 0, high, low) - corner) @ normal)
    scene_size = float(np.linalg.norm(high - low) + sum(side_lengths))
    near = _OFFSET * scene_size
    if far <= near:
        return None
    far *= 1 + _OFFSET  # so that surfaces exactly there are included
    mirror_center = corner + (right + up) / 2
    eye_distance = scene_size + float(np.linalg.norm((low + high) / 2 - mirror_center))
    view = look_along(mirror_center - eye_distance * reflected, reflected, up)
    # Along the sight to the mirror's plane, and there in fractions of its sides.
    shares = [
        (side - normal * (reflected @ side) / (reflected @ normal)) / (side @ side)
        for side in (right, up)
    ]
    clip_rows = np.array([-2 * shares[0], 2 * shares[1], 2 * normal / (far - near)])
    clip = np.eye(4)
    clip[:3, :3] = clip_rows @ view[:3, :3].T
    eye_offset = mirror_center - eye_distance * reflected - corner
    clip[:3, 3] = clip_rows @ eye_offset + [1.0, -1.0, -1.0 - 2 * near / (far - near)]
    return View(view, clip, 1e-3 * eye_distance, 2 * eye_distance, True)
