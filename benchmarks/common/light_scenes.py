"""Scenes for shadows: white and matt, so that light can be read off the pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyvista as pv

from benchmarks.common.meshes import DATA, MESHES
from pvibr.scenes.stage import Stage
from pvibr.scenes.trees import tree

#: Width and height in pixels: square, wide, tall.
WINDOWS = ((720, 720), (1280, 720), (400, 1200))
#: Along the shorter side of a window, degrees.
VIEW_ANGLE = 30.0
#: Where a scene is moved to, in its sizes.
AWAY = np.array([1.0, -0.7, 0.3])


@dataclass(frozen=True, eq=False)
class LightScene:
    """Meshes, lights and a camera."""

    name: str
    meshes: list
    lights: dict
    camera: tuple

    @property
    def bounds(self) -> np.ndarray:
        """Of all meshes, (6,)."""
        return np.array(pv.MultiBlock(self.meshes).bounds)

    @property
    def size(self) -> float:
        """Diagonal of the bounds."""
        return float(np.linalg.norm(self.bounds[1::2] - self.bounds[::2]))

    def stage(self, light, window, *, smooth=False, multi_samples=0) -> Stage:
        """Return a window that shows it by one light, in white before black.

        One sample per pixel, as rays through the middles of pixels see it.
        """
        look = {'view_angle': view_angle(window), 'background': 'black'}
        stage = Stage(window, **look, multi_samples=multi_samples)
        stage.plotter.remove_all_lights()
        self._fill(stage.plotter, light, smooth)
        stage.bounds = tuple(self.bounds)
        stage.look(self.camera)
        return stage

    def plotter(self, light, window) -> pv.Plotter:
        """Return a plotter that shows it by one light."""
        plotter = pv.Plotter(off_screen=True, window_size=list(window), lighting='none')
        self._fill(plotter, light, smooth=False)
        plotter.camera_position = self.camera
        plotter.camera.view_angle = view_angle(window)
        return plotter

    def _fill(self, plotter, light, smooth):
        plotter.add_light(self.lights[light].copy())
        look = {'color': 'white', 'ambient': 0, 'diffuse': 1, 'specular': 0}
        for mesh in self.meshes:
            plotter.add_mesh(mesh, smooth_shading=smooth, **look)


class VtkShadows:
    """VTK's own shadow pass, switched as an effect is."""

    def __init__(self, plotter):
        self._plotter, self._enabled = plotter, False

    @property
    def enabled(self) -> bool:
        """Whether frames are drawn with it."""
        return self._enabled

    @enabled.setter
    def enabled(self, enabled):
        if enabled != self._enabled:
            (self._plotter.enable_shadows if enabled else self._plotter.disable_shadows)()
        self._enabled = enabled


def measured_lit(stage, effect, least=0.02):
    """Return the share of light that is drawn: with an effect over without it."""
    effect.enabled = False
    plain = stage.picture().mean(-1)
    effect.enabled = True
    shadowed = stage.picture().mean(-1)
    enough = plain >= least
    return np.where(enough, shadowed / np.where(enough, plain, 1), np.nan)


def view_angle(window) -> float:
    """Return the vertical view angle that shows the same along the shorter side of any window."""
    width, height = window
    tangent = np.tan(np.radians(VIEW_ANGLE / 2)) * max(1.0, height / width)
    return float(np.degrees(2 * np.arctan(tangent)))


def place(scene, offset=0.0, scale=1.0) -> LightScene:
    """Return a scene made larger and moved as a whole."""
    shift = AWAY / np.linalg.norm(AWAY) * offset * scene.size * scale

    def moved(points):
        return np.asarray(points, np.float64) * scale + shift

    meshes = [bare(mesh, moved(mesh.points)) for mesh in scene.meshes]
    lights = {}
    for name, light in scene.lights.items():
        lights[name] = light.copy()
        lights[name].position = tuple(moved(light.position))
        lights[name].focal_point = tuple(moved(light.focal_point))
    eye, focus, up = scene.camera
    camera = tuple(moved(eye)), tuple(moved(focus)), up
    return replace(scene, meshes=meshes, lights=lights, camera=camera)


# -- the scenes ---------------------------------------------------------------------------------


def _spheres():
    """Return a floor with 50 spheres of 20 000 triangles: half rest on it, half hover."""
    rng = np.random.default_rng(8)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(10) - 4.5, (np.arange(5) - 2) * 1.8))
    meshes = [_floor(12.0)]
    for k in range(50):
        radius = rng.uniform(0.25, 0.45)
        over = 0.0 if k % 2 else rng.uniform(0.1, 1.2)
        aside = rng.uniform(-0.1, 0.1, 2)
        center = x[k] + aside[0], y[k] + aside[1], radius + over
        ball = pv.Sphere(radius=radius, center=center, theta_resolution=100, phi_resolution=102)
        meshes.append(bare(ball))
    camera = (6.0, -17.0, 11.0), (0, 0, 0.3), (0, 0, 1)
    return LightScene('spheres', meshes, _lights(12.0), camera)


def _terrain():
    """Return a mountain where the project's data are, else made-up hills."""
    mesh = _mountain()
    low, high = np.array(mesh.bounds).reshape(3, 2).T
    mesh.points = (mesh.points - (low + high) / 2) / (high - low)[:2].max() * 12.0
    lights = _lights(12.0)
    lights['directional'] = light_at((-9.0, 4.0, 3.5), (0, 0, 0))  # low sun: long shadows
    lights['spot'] = light_at((-8.0, -3.0, 4.0), (0, 0, 0.5), cone=30.0)
    lights['point'] = light_at((-3.5, 1.5, 3.0), (0, 0, 0), cone=90.0)
    return LightScene('terrain', [mesh], lights, ((4.0, -15.0, 10.0), (0, 0, 0), (0, 0, 1)))


def _mountain():
    path = DATA / 'projection' / 'SainteHelens.dem'
    if path.is_file():
        return bare(pv.read(path).warp_by_scalar(factor=2.0).extract_surface(algorithm=None))
    ground = pv.Plane(i_size=12.0, j_size=12.0, i_resolution=400, j_resolution=400).triangulate()
    points = np.array(ground.points, np.float64)
    x, y = points[:, 0], points[:, 1]
    heights = [np.sin(k * x + k) * np.cos(1.3 * k * y) / k for k in (1.0, 2.0, 5.0, 11.0)]
    points[:, 2] = 0.9 * np.sum(heights, axis=0)
    return bare(ground, points)


def _standing(name, make):
    def scene():
        parts = make()
        mesh = pv.merge(list(parts)) if isinstance(parts, pv.MultiBlock) else parts
        mesh = mesh.extract_surface(algorithm=None).triangulate()
        low, high = np.array(mesh.bounds).reshape(3, 2).T
        foot = [*(low + high)[:2] / 2, low[2]]
        points = (np.asarray(mesh.points, float) - foot) / (high - low).max() * 4.0
        meshes = [_floor(9.0), bare(mesh, points)]
        focus = (0.5, 0.3, 0.4 * points[:, 2].max())
        camera = (4.0, -10.5, 6.0), focus, (0, 0, 1)
        return LightScene(name, meshes, _lights(10.0), camera)

    return scene


def _statue():
    mesh = MESHES['statue']()
    size = np.ptp(np.array(mesh.bounds).reshape(3, 2), axis=1)
    # The scan lies on its back where the data are; it shall stand.
    return mesh.rotate_x(90.0) if size[1] > size[2] else mesh


def _lights(size):
    """Return one light of each kind for what stands on a floor around the origin."""
    return {
        'directional': light_at(np.array([-0.5, -0.3, 0.7]) * size),
        'spot': light_at(np.array([-0.45, -0.35, 0.55]) * size, cone=20.0),
        'point': light_at(np.array([-0.08, -0.06, 0.42]) * size, cone=90.0),
    }


def light_at(position, focus=(0, 0, 0), cone=None) -> pv.Light:
    """Return a white light of a scene: directional, or of a cone."""
    light = pv.Light(
        position=tuple(position), focal_point=tuple(focus), color='white', light_type='scene light'
    )
    if cone is not None:
        light.positional, light.cone_angle = True, cone
    return light


def _floor(size):
    return bare(pv.Plane(i_size=size, j_size=size, i_resolution=1, j_resolution=1))


def bare(mesh, points=None) -> pv.PolyData:
    """Return the triangles of a mesh alone, with points in float64."""
    mesh = mesh.triangulate()
    points = mesh.points if points is None else points
    return pv.PolyData.from_regular_faces(np.asarray(points, np.float64), mesh.regular_faces)


#: What makes each scene.
SCENES = {
    'spheres': _spheres,
    'terrain': _terrain,
    'tree': _standing('tree', lambda: tree('broadleaf')),
    'airplane': _standing('airplane', MESHES['airplane']),
    'statue': _standing('statue', _statue),
}
