"""Looks: sky, light, ground, shadows and tone of a subplot in one call."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

import pvibr
from pvibr.core.arguments import checked_direction
from pvibr.core.params import checked_flag
from pvibr.core.spelling import nearest
from pvibr.maths.vectors import unit_vectors


@dataclass(frozen=True)
class Recipe:
    """What a look consists of, beside the effects that all have."""

    #: Colour and intensity of the sun, and of lights from above, from the eye and from below.
    sun: tuple[str, float]
    above: tuple[str, float]
    eye: tuple[str, float]
    below: tuple[str, float]
    #: Degrees of the sun over the ground, and to the left of the camera.
    altitude: float
    aside: float
    #: Colours of the ground, and of the sky at the zenith and where it meets the ground.
    ground: str
    sky: tuple[str, str]
    #: Settings of soft shadows.
    shadows: dict[str, float]

    def effects(self, up, *, ground) -> dict:
        """Return new effects by class name."""
        top, horizon = self.sky
        made = [
            *([pvibr.Ground(self.ground, up=up)] if ground else []),
            pvibr.Shadows(method='pcss', **self.shadows),
            pvibr.AmbientOcclusion(),
            pvibr.Sky(top=top, horizon=horizon, bottom=horizon, up=up),
            pvibr.ToneMapping(),
        ]
        return {type(effect).__name__: effect for effect in made}


LOOKS = {
    'studio': Recipe(
        sun=('#fff4e6', 0.62),
        above=('white', 0.34),
        eye=('white', 0.3),
        below=('white', 0.2),
        altitude=52,
        aside=42,
        ground='#f0f0f1',
        sky=('#c3cad3', '#eef0f2'),
        shadows={'angle': 7.0},
    ),
    'daylight': Recipe(
        sun=('#fff1d6', 0.82),
        above=('#cfe0ff', 0.36),
        eye=('white', 0.22),
        below=('#e6d9c0', 0.2),
        altitude=42,
        aside=50,
        ground='#cdc7ba',
        sky=('#4f86c6', '#d5e3ee'),
        shadows={'angle': 1.5},
    ),
    'dusk': Recipe(
        sun=('#ffb27a', 1.1),
        above=('#8f9fe0', 0.55),
        eye=('#c9b8d8', 0.3),
        below=('#a58aa0', 0.22),
        altitude=18,
        aside=70,
        ground='#8f8691',
        sky=('#1d2747', '#e39a74'),
        shadows={'angle': 3.0},
    ),
    'paper': Recipe(
        sun=('white', 0.6),
        above=('white', 0.45),
        eye=('white', 0.28),
        below=('white', 0.24),
        altitude=62,
        aside=35,
        ground='white',
        sky=('white', 'white'),
        shadows={'angle': 14.0, 'strength': 0.8},
    ),
}

#: Where lights that follow the camera are, in its space: above, at the eye, and below.
_FROM_CAMERA = (0, 1, 0.3), (0, 0, 1), (0, -1, 0.4)


class Look:
    """A look that is worn: effects and lights, which can be changed and removed."""

    def __init__(self, pipeline, name, up, ground):
        recipe = LOOKS[name]
        self.name, self.up = name, up
        self._pipeline = pipeline
        renderer = pipeline.renderer
        self._old_lights = list(renderer.GetLights())
        self.lights = _lights(recipe, renderer, np.array(up))
        #: Effects of the look by class name, settings and all.
        self.effects = recipe.effects(up, ground=ground)
        self._replaced = [e for e in pipeline.effects if type(e).__name__ in self.effects]
        for effect in self._replaced:
            pipeline.remove(effect)
        renderer.RemoveAllLights()
        for light in self.lights:
            renderer.AddLight(light)
        for effect in self.effects.values():
            pipeline.add(effect)

    def __repr__(self) -> str:
        return f'<Look {self.name!r}: {", ".join(self.effects)}, {len(self.lights)} lights>'

    def remove(self):
        """Take it off: lights and effects are as they were before it."""
        renderer = self._pipeline.renderer
        for effect in self.effects.values():
            if effect.pipeline is self._pipeline:
                self._pipeline.remove(effect)
        for light in self.lights:
            renderer.RemoveLight(light)
        for light in self._old_lights:
            renderer.AddLight(light)
        newer = {type(effect) for effect in self._pipeline.effects}  # added since, in their place
        for effect in self._replaced:
            if effect.pipeline is None and type(effect) not in newer:
                self._pipeline.add(effect)
        self.lights, self.effects = [], {}
        self._old_lights, self._replaced = [], []


def take_off(self, pipeline):
    """Remove the look of a subplot, if it has one."""
    if pipeline in self._looks:
        self._looks.pop(pipeline).remove()


def look(self, name, *, up=None, ground=True):
    """Apply a look: sky, sun, ground, shadows, ambient occlusion and tone in one call.

    It adapts to what is in the active subplot, also to what is added later, and replaces the
    current look. Its effects are in :attr:`effects`, where each can be changed. The sun stands
    to the left of where the camera is now, and stays there.

    Parameters
    ----------
    name : {'studio', 'daylight', 'dusk', 'paper'} or None
        The look; None removes the current one and restores the lights and effects from before
        it.
    up : array_like, shape (3,), optional
        Up direction in world space; by default the axis that points up for the camera.
    ground : bool, optional
        Whether a ground is put under the scene.

    Returns
    -------
    pvibr.api.presets.Look or None
        The look: ``effects`` by class name, ``lights``, and ``remove()``.

    Raises
    ------
    ValueError
        If there is no such look, or `up` is no direction.
    TypeError
        If `ground` is not a bool.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='tomato')
    >>> look = pl.ibr.look('studio')
    >>> look.effects['Shadows'].strength = 0.7
    >>> pl.ibr.look(None)
    >>> len(pl.ibr)
    0
    >>> pl.close()
    """
    pipeline = self.pipeline
    if name is not None:
        name = checked_look(name)
    up = up_of(pipeline.renderer.GetActiveCamera(), up)
    ground = checked_flag('ground', ground)
    take_off(self, pipeline)
    if name is None:
        return None
    self._looks[pipeline] = look = Look(pipeline, name, up, ground)
    return look


def checked_look(name):
    """Return the name of a look."""
    if not isinstance(name, str) or name not in LOOKS:
        raise ValueError(
            f'name must be one of {", ".join(LOOKS)}, got {name!r}{nearest(str(name), LOOKS)}'
        )
    return name


def up_of(camera, up):
    """Return the up direction: the axis that points up for the camera if none is given."""
    if up is None:
        seen = np.array(camera.GetViewUp())
        axis = np.abs(seen).argmax()
        return tuple(float(x) for x in np.eye(3)[axis] * np.sign(seen[axis]))
    return tuple(checked_direction('up', up).tolist())


def _lights(recipe, renderer, up):
    """Return the sun, on the left of the camera, and lights that follow the camera."""
    up = unit_vectors(up)
    toward = -np.array(renderer.GetActiveCamera().GetDirectionOfProjection())
    level = toward - (toward @ up) * up
    if np.linalg.norm(level) < 1e-3:  # the camera looks straight down
        level = -np.array(renderer.GetActiveCamera().GetViewUp())
        level -= (level @ up) * up
    level = unit_vectors(level)
    aside, altitude = np.radians(recipe.aside), np.radians(recipe.altitude)
    around = np.cos(aside) * level - np.sin(aside) * np.cross(up, level)
    place = np.cos(altitude) * around + np.sin(altitude) * up
    sun = pv.Light(position=place, focal_point=(0, 0, 0), light_type='scene light')
    lights = [sun, *(pv.Light(position=at, light_type='camera light') for at in _FROM_CAMERA)]
    hues = recipe.sun, recipe.above, recipe.eye, recipe.below
    for light, (color, intensity) in zip(lights, hues, strict=True):
        light.diffuse_color = light.specular_color = color
        light.intensity = intensity
    return lights
