"""Members of layers: changes of actors and lights."""

from __future__ import annotations

import numpy as np

from pvibr.core._vtk import address
from pvibr.things.actor_watch import ineligibility
from pvibr.things.content_key import colors_of, look_key, shape_of

# The steepest slope of a highlight, cos(angle) ** power, over sqrt(power).
_SLOPE = np.exp(-0.5)


class Member:
    """An actor of a layer."""

    def __init__(self, actor):
        self.actor, self.key = actor, address(actor)
        self.matrix, self.bounds = np.eye(4), (1.0, -1.0) * 3
        self.why, self.dull, self.gloss = 'not drawn yet', 1.0, 0.0
        self.version = 0
        self._content_key: tuple = ()

    def update(self) -> bool:
        """Update the member; return True if the actor changed or moved."""
        content_key = look_key(self.actor)
        previous_matrix, matrix = self.matrix, self.actor.GetMatrix().GetData()
        self.matrix = np.reshape(matrix, (4, 4))
        self.bounds = self.actor.GetBounds() or (1.0, -1.0) * 3
        if content_key == self._content_key:
            return not np.array_equal(previous_matrix, self.matrix)
        self._content_key = content_key
        self.version += 1
        self.why = ineligibility(self.actor) if self.actor.GetVisibility() else 'hidden'
        self._read_shading(self.actor.GetProperty())
        return True

    def settle(self):
        """Ignore changes so far: drawing an actor may modify it."""
        self._content_key = look_key(self.actor)

    def _read_shading(self, prop):
        self.dull = self.gloss = 0.0
        if prop.GetLighting():
            self.dull = 1.0 if prop.GetInterpolation() == 3 else prop.GetDiffuse()  # VTK_PBR
            self.gloss = prop.GetSpecular() * _SLOPE * max(prop.GetSpecularPower(), 0.0) ** 0.5
            if prop.GetInterpolation() == 3:
                # As steep as the normal distribution, whose width is the square of roughness.
                self.gloss = _SLOPE / max(prop.GetRoughness(), 0.1) ** 2


class Lighting:
    """The lights of a renderer at one moment."""

    def __init__(self, renderer):
        renderer.UpdateLightsGeometryToFollowCamera()
        lights = [light for light in renderer.GetLights() if light.GetSwitch()]
        self.kinds = [_kind(light) for light in lights]
        self.colors = np.array([np.ravel(colors_of(light)) for light in lights]).reshape(-1, 9)
        positions = [light.GetTransformedPosition() for light in lights]
        self.positions = np.array(positions).reshape(-1, 3)
        focal_points = [light.GetTransformedFocalPoint() for light in lights]
        offsets = np.array(focal_points).reshape(-1, 3) - self.positions
        lengths = np.linalg.norm(offsets, axis=1)[:, None]
        self.directions = offsets / np.where(lengths > 0, lengths, 1.0)
        self.positional = np.array([light.GetPositional() for light in lights], bool)

    def change(self, earlier, center, radius) -> tuple[float, float]:
        """Return the change of colour and direction since an earlier moment."""
        if self.kinds != earlier.kinds:
            return np.inf, np.inf
        color_change = float(np.abs(self.colors - earlier.colors).max(axis=1, initial=0.0).sum())
        chord = np.linalg.norm(self.directions - earlier.directions, axis=1)
        angle = 2 * np.arcsin(np.clip(chord / 2, 0, 1))
        offsets = np.stack([self.positions, earlier.positions]) - center
        distance = np.linalg.norm(offsets, axis=2).min(0)
        step = np.linalg.norm(self.positions - earlier.positions, axis=1)
        angle_inside = np.where(step > 0, np.pi, 0.0)
        angle_outside = step / np.maximum(distance - radius, 1e-300)
        parallax = np.where(distance > radius, angle_outside, angle_inside)
        angle = np.where(self.positional, np.maximum(parallax, angle), angle)
        strength = self.colors.max(axis=1, initial=0.0)
        return color_change, float((strength * np.minimum(angle, np.pi)).sum())

    @property
    def strength(self) -> float:
        """Summed intensity of all lights, as a share of white."""
        return float(self.colors.max(axis=1, initial=0.0).sum())


def _kind(light) -> tuple:
    """Return the state of a light whose change has no error estimate."""
    kind = address(light), light.GetLightType(), *shape_of(light)
    is_unbounded = light.GetConeAngle() >= 90 and tuple(light.GetAttenuationValues()) == (1, 0, 0)
    if is_unbounded or not light.GetPositional():
        return kind
    # The edge of a cone may be sharp.
    return *kind, light.GetTransformedPosition(), light.GetTransformedFocalPoint()
