"""``pvibr bench shadows``: every method against rays, with VTK's own pass beside them."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import shadow_contact, shadow_errors, shadow_soft, shadow_times
from pvibr.bench.light_scenes import SCENES, WINDOWS
from pvibr.bench.plot import plot_shadows
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    scenes: tuple[str, ...] = tuple(SCENES)
    windows: tuple[tuple[int, int], ...] = WINDOWS
    lights: tuple[str, ...] = ('directional', 'spot', 'point')
    moved: tuple[float, ...] = (1e6, 1e9)
    extreme: str = 'statue'
    angles: tuple[float, ...] = (80.0, 82.0, 84.0, 86.0, 87.0, 88.0, 89.0)
    soft: tuple[str, ...] = ('spheres', 'terrain', 'statue')
    blurs: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)
    small: tuple[int, int] = (320, 180)
    screen: tuple[int, int] = (1280, 720)
    timed: str = 'spheres'
    repeats: int = 3
    frames: int = 3
    plotted: str = 'terrain'
    points: int = 9
    triangles: int = 1_000_000


QUICK = Settings(
    scenes=('airplane',),
    windows=((640, 360),),
    lights=('spot',),
    moved=(1e6,),
    extreme='airplane',
    angles=(80.0, 89.0),
    soft=('airplane',),
    blurs=(8.0,),
    small=(96, 54),
    screen=(320, 180),
    timed='airplane',
    repeats=1,
    frames=1,
    plotted='airplane',
    points=1,
    triangles=100_000,
)


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    parts = {
        'wrong pixels': shadow_errors.measure,
        'extremes': shadow_errors.measure_extremes,
        'contact': shadow_contact.measure,
        'soft': shadow_soft.measure,
        'times': shadow_times.measure,
        'plot': shadow_times.measure_plot,
    }
    return run('shadows', parts, QUICK if quick else Settings(), plot_shadows, out, quick=quick)
