"""Measure figures that move: against float64, numpy and VTK's own reader of glTF."""

from __future__ import annotations

from benchmarks.common import plots
from benchmarks.common.harness import Bench
from benchmarks.figures import crowd, errors, solvers, times


def plot(points, figure):
    """Draw what a new pose costs by vertices, and the time of reaching against its error."""
    poses, reaching = plots.subplots(figure, 1, 2)
    for way in (name for name in points['poses'][0] if name != 'vertices'):
        plots.curve(poses, points['poses'], 'vertices', way, label=way)
    poses.set(xscale='log', yscale='log', xlabel='vertices', title='posing and upload')
    poses.set_ylabel('ms that a frame of a new pose takes longer')
    for method, found in points['reaching'].items():
        reaching.plot(found['ms'], found['error'], 'o', ms=3, label=method)
    plots.bar(reaching, 1e-3)
    reaching.axvline(2, color='0.5', ls='--')
    reaching.set(xscale='log', yscale='log', xlabel='ms', ylabel='error over reach')
    reaching.set_title('chains of 30 joints with limits')


BENCH = Bench(
    parts={
        'posed on the GPU': errors.posed,
        'models': errors.models,
        'twists': errors.twists,
        'new poses': times.poses,
        'morph targets': times.morphs,
        'inverse kinematics': solvers.reaching,
        'pose space': solvers.correcting,
        'crowd': crowd.measure,
    },
    plot=plot,
    outside={'a figure that moves': times.moving},
    settings={
        'screen': ((1024, 768), (320, 180)),
        'rounds': (20, 1),
        'small': ((60, 40), (20, 12)),
        'offsets': ((0.0, 1e6), (1e6,)),
        'times': (10, 2),
        'models': (None, 2),
        'figures': (((25, 40), (80, 125), (250, 400)), ((20, 30), (40, 50))),
        'joints': (64, 8),
        'face': ((200, 250), (20, 30)),
        'targets': (256, 16),
        'chains': (100, 3),
        'crowd': (10_000, 300),
        'crowd_part': (200, 20),
    },
)
