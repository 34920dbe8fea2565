"""Occlusion by ray casting with embree."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from pvibr.core.arguments import check_one_of
from pvibr.visibility.surface_samples import bounds_of, triangles_of

#: Offset of a ray's start above its surface in scene sizes, as far as embree's float32 resolves.
_LIFT = 1e-6
#: Rays cast at once, to stay within about 100 MiB.
_CHUNK = 1 << 20
_FAR = 1e30
#: The last triangles and their tree: the sun moves more often than the land.
_CACHED_SCENE: list = []
_MAX_CACHED_FACES = 1 << 20  # about 100 MiB


def ray_method(method) -> bool:
    """Return whether a method casts rays."""
    check_one_of('method', method, ('auto', 'rays', 'map'))
    has_embree = find_spec('embreex') is not None
    if method == 'rays' and not has_embree:
        raise ModuleNotFoundError(
            "method='rays' needs embree: pip install \"pvibr[rays]\", or use method='map'"
        )
    return has_embree and method != 'map'


class Rays:
    """Surfaces as occluders of rays."""

    def __init__(self, surfaces):
        self._scene = None
        surfaces = [s for s in surfaces if s.n_points]
        faces = [triangles_of(s) for s in surfaces]
        if not sum(map(len, faces)):
            return
        bounds = bounds_of(surfaces)
        lower, upper = bounds[:, ::2].min(0), bounds[:, 1::2].max(0)
        # Centred and scaled to size 1, as embree uses float32.
        self._center, self._size = (lower + upper) / 2, float(np.linalg.norm(upper - lower))
        # Far from the origin, points are only as exact as the spacing of floats there.
        self._lift = _LIFT + 4 * np.spacing(np.abs(self._center).max()) / self._size
        points = [_float32((s.points - self._center) / self._size) for s in surfaces]
        first_points = np.cumsum([0, *map(len, points)])[:-1]
        corners = [f + k for f, k in zip(faces, first_points, strict=True)]
        self._scene = _scene(np.concatenate(points), np.concatenate(corners).astype(np.int32))

    def free(self, points, normals, toward, max_distance) -> np.ndarray:
        """Return whether rays along unit vectors are free up to a distance, (m,) bool."""
        is_free = np.ones(len(points), bool)
        if self._scene is None:
            return is_free
        for first in range(0, len(points), _CHUNK):
            chunk = slice(first, first + _CHUNK)
            ray_start = points[chunk] - self._center
            ray_start /= self._size
            ray_start += self._lift * normals[chunk]
            ray_length = np.minimum(max_distance[chunk] / self._size, _FAR)
            ray = _float32(ray_start), _float32(toward[chunk]), _float32(ray_length)
            is_free[chunk] = self._scene.run(*ray, query='OCCLUDED') < 0
        return is_free


def _scene(points, faces):
    """Return a scene of embree, the cached one if it has the same triangles."""
    if (
        _CACHED_SCENE
        and np.array_equal(_CACHED_SCENE[0], points)
        and np.array_equal(_CACHED_SCENE[1], faces)
    ):
        return _CACHED_SCENE[2]
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, points, faces)
    if len(faces) <= _MAX_CACHED_FACES:
        _CACHED_SCENE[:] = points, faces, scene
    return scene


def _float32(array):
    return np.ascontiguousarray(array, np.float32)
