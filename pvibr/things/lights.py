"""The lights of a renderer, as VTK's shaders number them."""

from __future__ import annotations

from dataclasses import dataclass, replace

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

#: A cone as wide as this (degrees from its axis) is seen better by six views than by one.
_WIDE = 60.0
#: The nearest that a caster is drawn, over the farthest: so that depth of 32 bits resolves both;
#: and where boxes tell that the nearest caster is nearer.
_NEAREST, _NEARER = 1e-3, 5e-5
_TEXEL = 2.0  # pixels that a texel may cover: an edge is found to half a texel
_TILE_EDGE = 4.0  # texels around a view, for filters that reach over its edge
_STEPS = 3  # views that get narrower by half each, before some do so by a quarter
_FINEST = 2e-6  # of a lamp's reach: depth of 32 bits resolves no less
_LEAD = 0.5  # how far before the eye its views' middles are, parts of their half width
_SLACK = 0.4  # and how far these may be from there before they are aimed again


@dataclass(frozen=True)
class SceneLight:
    """A light of a renderer, in world space."""

    number: int
    kind: str
    position: tuple[float, float, float]
    direction: tuple[float, float, float]
    cone: float
    still: bool = True

    @property
    def positional(self) -> bool:
        """Whether it is a spot or point light."""
        return self.kind in ('spot', 'point')

    def moved(self, shift) -> SceneLight:
        """Return the same at another place."""
        return replace(self, position=tuple(np.add(self.position, shift).tolist()))

    def turned(self, x, y) -> SceneLight:
        """Return the same with a direction that is off by two tangents."""
        right, up, back = look_along((0, 0, 0), self.direction)[:3, :3]
        way = x * right + y * up - back
        return replace(self, direction=tuple((way / np.linalg.norm(way)).tolist()))

    def homogeneous(self) -> np.ndarray:
        """Return its position with w = 1, or the direction toward it with w = 0, (4,)."""
        if self.positional:
            return np.array([*self.position, 1.0])
        return np.array([*(-np.array(self.direction)), 0.0])


@dataclass(frozen=True, eq=False)
class Cascade:
    """A view around the eye: one of nested views that do not depend on where the camera looks.

    Zhang et al., "Parallel-split shadow maps", 2006, nested as the levels of a clipmap are.
    """

    level: int  # how often it halves the light's reach
    center: np.ndarray
    view: View
    base: tuple  # the light and its reach: with another, it is drawn anew


def lights_of(renderer) -> list[SceneLight]:
    """Return the lights of a renderer that are on."""
    renderer.UpdateLightsGeometryToFollowCamera()
    on = [light for light in renderer.GetLights() if light.GetSwitch()]
    return [_scene_light(number, light) for number, light in enumerate(on)]


def _scene_light(number, light) -> SceneLight:
    position = np.array(light.GetTransformedPosition(), float)
    direction = np.array(light.GetTransformedFocalPoint(), float) - position
    length = float(np.linalg.norm(direction))
    if length == 0 or not np.isfinite(length):
        direction, length = np.array([0.0, 0.0, -1.0]), 1.0
    cone = float(light.GetConeAngle())
    if light.LightTypeIsHeadlight():
        kind = 'headlight'
    elif light.GetPositional():
        kind = 'spot' if cone < 90 else 'point'
    else:
        kind = 'directional'
    still = kind == 'headlight' or bool(light.LightTypeIsSceneLight())
    return SceneLight(number, kind, tuple(position), tuple(direction / length), cone, still)


def light_views(
    light, bounds, frame, resolution, count, *, kept=(), square=False
) -> tuple[list[View], list[Cascade]]:
    """Return views from a light that contain all casters, and up to so many around the eye.

    Of those that were kept of an earlier frame each is the same again unless it serves no more.
    """
    edge = 1 + 2 * _TILE_EDGE / resolution
    place, ahead = _seen(frame, bounds)
    if light.kind == 'directional':
        axes = look_along((0, 0, 0), light.direction)[:3, :3]
        whole = _box(axes, bounds, edge, square)
        half = 1 / np.diag(whole.clip_from_view)[:3] * [1, 1, -1]
        reach = near = half[:2].max()
        finest = 0.0
        base: tuple = light, whole.key()
        box = np.reshape(bounds, (-1, 3, 2))
        box = np.stack([box[..., 0].min(0), box[..., 1].max(0)])

        def aimed(level, old):
            return _around_eye(whole, level, axes @ place, axes @ ahead, axes, base, old, box)

        views = [whole]
    else:
        views, tangent, room = _positional(light, bounds, edge)
        reach, near = tangent * room[1], tangent * np.linalg.norm(place - light.position)
        base, finest = (light, tangent, room), _FINEST * reach

        def aimed(level, old):
            return _aimed(light, place, ahead, reach / 2.0**level, room, level, base, old)

    finest = max(_TEXEL * _pixel(frame, bounds), finest)
    levels = _levels(reach, near, 2 * reach / resolution / finest, frame, count, kept)
    return views, _matched(levels, kept, base, aimed)


def _positional(light, bounds, edge):
    """Return views of all casters, the tangent of half their angle, and nearest and farthest."""
    aim, tangent = _aim(light, bounds)
    nearest = box_distance(light.position, bounds)
    if tangent is None:
        near, far = _reach(light, bounds)
        return around(light.position, near, far, edge), 1.0, (nearest, far)
    away = (corners(bounds) - np.array(light.position)) @ aim
    far = float(away.max()) * 1.0001
    if far > 0:  # the housing of a lamp, behind it, is not what it shines on
        nearest = box_distance(light.position, np.asarray(bounds)[away.max(1) > 0])
    near = max(float(away.min()) * 0.9999, _near(nearest / np.sqrt(1 + 2 * tangent**2), far))
    near = min(near, 0.9999 * far)
    return [perspective(light.position, aim, tangent * edge, near, far)], tangent, (nearest, far)


def _seen(frame, bounds):
    """Return where the nearest casters may be that a camera sees, and where it looks."""
    ahead = -frame.view_from_world[2, :3]
    if frame.parallel:
        # Eyes of parallel cameras are anywhere: what they turn around is what they show.
        away = (corners(bounds).reshape(-1, 3) - frame.eye) @ ahead
        pivot = np.array(frame.renderer.GetActiveCamera().GetFocalPoint()) - frame.eye
        return frame.eye + ahead * np.clip(ahead @ pivot, away.min(), away.max()), np.zeros(3)
    return frame.eye + ahead * box_distance(frame.eye, bounds), ahead


def _levels(reach, near, wider, frame, most, kept) -> list[int]:
    """Return how often each view around the eye halves a light's reach, as its own near does."""
    if not near > 0:
        return []
    last = int(np.ceil(np.log2(max(wider, 1.0))))
    if frame.parallel:  # as much as is seen must be in the narrowest view
        seen = 1.2 * max(frame.size) / 2 / frame.pixel_scale
        last = min(last, int(np.log2(max(reach / seen, 1.0))))
    elif any(cascade.level == last + 1 for cascade in kept):
        last += 1  # as long as it serves: eyes come and go
    first = max(int(np.log2(reach / near)), 0)
    wanted = min(max(last - first, 0), 2 * most)
    count = min(most, max(min(wanted, _STEPS), -(-wanted // 2)))
    # The widest are each a quarter of the one before: one more wanted changes one alone.
    return [first + k + min(k, wanted - count) for k in range(1, count + 1)]


def _matched(levels, kept, base, aimed) -> list[Cascade]:
    """Return a view of each level, in the place of the one kept, or of one not wanted."""
    found = list(kept)
    for k, cascade in enumerate(kept):
        if cascade.level in levels or cascade.base != base:
            found[k] = aimed(cascade.level, cascade if cascade.base == base else None)
    have = {cascade.level for cascade in kept}
    free = [k for k, cascade in enumerate(kept) if cascade.level not in levels]
    for level in levels:
        if level not in have and free:
            found[free.pop()] = aimed(level, None)
        elif level not in have:
            found.append(aimed(level, None))
    return found


def _aimed(light, place, ahead, radius, room, level, base, old) -> Cascade:
    """Return a view of a positional light of what lies around a place; it moves in steps."""
    start = np.array(light.position)
    step = 0.5 * radius
    wanted = place + _LEAD * radius * ahead - start
    if old is not None and np.abs(wanted - old.center).max() <= _SLACK * radius:
        return old
    way = center = np.round(wanted / step) * step
    away = float(np.linalg.norm(way))
    if away < radius:
        way, away = np.array(light.direction) * radius, radius
    tangent = min(1.2 * radius / away, 1.0)
    # What is a part of its own width behind is left to wider views: depth is sharper so.
    far = min(room[1], away + 3 * radius)
    near = max(0.999 * room[0] / np.sqrt(1 + 2 * tangent**2), _NEAREST * away)
    view = perspective(start, way, tangent, min(near, 0.9999 * far), far)
    return Cascade(level, center, view, base)


def _aim(light, bounds):
    """Return the axis of a positional light and the tangent of half its angle."""
    points = corners(bounds).reshape(-1, 3)
    middle = (points.min(0) + points.max(0)) / 2
    ways = points - np.array(light.position)
    toward = middle - np.array(light.position)
    own = light.cone if light.kind == 'spot' else 180.0
    sizes = np.linalg.norm(ways, axis=1) * np.linalg.norm(toward)
    cosines = ways @ toward / np.where(sizes > 0, sizes, 1.0)
    least = float(np.where(sizes > 0, cosines, -1.0).min())
    around_casters = np.degrees(np.arccos(np.clip(least, -1.0, 1.0)))
    if around_casters < min(own, _WIDE):
        return toward / np.linalg.norm(toward), np.tan(np.radians(max(around_casters, 1e-4)))
    if own <= _WIDE:
        return np.array(light.direction), np.tan(np.radians(max(own, 1e-4)))
    return None, None


def _reach(light, bounds):
    """Return the nearest and farthest distance of casters from a positional light."""
    away = np.linalg.norm(corners(bounds) - np.array(light.position), axis=-1)
    far = max(float(away.max()), np.finfo(float).tiny) * 1.001
    # What is 60 degrees from the axis is half as far along it.
    return _near(box_distance(light.position, bounds) / 2, far), far


def _near(nearest, far) -> float:
    """Return where views of casters begin that are no nearer; within a box nothing is known."""
    return max(0.999 * nearest, (_NEARER if nearest > 0 else _NEAREST) * far)


def _box(axes, bounds, edge, square) -> View:
    """Return the parallel view of everything."""
    points = corners(bounds).reshape(-1, 3) @ axes.T
    low, high = points.min(0), points.max(0)
    # As wide and as high as it is: low light sees level ground foreshortened, and needs it sharp.
    size = high - low
    size = np.maximum(size, [1e-2 * size.max()] * 2 + [1e-3 * size.max()])
    size = np.maximum(size, np.finfo(float).tiny ** 0.5)
    if square:
        size[:2] = size[:2].max()
    middle = (low + high) / 2
    half = 0.5 * size * [edge, edge, 1.002]
    return orthographic(axes, middle - half, middle + half)


def texels_per_pixel(views, resolution, frame, bounds) -> float:
    """Return how many texels of the finest view a pixel spans where casters may be nearest."""
    place, _ = _seen(frame, bounds)
    found = 0.0
    for view in views:
        at = view.texture_from_world() @ [*place, 1.0]
        if at[3] > 0 and np.abs(at[:2] / at[3] - 0.5).max() <= 0.5:
            found = max(found, resolution * view.clip_from_view[0, 0] / (2 * at[3]))
    return float(_pixel(frame, bounds) * found)


def _pixel(frame, bounds) -> float:
    """Return the size of the smallest pixel on a caster, world units."""
    if frame.parallel:
        return 1.0 / frame.pixel_scale
    # Near planes are far before what is seen; in a box they are all that is known.
    return max(box_distance(frame.eye, bounds), frame.near) / frame.pixel_scale


def _around_eye(whole, level, eye, ahead, axes, base, old, box) -> Cascade:
    """Return a part of a parallel view where the eye looks; it moves in steps of a quarter."""
    half = 1 / np.diag(whole.clip_from_view)[:3] * [1, 1, -1]
    middle = whole.eye @ axes.T - [0, 0, whole.near + half[2]]
    part = half / [2.0**level, 2.0**level, 1]
    wanted = (eye + _LEAD * part[0] * ahead - middle) * [1, 1, 0]
    if old is not None and (np.abs(wanted - old.center) <= _SLACK * part).all():
        return old
    center = np.round(wanted / (0.5 * part)) * 0.5 * part
    low, high = middle + center - part, middle + center + part
    low[2], high[2] = _depths(axes, low, high, box)
    return Cascade(level, center, orthographic(axes, low, high), base)


def _depths(axes, low, high, box) -> tuple[float, float]:
    """Return the least and largest of a column's third coordinate within a box of the world."""
    # Land is flat: a narrow column is short in it, and its depths are the sharper.
    sides = np.stack([low[:2], high[:2]])[..., None] * axes[:2]
    least, most = sides.min(0).sum(0), sides.max(0).sum(0)
    up = axes[2]
    with np.errstate(divide='ignore', invalid='ignore'):
        ends = np.sort(np.stack([(box[0] - most) / up, (box[1] - least) / up]), 0)
    ends = ends[:, np.abs(up) > 1e-6]
    first, last = max(low[2], ends[0].max()), min(high[2], ends[1].min())
    if first > last:
        return low[2], high[2]
    room = 1e-3 * (last - first) + 0.01 * (high[0] - low[0])
    return first - room, last + room
