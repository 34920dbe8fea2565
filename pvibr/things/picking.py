"""Finds the instance under a pixel: a ray against bounding spheres, then against the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.things.clipping import ClippingPlanes
from pvibr.things.frame import Frame

#: Picking distance of lines and points in diagonals of their mesh, if larger than their width.
_NEAR = 0.04


@dataclass(frozen=True)
class Hit:
    """Where a ray met an instance, or an actor that a thing replaces."""

    index: int
    point: tuple
    distance: float
    actor: Any = None


def pixel_ray(renderer, x, y):
    """Return the ray through a pixel."""
    world_ends = []
    for depth in (0.0, 1.0):
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        world_point = np.array(renderer.GetWorldPoint())
        world_ends.append(world_point[:3] / world_point[3])
    direction = world_ends[1] - world_ends[0]
    return world_ends[0], direction / np.linalg.norm(direction)


def joined(placed_parts) -> pv.PolyData:
    """Return a single world-space mesh from pairs of parts and a matrix."""
    pairs = [(part.mesh, matrix) for parts, matrix in placed_parts for part in parts]
    meshes = [mesh.transform(matrix, inplace=False) for mesh, matrix in pairs]
    return (
        meshes[0] if len(meshes) == 1 else pv.merge(meshes, merge_points=False).extract_surface()
    )


def nearest_actor(actors, renderer, x, y, cells=False):
    """Return the nearest actor that the ray through a pixel meets; with `cells`, its cell."""
    cell_picker = _vtk.vtkCellPicker()
    cell_picker.SetTolerance(0.0)
    cell_picker.PickFromListOn()
    for actor in actors:
        cell_picker.AddPickList(actor)
    if not actors or not cell_picker.Pick(x, y, 0.0, renderer):
        return None
    ray_start, direction = pixel_ray(renderer, x, y)
    point, picked_actor = cell_picker.GetPickPosition(), cell_picker.GetActor()
    index = next(i for i, actor in enumerate(actors) if actor is picked_actor)
    index = cell_picker.GetCellId() if cells else index
    return Hit(index, point, float((point - ray_start) @ direction), picked_actor)


def nearest_hit(groups, renderer, x, y, visible, planes=None):
    """Return the nearest instance that the ray through a pixel meets within clipping planes."""
    ray_start, direction = pixel_ray(renderer, x, y)
    limits = first, last = ClippingPlanes(planes).reach(ray_start, direction)
    nearest = None
    for group in groups if first < last else ():
        reach_at = partial(_lengths_of, _width(group), renderer)
        for enter_distance, slot in _candidates(group, ray_start, direction, visible, reach_at):
            if enter_distance > (last if nearest is None else nearest.distance):
                break
            pixel_reach = float(np.max(reach_at(group.centers([slot]))))
            hit = _meet(group, slot, ray_start, direction, pixel_reach, limits)
            if hit is not None and (nearest is None or hit.distance < nearest.distance):
                nearest = hit
    return nearest


def _width(group) -> float:
    """Return how far lines and points reach beyond their geometry, in pixels; 0 for surfaces."""
    strokes = [p.actor.GetProperty() for p in group.levels[0].parts if not p.mesh.n_cells]
    stroke_widths = (max(p.GetLineWidth(), p.GetPointSize()) for p in strokes)
    # Points are squares, with antialiased edges.
    return max((width * 0.5**0.5 + 1 for width in stroke_widths), default=0.0)


def _lengths_of(pixel_count, renderer, centers):
    """Return the world size of a number of pixels at given centres."""
    frame = Frame.of(renderer)
    distances = np.linalg.norm(centers - renderer.GetActiveCamera().GetPosition(), axis=1)
    # A subplot may be empty.
    return pixel_count * (1.0 if frame.parallel else distances) / (frame.pixel_scale or np.inf)


def _candidates(group, ray_start, direction, visible_mask, reach_at):
    """Return (distance, slot) of the enlarged bounding spheres that the ray enters, sorted."""
    blocks = group.blocks
    block_reach = blocks.bounding_radii + reach_at(blocks.centers)
    _, is_near = _spheres(blocks.centers, block_reach, ray_start, direction)
    slots = (np.flatnonzero(is_near)[:, None] * group.unit + np.arange(group.unit)).ravel()
    slots = slots[slots < len(group)]
    slots = slots[visible_mask[group.ids[slots]]]
    if not len(slots):
        return []
    centers = group.centers(slots)
    radii = group.radii[slots] + reach_at(centers)
    enter_distances, is_hit = _spheres(centers, radii, ray_start, direction)
    return sorted(zip(enter_distances[is_hit].tolist(), slots[is_hit].tolist(), strict=True))


def _spheres(centers, radii, ray_start, direction):
    along_ray = (centers - ray_start) @ direction
    ray_gaps = np.linalg.norm(centers - ray_start - along_ray[:, None] * direction, axis=1)
    half_chord = np.sqrt(np.maximum(radii**2 - ray_gaps**2, 0.0))
    return along_ray - half_chord, (ray_gaps <= radii) & (along_ray + half_chord > 0)


def _meet(group, slot, ray_start, direction, world_width, limits):
    matrix, (first, last) = group.matrix(slot), limits
    model_from_world = np.linalg.inv(matrix)
    local_start = model_from_world[:3, :3] @ ray_start + model_from_world[:3, 3]
    local_direction = model_from_world[:3, :3] @ direction
    reach = np.linalg.norm(local_start - group.atlas.center) + 2 * group.atlas.radius
    last = min(reach / np.linalg.norm(local_direction), last)
    local_end = local_start + local_direction * last
    local_start = local_start + local_direction * first
    nearest = None
    world_width /= max(abs(float(np.linalg.det(matrix[:3, :3]))) ** (1 / 3), 1e-30)
    for part in group.parts(slot):
        local_point = _line_mesh(part, local_start, local_end, world_width)
        if local_point is not None:
            world_point = matrix[:3, :3] @ local_point + matrix[:3, 3]
            distance = float((world_point - ray_start) @ direction)
            if nearest is None or distance < nearest.distance:
                nearest = Hit(int(group.ids[slot]), tuple(world_point.tolist()), distance)
    return nearest


def _line_mesh(part, start, end, world_width):
    if not part.mesh.n_cells:
        return _line_strokes(part.strokes, start, end, max(_NEAR * part.mesh.length, world_width))
    t, sub_id, cell_id = _vtk.reference(0.0), _vtk.reference(0), _vtk.reference(0)
    point, param = [0.0] * 3, [0.0] * 3
    is_hit = part.locator.IntersectWithLine(start, end, 0.0, t, point, param, sub_id, cell_id)
    return np.array(point) if is_hit else None


def _line_strokes(strokes, start, end, near):
    """Return the first point of lines and points that a segment passes within `near`, or None."""
    ray = (end - start) / np.linalg.norm(end - start)
    from_start, along_stroke = strokes[:, 0] - start, strokes[:, 1] - strokes[:, 0]
    offset, slope = (v - (v @ ray)[:, None] * ray for v in (from_start, along_stroke))
    squared_slope = np.maximum(np.einsum('ij,ij->i', slope, slope), 1e-30)
    t = np.clip(-np.einsum('ij,ij->i', offset, slope) / squared_slope, 0.0, 1.0)
    is_near = np.linalg.norm(offset + t[:, None] * slope, axis=1) <= near
    if not is_near.any():
        return None
    points = strokes[is_near, 0] + t[is_near, None] * along_stroke[is_near]
    return points[((points - start) @ ray).argmin()]
