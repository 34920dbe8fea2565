"""What is in layers: when it changed, and the light that falls on it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core._vtk import address

# The steepest slope of a highlight, cos(angle) ** power, is this times the root of the power.
_SLOPE = np.exp(-0.5)


class Member:
    """An actor of a layer."""

    def __init__(self, actor):
        self.actor, self.key = actor, address(actor)
        # Asked for in every frame: an attribute of a PyVista actor takes its time.
        self._mapper, self._prop, self._back = (
            actor.GetMapper,
            actor.GetProperty,
            actor.GetBackfaceProperty,
        )
        self._texture, self._visible = actor.GetTexture, actor.GetVisibility
        self._place, self._box = actor.GetMatrix, actor.GetBounds
        self.matrix, self.bounds = np.eye(4), (1.0, -1.0) * 3
        self.why, self.dull, self.gloss = 'not drawn yet', 1.0, 0.0
        self.version = 0
        self._content_key: Any = None
        self._draws: dict = {}
        self._shown = False
        self._hidden = False

    def update(self, draws) -> bool:
        """Look at the actor; its own time is no help: that is also of being hidden."""
        self._draws = draws
        data, content_key = self._look()
        before, self.matrix = self.matrix, np.reshape(self._place().GetData(), (4, 4))
        self.bounds = self._box() or (1.0, -1.0) * 3
        if content_key == self._content_key:
            return not np.array_equal(before, self.matrix)
        self._content_key = content_key
        self.version += 1
        self.why = self._unfit(data)
        self._take_looks(self._prop())
        return True

    def settle(self):
        """Take what it is now for what it was when last looked at: drawing may touch actors."""
        self._content_key = self._look()[1]

    def _look(self) -> tuple:
        """Return the data that it draws, and what changes whenever its looks do."""
        mapper, worn = self._mapper(), _time_of(self._texture())
        data = _updated(mapper)
        self._shown = bool(self._visible()) or self._hidden
        things = mapper, data, self._prop(), self._back()
        return data, (self._shown, worn, self._draws.get(worn[0]), *map(_time_of, things))

    def _unfit(self, data) -> str:
        if not self._shown:
            return 'hidden'
        if data is None or self.bounds[0] > self.bounds[1]:
            return 'empty'
        if not np.isfinite(self.bounds).all():
            return 'bounds that are not finite'
        if self.actor.HasTranslucentPolygonalGeometry():
            return 'translucent'
        return ''

    def _take_looks(self, prop):
        self.dull = self.gloss = 0.0
        if prop.GetLighting():
            self.dull = 1.0 if prop.GetInterpolation() == 3 else prop.GetDiffuse()  # VTK_PBR
            self.gloss = prop.GetSpecular() * _SLOPE * max(prop.GetSpecularPower(), 0.0) ** 0.5
            if prop.GetInterpolation() == 3:
                # As steep as its normal distribution, whose width is the square of roughness.
                self.gloss = _SLOPE / max(prop.GetRoughness(), 0.1) ** 2

    def hide(self):
        """Leave it out of the frame about to be drawn."""
        self._hidden = True
        self.actor.VisibilityOff()

    def show(self):
        """Take that back."""
        if self._hidden:
            self._hidden = False
            self.actor.VisibilityOn()


def _updated(mapper):
    """Return what a mapper draws, up to date; None where it has nothing."""
    if mapper is None or not mapper.GetNumberOfInputPorts():
        return None
    if not mapper.GetNumberOfInputConnections(0):
        return None
    source = mapper.GetInputAlgorithm()
    if not source.IsA('vtkTrivialProducer'):
        source.Update()
    return mapper.GetInputDataObject(0, 0)


def _time_of(thing) -> tuple:
    return (None, 0) if thing is None else (address(thing), thing.GetMTime())


class Lighting:
    """The lights of a renderer at one moment."""

    def __init__(self, renderer):
        renderer.UpdateLightsGeometryToFollowCamera()
        on = [light for light in renderer.GetLights() if light.GetSwitch()]
        self.kinds = [_kind(light) for light in on]
        self.colors = np.array([_colors(light) for light in on]).reshape(len(on), -1)
        self.places = np.array([light.GetTransformedPosition() for light in on]).reshape(-1, 3)
        ends = np.array([light.GetTransformedFocalPoint() for light in on]).reshape(-1, 3)
        ways = ends - self.places
        lengths = np.linalg.norm(ways, axis=1)[:, None]
        self.ways = ways / np.where(lengths > 0, lengths, 1.0)
        self.positional = np.array([bool(light.GetPositional()) for light in on], bool)

    def change(self, before, center, radius) -> tuple[float, float]:
        """Return how much the light differs from that of another moment."""
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
        """Of all lights together, as a share of white."""
        return float(self.colors.max(axis=1, initial=0.0).sum())


def _kind(light) -> tuple:
    cone = light.GetConeAngle(), light.GetExponent(), tuple(light.GetAttenuationValues())
    return address(light), light.GetLightType(), light.GetPositional(), *cone


def _colors(light) -> np.ndarray:
    colors = light.GetDiffuseColor(), light.GetSpecularColor(), light.GetAmbientColor()
    return light.GetIntensity() * np.concatenate(colors)
