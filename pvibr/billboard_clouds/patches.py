"""What the planes of a billboard cloud leave open of a surface, as a few triangles near it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.billboard_clouds.coverage import Around, by_part, inside, joined, nearest_planes
from pvibr.maths.billboard_clouds import Planes
from pvibr.meshes.decimate import connected, displacement, is_surface, lighter
from pvibr.meshes.surfaces import some_triangles

_SHARE = 0.25  # of the triangles of a surface in the next lighter one
_MOVED = 0.5  # of the bound: how far a lighter surface may be from the mesh
_FEWEST = 100  # triangles that need no lighter surface
_BEHIND = 3.0  # bounds behind the surface: what is seen there is another side of the mesh
_HOLE = 5.0  # how bad a pixel is that shows nothing, beside one that shows another side
_LEFT = 0.01  # badness left, of one per pixel
_CHART = 16  # of the texture's side: as many charts along each side have room


@dataclass(frozen=True, eq=False)
class Patches:
    """Parts of triangles, and the planes that these are drawn onto for their texture."""

    parts: list
    planes: Planes


NO_PATCHES = Patches([], Planes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int)))


def closing_patches(parts, origin, sheet, opaque, bound) -> Patches:
    """Return the triangles of a lighter surface that are seen where no plane is near."""
    light = [_light(part, bound) for part in parts if is_surface(part)]
    if not light:
        return NO_PATCHES
    points, faces = joined(light, origin)
    chosen = _open(points, faces, sheet, opaque, bound)
    planes = _charts(points, faces[chosen], (sheet.side // _CHART) ** 2)
    chosen[chosen] = planes.owner >= 0
    found = [
        part.with_mesh(some_triangles(part.mesh, np.flatnonzero(own)))
        for part, own in by_part(light, chosen)
        if own.any()
    ]
    owner = planes.owner[planes.owner >= 0]
    return Patches(found, Planes(planes.normals, planes.offsets, owner)) if found else NO_PATCHES


def _light(part, bound):
    """Return a part of few triangles near those of another."""
    found = part
    while found.mesh.n_cells > _FEWEST:
        lightest = lighter(found, _SHARE)
        moved = None if lightest is None else displacement(part, lightest)
        if moved is None or moved > _MOVED * bound:
            break
        found = lightest
    return found


def _open(points, faces, sheet, opaque, bound):
    """Return which triangles close what is open, without those that close least."""
    bad, pixels = np.zeros(len(faces)), 0
    for view in Around(points).look(points, faces):
        _, seen = inside(view)
        plane, front, _ = nearest_planes(seen, sheet, len(sheet.low), opaque)
        worth = np.where(plane < 0, _HOLE, front < -_BEHIND * bound)
        bad += np.bincount(seen.face, worth, len(faces))
        pixels += len(plane)
    order = np.argsort(bad, kind='stable')
    chosen = np.empty(len(faces), bool)
    chosen[order] = np.cumsum(bad[order]) > _LEFT * pixels
    return chosen


def _charts(points, faces, most) -> Planes:
    """Return planes of connected triangles that look to one side; owner -1 if of too few."""
    a, b, c = points[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    axis = np.abs(normals).argmax(1)
    side = 2 * axis + (normals[np.arange(len(axis)), axis] < 0)
    place = np.unique(points.astype(np.float32), axis=0, return_inverse=True)[1].reshape(-1)
    count, chart = connected(6 * place[faces] + side[:, None], 6 * len(points))
    sizes = np.bincount(chart, minlength=count)
    largest = np.argsort(-sizes, kind='stable')[:most]
    number = np.full(count, -1)
    number[largest] = np.arange(len(largest))
    side_of = np.zeros(count, int)
    side_of[chart] = side
    axes = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]][side_of]
    heights = np.bincount(chart, ((a + b + c) / 3 * axes[chart]).sum(1), count) / sizes
    return Planes(axes[largest], heights[largest], number[chart])
