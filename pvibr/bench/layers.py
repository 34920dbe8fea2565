"""Coherent layers: time, error, and how often each is taken again."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.bench.impostors import scatter
from pvibr.bench.plot import save, two_axes
from pvibr.bench.rows import Row
from pvibr.bench.runs import run
from pvibr.capture.offscreen import Stage
from pvibr.maths.image_error import flip

#: Degrees that the camera turns, and world units that it goes sideways, from one frame to the
#: next: 6 degrees and 1.2 units a second at 60 frames a second.
TURN, STEP = 0.1, 0.02
_EVERY = 8  # frames of which one is drawn in full as well, to be compared


@dataclass
class Settings:
    """How much is measured."""

    size: tuple = (1280, 720)
    actors: int = 80
    cells: int = 40_000
    frames: int = 24
    errors: tuple = (0.5, 1.0, 2.0, 4.0)


QUICK = Settings((160, 90), 8, 1000, 16, (1.0,))


def measure(out, *, quick=False) -> list:
    """Measure everything, and write the table and the plot."""
    parts = {'pan': _pan, 'track': _track, 'depth of field': _depth_of_field}
    return run('layers', parts, QUICK if quick else Settings(), plot, out, quick=quick)


def pan(frames) -> list:
    """Return cameras that turn about the vertical, where they stand."""
    angles = np.radians(TURN * (np.arange(frames) - frames / 2))
    return [((0, -40, 6), (40 * np.sin(a), 40 * np.cos(a) - 40, 2), (0, 0, 1)) for a in angles]


def track(frames) -> list:
    """Return cameras that go sideways."""
    steps = STEP * (np.arange(frames) - frames / 2)
    return [((x, -40, 6), (x, 0, 2), (0, 0, 1)) for x in steps.tolist()]


def scene(settings) -> list:
    """Return ground and heavy actors on it, near and far."""
    actors = scatter(settings.actors, settings.cells, 4.0)
    for actor in actors:
        actor.position = np.add(actor.position, (0.0, 0.0, 1.0))
    ground = pv.Plane(i_size=400, j_size=400, i_resolution=100, j_resolution=100)
    ground['height'] = np.sin(0.1 * ground.points[:, 0]) * np.cos(0.05 * ground.points[:, 1])
    plane = pv.Actor(mapper=pv.DataSetMapper(ground))
    plane.mapper.scalar_map_mode = 'point'
    plane.mapper.lookup_table = pv.LookupTable('terrain')
    plane.mapper.scalar_range = -1.0, 1.0
    return [plane, *actors]


def _stage(settings):
    stage = Stage(settings.size)
    stage.add(scene(settings))
    return stage


def _pan(settings, results):
    _path(settings, results, 'pan', pan(settings.frames), (3, 0.02))


def _track(settings, results):
    _path(settings, results, 'track', track(settings.frames), ())


def _path(settings, results, name, cameras, bars):
    with _stage(settings) as stage:
        stage.look(cameras[0])
        layers = stage.plotter.ibr.add_image_layers()
        for warp in ('affine', 'projective'):
            for max_error in settings.errors:
                layers.warp, layers.max_error = warp, max_error
                found = _timed(stage, layers, cameras)
                results.points.setdefault(name, {}).setdefault(warp, {})[max_error] = found
                if max_error == 1.0:
                    _tell(results, f'{name}, {warp}', found, bars)


def _timed(stage, layers, cameras) -> dict:
    """Return mean milliseconds of frames, and the error of some of them."""
    for enabled in (False, True):
        layers.enabled = enabled
        for camera in cameras[:2]:
            stage.look(camera)
            stage.draw()
    times: dict = {True: [], False: []}
    errors, before, worst = [], layers.report()['taken'], 0.0
    for k, camera in enumerate(cameras):
        stage.look(camera)
        times[True].append(_spent(stage))
        worst = max(worst, layers.report()['residual_px'])
        if k % _EVERY == _EVERY - 1:
            drawn = stage.read()
            layers.enabled = False
            times[False].append(_spent(stage))
            errors.append(float(flip(drawn, stage.read()).mean()))
            layers.enabled = True
    told = layers.report()
    (ms, cpu), (full_ms, full_cpu) = (np.mean(times[k], axis=0).tolist() for k in (True, False))
    return {
        'ms': ms,
        'cpu': cpu,
        'full_ms': full_ms,
        'full_cpu': full_cpu,
        'flip': float(np.mean(errors)),
        'residual': worst,
        'taken': (told['taken'] - before) / len(cameras),
        'layers': len(layers),
    }


def _spent(stage) -> tuple[float, float]:
    """Return milliseconds of a frame, of the wall and of the processor."""
    start = time.process_time()
    wall = stage.draw()
    return 1e3 * wall, 1e3 * (time.process_time() - start)


def _tell(results, name, found, bars):
    faster, flip_bar = bars or (None, None)
    results.rows += [
        Row(f'{name}: full rendering', found['full_ms'], 'ms'),
        Row(f'{name}: layers, taken again included', found['ms'], 'ms'),
        Row(f'{name}: faster', found['full_ms'] / found['ms'], 'x', faster, at_least=True),
        Row(f'{name}: less processor time', found['full_cpu'] / found['cpu'], 'x'),
        Row(f'{name}: mean FLIP against full rendering', found['flip'], '', flip_bar),
        Row(f'{name}: largest residual shown', found['residual'], 'px', 1.0),
        Row(f'{name}: layers taken in a frame, of {found["layers"]}', found['taken']),
    ]


def _depth_of_field(settings, results):
    """Measure a background that is blurred as it is taken."""
    cameras = pan(settings.frames)
    with _stage(settings) as stage:
        stage.look(cameras[0])
        layers = stage.plotter.ibr.add_image_layers()
        for blur in (0.0, 4.0):
            layers.blur = (0.0, blur)
            found = _timed(stage, layers, cameras)
            name = f'pan, all but the nearest blurred by {blur:g} px'
            results.rows.append(Row(name, found['ms'], 'ms'))


def plot(results, path):
    """Draw time against error, of both kinds of warps."""
    figure, both = two_axes((12, 5))
    for axes, name in zip(both, ('pan', 'track'), strict=True):
        full = []
        for warp, points in results.points[name].items():
            ms = [p['ms'] for p in points.values()]
            axes.plot(ms, [p['flip'] for p in points.values()], 'o-', label=warp)
            for max_error, p in points.items():
                place = {'xytext': (4, 5), 'textcoords': 'offset points', 'fontsize': 'x-small'}
                axes.annotate(f'{max_error:g} px', (p['ms'], p['flip']), **place)
            full += [p['full_ms'] for p in points.values()]
        axes.axvline(np.mean(full), ls='--', color='0.5', label='full rendering')
        axes.axvline(np.mean(full) / 3, ls=':', color='0.5', label='a third of it')
        axes.axhline(0.02, ls='--', color='0.7', label='bar')
        axes.set(xscale='log', xlabel='ms a frame', title=f'slow {name}', ylim=(0, None))
        axes.set_ylabel('mean FLIP against full rendering')
        axes.legend(fontsize='small')
    save(figure, 'layers', results, path)
