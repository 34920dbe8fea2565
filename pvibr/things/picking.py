"""Which instance is under a pixel: a ray against spheres, then against the mesh itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.things.clipping import ClippingPlanes
from pvibr.things.frame import Frame

#: How near to lines and points a ray passes that meets them, in diagonals of their mesh; it meets
#: them, too, in the pixels that they cover.
_NEAR = 0.04


@dataclass(frozen=True)
class Hit:
    """Where a ray met an instance, or an actor that something stands for."""

    index: int
    point: tuple
    distance: float
    actor: Any = None


def pixel_ray(renderer, x, y):
    """Return the ray through a pixel."""
    ends = []
    for depth in (0.0, 1.0):
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        point = np.array(renderer.GetWorldPoint())
        ends.append(point[:3] / point[3])
    direction = ends[1] - ends[0]
    return ends[0], direction / np.linalg.norm(direction)


def joined(placed) -> pv.PolyData:
    """Return one mesh in world units of pairs of parts and a matrix."""
    moved = [p.mesh.transform(matrix, inplace=False) for parts, matrix in placed for p in parts]
    return moved[0] if len(moved) == 1 else pv.merge(moved, merge_points=False).extract_surface()


def nearest_actor(actors, renderer, x, y, cells=False):
    """Return the first of some actors that the ray through a pixel meets, or its cell."""
    picker = _vtk.vtkCellPicker()
    picker.SetTolerance(0.0)
    picker.PickFromListOn()
    for actor in actors:
        picker.AddPickList(actor)
    if not actors or not picker.Pick(x, y, 0.0, renderer):
        return None
    start, direction = pixel_ray(renderer, x, y)
    point, found = picker.GetPickPosition(), picker.GetActor()
    index = next(i for i, actor in enumerate(actors) if actor is found)
    index = picker.GetCellId() if cells else index
    return Hit(index, point, float((point - start) @ direction), found)


def nearest_hit(groups, renderer, x, y, visible, planes=None):
    """Return the first instance that the ray through a pixel meets, where planes keep it."""
    start, direction = pixel_ray(renderer, x, y)
    first, last = ClippingPlanes(planes).reach(start, direction)
    best = None
    for group in groups if first < last else ():
        wider = partial(_lengths_of, _width(group), renderer)
        for enters, slot in _candidates(group, start, direction, visible, wider):
            if enters > (last if best is None else best.distance):
                break
            near = float(np.max(wider(group.centers([slot]))))
            hit = _meet(group, slot, start, direction, near, first, last)
            if hit is not None and (best is None or hit.distance < best.distance):
                best = hit
    return best


def _width(group) -> float:
    """Return how far lines and points reach beyond themselves, in pixels; 0 for surfaces."""
    strokes = [p.actor.GetProperty() for p in group.levels[0].parts if not p.mesh.n_cells]
    widest = (max(p.GetLineWidth(), p.GetPointSize()) for p in strokes)
    # Points are squares, and their outlines are blended into the pixels around.
    return max((width * 0.5**0.5 + 1 for width in widest), default=0.0)


def _lengths_of(pixels, renderer, centers):
    """Return how long pixels are at some places, world units."""
    frame = Frame.of(renderer)
    away = np.linalg.norm(centers - renderer.GetActiveCamera().GetPosition(), axis=1)
    # A subplot may be empty.
    return pixels * (1.0 if frame.parallel else away) / (frame.pixel_scale or np.inf)


def _candidates(group, start, direction, visible, wider):
    """Return (distance, slot) of the widened spheres that the ray enters, the nearest first."""
    blocks = group.blocks
    reach = blocks.reach + blocks.largest + wider(blocks.centers)
    _, near = _spheres(blocks.centers, reach, start, direction)
    slots = (np.flatnonzero(near)[:, None] * group.unit + np.arange(group.unit)).ravel()
    slots = slots[slots < len(group)]
    slots = slots[visible[group.ids[slots]]]
    if not len(slots):
        return []
    centers = group.centers(slots)
    enters, hit = _spheres(centers, group.radii[slots] + wider(centers), start, direction)
    return sorted(zip(enters[hit].tolist(), slots[hit].tolist(), strict=True))


def _spheres(centers, radii, start, direction):
    along = (centers - start) @ direction
    away = np.linalg.norm(centers - start - along[:, None] * direction, axis=1)
    half = np.sqrt(np.maximum(radii**2 - away**2, 0.0))
    return along - half, (away <= radii) & (along + half > 0)


def _meet(group, slot, start, direction, width, first, last):
    matrix = group.matrix(slot)
    inverse = np.linalg.inv(matrix)
    origin = inverse[:3, :3] @ start + inverse[:3, 3]
    toward = inverse[:3, :3] @ direction
    reach = np.linalg.norm(origin - group.atlas.center) + 2 * group.atlas.radius
    end = origin + toward * min(reach / np.linalg.norm(toward), last)
    origin = origin + toward * first
    best = None
    width /= max(abs(float(np.linalg.det(matrix[:3, :3]))) ** (1 / 3), 1e-30)
    for part in group.parts(slot):
        point = _line_mesh(part, origin, end, width)
        if point is not None:
            world = matrix[:3, :3] @ point + matrix[:3, 3]
            distance = float((world - start) @ direction)
            if best is None or distance < best.distance:
                best = Hit(int(group.ids[slot]), tuple(world.tolist()), distance)
    return best


def _line_mesh(part, start, end, width):
    t, sub, cell = _vtk.reference(0.0), _vtk.reference(0), _vtk.reference(0)
    point, param = [0.0] * 3, [0.0] * 3
    if not part.mesh.n_cells:
        return _line_strokes(part.strokes, start, end, max(_NEAR * part.mesh.length, width))
    met = part.locator.IntersectWithLine(start, end, 0.0, t, point, param, sub, cell)
    return np.array(point) if met else None


def _line_strokes(strokes, start, end, near):
    """Return the first point of lines and points that a line passes nearby, or None."""
    along = (end - start) / np.linalg.norm(end - start)
    away, reach = strokes[:, 0] - start, strokes[:, 1] - strokes[:, 0]
    aside, turned = (v - (v @ along)[:, None] * along for v in (away, reach))
    length = np.einsum('ij,ij->i', turned, turned)
    t = np.clip(-np.einsum('ij,ij->i', aside, turned) / np.maximum(length, 1e-30), 0.0, 1.0)
    met = np.linalg.norm(aside + t[:, None] * turned, axis=1) <= near
    if not met.any():
        return None
    points = strokes[met, 0] + t[met, None] * reach[met]
    return points[((points - start) @ along).argmin()]
