"""How much of a light reaches samples, by depth maps that are finer where these are in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.core.frame import Frame
from pvibr.maths import depth_test
from pvibr.scene.lights import light_views

#: Texels along a side of the map of everything, and of finer maps of its parts.
_TEXELS, _FINER = 4096, 2048
#: Parts along a side, and how many are drawn at most: those with most samples in doubt.
_PARTS = 8
_MOST = 24
#: How far points are moved along their normals before they are compared, texels: less than in
#: pictures, since one wrong corner makes a point wrong.
OFFSET = 0.1
_EDGE = 4.0  # texels around a part, where neighbours are looked at


def views_of(scene, light, resolution) -> list:
    """Return the views of a point-like light of all meshes of a scene."""
    return light_views(light, scene.bounds, Frame.of(scene.renderer), resolution, 0)[0]


def nearest_view(views, points) -> np.ndarray:
    """Return which view points are most ahead of, (m,)."""
    matrices = [view.texture_from_world()[3] for view in views]
    return np.argmax([points @ m[:3] + m[3] for m in matrices], axis=0)


def lit_by_maps(scene, light, points, normals, resolution=None, *, judge=True, touching=0.0):
    """Return what points see of a light, 0 to 1, and whether that is in doubt, both (m,)."""
    # In doubt is what a texel beside would tell otherwise, or an edge of a triangle too thin for
    # texels. Without a resolution, parts of the map where points are so are drawn again, finer.
    texels = resolution or _TEXELS
    found, doubt = np.ones(len(points)), np.zeros(len(points), bool)
    views = views_of(scene, light, texels)
    nearest = nearest_view(views, points)
    for k, view in enumerate(views):
        rows = np.flatnonzero(nearest == k)
        jobs = [(view, texels, rows)] if len(rows) else []
        for part, side, inside in jobs:
            seen = part, scene.depth(part, side), points[inside], normals[inside]
            found[inside] = depth_test.seen(*seen, OFFSET)
            if judge or resolution is None:
                doubt[inside] = depth_test.uncertain(*seen, scene.depth_of_edges(), touching)
            if part is view and resolution is None:
                jobs += _parts(view, points, rows[doubt[rows]], _MOST // len(views))
    return found, doubt


def _parts(view, points, rows, most):
    """Yield the parts of a view that have most of some points, their texels and which they are."""
    matrix = view.texture_from_world()
    at = points[rows] @ matrix[:, :3].T + matrix[:, 3]
    place = np.clip(np.floor(at[:, :2] / at[:, 3:] * _PARTS), 0, _PARTS - 1).astype(int)
    numbers, counts = np.unique(place @ [1, _PARTS], return_counts=True)
    grown = _PARTS / (1 + 2 * _EDGE / _FINER)
    for number in numbers[np.argsort(-counts)][:most]:
        crop = np.diag([grown, grown, 1.0, 1.0])
        middle = (2 * np.array([number % _PARTS, number // _PARTS]) + 1) / _PARTS - 1
        crop[:2, 3] = -grown * middle
        inside = rows[place @ [1, _PARTS] == number]
        yield replace(view, clip_from_view=crop @ view.clip_from_view), _FINER, inside
