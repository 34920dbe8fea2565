"""Accumulation against itself with many more samples, and what it costs a view that moves."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import seconds
from pvibr.effects.accumulation import Accumulation
from pvibr.effects.ambient_occlusion import AmbientOcclusion
from pvibr.effects.depth_of_field import DepthOfField
from pvibr.maths.image_error import psnr
from pvibr.scenes.stage import Stage
from pvibr.shadows.shadows import Shadows

_SUN = ((3, -2, 6), False)
_LAMP = ((1.5, -2, 4), True)


def measure(settings, results):
    """Yield errors of pixels alone, and of lens, soft light and occlusion together."""
    count = settings.still_samples
    with _things_on_a_floor(settings.screen, _SUN, settings.still_seed) as stage:
        yield from _moving(stage, settings.rounds)
    for name, light in (('sun', _SUN), ('lamp', _LAMP)):
        with _things_on_a_floor(settings.still, light, settings.still_seed) as stage:
            if name == 'sun':
                yield from _against(stage, 'pixels alone', count, {64: 45})
            for effect in (
                Shadows(method='pcss', angle=4.0, radius=0.15, resolution=settings.still_texels),
                AmbientOcclusion(0.4),
                DepthOfField(radius=0.15),
            ):
                stage.plotter.ibr.add(effect)
            yield from _against(stage, f'lens, {name}, occlusion', count, {64: 38, 256: 45})


def _against(stage, what, count, bars):
    expected = _picture(stage, count)
    for samples, bar in bars.items():
        if samples >= count:
            continue
        found = _picture(stage, samples)
        name = f'accumulation, {what}, {samples} samples'
        yield Row(f'{name}: PSNR', psnr(found, expected), 'dB', bar, at_least=True)
        off = 255 * abs(float((found - expected).mean()))
        yield Row(f'{name}: mean off by', off, 'of 255', 0.5)


def _picture(stage, samples):
    return stage.plotter.ibr.screenshot(samples=samples) / 255


def _moving(stage, pairs):
    """Yield what it costs frames of a camera that moves, and the frames of a still view."""
    plotter, still = stage.plotter, Accumulation(4096)
    times: dict[str, list[float]] = {'with': [], 'without': [], 'at rest': []}

    def frame(name):
        times[name].append(seconds(plotter.render_window, plotter.render_window.Render))

    for k in range(pairs):
        for name in ('without', 'with'):
            if name == 'with':
                plotter.ibr.add(still)
            plotter.camera.azimuth = 0.2 * k
            plotter.render_window.Render()
            plotter.camera.azimuth = 0.2 * k + 0.1
            frame(name)
        for _ in range(2):
            plotter.render_window.Render()
        frame('at rest')
        plotter.ibr.remove(still)
    plotter.camera.azimuth = 0.0
    for name, what in (('with', 'a moving view'), ('at rest', 'a view at rest')):
        ratio = np.median(np.divide(times[name], times['without']))
        yield Row(f'accumulation, frames of {what}: over those without', ratio, 'x')


def _things_on_a_floor(size, light, seed) -> Stage:
    """Return a window that shows spheres, cubes and cones over a floor under a light."""
    position, positional = light
    lamp = pv.Light(position=position, light_type='scene light', intensity=0.9)
    lamp.positional = positional
    if positional:
        lamp.cone_angle = 60
    head = pv.Light(light_type='headlight', intensity=0.3)
    stage, rng = Stage(size, lights=[lamp, head]), np.random.default_rng(seed)
    stage.plotter.add_mesh(pv.Plane(i_size=8, j_size=8), color='wheat')
    for k in range(9):
        x, y, z = rng.uniform((-1.6, -1.6, 0.35), (1.6, 1.6, 1.35))
        color = rng.uniform(0.2, 1, 3)
        if k % 3 == 0:
            mesh = pv.Sphere(radius=0.3, center=(x, y, z))
        elif k % 3 == 1:
            mesh = pv.Cube(center=(x, y, z), x_length=0.5, y_length=0.5, z_length=0.7)
        else:
            mesh = pv.Cone(center=(x, y, z), radius=0.3, height=0.8, direction=(0, 0, 1))
        stage.plotter.add_mesh(mesh, color=color)
    stage.look([(0.5, -6, 3.5), (0, 0, 0.3), (0, 0, 1)])
    return stage
