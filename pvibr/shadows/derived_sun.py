"""One sun in place of lights that follow the camera, which have no shadows worth their cost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.views import look_along
from pvibr.scene.lights import lights_of

#: Toward the sun, seen from the first camera: right, up and back.
_TOWARD = np.array([0.45, 0.65, 0.6])
_NORMALS = 256  # of a half ball toward the camera, whose light is kept


class DerivedSun:
    """A sun that stands still, and how much it dimmed the lights that follow the camera."""

    def __init__(self):
        self._renderer: Any = None
        self._light: _vtk.vtkLight | None = None
        self._dimmed: list = []
        self._share = 1.0

    def match(self, frame, wanted, share):
        """Have a sun where it is wanted and no light stands still; others keep a share."""
        own = self._light
        others = [x for x in frame.renderer.GetLights() if x.GetSwitch() and x is not own]
        wanted = wanted and others and not any(x.LightTypeIsSceneLight() for x in others)
        if not wanted:
            self.remove()
            return
        same = [address(x) for x in others] == [address(x) for x in self._dimmed]
        there = own is not None and frame.renderer.GetLights().IsItemPresent(own)
        if same and there and share == self._share:
            return
        toward = _TOWARD @ frame.view_from_world[:3, :3] if own is None else own.position
        self.remove()
        self._add(frame.renderer, np.array(toward), others, share)

    def _add(self, renderer, toward, others, share):
        toward /= np.linalg.norm(toward)
        color = (1 - share) * _as_bright(renderer, toward)
        for light in others:
            light.SetIntensity(light.GetIntensity() * share)
        self._light = sun = pv.Light(position=toward, light_type='scene light')
        sun.SetColor(color / max(color.max(), 1e-6))
        sun.intensity = color.max()
        renderer.AddLight(sun)
        self._renderer, self._dimmed, self._share = renderer, others, share

    def remove(self):
        """Remove the sun, and give other lights their brightness back."""
        if self._light is None:
            return
        for light in self._dimmed:
            light.SetIntensity(light.GetIntensity() / self._share)
        self._renderer.RemoveLight(self._light)
        self._renderer, self._light, self._dimmed = None, None, []


def _as_bright(renderer, toward) -> np.ndarray:
    """Return the colour of a sun that lights what a camera sees as the renderer's lights do."""
    camera = renderer.GetActiveCamera()
    axes = look_along((0, 0, 0), camera.GetDirectionOfProjection(), camera.GetViewUp())[:3, :3]
    disk = vogel_disk(_NORMALS)
    normals = np.column_stack([disk, np.sqrt(np.maximum(1 - (disk**2).sum(1), 0))]) @ axes
    lights = [x for x in renderer.GetLights() if x.GetSwitch()]
    given = np.zeros((_NORMALS, 3))
    for light, known in zip(lights, lights_of(renderer), strict=True):
        color = light.GetIntensity() * np.array(light.GetDiffuseColor())
        given += np.outer(np.maximum(normals @ -np.array(known.direction), 0), color)
    sun = np.maximum(normals @ toward, 0)
    # As bright on the whole, and nowhere brighter than the brightest was.
    return np.minimum(given.mean(0) / sun.mean(), given.max(0) / sun.max())
