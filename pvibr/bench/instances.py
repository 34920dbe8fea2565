"""``pvibr bench instances``: many instances against VTK's own ways and the full meshes."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import crowd, precision, single, walk
from pvibr.bench.plot import plot
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    size: tuple[int, int] = (1280, 720)
    trees: int = 10_000
    cameras: int = 4
    part: int = 400
    steps: int = 16
    meshes: int | None = None
    sizes: tuple[int, ...] = (16, 32, 64, 128)
    errors: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
    directions: int = 6
    crowd: int = 1_000_000
    extremes: int = 2


QUICK = Settings(
    size=(320, 180),
    trees=300,
    cameras=1,
    part=30,
    steps=3,
    meshes=2,
    sizes=(32,),
    errors=(1.0,),
    directions=2,
    crowd=20_000,
    extremes=1,
)


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    parts = {
        'walk': walk.measure,
        'single meshes': single.measure,
        'crowd': crowd.measure,
        'precision': precision.measure,
    }
    return run('instances', parts, QUICK if quick else Settings(), plot, out, quick=quick)
