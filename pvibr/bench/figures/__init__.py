"""Measure figures that move: against float64, numpy and VTK's own reader of glTF."""

from __future__ import annotations

from pvibr.bench.common import plots
from pvibr.bench.common.harness import Bench
from pvibr.bench.figures import crowd, errors, solvers, times


def plot(points):
    """Draw what a new pose costs by vertices, and the time of reaching against its error."""
    figure, (poses, reaching) = plots.several_axes((13, 5.5), 1, 2)
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
    for axes in (poses, reaching):
        axes.legend(fontsize='x-small')
    return figure


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
    full={
        'screen': (1280, 720),
        'rounds': 20,
        'small': (60, 40),
        'offsets': (0.0, 1e6),
        'times': 10,
        'models': None,
        'figures': ((25, 40), (80, 125), (250, 400)),
        'joints': 64,
        'face': (200, 250),
        'targets': 256,
        'chains': 100,
        'crowd': 10_000,
        'crowd_part': 200,
    },
    quick={
        'screen': (320, 180),
        'rounds': 1,
        'small': (20, 12),
        'offsets': (1e6,),
        'times': 2,
        'models': 2,
        'figures': ((20, 30), (40, 50)),
        'joints': 8,
        'face': (20, 30),
        'targets': 16,
        'chains': 3,
        'crowd': 300,
        'crowd_part': 20,
    },
)
