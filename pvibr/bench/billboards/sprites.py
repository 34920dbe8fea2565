"""Billboards against VTK's own ways, and what cut-outs cover when they are far."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.bench.common.timing import least_ms, look, plotter
from pvibr.bench.common.whole_frames import real_plotter, turning
from pvibr.billboards.billboards import Billboards
from pvibr.billboards.images import SheetImages

_SIDE = 0.02  # of a billboard, where the points fill a cube of side 2
_EYES = [(0.1 * k, -4, 0.5) for k in range(4)]


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
    curves: dict = {}
    for count in settings.counts:
        found = _times(count, settings.size, settings.slow)
        for way, ms in found.items():
            curves.setdefault(way, []).append((count, ms))
            yield Row(f'{count:,} {way}', ms, 'ms')
        for way in ('glyph, which does not turn', 'points_gaussian'):
            if way in found:
                ratio = found[way] / found['cut-outs']
                yield Row(f'{count:,} cut-outs, faster than {way}', ratio, 'x')
    results.points['sprites'] = curves
    yield from _coverage(settings, results)


def cut_outs(settings, size, on):
    """Return billboards, or cards by VTK's glyph filter."""
    pl = real_plotter(size)
    (_billboards if on else _glyph)(pl, _points(settings.slow))
    look(pl, _EYES[0])
    return pl, turning(pl)


def _points(count):
    return np.random.default_rng(0).uniform(-1, 1, (count, 3))


def _billboards(pl, points, **options):
    pl.ibr.add_billboards(points, disc(), size=_SIDE, **options)


def _glyph(pl, points):
    plane = pv.Plane(
        direction=(0, -1, 0), i_resolution=1, j_resolution=1, i_size=_SIDE, j_size=_SIDE
    )
    cloud = pv.PolyData(points.astype(np.float32))
    cards = cloud.glyph(geom=plane, scale=False, orient=False)
    pl.add_mesh(cards, texture=pv.Texture(disc()), lighting=False)


def _gaussian(pl, points):
    cloud = pv.PolyData(points.astype(np.float32))
    pl.add_mesh(cloud, style='points_gaussian', emissive=False, point_size=10)


def _times(count, size, slow):
    ways: dict[str, Callable] = {
        'cut-outs': _billboards,
        'cut-outs about an axis': partial(_billboards, facing='cylindrical'),
    }
    if count <= slow:
        ways['blended'] = partial(_billboards, cutout=None)
        ways['glyph, which does not turn'] = _glyph
        ways['points_gaussian'] = _gaussian
    points = _points(count)
    return {name: least_ms(size, partial(put, points=points), _EYES) for name, put in ways.items()}


def _coverage(settings, results):
    """Yield what cut-outs cover at several sizes: as here, and with plain levels."""
    image = foliage()
    share = (image[..., 3] >= 128).mean()
    curves = results.points['coverage'] = {}
    for way, name, bar in (
        ('kept', 'levels that keep coverage', 20),
        ('plain', 'plain levels', None),
    ):
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
    pl = plotter([pixels + 20] * 2)
    pl.set_background('black')
    pl.ibr.add(
        _WAYS[way]([[0.0, 0, 0]], image, size=pixels, size_unit='pixel', colors=[[1.0, 1.0, 1.0]])
    )
    look(pl, (0, -5, 0))
    pl.show(auto_close=False)
    picture = np.asarray(pl.screenshot(return_img=True), int)
    pl.close()
    return float((picture[..., 1] > 60).sum() / pixels**2)
