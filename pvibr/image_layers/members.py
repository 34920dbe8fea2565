"""Members of layers: changes of actors and of lights."""

from __future__ import annotations

import numpy as np

from pvibr.core._vtk import address
from pvibr.scene.actor_watch import ineligibility
from pvibr.scene.content_key import colors_of, look_key, shape_of

# The steepest slope of a highlight, cos(angle) ** power, is this times the root of the power.
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
        """Update the member, and return True if the actor changed or moved."""
        content_key = look_key(self.actor)
        before, matrix = self.matrix, self.actor.GetMatrix().GetData()
        self.matrix = np.reshape(matrix, (4, 4))
        self.bounds = self.actor.GetBounds() or (1.0, -1.0) * 3
        if content_key == self._content_key:
            return not np.array_equal(before, self.matrix)
        self._content_key = content_key
        self.version += 1
        self.why = ineligibility(self.actor) if self.actor.GetVisibility() else 'hidden'
        self._take_looks(self.actor.GetProperty())
        return True

    def settle(self):
        """Ignore changes so far: drawing an actor may modify it."""
        self._content_key = look_key(self.actor)

    def _take_looks(self, prop):
        self.dull = self.gloss = 0.0
        if prop.GetLighting():
            self.dull = 1.0 if prop.GetInterpolation() == 3 else prop.GetDiffuse()  # VTK_PBR
            self.gloss = prop.GetSpecular() * _SLOPE * max(prop.GetSpecularPower(), 0.0) ** 0.5
            if prop.GetInterpolation() == 3:
                # As steep as its normal distribution, whose width is the square of roughness.
                self.gloss = _SLOPE / max(prop.GetRoughness(), 0.1) ** 2


class Lighting:
    """The lights of a renderer at one moment."""

    def __init__(self, renderer):
        renderer.UpdateLightsGeometryToFollowCamera()
        on = [light for light in renderer.GetLights() if light.GetSwitch()]
        self.kinds = [_kind(light) for light in on]
        colors = [np.ravel(colors_of(light)) for light in on]
        self.colors = np.array(colors) if on else np.zeros((0, 9))
        self.places = np.array([light.GetTransformedPosition() for light in on]).reshape(-1, 3)
        ends = np.array([light.GetTransformedFocalPoint() for light in on]).reshape(-1, 3)
        ways = ends - self.places
        lengths = np.linalg.norm(ways, axis=1)[:, None]
        self.ways = ways / np.where(lengths > 0, lengths, 1.0)
        self.positional = np.array([bool(light.GetPositional()) for light in on], bool)

    def change(self, before, center, radius) -> tuple[float, float]:
        """Return the change of colour and direction since another moment."""
        if self.kinds != before.kinds:
            return np.inf, np.inf
        color = float(np.abs(self.colors - before.colors).max(axis=1, initial=0.0).sum())
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(self.ways - before.ways, axis=1) / 2, 0, 1))
        away = np.minimum(
            np.linalg.norm(self.places - center, axis=1),
            np.linalg.norm(before.places - center, axis=1),
        )
        steps = np.linalg.norm(self.places - before.places, axis=1)
        near = np.where(steps > 0, np.pi, 0.0)
        around = np.where(away > radius, steps / np.maximum(away - radius, 1e-300), near)
        angle = np.where(self.positional, np.maximum(around, angle), angle)
        strength = self.colors.max(axis=1, initial=0.0)
        return color, float((strength * np.minimum(angle, np.pi)).sum())

    @property
    def strength(self) -> float:
        """Intensity of all lights together, as a share of white."""
        return float(self.colors.max(axis=1, initial=0.0).sum())


def _kind(light) -> tuple:
    """Return what changes with a light in ways of which nothing is known."""
    kind = address(light), light.GetLightType(), *shape_of(light)
    wide = light.GetConeAngle() >= 90 and tuple(light.GetAttenuationValues()) == (1, 0, 0)
    if wide or not light.GetPositional():
        return kind
    # The edge of a cone is as sharp as any.
    return *kind, light.GetTransformedPosition(), light.GetTransformedFocalPoint()
