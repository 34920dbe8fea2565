"""Whether surfaces hide places from each other, by rays that embree casts."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from pvibr.projection.samples import bounds_of

#: A ray starts so far above its surface, in sizes of the scene: what embree's float32 resolves.
_LIFT = 1e-6
#: Rays cast at once: what they need stays within some 100 MiB.
_CHUNK = 1 << 20
_FAR = 1e30


def ray_method(method) -> bool:
    """Return whether a method, 'auto', 'rays' or 'map', casts rays."""
    if method not in ('auto', 'rays', 'map'):
        msg = f"method is {method!r}; it must be 'auto', 'rays' or 'map'."
        raise ValueError(msg)
    there = find_spec('embreex') is not None
    if method == 'rays' and not there:
        msg = "method is 'rays', which needs embree: pip install \"pvibr[rays]\"; or method='map'."
        raise ModuleNotFoundError(msg)
    return there and method != 'map'


class Rays:
    """Surfaces that rays may meet."""

    def __init__(self, surfaces):
        triangles = np.concatenate([_triangles(s) for s in surfaces if s.n_points])
        self._scene = None
        if not len(triangles):
            return
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        bounds = bounds_of(surfaces)
        low, high = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
        # About the origin and of a size of 1, wherever they are: embree has float32.
        self._center, self._size = (low + high) / 2, float(np.linalg.norm(high - low))
        # Far from the origin points are known no better than numbers there are spaced.
        self._lift = _LIFT + 4 * np.spacing(np.abs(self._center).max()) / self._size
        self._scene = EmbreeScene(robust=True)
        triangles -= self._center
        triangles /= self._size
        TriangleMesh(self._scene, _float32(triangles))

    def free(self, points, normals, toward, reach) -> np.ndarray:
        """Return whether nothing is between points and what is so far along unit vectors, (m,)."""
        found = np.ones(len(points), bool)
        if self._scene is None:
            return found
        for rows in np.array_split(np.arange(len(points)), len(points) // _CHUNK + 1):
            start = (points[rows] - self._center) / self._size + self._lift * normals[rows]
            away = np.minimum(reach[rows] / self._size, _FAR)
            ray = _float32(start), _float32(toward[rows]), _float32(away)
            found[rows] = self._scene.run(*ray, query='OCCLUDED') < 0
        return found


def _triangles(surface) -> np.ndarray:
    """Return the corners of a surface's triangles, (n, 3, 3)."""
    flat = surface if surface.is_all_triangles else surface.triangulate()
    return np.asarray(flat.points, float)[flat.regular_faces.reshape(-1, 3)]


def _float32(array):
    return np.ascontiguousarray(array, np.float32)
