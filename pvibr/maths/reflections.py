"""Views of flat mirrors in parallel projection."""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import View, look_along

_OFFSET = 1e-3  # of the reach of the scene, so that a mirror does not see itself


def through_rectangle(rectangle, sight, bounds) -> View | None:
    """Return the parallel view from behind a mirror, its rectangle filling it, sides swapped.

    `rectangle` is corner, right, up as seen from the front; None if nothing is in front.
    """
    corner, right, up = (np.asarray(x, float) for x in rectangle)
    lengths = np.linalg.norm(right), np.linalg.norm(up)
    normal = np.cross(right / lengths[0], up / lengths[1])
    sight = np.asarray(sight, float) / np.linalg.norm(sight)
    out = sight - 2 * (sight @ normal) * normal
    if not len(bounds):
        return None
    low, high = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
    far = float((np.where(normal > 0, high, low) - corner) @ normal)
    size = float(np.linalg.norm(high - low) + sum(lengths))
    near = _OFFSET * size
    if far <= near:
        return None
    far *= 1 + _OFFSET  # so that what ends there is seen
    middle = corner + (right + up) / 2
    reach = size + float(np.linalg.norm((low + high) / 2 - middle))
    view = look_along(middle - reach * out, out, up)
    # Along the sight to the mirror's plane, and there in shares of its sides.
    shares = [
        (side - normal * (out @ side) / (out @ normal)) / (side @ side) for side in (right, up)
    ]
    rows = np.array([-2 * shares[0], 2 * shares[1], 2 * normal / (far - near)])
    clip = np.eye(4)
    clip[:3, :3] = rows @ view[:3, :3].T
    eye = middle - reach * out - corner
    clip[:3, 3] = rows @ eye + [1.0, -1.0, -1.0 - 2 * near / (far - near)]
    return View(view, clip, 1e-3 * reach, 2 * reach, True)
