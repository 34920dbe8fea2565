"""Measure instances: each point is one setting, VTK's own ways on the same axes."""

from __future__ import annotations

from functools import cache

from benchmarks.common import plots
from benchmarks.common.harness import Bench
from benchmarks.common.whole_frames import turning
from benchmarks.instances import costs, crowd, dense, knots, near, order, single, walk
from pvibr.scenes.landscape import landscape
from pvibr.scenes.stage import MULTI_SAMPLES, mesh_actors, scenery

_landscape = cache(landscape)  # drawn in several plotters


def plot(points, figure):
    """Draw the walk at the left, single meshes at the right, both at defaults."""
    left, right = plots.subplots(figure, 1, 2)
    _walk(left, points['walk'], MULTI_SAMPLES[0])
    _single(right, points.get('single', {}))


def _walk(axes, walk, samples):
    own = walk[str(samples)]['pvibr']
    plots.curve(axes, [p for _, p in own], 'CPU', 'flip', label='pvibr')
    for k, (max_error, p) in enumerate(own):
        # Above and below by turns: points of close errors lie close together.
        plots.note(axes, f'{max_error:g} px', p['CPU'], p['flip'], (4, 8 if k % 2 else -14))
    # The glyph mapper shows no colours of vertices, so its error would be one of colour.
    for (name, ms), style in zip(walk[str(samples)]['peers'].items(), ('-', '--'), strict=True):
        axes.axvline(ms['CPU'], ls=style, color='0.5', label=f'{name} (extrapolated)')
    plots.bar(axes, walk['meshes'], label='full meshes at one sample')
    axes.set(xscale='log', xlabel=f'CPU ms a frame, {samples} samples', title='walk')
    axes.set(ylabel='mean FLIP against 16 samples per pixel', ylim=(0, 1.2 * axes.dataLim.ymax))


def _single(axes, meshes):
    flip = single.flip_key(MULTI_SAMPLES[0])
    for name, by_size in meshes.items():
        sizes = list(by_size)
        key = '1.0' if '1.0' in by_size[sizes[0]] else list(by_size[sizes[0]])[-1]
        axes.plot(sizes, [by_size[size][key][flip] for size in sizes], 'o-', label=name)
    plots.bar(axes, 1.0, label=None)
    axes.set_xscale('log', base=2)
    axes.set(xlabel='diameter on the screen, px', ylim=(0, None), title='single meshes')
    axes.set_ylabel('FLIP over that of the mesh at one sample')


def _forest(settings, size, on):
    """Return a small forest: of instances, or of VTK's actors."""
    scene = _landscape(settings.part)
    plotter = scenery(scene, 1.0, size, off_screen=True)
    if not on:
        plotter.remove_actor('trees')
        for actor in mesh_actors(scene.parts(), scene.matrices, scene.index):
            plotter.renderer.AddViewProp(actor)
    return plotter, turning(plotter)


BENCH = Bench(
    parts={
        'walk': walk.measure,
        'knots': knots.measure,
        'dense block': dense.measure,
        'near trees': near.measure,
        "README's example": near.measure_readme,
        'single meshes': single.measure,
        'crowd': crowd.measure,
        'precision': single.measure_precision,
        'order': order.measure,
        'costs': costs.measure,
    },
    plot=plot,
    outside={'trees as instances': _forest},
    settings={
        'size': ((1024, 768), (320, 180)),
        'trees': (10_000, 300),
        'cameras': (4, 1),
        'part': (400, 30),
        'steps': (16, 3),
        'knots': (10_000, 100),
        'knot_cells': (48_000, 2_000),
        'knots_size': (knots.SIZE, (320, 180)),
        'dense': (31, 8),
        'dense_frames': (9, 2),
        'dense_views': (200, 3),
        'near_frames': (9, 2),
        'meshes': (None, 2),
        'sizes': ((16, 32, 64, 128), (32,)),
        'errors': ((0.5, 1.0, 2.0, 4.0), (1.0,)),
        'directions': (6, 2),
        'crowd': (1_000_000, 20_000),
        'extremes': (2, 1),
        'scenes': (20, 2),
        'moved': ((10_000, 1_000_000), (1_000, 2_000)),
    },
)
