"""Measure what image effects cost, and their error."""

from __future__ import annotations

from benchmarks.common import plots
from benchmarks.common.harness import Bench
from benchmarks.common.whole_frames import real_plotter, turning
from benchmarks.effects import (
    accumulation,
    bloom,
    copies,
    depth_of_field,
    outline,
    together,
)


def plot(points, figure):
    """Draw what image effects cost, and for each with settings its time against its error."""
    (cost, blooms), (outlines, lens) = plots.subplots(figure, 2, 2)
    cost.barh(list(points['copies']), list(points['copies'].values()))
    cost.axvline(1, color='0.5', ls='--')
    cost.set(xlabel='full-screen copies', title='time of an effect')
    for one, name in ((blooms, 'bloom'), (outlines, 'outline')):
        plots.curve(one, points[name], 'copies', 'error', ls='')
        for p in points[name]:
            plots.note(one, p['name'], p['copies'], p['error'], (4, 3), 'xx-small')
        one.set(xlabel='full-screen copies', xlim=(0, None))
    plots.bar(blooms, 0.5)
    blooms.set(title='bloom, against a true Gaussian', ylabel='mean error, of 255', yscale='log')
    outlines.set(title='outline, against all silhouettes of a torus')
    outlines.set_ylabel('1 - harmonic mean of precision and recall')
    for radius in sorted({p['radius'] for p in points['lens']}):
        same = [p for p in points['lens'] if p['radius'] == radius]
        plots.curve(lens, same, 'ms', 'psnr', label=f'lens of radius {radius:g}')
    plots.bar(lens, 32)
    lens.set(xlabel='ms', ylabel='PSNR, dB', title='depth of field, against 256 pinholes')


def _five(settings, size, on):
    """Return a scene with five effects, or without."""
    plotter = real_plotter(size)
    together.choose(together.fill(plotter), together.FIVE if on else ())
    return plotter, turning(plotter)


BENCH = Bench(
    parts={
        'bloom': bloom.measure,
        'screen': copies.measure,
        'outline': outline.measure,
        'depth of field': depth_of_field.measure,
        'together': together.measure,
        'accumulation': accumulation.measure,
    },
    plot=plot,
    outside={'five effects': _five},
    settings={
        'screen': ((1024, 768), (320, 180)),
        'rounds': (9, 1),
        'pairs': (25, 1),
        'lens': ((640, 480), (160, 120)),
        'radii': ((0.1, 0.2), (0.1,)),
        'samples': ((16, 48, 128), (16,)),
        'lenses': (256, 16),
        'still': ((320, 240), (48, 36)),
        'still_samples': (1024, 8),
        'still_texels': (1024, 64),
        'still_seed': (7, 7),
    },
)
