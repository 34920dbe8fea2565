"""What shadows add to the time of a frame, beside what VTK's own pass adds."""

from __future__ import annotations

import time
from itertools import product
from types import SimpleNamespace

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.light_scenes import SCENES
from benchmarks.common.rays import Rays
from benchmarks.common.timing import timed
from benchmarks.shadows import errors
from benchmarks.shadows.errors import EXTENTS, VTK, shown, sight
from pvibr.cli.timing import spent
from pvibr.maths.silhouettes import LitMesh, edge_table

#: What is allowed over what VTK adds.
BARS = {'camera': 0.5, 'light': 0.7}
_STEP = 0.01  # of the scene's size, that camera or light move in a frame
_SIZES = {f'{n}': {'resolution': n} for n in (2048, 512, 1024, 4096)}
_BLURS = {f'{x:g} texels': {'filter_radius': x} for x in (8.0, 2.0, 16.0)}
_BIASES = {f'{x:g} texels': {'normal_bias': x} for x in (0.35, 0.0, 0.1, 1.0, 4.0)}
#: Curves of the plot: by name, settings by what is written beside their points.
HARD: dict = {
    'hard, by resolution': {k: v | {'method': 'hard'} for k, v in _SIZES.items()},
    'pcf, by resolution': _SIZES,
    'pcf, by normal bias': _BIASES,
    'volume': {'': {'method': 'volume'}},
    "VTK's own pass": {'': VTK},
}
SOFT: dict = {
    'hard': {'': {'method': 'hard'}},
    'pcf, by filter radius': _BLURS,
    'pcss, by taps': {f'{n} taps': {'method': 'pcss', 'taps': n} for n in (32, 8, 16, 64)},
    **{
        f'{m}, by filter radius': {k: v | {'method': m} for k, v in _BLURS.items()}
        for m in ('vsm', 'evsm', 'msm')
    },
    "VTK's own pass": {'': VTK},
}


def measure(settings, results):
    """Yield times over those of VTK's pass, draws of lights' views, and outlines."""
    scene = SCENES[settings.timed]()
    choices = {'hard': {'method': 'hard'}, 'pcf': {}, 'volume': {'method': 'volume'}, VTK: VTK}
    for light in ('spot', 'directional'):
        extra = extra_ms(scene, light, choices, settings)
        results.points.setdefault('times', {})[light] = extra
        for name, (what, bar) in product(choices, BARS.items()):
            wall, cpu = (extra[name][what][k] for k in ('wall', 'cpu'))
            title = f'time: {settings.timed}, {light}, {what} moves, {name}'
            yield Row(f'{title} adds', wall, 'ms')
            if name != VTK:
                peer = extra[VTK][what]
                asked = bar if name == 'pcf' else None
                yield Row(f'{title}, over what VTK adds', wall / peer['wall'], 'x', asked)
                yield Row(f'{title}, the same in CPU time', cpu / peer['cpu'], 'x', asked)
    for light in settings.lights:
        redrawn = _bakes(scene, light, settings.screen)
        yield Row(f'views drawn while only the camera moves, {light}', redrawn, '', 0)
    yield from _outlines(settings)


def extra_ms(scene, light, choices, settings, moves=('camera', 'light')) -> dict:
    """Return what shadows add to a frame while the camera or the light moves."""
    found: dict = {name: {what: [] for what in moves} for name in (None, *choices)}
    with scene.stage(light, settings.screen, multi_samples=None) as stage:
        for _ in range(settings.repeats):
            _frames(scene, stage, found[None], settings)
            for name, choice in choices.items():
                with shown(stage, choice) as effect:
                    effect.enabled = True
                    _frames(scene, stage, found[name], settings)
    plain = found.pop(None)
    extra: dict = {name: {} for name in choices}
    for name, what in product(choices, moves):
        added = np.median(found[name][what], axis=0) - np.median(plain[what], axis=0)
        cpu, wall = (1e3 * added).tolist()
        extra[name][what] = {'wall': wall, 'cpu': cpu}
    return extra


def _cameras(scene, frames) -> list:
    """Return the scene's camera, and cameras that go sideways from it."""
    eye, focus, up = scene.camera
    return [(_aside(eye, _STEP * scene.size * k), focus, up) for k in range(frames)]


def _aside(place, way) -> tuple:
    return place[0] + way, *place[1:]


def _frames(scene, stage, found, settings):
    """Add the seconds of frames, of the processors and on the wall."""
    lamp = stage.renderer.lights[0]
    position = lamp.position
    stage.draw()
    stage.draw()  # the first made textures and shaders
    for camera in _cameras(scene, settings.frames):
        stage.look(camera)
        found['camera'].append(spent(stage.window))
    for k in range(settings.frames if 'light' in found else 0):
        lamp.position = _aside(position, _STEP * scene.size * (k + 1))
        found['light'].append(spent(stage.window))
    lamp.position = position


def _bakes(scene, light, window) -> int:
    with scene.stage(light, window) as stage, shown(stage, {}) as effect:
        stage.draw()
        before = effect.report()['views drawn']
        for camera in _cameras(scene, 5)[1:]:
            stage.look(camera)
            stage.draw()
        return effect.report()['views drawn'] - before


def _outlines(settings):
    side = int(np.sqrt(settings.triangles / 2)) + 1
    mesh = pv.Sphere(theta_resolution=side, phi_resolution=side + 1)
    edges, table = timed(lambda: edge_table(mesh.points, mesh.regular_faces))
    lights = [(x, 0.3, 2.0, 1.0) for x in np.linspace(-1, 1, 7)]
    seconds = [timed(lambda at=at: LitMesh(edges, at).silhouette)[1] for at in lights]
    what = f'outline of {mesh.n_cells:,} triangles'
    yield Row(what, 1e3 * np.median(seconds), 'ms', 50)
    yield Row(f'{what}: its table, once', table, 's')


def measure_plot(settings, results):
    """Add the points of the plot: error and time of every method by its settings."""
    scene = SCENES[settings.plotted]()
    rays = Rays(scene.meshes)
    hard, soft = (
        {name: dict(list(curve.items())[: settings.points]) for name, curve in curves.items()}
        for curves in (HARD, SOFT)
    )
    choices = {str(c): c for curves in (hard, soft) for by in curves.values() for c in by.values()}
    once = SimpleNamespace(**vars(settings) | {'repeats': 1})  # each point is one of many
    times = extra_ms(scene, 'spot', choices, once, ('camera',))
    with sight(scene, rays, 'spot', settings.screen) as found:
        shown_hard = _curves(hard, times, lambda c: errors.wrong_share(found, c))
    extent = EXTENTS['spot'] * scene.size
    start = time.perf_counter()
    with sight(scene, rays, 'spot', settings.small, extent=extent) as found:
        reference = time.perf_counter() - start
        shown_soft = _curves(soft, times, lambda c: errors.soft_error(found, c, extent))
    results.points['plot'] = {'hard': shown_hard, 'soft': shown_soft, 'rays': reference}


def _curves(curves, times, measured) -> dict:
    """Return the points of curves, the fastest first."""
    found: dict[str, list] = {name: [] for name in curves}
    for name, curve in curves.items():
        for label, c in curve.items():
            point = {'label': label, 'setting': str(c), 'ms': times[str(c)]['camera']['wall']}
            found[name].append(point | {'error': measured(c)})
        found[name].sort(key=lambda p: p['ms'])
    return found
