"""``pvibr bench shadows``: every method against rays, with VTK's own pass beside them."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import shadow_contact, shadow_errors, shadow_soft, shadow_times
from pvibr.bench.light_scenes import SCENES, WINDOWS
from pvibr.bench.plot import plot_shadows
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured.

    Parameters
    ----------
    scenes : tuple of str
        Of :data:`pvibr.bench.light_scenes.SCENES`.
    windows : tuple of tuple of 2 int
        Pixels.
    lights : tuple of str
        Of each scene.
    moved : tuple of float
        How far away from the origin, in sizes of the scene.
    extreme : str
        The scene for that, for odd lights and for far planes.
    angles : tuple of float
        Between light and normal, degrees, where acne is looked for.
    soft : tuple of str
        Scenes lit by lights of a size.
    blurs : tuple of float
        Texels, of which the moments take what fits best.
    small : tuple of 2 int
        Window where 256 rays are cast for each pixel.
    screen : tuple of 2 int
        Window where frames are timed.
    timed : str
        The scene whose frames are timed.
    repeats, frames : int
        How often, and how many frames each time.
    plotted : str
        The scene of the plot, lit by its spot.
    points : int
        Of each of its curves, at most.
    triangles : int
        Of the mesh whose outline is found.
    """

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
    scenes=('airplane',), windows=((640, 360),), lights=('spot',), moved=(1e6,),
    extreme='airplane', angles=(80.0, 89.0), soft=('airplane',), blurs=(8.0,), small=(96, 54),
    screen=(320, 180), timed='airplane', repeats=1, frames=1, plotted='airplane', points=1,
    triangles=100_000,
)  # fmt: skip


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows.

    Parameters
    ----------
    out : pathlib.Path
        Folder.
    quick : bool
        Whether only a few points are measured.

    Returns
    -------
    list of Row
        What was measured.
    """
    parts = {
        'wrong pixels': shadow_errors.measure,
        'extremes': shadow_errors.measure_extremes,
        'contact': shadow_contact.measure,
        'soft': shadow_soft.measure,
        'times': shadow_times.measure,
        'plot': shadow_times.measure_plot,
    }
    return run('shadows', parts, QUICK if quick else Settings(), plot_shadows, out, quick=quick)
