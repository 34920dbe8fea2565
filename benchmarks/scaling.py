"""Measure how frames grow with instances, actors, triangles, pixels, lights, figures and more."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pyvista as pv

import pvibr
from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.whole_frames import median_seconds, real_plotter, turning
from pvibr.scenes.walker import walker

#: Effects in the order in which they are added.
_EFFECTS: tuple[Callable, ...] = (
    partial(pvibr.Bloom, threshold=0.8),
    pvibr.ToneMapping,
    pvibr.Outline,
    pvibr.AmbientOcclusion,
    pvibr.Fog,
    pvibr.Vignette,
    pvibr.DepthOfField,
    pvibr.Shadows,
)


def _places(count, seed=0):
    """Return places in a square of a fixed size, so that the picture is as full for any count."""
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * (1, 1, 0.05)


def _ball(triangles, radius=1.0):
    side = max(int((triangles / 2) ** 0.5), 4)
    return pv.Sphere(radius=radius, theta_resolution=side, phi_resolution=side)


def _instances(plotter, count):
    plotter.ibr.add_instances(_ball(20_000), _places(count), scale=0.3 * count**-0.5)


def _instance_triangles(plotter, triangles):
    plotter.ibr.add_instances(_ball(triangles), _places(1000), scale=0.01)


def _spheres(plotter, count):
    plotter.ibr.add_spheres(_places(count), 0.3 * count**-0.5)


def _large_triangles(plotter, triangles):
    plotter.ibr.add_large_mesh(_ball(triangles))


def _actors(plotter, count):
    ball = _ball(5_000, 0.3 * count**-0.5)
    actors = [plotter.add_mesh(ball.translate(at)) for at in _places(count)]
    plotter.ibr.add_impostor(actors)


def _figures(plotter, count):
    figures = plotter.ibr.add_animated(
        walker(3_000), _places(count), scale=0.3 * count**-0.5, cache=True
    )
    figures.times = np.random.default_rng(2).uniform(0, 1, count)


def _lights(plotter, count):
    plotter.remove_all_lights()
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        plotter.add_light(pv.Light(position=(np.cos(angle), np.sin(angle), 1)))
    _instances(plotter, 1000)


def _photographs(plotter, count):
    image = np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    plotter.add_mesh(pv.Plane(i_size=2, j_size=2))
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        camera = pv.Camera()
        camera.position, camera.focal_point = (np.cos(angle), np.sin(angle), 2), (0, 0, 0)
        plotter.ibr.add(pvibr.Projector(image, camera))


def _effects(plotter, count):
    _instances(plotter, 1000)
    for make in _EFFECTS[:count]:
        plotter.ibr.add(make())


def _pixels(plotter, _count):
    _instances(plotter, 1000)


#: What grows, how it is drawn, and the exponent that a frame may grow by.
_SUBJECTS: dict[str, tuple[Callable, float]] = {
    'instances': (_instances, 1.0),
    'triangles of an instance': (_instance_triangles, 0.1),
    'spheres': (_spheres, 1.0),
    'triangles of a large mesh': (_large_triangles, 0.3),
    'actors of an impostor': (_actors, 1.0),
    'figures': (_figures, 1.0),
    'lights': (_lights, 1.0),
    'photographs': (_photographs, 1.0),
    'effects': (_effects, 1.0),
    'pixels': (_pixels, 1.0),
}


def _seconds(fill, count, size, frames) -> float:
    """Return the median processor time of a frame while the camera turns."""
    plotter = real_plotter(size)
    fill(plotter, count)
    plotter.camera_position = [(2.2, -2.4, 1.4), (0, 0, 0), (0, 0, 1)]
    return median_seconds(plotter, turning(plotter), frames)


def exponents(counts, times) -> tuple[float, float]:
    """Return by which power times grow over all, and over the last two."""
    x, y = np.log(counts), np.log(times)
    return float(np.polyfit(x, y, 1)[0]), float(np.diff(y[-2:])[0] / np.diff(x[-2:])[0])


def _grown(subject, settings, results):
    """Yield the exponents of a subject."""
    fill, most = _SUBJECTS[subject]
    counts = settings.counts[subject]
    times = []
    for count in counts:
        size = settings.size
        if subject == 'pixels':
            width = round((count * 16 / 9) ** 0.5)
            size = width, round(count / width)
        times.append(_seconds(fill, count, size, settings.frames))
    results.points[subject] = {'counts': list(counts), 'ms': [1e3 * t for t in times]}
    over_all, last = exponents(counts, times)
    yield Row(f'{subject}, {counts[0]:,} to {counts[-1]:,}: exponent', over_all, '', most)
    yield Row(f'{subject}: exponent of the last step', last)
    yield Row(f'{subject}: frame of the most', 1e3 * times[-1], 'ms')


def plot(points, figure):
    """Draw the time of a frame against what grows in it."""
    axes = plots.subplots(figure, 2, (len(points) + 1) // 2, squeeze=False).ravel()
    for one, (subject, found) in zip(axes, points.items(), strict=False):
        one.plot(found['counts'], found['ms'], 'o-')
        one.set(xscale='log', yscale='log', xlabel=subject, ylabel='CPU of a frame, ms')


BENCH = Bench(
    parts={subject: partial(_grown, subject) for subject in _SUBJECTS},
    plot=plot,
    outside={},
    settings={
        'size': ((1024, 768), (320, 180)),
        'frames': (7, 1),
        'counts': (
            {
                'instances': (1_000, 10_000, 100_000, 1_000_000),
                'triangles of an instance': (2_000, 20_000, 200_000, 2_000_000),
                'spheres': (1_000, 10_000, 100_000, 1_000_000),
                'triangles of a large mesh': (100_000, 1_000_000, 4_000_000),
                'actors of an impostor': (10, 100, 1_000),
                'figures': (10, 100, 1_000, 4_000),
                'lights': (1, 2, 4, 8),
                'photographs': (1, 2, 4, 8),
                'effects': (1, 2, 4, 8),
                'pixels': (640 * 360, 1280 * 720, 2560 * 1440, 3840 * 2160),
            },
            {
                'instances': (10, 1_000),
                'triangles of an instance': (200, 2_000),
                'spheres': (10, 1_000),
                'triangles of a large mesh': (2_000, 20_000),
                'actors of an impostor': (2, 10),
                'figures': (2, 10),
                'lights': (1, 4),
                'photographs': (1, 2),
                'effects': (1, 8),
                'pixels': (160 * 90, 640 * 360),
            },
        ),
    },
)
