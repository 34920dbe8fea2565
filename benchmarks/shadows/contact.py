"""What goes wrong where light grazes, and where things stand: acne, and gaps at the foot."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.light_scenes import LightScene, bare, light_at, measured_lit
from benchmarks.common.rays import Rays
from benchmarks.shadows.errors import drawn, shown, sight
from pvibr.shadows.shadow_maps import CASCADES
from pvibr.things.light_views import light_views
from pvibr.things.lights import lights_of

METHODS = ('hard', 'pcf', 'volume')
KINDS = ('directional', 'spot')
_DARK = 0.95  # of the light: less is acne on a plane that nothing hides
_PIXELS = 8  # along a texel, where a gap is measured
_ROOM = 12.0  # texels from the foot that are looked at


def measure(settings, results):
    """Yield the number of dark pixels where all is lit, and the width of gaps."""
    low, high = settings.angles[0], settings.angles[-1]
    for method in METHODS:
        setting = {'method': method}
        for kind in KINDS:
            dark = sum(acne(kind, setting, angle) for angle in settings.angles)
            plane = f'acne: plane, {kind}, {low:g} to {high:g} degrees, {method}'
            yield Row(plane, dark, 'pixels', 0)
            ball = f'acne: ball, {kind}, 80 to 89 degrees, {method}'
            yield Row(ball, acne_on_ball(kind, setting), 'pixels', 0)
    gaps = results.points['gaps'] = {
        f'{what}, {kind}, {method}': gap(thick, kind, {'method': method})
        for what, thick in (('box', 0.1), ('sheet', 0.0))
        for kind in KINDS
        for method in METHODS
    }
    for name, width in gaps.items():
        yield Row(f'gap: {name}', width, 'texels', 1)


def _lamp(kind, toward, distance):
    return light_at(np.array(toward) * distance, cone=30.0 if kind == 'spot' else None)


def _grazing(angle) -> np.ndarray:
    """Return a direction to a light so many degrees from straight above."""
    angle, around = np.radians([angle, 25.0])
    across = np.sin(angle)
    return np.array([across * np.cos(around), across * np.sin(around), np.cos(angle)])


def acne(kind, setting, angle) -> int:
    """Return the dark pixels on a plane that is wholly lit."""
    plane = bare(pv.Plane(i_size=10, j_size=10, i_resolution=60, j_resolution=60))
    toward = _grazing(angle)
    lamp = _lamp(kind, toward, 20.0)
    lamp.intensity = 0.8 / toward[2]  # as bright at any angle
    scene = LightScene('plane', [plane], {kind: lamp}, ((3, -14, 7), (0, 0, 0), (0, 0, 1)))
    with scene.stage(kind, (640, 360)) as stage, shown(stage, setting) as effect:
        lit = measured_lit(stage, effect, 0.1)
    return int((lit < _DARK).sum())


def acne_on_ball(kind, setting) -> int:
    """Return the dark pixels on a ball's triangles that light grazes, and that rays find lit."""
    ball = bare(pv.Sphere(radius=2.0, theta_resolution=100, phi_resolution=102))
    lamp = _lamp(kind, _grazing(60.0), 12.0)
    lamp.intensity = 5.0
    scene = LightScene('ball', [ball], {kind: lamp}, ((-3, -10, 4), (0, 0, 0), (0, 0, 1)))
    with sight(scene, Rays(scene.meshes), kind, (640, 360)) as found:
        lit = drawn(found, setting, 0.05)
        cosine = found.surface.facing(lamp)
        grazed = (cosine > np.cos(np.radians(89))) & (cosine < np.cos(np.radians(80)))
        sure = grazed & (found.lit == 1) & ~found.band
    return int((lit[sure] < 0.5).sum())


def gap(thick, kind, setting) -> float:
    """Return the widest light between a wall's foot and its shadow, in texels."""
    floor = bare(pv.Plane(i_size=12, j_size=12))
    sheet = pv.Plane(center=(0, 0, 1), direction=(0, 1, 0), i_size=2, j_size=4)
    wall = pv.Box((-2, 2, -thick, 0, 0, 2)) if thick else sheet
    around = np.radians(20.0)  # so that the texels lie across the wall
    toward = np.array([np.sin(around), -np.cos(around), 1.0]) / np.sqrt(2)
    lamp = _lamp(kind, toward, 9.0)
    camera = (0, 0, 20), (0, 0, 0), (0, 1, 0)
    scene = LightScene('wall', [floor, bare(wall)], {kind: lamp}, camera)
    window = (16 * _PIXELS, 2 * int(_ROOM + 2) * _PIXELS)
    with scene.stage(kind, window) as stage, shown(stage, setting) as effect:
        camera = stage.plotter.camera
        camera.parallel_projection = True
        for _ in range(8):  # the nearer the camera, the smaller the texels around it
            texel = _texel(stage, effect.resolution)
            camera.parallel_scale = (_ROOM + 2) * texel
        pixel = texel / _PIXELS
        lit = np.nan_to_num(measured_lit(stage, effect, 0.1))
    away = (window[1] / 2 - np.arange(window[1]) - 0.5) * pixel
    room = (away > 0) & (away < _ROOM * texel)
    return float(lit[room].sum(0).max() / _PIXELS)


def _texel(stage, resolution) -> float:
    """Return the side of a texel on the floor at the foot, across the wall, world units."""
    (light,) = lights_of(stage.renderer)
    bounds = [actor.GetBounds() for actor in stage.renderer.GetActors()]
    whole, refined = light_views(light, bounds, stage.frame(), resolution, CASCADES)
    ahead, texel = 1e-3, np.inf
    for view in whole + [cascade.view for cascade in refined]:
        ends = np.array([[0, 0, 0, 1], [0, ahead, 0, 1]]) @ view.texture_from_world().T
        ends = ends[:, :2] / ends[:, 3:]
        if np.abs(ends[0] - 0.5).max() < 0.49:  # the foot is in it
            texel = min(texel, ahead / np.linalg.norm(ends[1] - ends[0]) / resolution)
    return float(texel)
