"""Measure billboards, what cut-outs cover, quadrics, and the levels of a plant."""

from __future__ import annotations

from functools import partial

from benchmarks.billboards import plants, quadrics, sprites
from benchmarks.common import plots
from benchmarks.common.harness import Bench
from benchmarks.common.whole_frames import real_plotter, turning


def plot(points, figure):
    """Draw times by count, coverage by size, and time against error of the levels of a plant."""
    times, balls, cover, plant = axes = plots.subplots(figure, 1, 4)
    for one, name, count in ((times, 'sprites', 'billboards'), (balls, 'spheres', 'spheres')):
        for way, points_ in points[name].items():
            one.plot(*zip(*points_, strict=True), 'o-', label=way)
        one.set(xscale='log', yscale='log', xlabel=count, ylabel='ms a frame')
    for way, points_ in points['coverage'].items():
        cover.plot(*zip(*points_, strict=True), 'o-', label=f'{way} levels')
    plots.bar(cover, 1, label=None)
    cover.set_xscale('log', base=2)
    cover.set(xlabel='size on the screen, px', ylabel='what a cut-out covers, over what it should')
    for name, p in points['plants'].items():
        plots.curve(plant, [p], 'ms', 'flip', label=f'{name}, {p["triangles"]} triangles')
    plant.set(xscale='log', xlabel='ms a tree', ylabel='mean FLIP against 16 samples per pixel')
    for one in axes:
        one.set_ylim(None if one in (times, balls) else 0, None)


def _points(own, peer, cameras, settings, size, on):
    """Return what stands at points, of pvibr or of VTK."""
    pl = real_plotter(size)
    (own if on else peer)(pl, sprites.cube(settings.slow))
    pl.camera_position = cameras[0]
    return pl, turning(pl)


BENCH = Bench(
    parts={
        'sprites': sprites.measure,
        'spheres': quadrics.measure_spheres,
        'quadrics': quadrics.measure,
        'plants': plants.measure,
    },
    plot=plot,
    outside={
        'cut-outs': partial(_points, sprites.billboards, sprites.glyph, sprites.CAMERAS),
        'spheres': partial(_points, quadrics.spheres, quadrics.sphere_mapper, quadrics.CAMERAS),
    },
    settings={
        'size': ((1024, 768), (320, 180)),
        'counts': ((1_000, 10_000, 100_000, 1_000_000), (1_000,)),
        'slow': (100_000, 1_000),
        'quadrics': (10_000, 500),
        'sprite_sizes': ((256, 200, 150, 100, 75, 50, 37, 25), (75,)),
        'plant_pixels': (128, 32),
        'plant_views': (6, 1),
        'plants': (20, 2),
        'copies': (50, 2),
    },
)
