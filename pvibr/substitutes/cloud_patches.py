"""Triangles that close the gaps between planes of a billboard cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.meshes.decimate import connected, displacement, is_surface, lighter
from pvibr.meshes.surfaces import some_triangles
from pvibr.substitutes.cloud_coverage import Around, by_part, inside, joined, nearest_planes
from pvibr.substitutes.cloud_maths import Planes

_SHARE = 0.25  # triangles of each lighter surface, relative to the one before
_MOVED = 0.5  # greatest displacement of a lighter surface, over the bound
_FEWEST = 100  # triangles that need no lighter surface
_BEHIND = 3.0  # distance behind the surface at which a plane shows another side, over the bound
_HOLE = 5.0  # badness of a pixel that shows nothing; 1 for one that shows another side
_TOLERATED = 0.01  # badness per pixel that may remain
_CHART = 16  # texels along the side of a chart, on average


@dataclass(frozen=True, eq=False)
class Patches:
    """Parts with few triangles, and the planes onto which these are drawn."""

    parts: list
    planes: Planes


NO_PATCHES = Patches([], Planes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int)))


def closing_patches(parts, origin, sheet, opaque, bound) -> Patches:
    """Return triangles of a lighter surface that are seen where no plane is near."""
    light_parts = [_light(part, bound) for part in parts if is_surface(part)]
    if not light_parts:
        return NO_PATCHES
    points, faces = joined(light_parts, origin)
    is_patch = _open(points, faces, sheet, opaque, bound)
    planes = _charts(points, faces[is_patch], (sheet.side // _CHART) ** 2)
    is_patch[is_patch] = planes.owner >= 0
    patch_parts = [
        part.with_mesh(some_triangles(part.mesh, np.flatnonzero(is_own)))
        for part, is_own in by_part(light_parts, is_patch)
        if is_own.any()
    ]
    if not patch_parts:
        return NO_PATCHES
    owner = planes.owner[planes.owner >= 0]
    return Patches(patch_parts, Planes(planes.normals, planes.offsets, owner))


def _light(part, bound):
    """Return a part simplified within the bound."""
    light_part = part
    while light_part.mesh.n_cells > _FEWEST:
        lighter_part = lighter(light_part, _SHARE)
        moved_distance = None if lighter_part is None else displacement(part, lighter_part)
        if moved_distance is None or moved_distance > _MOVED * bound:
            break
        light_part = lighter_part
    return light_part


def _open(points, faces, sheet, opaque, bound):
    """Return a mask of the triangles that close gaps, except those that close least."""
    badness, pixel_count = np.zeros(len(faces)), 0
    for view in Around(points).look(points, faces):
        _, surface = inside(view)
        plane, front, _ = nearest_planes(surface, sheet, len(sheet.low), opaque)
        pixel_badness = np.where(plane < 0, _HOLE, front < -_BEHIND * bound)
        badness += np.bincount(surface.face, pixel_badness, len(faces))
        pixel_count += len(plane)
    order = np.argsort(badness, kind='stable')
    is_patch = np.empty(len(faces), bool)
    is_patch[order] = np.cumsum(badness[order]) > _TOLERATED * pixel_count
    return is_patch


def _charts(points, faces, most_charts) -> Planes:
    """Return planes of connected triangles that face one axis; owner -1 in small groups."""
    a, b, c = points[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    axis = np.abs(normals).argmax(1)
    facing_side = 2 * axis + (normals[np.arange(len(axis)), axis] < 0)
    point_ids = np.unique(points.astype(np.float32), axis=0, return_inverse=True)[1].reshape(-1)
    count, chart = connected(6 * point_ids[faces] + facing_side[:, None], 6 * len(points))
    sizes = np.bincount(chart, minlength=count)
    largest = np.argsort(-sizes, kind='stable')[:most_charts]
    chart_number = np.full(count, -1)
    chart_number[largest] = np.arange(len(largest))
    side_of = np.zeros(count, int)
    side_of[chart] = facing_side
    axes = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]][side_of]
    heights = np.bincount(chart, ((a + b + c) / 3 * axes[chart]).sum(1), count) / sizes
    return Planes(axes[largest], heights[largest], chart_number[chart])
