"""Lit fraction of samples by depth maps, refined where samples are in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.things.frame import Frame
from pvibr.things.lights import light_views
from pvibr.visibility import depth_test

#: Texels along a side of the map of the scene, and of refined maps of its parts.
_TEXELS, _FINER = 4096, 2048
#: Parts along a side of the map, and the most that are refined, those with most doubtful samples.
_PARTS, _MAX_PARTS = 8, 24
#: Offset of points along their normals, texels: less than in pictures, since one wrong corner
#: makes a point wrong.
OFFSET = 0.1
_EDGE = 4.0  # texels of margin around a part, for comparisons with neighbours


def views_of(scene, light, resolution) -> list:
    """Return the views of a point light that cover all meshes of a scene."""
    return light_views(light, scene.bounds, Frame.of(scene.renderer), resolution, 0)[0]


def nearest_view(views, points) -> np.ndarray:
    """Return the index of the view that faces each point best, (m,)."""
    texture_matrices = [view.texture_from_world()[3] for view in views]
    return np.argmax([points @ m[:3] + m[3] for m in texture_matrices], axis=0)


def lit_by_maps(scene, light, points, normals, resolution=None, *, judge=True, touching=0.0):
    """Return the lit fraction of points, 0 to 1, and whether it is in doubt, both (m,)."""
    # A point is in doubt if a neighbouring texel disagrees or holds the edge of a triangle thinner
    # than a texel. Without a resolution, the parts with doubtful points are redrawn finer.
    texels = resolution or _TEXELS
    lit_share, doubt = np.ones(len(points)), np.zeros(len(points), bool)
    views = views_of(scene, light, texels)
    nearest = nearest_view(views, points)
    for k, view in enumerate(views):
        view_rows = np.flatnonzero(nearest == k)
        jobs = [(view, texels, view_rows)] if len(view_rows) else []
        for part, side, inside in jobs:
            depth_query = part, scene.depth(part, side), points[inside], normals[inside]
            lit_share[inside] = depth_test.seen(*depth_query, OFFSET)
            if judge or resolution is None:
                edge_depth = scene.depth_of_edges()
                doubt[inside] = depth_test.uncertain(*depth_query, edge_depth, touching)
            if part is view and resolution is None:
                jobs += _parts(view, points, view_rows[doubt[view_rows]], _MAX_PARTS // len(views))
    return lit_share, doubt


def _parts(view, points, doubtful_rows, max_parts):
    """Yield (view, texels, points inside) of the parts of a view with most doubtful points."""
    matrix = view.texture_from_world()
    homogeneous = points[doubtful_rows] @ matrix[:, :3].T + matrix[:, 3]
    cells = np.floor(homogeneous[:, :2] / homogeneous[:, 3:] * _PARTS)
    cells = np.clip(cells, 0, _PARTS - 1).astype(int) @ [1, _PARTS]
    cell_numbers, sample_counts = np.unique(cells, return_counts=True)
    zoom = _PARTS / (1 + 2 * _EDGE / _FINER)
    for cell in cell_numbers[np.argsort(-sample_counts)][:max_parts]:
        crop = np.diag([zoom, zoom, 1.0, 1.0])
        cell_center = (2 * np.array([cell % _PARTS, cell // _PARTS]) + 1) / _PARTS - 1
        crop[:2, 3] = -zoom * cell_center
        inside = doubtful_rows[cells == cell]
        yield replace(view, clip_from_view=crop @ view.clip_from_view), _FINER, inside
