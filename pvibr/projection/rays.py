"""Whether surfaces hide places from each other, by rays that embree casts."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from pvibr.maths.arguments import check_one_of
from pvibr.projection.samples import bounds_of, triangles_of

#: A ray starts so far above its surface, in sizes of the scene: what embree's float32 resolves.
_LIFT = 1e-6
#: Rays cast at once: what they need stays within some 100 MiB.
_CHUNK = 1 << 20
_FAR = 1e30
#: The last triangles and their tree: the sun moves more often than the land.
_KEPT: list = []
_MOST_KEPT = 1 << 20  # triangles of a tree that is kept: some 100 MiB


def ray_method(method) -> bool:
    """Return whether a method, 'auto', 'rays' or 'map', casts rays."""
    check_one_of('method', method, ('auto', 'rays', 'map'))
    there = find_spec('embreex') is not None
    if method == 'rays' and not there:
        raise ModuleNotFoundError(
            "method is 'rays', which needs embree: pip install \"pvibr[rays]\"; or method='map'."
        )
    return there and method != 'map'


class Rays:
    """Surfaces that rays may meet."""

    def __init__(self, surfaces):
        self._scene = None
        surfaces = [s for s in surfaces if s.n_points]
        faces = [triangles_of(s) for s in surfaces]
        if not sum(map(len, faces)):
            return
        bounds = bounds_of(surfaces)
        low, high = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
        # About the origin and of a size of 1, wherever they are: embree has float32.
        self._center, self._size = (low + high) / 2, float(np.linalg.norm(high - low))
        # Far from the origin points are known no better than numbers there are spaced.
        self._lift = _LIFT + 4 * np.spacing(np.abs(self._center).max()) / self._size
        points = [_float32((s.points - self._center) / self._size) for s in surfaces]
        first = np.cumsum([0, *map(len, points)])[:-1]
        corners = [f + k for f, k in zip(faces, first, strict=True)]
        self._scene = _scene(np.concatenate(points), np.concatenate(corners).astype(np.int32))

    def free(self, points, normals, toward, reach) -> np.ndarray:
        """Return whether nothing is between points and what is so far along unit vectors, (m,)."""
        found = np.ones(len(points), bool)
        if self._scene is None:
            return found
        for first in range(0, len(points), _CHUNK):
            rows = slice(first, first + _CHUNK)
            start = points[rows] - self._center
            start /= self._size
            start += self._lift * normals[rows]
            away = np.minimum(reach[rows] / self._size, _FAR)
            ray = _float32(start), _float32(toward[rows]), _float32(away)
            found[rows] = self._scene.run(*ray, query='OCCLUDED') < 0
        return found


def _scene(points, faces):
    """Return a scene of embree; the last one again if it has the same triangles."""
    if _KEPT and np.array_equal(_KEPT[0], points) and np.array_equal(_KEPT[1], faces):
        return _KEPT[2]
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, points, faces)
    if len(faces) <= _MOST_KEPT:
        _KEPT[:] = points, faces, scene
    return scene


def _float32(array):
    return np.ascontiguousarray(array, np.float32)
