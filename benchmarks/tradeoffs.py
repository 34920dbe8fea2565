"""Measure time against error by the tolerance of each technique, with its default marked."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.timing import mean_flip, pictures
from benchmarks.common.whole_frames import median_seconds, real_plotter, turning
from pvibr.scenes.stage import SAMPLES, SKY, Stage

#: The tolerance that users have, in pixels.
_DEFAULT = 1.0


def _knot(triangles):
    side = max(int((triangles / 2) ** 0.5), 8)
    return pv.ParametricKuen(u_res=side, v_res=side).scale(0.3).triangulate()


def _places(count):
    return np.random.default_rng(0).uniform(-1, 1, (count, 3)) * (1, 1, 0.1) * count**0.5


def _instances(plotter, settings, max_error):
    mesh, places = _knot(settings.triangles), _places(settings.count)
    if max_error is None:
        for at in places:
            plotter.add_mesh(mesh.translate(at), color='tan', reset_camera=False)
    else:
        plotter.ibr.add_instances(mesh, places, color='tan', max_error=max_error)


def _impostors(plotter, settings, max_error):
    mesh = _knot(settings.triangles)
    actors = [
        plotter.add_mesh(mesh.translate(at), color='tan', reset_camera=False)
        for at in _places(settings.count)
    ]
    if max_error is not None:
        plotter.ibr.add_impostor(actors, max_error=max_error)


def _large(plotter, settings, max_error):
    side = int((settings.large_triangles / 2) ** 0.5)
    x, y = np.meshgrid(*[np.linspace(-1, 1, side)] * 2)
    rng, z = np.random.default_rng(3), np.zeros_like(x)
    for octave in range(9):
        (a, b), phase = rng.normal(size=2) * 2**octave, rng.uniform(0, 6)
        z += 0.1 * 0.55**octave * np.sin(2 * (a * x + b * y) + phase)
    reach = settings.count**0.5
    mesh = (
        pv.StructuredGrid(reach * x, reach * y, reach * z)
        .extract_surface(algorithm='dataset_surface')
        .triangulate()
    )
    if max_error is None:
        plotter.add_mesh(mesh, color='tan', smooth_shading=True, reset_camera=False)
    else:
        plotter.ibr.add_large_mesh(mesh, color='tan', smooth_shading=True, max_error=max_error)


_TECHNIQUES = {'instances': _instances, 'impostors': _impostors, 'large meshes': _large}


def _cameras(settings) -> list:
    reach = settings.count**0.5
    angles = np.linspace(0.3, 2 * np.pi + 0.3, settings.views, endpoint=False)
    return [
        ((1.8 * reach * np.cos(a), 1.8 * reach * np.sin(a), 0.9 * reach), (0, 0, 0), (0, 0, 1))
        for a in angles
    ]


def _pictures(fill, settings, samples):
    with Stage(settings.size, samples=samples) as stage:
        fill(stage.plotter, settings)
        return pictures(stage, _cameras(settings))


def _milliseconds(fill, settings) -> float:
    """Return the median processor time of a frame while the camera turns."""
    plotter = real_plotter(settings.size)
    plotter.set_background(SKY)
    fill(plotter, settings)
    plotter.camera_position = _cameras(settings)[0]
    return 1e3 * median_seconds(plotter, turning(plotter), settings.frames)


def knee(times, errors) -> int:
    """Return which point of a trade-off lies farthest below the line between its ends, by logs.

    Satopaa et al., "Finding a Kneedle in a Haystack", 2011.
    """
    x, y = (np.log(np.maximum(values, 1e-12)) for values in (times, errors))
    x, y = ((v - v.min()) / max(np.ptp(v), 1e-12) for v in (x, y))
    return int(np.argmin(x + y))


def _traded(name, settings, results):
    """Yield times and errors of a technique by its tolerance."""
    fill = _TECHNIQUES[name]
    truth = _pictures(partial(fill, max_error=None), settings, SAMPLES)
    mesh_error = mean_flip(_pictures(partial(fill, max_error=None), settings, 1), truth)
    mesh_ms = _milliseconds(partial(fill, max_error=None), settings)
    times, errors = [], []
    for max_error in settings.errors:
        way = partial(fill, max_error=max_error)
        errors.append(mean_flip(_pictures(way, settings, 1), truth) / max(mesh_error, 1e-9))
        times.append(_milliseconds(way, settings))
        title = f'{name}, max_error={max_error:g}'
        yield Row(f'{title}: FLIP over that of the mesh', errors[-1], 'x')
        yield Row(f'{title}: frame over that of the mesh', times[-1] / mesh_ms, 'x')
    best = settings.errors[knee(times, errors)]
    yield Row(f'{name}: the default over the knee', _DEFAULT / best, 'x')
    results.points[name] = {
        'max_error': list(settings.errors),
        'ms': times,
        'flip': errors,
        'mesh_ms': mesh_ms,
    }


def plot(points, figure):
    """Draw error against time, each technique with its default as a star and the full mesh."""
    axes = plots.subplots(figure, 1, len(points), squeeze=False).ravel()
    for one, (name, found) in zip(axes, points.items(), strict=True):
        one.plot(found['ms'], found['flip'], 'o-', label='by max_error')
        one.plot([found['mesh_ms']], [1.0], 'ks', label='the mesh')
        for tolerance, x, y in zip(found['max_error'], found['ms'], found['flip'], strict=True):
            plots.note(one, f'{tolerance:g}', x, y)
            if tolerance == _DEFAULT:
                one.plot([x], [y], 'r*', ms=15, label='default')
        one.set(xscale='log', xlabel='CPU of a frame, ms', title=name, ylim=(0, None))
        one.set_ylabel('FLIP over that of the mesh')


BENCH = Bench(
    parts={name: partial(_traded, name) for name in _TECHNIQUES},
    plot=plot,
    outside={},
    settings={
        'size': ((1024, 768), (320, 180)),
        'frames': (7, 1),
        'views': (4, 1),
        'count': (400, 9),
        'triangles': (20_000, 2_000),
        'large_triangles': (2_000_000, 20_000),
        'errors': ((0.25, 0.5, 1.0, 2.0, 4.0), (1.0, 4.0)),
    },
)
