"""Billboards against VTK's own ways, and what cut-outs cover when they are far."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import least_ms
from pvibr.points.billboard_images import SheetImages
from pvibr.points.billboards import Billboards
from pvibr.scenes.stage import Stage

_SIDE = 0.02  # of a billboard, where the points fill a cube of side 2
CAMERAS = [((0.1 * k, -4, 0.5), (0, 0, 0), (0, 0, 1)) for k in range(4)]


def disc(side=64) -> np.ndarray:
    """Return a soft disc, white, shape (side, side, 4) uint8."""
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    image = np.full((side, side, 4), 255, np.uint8)
    image[..., 3] = np.rint(255 * np.clip(4 - 8 * np.hypot(x, y) / side, 0, 1))
    return image


def foliage(side=256, leaves=300, seed=0) -> np.ndarray:
    """Return small leaves with gaps, shape (side, side, 4) uint8."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    alpha = np.zeros((side, side))
    for cx, cy, turn in rng.uniform(0, 1, (leaves, 3)) * [side, side, np.pi]:
        u = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        v = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        alpha = np.maximum(alpha, np.clip(3 * (1 - np.hypot(u / 6, v / 2)) + 0.5, 0, 1))
    image = np.full((side, side, 4), (60, 140, 50, 0), np.uint8)
    image[..., 3] = np.rint(255 * alpha)
    return image


def measure(settings, results):
    """Yield times by count, and what cut-outs cover."""
    bars = {'glyph, which does not turn': None, 'points_gaussian': None}
    ways = partial(_ways, slow=settings.slow)
    yield from times_by_count(settings, results, 'sprites', ways, CAMERAS, bars)
    yield from _coverage(settings, results)


def cube(count) -> np.ndarray:
    """Return points at random in a cube of side 2, float32."""
    return np.random.default_rng(0).uniform(-1, 1, (count, 3)).astype(np.float32)


def times_by_count(settings, results, name, ways, cameras, bars) -> Iterator[Row]:
    """Yield the ms of ways to show points by their number, and the first's speed over peers."""
    curves: dict = {}
    results.points[name] = curves
    for count in settings.counts:
        points = cube(count)
        found = {
            way: least_ms(settings.size, partial(put, points=points), cameras)
            for way, put in ways(count).items()
        }
        own = next(iter(found))
        for way, ms in found.items():
            curves.setdefault(way, []).append((count, ms))
            yield Row(f'{count:,} {way}', ms, 'ms')
        for peer in [name for name in bars if name in found]:
            bar = bars[peer] if count == 1_000_000 else None
            ratio = found[peer] / found[own]
            yield Row(f'{count:,} {own}, faster than {peer}', ratio, 'x', bar, at_least=True)


def _ways(count, slow) -> dict[str, Callable]:
    ways: dict[str, Callable] = {
        'cut-outs': billboards,
        'cut-outs about an axis': partial(billboards, facing='cylindrical'),
    }
    if count <= slow:
        ways['blended'] = partial(billboards, cutout=None)
        ways['glyph, which does not turn'] = glyph
        ways['points_gaussian'] = _gaussian
    return ways


def billboards(pl, points, **options):
    """Add billboards of pvibr."""
    pl.ibr.add_billboards(points, disc(), size=_SIDE, **options)


def glyph(pl, points):
    """Add cards by VTK's glyph filter."""
    plane = pv.Plane(
        direction=(0, -1, 0), i_resolution=1, j_resolution=1, i_size=_SIDE, j_size=_SIDE
    )
    cards = pv.PolyData(points).glyph(geom=plane, scale=False, orient=False)
    pl.add_mesh(cards, texture=pv.Texture(disc()), lighting=False)


def _gaussian(pl, points):
    pl.add_mesh(pv.PolyData(points), style='points_gaussian', emissive=False, point_size=10)


def _coverage(settings, results):
    """Yield what cut-outs cover at several sizes: as here, and with plain levels."""
    image = foliage()
    share = (image[..., 3] >= 128).mean()
    curves = results.points['coverage'] = {}
    names = {'kept': ('levels that keep coverage', 20), 'plain': ('plain levels', None)}
    for way, (name, bar) in names.items():
        drawn = {pixels: covered(image, pixels, way) / share for pixels in settings.sprite_sizes}
        curves[way] = list(drawn.items())
        worst = 100 * max(abs(1 - c) for c in drawn.values())
        yield Row(f'cut-outs by {name}: worst error of what they cover', worst, '%', bar)


class _PlainLevels(Billboards):
    """Billboards whose smaller levels are plain averages."""

    def __init__(self, points, image, **options):
        super().__init__(points, image, **options)
        self._images = SheetImages([image], None)


_WAYS = {'kept': Billboards, 'plain': _PlainLevels}


def covered(image, pixels, way):
    """Return the share of its square that a cut-out covers on the screen."""
    card = _WAYS[way]([[0.0, 0, 0]], image, size=pixels, size_unit='pixel', colors=[[1.0] * 3])
    with Stage([pixels + 20] * 2, background='black', multi_samples=0) as stage:
        stage.plotter.ibr.add(card)
        stage.look([(0, -5, 0), (0, 0, 0), (0, 0, 1)])
        green = stage.picture()[..., 1]
    return float((green > 60 / 255).sum() / pixels**2)
