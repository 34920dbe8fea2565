"""The lights of a renderer, numbered as in VTK's shaders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pvibr.maths.views import (
    look_along,
)


@dataclass(frozen=True)
class SceneLight:
    """A light of a renderer, in world space."""

    number: int
    kind: str
    position: tuple[float, float, float]
    direction: tuple[float, float, float]
    cone: float
    #: Whether it stays in the scene when the camera moves; headlights count as such.
    still: bool = True

    @property
    def positional(self) -> bool:
        """Whether it is a spot or point light."""
        return self.kind in ('spot', 'point')

    def moved(self, shift) -> SceneLight:
        """Return the same light at a shifted position."""
        return replace(self, position=tuple(np.add(self.position, shift).tolist()))

    def turned(self, x, y) -> SceneLight:
        """Return the same light, its direction turned by two tangents."""
        right, up, back = look_along((0, 0, 0), self.direction)[:3, :3]
        turned = x * right + y * up - back
        return replace(self, direction=tuple((turned / np.linalg.norm(turned)).tolist()))

    def homogeneous(self) -> np.ndarray:
        """Return its position with w = 1, or the direction toward it with w = 0, shape (4,)."""
        if self.positional:
            return np.array([*self.position, 1.0])
        return np.array([*(-np.array(self.direction)), 0.0])


def lights_of(renderer) -> list[SceneLight]:
    """Return the lights of a renderer that are on."""
    renderer.UpdateLightsGeometryToFollowCamera()
    switched_on = [light for light in renderer.GetLights() if light.GetSwitch()]
    return [_scene_light(number, light) for number, light in enumerate(switched_on)]


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
    is_still = kind == 'headlight' or bool(light.LightTypeIsSceneLight())
    return SceneLight(number, kind, tuple(position), tuple(direction / length), cone, is_still)
