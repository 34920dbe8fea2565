"""Measure shadows against rays: each point is one setting, VTK's own pass on the same axes."""

from __future__ import annotations

import pvibr
from benchmarks.common import plots
from benchmarks.common.harness import Bench
from benchmarks.common.light_scenes import SCENES, WINDOWS
from benchmarks.common.whole_frames import turning
from benchmarks.shadows import contact, errors, times


def plot(points, figure):
    """Draw what shadows add to a frame against their error: hard ones left, soft ones right."""
    left, right = plots.subplots(figure, 1, 2)
    points = points['plot']
    _curves(left, points['hard'], 0.2)
    left.set_yscale('symlog', linthresh=0.01)
    left.set(ylabel='wrong pixels, %', title='light without size, against rays', ylim=(0, None))
    _curves(right, points['soft'], 0.03)
    right.set(ylabel='mean absolute error of the lit share', ylim=(0, None))
    right.set(title=f'light of a size, against 256 rays per pixel ({points["rays"]:.1f} s)')


def _curves(axes, curves, bar):
    for name, points in curves.items():
        style = {'ls': '', 'marker': '*', 'ms': 14} if name.startswith('VTK') else {}
        plots.curve(axes, points, 'ms', 'error', label=name, **style)
        for p in (points[0], points[-1]) if len(points) > 1 else ():
            plots.note(axes, p['label'], p['ms'], p['error'])
    plots.bar(axes, bar)
    axes.set(xscale='log', xlabel='ms that a frame takes longer while the camera moves')


def _lit(settings, size, on):
    """Return a scene in the light of a spot, with shadows or without."""
    plotter = SCENES[settings.timed]().plotter('spot', size)
    if on:
        plotter.ibr.add(pvibr.Shadows())
    return plotter, turning(plotter)


BENCH = Bench(
    parts={
        'wrong pixels': errors.measure,
        'extremes': errors.measure_extremes,
        'contact': contact.measure,
        'soft': errors.measure_soft,
        'times': times.measure,
        'plot': times.measure_plot,
    },
    plot=plot,
    outside={'shadows of a spot': _lit},
    settings={
        'scenes': (tuple(SCENES), ('airplane',)),
        'windows': (WINDOWS, ((640, 360),)),
        'lights': (('directional', 'spot', 'point'), ('spot',)),
        'moved': ((1e6, 1e9), (1e6,)),
        'extreme': ('statue', 'airplane'),
        'angles': ((80.0, 82.0, 84.0, 86.0, 87.0, 88.0, 89.0), (80.0, 89.0)),
        'soft': (('spheres', 'terrain', 'statue'), ('airplane',)),
        'blurs': ((1.0, 2.0, 4.0, 8.0, 16.0), (8.0,)),
        'small': ((320, 180), (96, 54)),
        'screen': ((1024, 768), (320, 180)),
        'timed': ('spheres', 'airplane'),
        'repeats': (3, 1),
        'frames': (3, 1),
        'plotted': ('terrain', 'airplane'),
        'points': (9, 1),
        'triangles': (1_000_000, 100_000),
    },
)
