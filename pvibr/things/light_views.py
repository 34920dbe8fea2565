"""Views from lights: of all that casts shadows, and cascades around the eye."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from pvibr.maths.views import (
    View,
    around,
    box_distance,
    corners,
    look_along,
    orthographic,
    perspective,
)

#: Half angle of a cone, degrees, above which a cube of six views is sharper than one view.
_WIDE = 60.0
#: Smallest ratio of near to far plane that 32-bit depth resolves well, and the smallest used where
#: bounds show that a caster is nearer.
_NEAREST, _NEARER = 1e-3, 5e-5
_TEXEL = 2.0  # pixels per texel: edges are located to half a texel
_TILE_EDGE = 4.0  # margin of a view in texels, for filters that cross its edge
_STEPS = 3  # cascades that halve the width, before some quarter it
_FINEST = 2e-6  # finest texel over a lamp's reach, the resolution of 32-bit depth
_LEAD = 0.5  # distance of a cascade's centre ahead of the eye, in half widths
_SLACK = 0.4  # drift of the centre before the cascade is moved, in half widths


@dataclass(frozen=True, eq=False)
class Cascade:
    """One of nested views around the eye that do not depend on the camera's direction.

    Zhang et al., "Parallel-split shadow maps", 2006, nested like the levels of a clipmap.
    """

    level: int  # number of halvings of the light's reach
    center: np.ndarray
    view: View
    base: tuple  # the light and its reach; a change makes the view stale


def light_views(
    light, bounds, frame, resolution, count, *, previous=(), square=False
) -> tuple[list[View], list[Cascade]]:
    """Return views from a light that contain all casters, and up to `count` cascades.

    Cascades of an earlier frame are reused while they serve.
    """
    edge = 1 + 2 * _TILE_EDGE / resolution
    nearest_place, look = _nearest_seen(frame, bounds)
    if light.kind == 'directional':
        axes = look_along((0, 0, 0), light.direction)[:3, :3]
        whole = _box(axes, bounds, edge, square)
        reach = near = _half_size(whole)[:2].max()
        finest_texel, views = 0.0, [whole]
        base: tuple = light, whole.key()
        world_boxes = np.reshape(bounds, (-1, 3, 2))
        world_box = np.stack([world_boxes[..., 0].min(0), world_boxes[..., 1].max(0)])
        aimed = partial(_around_eye, whole, axes, axes @ nearest_place, axes @ look, world_box)
    else:
        views, tangent, distances = _positional(light, bounds, edge)
        reach = tangent * distances[1]
        near = tangent * np.linalg.norm(nearest_place - light.position)
        base, finest_texel = (light, tangent, distances), _FINEST * reach
        aimed = partial(_aimed, light, nearest_place, look, reach, distances)
    finest_texel = max(_TEXEL * _pixel(frame, bounds), finest_texel)
    finest_ratio = 2 * reach / resolution / finest_texel
    levels = _cascade_levels(reach, near, finest_ratio, frame, count, previous)
    return views, _matched(levels, previous, base, aimed)


def _positional(light, bounds, edge):
    """Return views of all casters, the tangent of the half angle, and (nearest, far)."""
    view_axis, tangent = _aim(light, bounds)
    nearest = box_distance(light.position, bounds)
    if tangent is None:
        near, far = _reach(light, bounds)
        return around(light.position, near, far, edge), 1.0, (nearest, far)
    along_axis = (corners(bounds) - np.array(light.position)) @ view_axis
    far = float(along_axis.max()) * 1.0001
    if far > 0:  # a lamp's housing behind it is not lit
        nearest = box_distance(light.position, np.asarray(bounds)[along_axis.max(1) > 0])
    least_near = _near(nearest / np.sqrt(1 + 2 * tangent**2), far)
    near = min(max(float(along_axis.min()) * 0.9999, least_near), 0.9999 * far)
    view = perspective(light.position, view_axis, tangent * edge, near, far)
    return [view], tangent, (nearest, far)


def _nearest_seen(frame, bounds):
    """Return the nearest point where visible casters may be, and the look direction."""
    look = -frame.view_from_world[2, :3]
    if not frame.parallel:
        return frame.eye + look * box_distance(frame.eye, bounds), look
    # A parallel camera's eye is arbitrary; its focal point shows what it looks at.
    depths = (corners(bounds).reshape(-1, 3) - frame.eye) @ look
    to_focus = np.array(frame.renderer.GetActiveCamera().GetFocalPoint()) - frame.eye
    focus_depth = np.clip(look @ to_focus, depths.min(), depths.max())
    return frame.eye + look * focus_depth, np.zeros(3)


def _cascade_levels(reach, near, finest_ratio, frame, max_count, previous) -> list[int]:
    """Return the halvings of the light's reach of each cascade, chosen by the eye's distance."""
    if not near > 0:
        return []
    last_level = int(np.ceil(np.log2(max(finest_ratio, 1.0))))
    if frame.parallel:  # the narrowest view must contain all that is visible
        visible_radius = 1.2 * max(np.divide(frame.size, frame.pixel_scales)) / 2
        last_level = min(last_level, int(np.log2(max(reach / visible_radius, 1.0))))
    elif any(cascade.level == last_level + 1 for cascade in previous):
        last_level += 1  # hysteresis for a moving eye
    first_level = max(int(np.log2(reach / near)), 0)
    level_count = min(max(last_level - first_level, 0), 2 * max_count)
    count = min(max_count, max(min(level_count, _STEPS), -(-level_count // 2)))
    # The widest quarter the width each: one more level then changes one view only.
    return [first_level + k + min(k, level_count - count) for k in range(1, count + 1)]


def _matched(levels, previous, base, aimed) -> list[Cascade]:
    """Return a cascade per level, reusing the slots of previous ones."""
    cascades = list(previous)
    for k, cascade in enumerate(previous):
        if cascade.level in levels or cascade.base != base:
            cascades[k] = aimed(cascade.level, base, cascade if cascade.base == base else None)
    previous_levels = {cascade.level for cascade in previous}
    free_slots = [k for k, cascade in enumerate(previous) if cascade.level not in levels]
    for level in levels:
        if level not in previous_levels and free_slots:
            cascades[free_slots.pop()] = aimed(level, base, None)
        elif level not in previous_levels:
            cascades.append(aimed(level, base, None))
    return cascades


def _aimed(light, nearest_place, look, reach, distances, level, base, previous) -> Cascade:
    """Return a positional light's view of what surrounds a point; it moves in steps."""
    position, radius = np.array(light.position), reach / 2.0**level
    ideal_center = nearest_place + _LEAD * radius * look - position
    if previous is not None and np.abs(ideal_center - previous.center).max() <= _SLACK * radius:
        return previous
    center = view_axis = np.round(ideal_center / (0.5 * radius)) * 0.5 * radius
    distance = float(np.linalg.norm(view_axis))
    if distance < radius:
        view_axis, distance = np.array(light.direction) * radius, radius
    tangent = min(1.2 * radius / distance, 1.0)
    # What lies far behind is left to wider views: depth precision is better that way.
    far = min(distances[1], distance + 3 * radius)
    near = max(0.999 * distances[0] / np.sqrt(1 + 2 * tangent**2), _NEAREST * distance)
    view = perspective(position, view_axis, tangent, min(near, 0.9999 * far), far)
    return Cascade(level, center, view, base)


def _aim(light, bounds):
    """Return the view axis of a positional light and the tangent of its half angle."""
    points = corners(bounds).reshape(-1, 3)
    middle = (points.min(0) + points.max(0)) / 2
    to_corners = points - np.array(light.position)
    to_middle = middle - np.array(light.position)
    cone_angle = light.cone if light.kind == 'spot' else 180.0
    length_products = np.linalg.norm(to_corners, axis=1) * np.linalg.norm(to_middle)
    angle_cosines = to_corners @ to_middle / np.where(length_products > 0, length_products, 1.0)
    least_cosine = float(np.where(length_products > 0, angle_cosines, -1.0).min())
    caster_angle = np.degrees(np.arccos(np.clip(least_cosine, -1.0, 1.0)))
    if caster_angle < min(cone_angle, _WIDE):
        return to_middle / np.linalg.norm(to_middle), np.tan(np.radians(max(caster_angle, 1e-4)))
    if cone_angle <= _WIDE:
        return np.array(light.direction), np.tan(np.radians(max(cone_angle, 1e-4)))
    return None, None


def _reach(light, bounds):
    """Return the nearest and farthest distance of casters from a positional light."""
    distances = np.linalg.norm(corners(bounds) - np.array(light.position), axis=-1)
    far = max(float(distances.max()), np.finfo(float).tiny) * 1.001
    # A corner of a cube face is more than half as far along its axis.
    return _near(box_distance(light.position, bounds) / 2, far), far


def _near(nearest, far) -> float:
    """Return the near plane for the nearest caster's distance, 0 if the light is among them."""
    return max(0.999 * nearest, (_NEARER if nearest > 0 else _NEAREST) * far)


def _box(axes, bounds, edge, square) -> View:
    """Return the parallel view of all casters."""
    points = corners(bounds).reshape(-1, 3) @ axes.T
    low, high = points.min(0), points.max(0)
    # Not square: low light sees level ground foreshortened, and must resolve it.
    size = high - low
    size = np.maximum(size, [1e-2 * size.max()] * 2 + [1e-3 * size.max()])
    size = np.maximum(size, np.finfo(float).tiny ** 0.5)
    if square:
        size[:2] = size[:2].max()
    middle, half_size = (low + high) / 2, 0.5 * size * [edge, edge, 1.002]
    return orthographic(axes, middle - half_size, middle + half_size)


def _half_size(view) -> np.ndarray:
    """Return half the extent of a parallel view, shape (3,)."""
    return 1 / np.diag(view.clip_from_view)[:3] * [1, 1, -1]


def texels_per_pixel(views, resolution, frame, bounds) -> float:
    """Return the texels of the finest view per pixel, where casters may be nearest."""
    nearest_place, _ = _nearest_seen(frame, bounds)
    texels = 0.0
    for view in views:
        view_point = view.texture_from_world() @ [*nearest_place, 1.0]
        if view_point[3] > 0 and np.abs(view_point[:2] / view_point[3] - 0.5).max() <= 0.5:
            texels = max(texels, resolution * view.clip_from_view[0, 0] / (2 * view_point[3]))
    return float(_pixel(frame, bounds) * texels)


def _pixel(frame, bounds) -> float:
    """Return the smallest pixel footprint on a caster, world units."""
    if frame.parallel:
        return 1.0 / frame.pixel_scale
    # Within the casters' bounds the near plane is the only known distance.
    return max(box_distance(frame.eye, bounds), frame.near) / frame.pixel_scale


def _around_eye(whole, axes, eye, look, world_box, level, base, previous) -> Cascade:
    """Return a part of a parallel view where the eye looks; it moves in quarter steps."""
    half_size = _half_size(whole)
    middle = whole.eye @ axes.T - [0, 0, whole.near + half_size[2]]
    part_half = half_size / [2.0**level, 2.0**level, 1]
    ideal = (eye + _LEAD * part_half[0] * look - middle) * [1, 1, 0]
    if previous is not None and (np.abs(ideal - previous.center) <= _SLACK * part_half).all():
        return previous
    center = np.round(ideal / (0.5 * part_half)) * 0.5 * part_half
    low, high = middle + center - part_half, middle + center + part_half
    low[2], high[2] = _depths(axes, low, high, world_box)
    return Cascade(level, center, orthographic(axes, low, high), base)


def _depths(axes, low, high, world_box) -> tuple[float, float]:
    """Return the depth range of a light-space column within a world box."""
    # Terrain is flat: a narrow column spans little depth, which gains precision.
    sides = np.stack([low[:2], high[:2]])[..., None] * axes[:2]
    column_low, column_high = sides.min(0).sum(0), sides.max(0).sum(0)
    up = axes[2]
    with np.errstate(divide='ignore', invalid='ignore'):
        crossings = np.stack([(world_box[0] - column_high) / up, (world_box[1] - column_low) / up])
    crossings = np.sort(crossings, 0)[:, np.abs(up) > 1e-6]
    first, last = max(low[2], crossings[0].max()), min(high[2], crossings[1].min())
    if first > last:
        return low[2], high[2]
    margin = 1e-3 * (last - first) + 0.01 * (high[0] - low[0])
    return first - margin, last + margin
