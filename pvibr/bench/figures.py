"""``pvibr bench figures``: what moves, against float64, numpy and VTK's own reader of glTF."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import figures_crowd, figures_errors, figures_solvers, figures_times
from pvibr.bench.plot import plot_figures
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    screen: tuple[int, int] = (1280, 720)
    rounds: int = 20
    small: tuple[int, int] = (60, 40)
    offsets: tuple[float, ...] = (0.0, 1e6)
    times: int = 10
    models: int | None = None
    figures: tuple[tuple[int, int], ...] = ((25, 40), (80, 125), (250, 400))
    joints: int = 64
    face: tuple[int, int] = (200, 250)
    targets: int = 256
    chains: int = 100
    crowd: int = 10_000
    crowd_part: int = 200


QUICK = Settings(
    (320, 180),
    1,
    (20, 12),
    (1e6,),
    2,
    2,
    figures=((20, 30), (40, 50)),
    joints=8,
    face=(20, 30),
    targets=16,
    chains=3,
    crowd=300,
    crowd_part=20,
)


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    parts = {
        'posed on the GPU': figures_errors.posed,
        'models': figures_errors.models,
        'twists': figures_errors.twists,
        'new poses': figures_times.poses,
        'morph targets': figures_times.morphs,
        'inverse kinematics': figures_solvers.reaching,
        'pose space': figures_solvers.correcting,
        'crowd': figures_crowd.measure,
    }
    return run('figures', parts, QUICK if quick else Settings(), plot_figures, out, quick=quick)
