"""One sun derived from lights that follow the camera, whose own shadows would be worthless."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.views import look_along
from pvibr.things.lights import lights_of

#: Direction to the sun in the first camera's axes: right, up, back.
_TOWARD = np.array([0.45, 0.65, 0.6])
_NORMALS = 256  # on the hemisphere facing the camera, over which brightness is matched


class DerivedSun:
    """A static sun, and the lights that it dimmed since they follow the camera."""

    def __init__(self):
        self._renderer: Any = None
        self._sun: _vtk.vtkLight | None = None
        self._dimmed_lights: list = []
        self._kept_share = 1.0

    def match(self, frame, is_wanted, kept_share):
        """Add the sun if it is wanted and all lights follow the camera; these keep a share."""
        sun = self._sun
        followers = [x for x in frame.renderer.GetLights() if x.GetSwitch() and x is not sun]
        if not is_wanted or not followers or any(x.LightTypeIsSceneLight() for x in followers):
            self.remove()
            return
        is_unchanged = [address(x) for x in followers] == [address(x) for x in self._dimmed_lights]
        is_present = sun is not None and frame.renderer.GetLights().IsItemPresent(sun)
        if is_unchanged and is_present and kept_share == self._kept_share:
            return
        toward = _TOWARD @ frame.view_from_world[:3, :3] if sun is None else sun.position
        self.remove()
        self._add(frame.renderer, np.array(toward), followers, kept_share)

    def _add(self, renderer, toward, followers, kept_share):
        toward /= np.linalg.norm(toward)
        sun_color = (1 - kept_share) * _as_bright(renderer, toward)
        for light in followers:
            light.SetIntensity(light.GetIntensity() * kept_share)
        self._sun = pv.Light(position=toward, light_type='scene light')
        self._sun.SetColor(sun_color / max(sun_color.max(), 1e-6))
        self._sun.intensity = sun_color.max()
        renderer.AddLight(self._sun)
        self._renderer, self._dimmed_lights, self._kept_share = renderer, followers, kept_share

    def remove(self):
        """Remove the sun, and restore the brightness of other lights."""
        if self._sun is None:
            return
        for light in self._dimmed_lights:
            light.SetIntensity(light.GetIntensity() / self._kept_share)
        self._renderer.RemoveLight(self._sun)
        self._renderer, self._sun, self._dimmed_lights = None, None, []


def _as_bright(renderer, toward) -> np.ndarray:
    """Return the colour of a sun that lights the camera's side as the renderer's lights do."""
    camera = renderer.GetActiveCamera()
    axes = look_along((0, 0, 0), camera.GetDirectionOfProjection(), camera.GetViewUp())[:3, :3]
    x, y = vogel_disk(_NORMALS).T
    normals = np.column_stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))]) @ axes
    lights_on = [x for x in renderer.GetLights() if x.GetSwitch()]
    light_sums = np.zeros((_NORMALS, 3))
    for light, scene_light in zip(lights_on, lights_of(renderer), strict=True):
        light_color = light.GetIntensity() * np.array(light.GetDiffuseColor())
        cosines = np.maximum(normals @ -np.array(scene_light.direction), 0)
        light_sums += np.outer(cosines, light_color)
    sun_cosines = np.maximum(normals @ toward, 0)
    # The same mean brightness, and no peak above the old one.
    by_mean, by_peak = (
        light_sums.mean(0) / sun_cosines.mean(),
        light_sums.max(0) / sun_cosines.max(),
    )
    return np.minimum(by_mean, by_peak)
