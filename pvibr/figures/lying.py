"""Figures that lie on their backs: their y points up, in a scene whose z does."""

from __future__ import annotations

import numpy as np

_MOSTLY = 0.7  # of the camera's up direction along z


def lying_note(figure, world_from_figure, pipeline) -> dict[str, str]:
    """Return what the report says of a figure that seems to lie on its back; else nothing."""
    if pipeline is None or 'upright' in figure.skeleton.names:
        return {}
    low, high = np.reshape(figure.bounds(), (3, 2)).T
    sizes = np.abs(world_from_figure[:3, :3]) @ (high - low)
    view_up = pipeline.renderer.GetActiveCamera().GetViewUp()
    if (low > high).any() or sizes[1] <= sizes[2] or view_up[2] < _MOSTLY:
        return {}
    return {
        'up': f'it measures {sizes[1]:.3g} along y and {sizes[2]:.3g} along z, but z points up '
        "for the camera: if it lies on its back, add it with up='z'"
    }
