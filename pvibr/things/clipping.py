"""Clipping planes of things whose surfaces are found by fragment shaders."""

from __future__ import annotations

import numpy as np

#: As many as VTK takes.
_MOST = 6
#: Fragment shader: whether a place in eye space is on the sides that planes keep.
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


class ClippingPlanes:
    """Planes in the world, of which each keeps what its normal points to."""

    def __init__(self, planes=None):
        self._planes = [] if planes is None else list(planes)
        if len(self._planes) > _MOST:
            raise ValueError(f'planes are {len(self._planes)}: must be {_MOST} at most')

    def __len__(self):
        return len(self._planes)

    def key(self) -> tuple:
        """Return what changes with them."""
        return tuple(plane.GetMTime() for plane in self._planes)

    def _equations(self) -> np.ndarray:
        """Return normals and offsets, shape (n, 4)."""
        normals = np.array([p.GetNormal() for p in self._planes]).reshape(-1, 3)
        origins = np.array([p.GetOrigin() for p in self._planes]).reshape(-1, 3)
        return np.column_stack([normals, -(normals * origins).sum(1)])

    def kept(self, points) -> np.ndarray:
        """Return which points, (..., 3), are on the sides that are kept."""
        found = self._equations()
        return (points @ found[:, :3].T + found[:, 3] >= 0).all(-1)

    def reach(self, start, direction) -> tuple[float, float]:
        """Return between which distances, of 0 and more, a ray is on the sides that are kept."""
        found = self._equations()
        rise, above = found[:, :3] @ direction, found[:, :3] @ start + found[:, 3]
        with np.errstate(divide='ignore', invalid='ignore'):
            met = -above / rise
        last = -np.inf if ((rise == 0) & (above < 0)).any() else np.inf
        return met[rise > 0].max(initial=0.0), met[rise < 0].min(initial=last)

    def uniforms(self, frame) -> dict:
        """Return the uniforms of a view: planes in eye space, and such that keep all."""
        rows = np.tile([0.0, 0.0, 0.0, 1.0], (_MOST, 1))
        rows[: len(self)] = self._equations() @ np.linalg.inv(frame.view_from_world)
        return {'ibr_planes': rows.reshape(-1, 1)}
