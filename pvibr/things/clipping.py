"""Clipping planes of things whose surfaces are found in fragment shaders."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk

#: VTK's limit.
_MAX_PLANES = 6
#: GLSL: whether a point in view space is on the kept side of all planes.
KEPT = """uniform float ibr_planes[24];
bool ibr_kept(vec3 place)
{
  for (int k = 0; k < 24; k += 4)
  {
    vec4 plane = vec4(ibr_planes[k], ibr_planes[k + 1], ibr_planes[k + 2], ibr_planes[k + 3]);
    if (dot(plane, vec4(place, 1.0)) < 0.0) return false;
  }
  return true;
}
"""


def set_planes(mapper, planes):
    """Have a mapper clip by planes, which other mappers may have, too."""
    collection = _vtk.vtkPlaneCollection()  # mappers that share one empty it for each other
    for plane in planes:
        collection.AddItem(plane)
    mapper.SetClippingPlanes(collection)


class ClippingPlanes:
    """World-space planes, each of which keeps the side that its normal points to."""

    def __init__(self, planes=None):
        self._planes = [] if planes is None else list(planes)
        if len(self._planes) > _MAX_PLANES:
            raise ValueError(f'planes must be at most {_MAX_PLANES}, got {len(self._planes)}')

    def __len__(self):
        return len(self._planes)

    def key(self) -> tuple:
        """Return a value that changes with the planes."""
        return tuple([plane.GetMTime() for plane in self._planes]) if self._planes else ()

    def _equations(self) -> np.ndarray:
        """Return normals and offsets, shape (n, 4)."""
        normals = np.array([p.GetNormal() for p in self._planes]).reshape(-1, 3)
        origins = np.array([p.GetOrigin() for p in self._planes]).reshape(-1, 3)
        return np.column_stack([normals, -(normals * origins).sum(1)])

    def kept(self, points) -> np.ndarray:
        """Return which points, (..., 3), are on the kept sides."""
        equations = self._equations()
        return (points @ equations[:, :3].T + equations[:, 3] >= 0).all(-1)

    def reach(self, ray_start, direction) -> tuple[float, float]:
        """Return the (first, last) distance, at least 0, at which a ray is on the kept sides."""
        equations = self._equations()
        slopes = equations[:, :3] @ direction
        heights = equations[:, :3] @ ray_start + equations[:, 3]
        with np.errstate(divide='ignore', invalid='ignore'):
            crossings = -heights / slopes
        last = -np.inf if ((slopes == 0) & (heights < 0)).any() else np.inf
        return crossings[slopes > 0].max(initial=0.0), crossings[slopes < 0].min(initial=last)

    def uniforms(self, frame) -> dict:
        """Return the uniforms of a view: planes in view space, padded by planes that keep all."""
        view_planes = np.tile([0.0, 0.0, 0.0, 1.0], (_MAX_PLANES, 1))
        view_planes[: len(self)] = self._equations() @ np.linalg.inv(frame.view_from_world)
        return {'ibr_planes': view_planes.reshape(-1, 1)}
