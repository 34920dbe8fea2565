"""The lights of a renderer, as VTK's shaders number them."""

from __future__ import annotations

from dataclasses import dataclass

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
#: The nearest that a caster is drawn, over the farthest: what depth of 32 bits resolves.
_NEAREST = 1e-3
_TEXEL = 2.0  # pixels that a texel may cover: an edge is found to half a texel
_TILE_EDGE = 4.0  # texels around a view, for filters that reach over its edge
_STEPS = 3  # by which views within each other get narrower by half, before they do so faster
_FINEST = 2e-6  # of a light's reach: depth of 32 bits resolves no less
_SHRINK = 4.0  # at most, from one view to the next


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

    def homogeneous(self) -> np.ndarray:
        """Return its position with w = 1, or the direction toward it with w = 0, (4,)."""
        if self.positional:
            return np.array([*self.position, 1.0])
        return np.array([*(-np.array(self.direction)), 0.0])


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
    light, bounds, frame, resolution, cascades, *, least=0, square=False
) -> tuple[list[View], list[View]]:
    """Return views from a light that contain all casters, and up to so many around the eye."""
    edge = 1 + 2 * _TILE_EDGE / resolution
    if light.kind == 'directional':
        return _cascades(light, bounds, frame, resolution, (least, cascades), square)
    aim, tangent = _aim(light, bounds)
    if tangent is None:
        near, far = _reach(light, bounds)
        views, tangent = around(light.position, near, far, edge), 1.0
    else:
        away = (corners(bounds).reshape(-1, 3) - np.array(light.position)) @ aim
        far = float(away.max()) * 1.0001
        near = min(max(float(away.min()) * 0.9999, _NEAREST * far), 0.9999 * far)
        views = [perspective(light.position, aim, tangent * edge, near, far)]
    place, ahead = _seen(frame, bounds)
    radius = tangent * np.linalg.norm(place - light.position)
    shrinks = _shrinks(2 * radius / resolution, frame, bounds, radius, (least, cascades))
    room = box_distance(light.position, bounds), far
    return views, [_aimed(light, place, ahead, radius / s, room) for s in shrinks]


def _seen(frame, bounds):
    """Return where the nearest casters may be that a camera sees, and where it looks."""
    ahead = -frame.view_from_world[2, :3]
    if frame.parallel:
        # Eyes of parallel cameras are anywhere: what they turn around is what they show.
        away = (corners(bounds).reshape(-1, 3) - frame.eye) @ ahead
        pivot = np.array(frame.renderer.GetActiveCamera().GetFocalPoint()) - frame.eye
        return frame.eye + ahead * np.clip(ahead @ pivot, away.min(), away.max()), np.zeros(3)
    return frame.eye + ahead * box_distance(frame.eye, bounds), ahead


def _shrinks(texel, frame, bounds, radius, count) -> list[float]:
    """Return how much narrower each view around the eye is than that of everything."""
    finest = max(_TEXEL * _pixel(frame, bounds), _FINEST * radius)
    wanted = int(np.ceil(np.log2(max(texel / finest, 1.0))))
    if frame.parallel:  # as much as is seen must be in the narrowest view
        seen = 1.2 * max(frame.size) / 2 / frame.pixel_scale
        wanted = min(wanted, int(np.log2(max(radius / seen, 1.0))))
    least, most = count
    fewest = max(min(wanted, _STEPS), int(np.ceil(wanted / np.log2(_SHRINK))))
    levels = max(min(most, fewest), least)
    step = min(max(2.0 ** (wanted / max(levels, 1)), 2.0), _SHRINK)
    return [step**k for k in range(1, levels + 1)]


def _aimed(light, place, ahead, radius, room) -> View:
    """Return a view of a positional light of what lies around a place; it moves in steps."""
    start = np.array(light.position)
    step = 0.5 * radius
    way = np.round((place + 0.6 * radius * ahead - start) / step) * step
    away = float(np.linalg.norm(way))
    if away < radius:
        way, away = np.array(light.direction) * radius, radius
    tangent = min(1.2 * radius / away, 1.0)
    # What is a part of its own width behind is left to wider views: depth is sharper so.
    far = min(room[1], away + 3 * radius)
    near = max(0.999 * room[0] / np.sqrt(1 + 2 * tangent**2), _NEAREST * away)
    return perspective(start, way, tangent, min(near, 0.9999 * far), far)


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
    return max(box_distance(light.position, bounds) / 2 * 0.999, _NEAREST * far), far


def _cascades(light, bounds, frame, resolution, count, square):
    """Return the view of everything, and views of halving width around the eye.

    The last is the narrowest: cascades (Zhang et al., "Parallel-split shadow maps",
    2006) nested as the levels of a clipmap are, so that none depends on where the camera looks.
    """
    axes = look_along((0, 0, 0), light.direction)[:3, :3]
    points = corners(bounds).reshape(-1, 3) @ axes.T
    low, high = points.min(0), points.max(0)
    # As wide and as high as it is: low light sees level ground foreshortened, and needs it sharp.
    size = high - low
    size = np.maximum(size, [1e-2 * size.max()] * 2 + [1e-3 * size.max()])
    size = np.maximum(size, np.finfo(float).tiny ** 0.5)
    if square:
        size[:2] = size[:2].max()
    middle = (low + high) / 2
    half = 0.5 * size * [*[1 + 2 * _TILE_EDGE / resolution] * 2, 1.002]
    whole = orthographic(axes, middle - half, middle + half)
    place, ahead = _seen(frame, bounds)
    radius = half[:2].max()
    shrinks = _shrinks(2 * radius / resolution, frame, bounds, radius, count)
    eye, ahead = axes @ place, axes @ ahead
    return [whole], [_around_eye(whole, s, eye, ahead, axes) for s in shrinks]


def _pixel(frame, bounds) -> float:
    """Return the size of the smallest pixel on a caster, world units."""
    if frame.parallel:
        return 1.0 / frame.pixel_scale
    # Near planes are far before what is seen; in a box they are all that is known.
    return max(box_distance(frame.eye, bounds), frame.near) / frame.pixel_scale


def _around_eye(whole, shrink, eye, ahead, axes) -> View:
    """Return a part of a view, where the eye looks; it moves in steps of a quarter."""
    half = 1 / np.diag(whole.clip_from_view)[:3] * [1, 1, -1]
    middle = whole.eye @ axes.T - [0, 0, whole.near + half[2]]
    part = half / [shrink, shrink, 1]
    center = middle + np.round((eye + 0.6 * part[0] * ahead - middle) / (0.5 * part)) * 0.5 * part
    center[2] = middle[2]
    return orthographic(axes, center - part, center + part)
