"""Measure coherent layers against full rendering."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.meshes import scatter
from benchmarks.common.timing import beside_full, warm_up
from benchmarks.common.whole_frames import real_plotter, turning
from pvibr.maths.flip import flip
from pvibr.scenes.stage import Stage

#: Degrees that the camera turns, and world units that it goes sideways, from one frame to the
#: next: 6 degrees and 1.2 units a second at 60 frames a second.
TURN, STEP = 0.1, 0.02
_EVERY = 8  # frames of which one is drawn in full as well, to be compared


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


def _path(settings, results, name, path, faster=None, error=None):
    """Yield the rows of a path for both kinds of warps."""
    cameras = path(settings.frames)
    with _stage(settings) as stage:
        stage.look(cameras[0])
        layers = stage.plotter.ibr.add_image_layers()
        for warp in ('affine', 'projective'):
            for max_error in settings.errors:
                layers.warp, layers.max_error = warp, max_error
                found = _timed(stage, layers, cameras)
                results.points.setdefault(name, {}).setdefault(warp, {})[max_error] = found
                if max_error == 1.0:
                    yield from _rows(f'{name}, {warp}', found, faster, error)


def _timed(stage, layers, cameras) -> dict:
    """Return mean milliseconds of frames, and the error of some of them."""
    warm_up(stage, layers, cameras[:2])
    taken, residuals, drawn, errors = layers.report()['taken'], [0.0], [], []

    def note(enabled):
        if enabled:
            drawn.append(stage.read())
            residuals.append(layers.report()['residual_px'])
        else:
            errors.append(flip(drawn[-1], stage.read()).mean())

    return beside_full(stage, layers, cameras, _EVERY, note) | {
        'flip': float(np.mean(errors)),
        'residual': max(residuals),
        'taken': (layers.report()['taken'] - taken) / len(cameras),
        'layers': len(layers),
    }


def _rows(name, found, faster, error):
    yield Row(f'{name}: full rendering', found['full_ms'], 'ms')
    yield Row(f'{name}: layers, taken again included', found['ms'], 'ms')
    yield Row(f'{name}: faster', found['full_ms'] / found['ms'], 'x', faster, at_least=True)
    yield Row(f'{name}: less processor time', found['full_cpu'] / found['cpu'], 'x')
    yield Row(f'{name}: mean FLIP against full rendering', found['flip'], '', error)
    yield Row(f'{name}: largest residual shown', found['residual'], 'px', 1.0)
    yield Row(f'{name}: layers taken in a frame, of {found["layers"]}', found['taken'])


def _depth_of_field(settings, results):
    """Yield the time of a background that is blurred as it is taken."""
    cameras = pan(settings.frames)
    with _stage(settings) as stage:
        stage.look(cameras[0])
        layers = stage.plotter.ibr.add_image_layers()
        for blur in (0.0, 4.0):
            layers.blur = (0.0, blur)
            found = _timed(stage, layers, cameras)
            yield Row(f'pan, all but the nearest blurred by {blur:g} px', found['ms'], 'ms')


def plot(points, figure):
    """Draw time against error, of both kinds of warps."""
    both = plots.subplots(figure, 1, 2)
    for axes, name in zip(both, ('pan', 'track'), strict=True):
        for warp, by_error in points[name].items():
            plots.curve(axes, list(by_error.values()), 'ms', 'flip', label=warp)
            for max_error, p in by_error.items():
                plots.note(axes, f'{max_error:g} px', p['ms'], p['flip'])
        full = np.mean([p['full_ms'] for by in points[name].values() for p in by.values()])
        axes.axvline(full, ls='--', color='0.5', label='full rendering')
        axes.axvline(full / 3, ls=':', color='0.5', label='a third of it')
        plots.bar(axes, 0.02)
        axes.set(xscale='log', xlabel='ms a frame', title=f'slow {name}', ylim=(0, None))
        axes.set_ylabel('mean FLIP against full rendering')


def _panned(settings, size, on):
    """Return ground and heavy actors, as layers or as they are."""
    pl = real_plotter(size, scene(settings))
    pl.camera_position = pan(1)[0]
    if on:
        pl.ibr.add_image_layers()
    return pl, turning(pl, TURN)


BENCH = Bench(
    parts={
        'pan': partial(_path, name='pan', path=pan, faster=3, error=0.02),
        'track': partial(_path, name='track', path=track),
        'depth of field': _depth_of_field,
    },
    plot=plot,
    outside={'image layers': _panned},
    settings={
        'size': ((1024, 768), (160, 90)),
        'actors': (80, 8),
        'cells': (40_000, 1000),
        'frames': (24, 16),
        'errors': ((0.5, 1.0, 2.0, 4.0), (1.0,)),
    },
)
