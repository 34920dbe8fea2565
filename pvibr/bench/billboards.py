"""``pvibr bench billboards``: billboards, what cut-outs cover, the levels of a plant."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import plants, quadrics, spheres, sprites
from pvibr.bench.plot import save, several_axes
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    size: tuple[int, int] = (1280, 720)
    counts: tuple[int, ...] = (1_000, 10_000, 100_000, 1_000_000)
    slow: int = 100_000
    quadrics: int = 10_000
    sprite_sizes: tuple[int, ...] = (256, 200, 150, 100, 75, 50, 37, 25)
    plant_pixels: int = 128
    plant_views: int = 6
    plants: int = 20
    copies: int = 50


QUICK = Settings(
    size=(320, 180),
    counts=(1_000,),
    slow=1_000,
    quadrics=500,
    sprite_sizes=(75,),
    plant_pixels=32,
    plant_views=1,
    plants=2,
    copies=2,
)


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    parts = {
        'sprites': sprites.measure,
        'spheres': spheres.measure,
        'quadrics': quadrics.measure,
        'plants': plants.measure,
    }
    return run('billboards', parts, QUICK if quick else Settings(), plot, out, quick=quick)


def plot(results, path):
    """Draw times by count, coverage by size, and time against error of the levels of a plant."""
    figure, (times, balls, cover, plant) = several_axes((20, 4.8), 1, 4)
    for way, curve in results.points['sprites'].items():
        times.plot(*zip(*curve, strict=True), 'o-', label=way)
    times.set(xscale='log', yscale='log', xlabel='billboards', ylabel='ms a frame')
    for way, curve in results.points['spheres'].items():
        balls.plot(*zip(*curve, strict=True), 'o-', label=way)
    balls.set(xscale='log', yscale='log', xlabel='spheres', ylabel='ms a frame')
    for way, curve in results.points['coverage'].items():
        cover.plot(*zip(*curve, strict=True), 'o-', label=f'{way} levels')
    cover.axhline(1, color='0.5', ls='--')
    cover.set_xscale('log', base=2)
    cover.set(xlabel='size on the screen, px', ylabel='what a cut-out covers, over what it should')
    for name, point in results.points['plants'].items():
        plant.plot(
            point['ms'], point['flip'], 'o', label=f'{name}, {point["triangles"]} triangles'
        )
    plant.set(xscale='log', xlabel='ms a tree', ylabel='mean FLIP against 16 samples a pixel')
    for axes in (times, balls, cover, plant):
        axes.set_ylim(None if axes in (times, balls) else 0, None)
        axes.legend(fontsize='x-small')
    save(figure, 'billboards', results, path)
