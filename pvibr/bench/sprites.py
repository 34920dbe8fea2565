"""Billboards against VTK's own ways, and what cut-outs cover when they are far."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.bench.rows import Row
from pvibr.images.sheet import Sheet

_SIDE = 0.02  # of a billboard, where the points fill a cube of side 2
_VIEWS = 4


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
    """Measure both."""
    curves: dict = {}
    for count in settings.counts:
        found = _times(count, settings.size, settings.slow)
        for way, ms in found.items():
            curves.setdefault(way, []).append((count, ms))
            results.rows.append(Row(f'{count:,} {way}', ms, 'ms'))
        for way in ('glyph, which does not turn', 'points_gaussian'):
            if way in found:
                ratio = found[way] / found['cut-outs']
                results.rows.append(Row(f'{count:,} cut-outs, faster than {way}', ratio, 'x'))
    results.points['sprites'] = curves
    _coverage(settings, results)


def _times(count, size, slow) -> dict:
    points = np.random.default_rng(0).uniform(-1, 1, (count, 3))
    image, single = disc(), points.astype(np.float32)

    def glyph(pl):
        plane = pv.Plane(
            direction=(0, -1, 0), i_resolution=1, j_resolution=1, i_size=_SIDE, j_size=_SIDE
        )
        cards = pv.PolyData(single).glyph(geom=plane, scale=False, orient=False)
        pl.add_mesh(cards, texture=pv.Texture(image), lighting=False)

    def gaussian(pl):
        pl.add_mesh(pv.PolyData(single), style='points_gaussian', emissive=False, point_size=10)

    def billboards(**options):
        return lambda pl: pl.ibr.add_billboards(points, image, size=_SIDE, **options)

    ways = {'cut-outs': billboards(), 'cut-outs about an axis': billboards(facing='cylindrical')}
    if count <= slow:
        ways['blended'] = billboards(cutout=None)
        ways['glyph, which does not turn'] = glyph
        ways['points_gaussian'] = gaussian
    return {name: _ms(put, size) for name, put in ways.items()}


def _ms(put, size) -> float:
    """Return the least milliseconds of a frame while the camera moves."""
    pl = pv.Plotter(off_screen=True, window_size=list(size))
    pl.renderer.disable_anti_aliasing()
    put(pl)
    camera = pl.camera
    camera.focal_point, camera.up = (0, 0, 0), (0, 0, 1)
    found = []
    for k in range(_VIEWS):
        camera.position = (0.1 * k, -4, 0.5)
        pl.renderer.ResetCameraClippingRange()
        found.append(frame_ms(pl))
    pl.close()
    return min(found[1:])


def frame_ms(pl) -> float:
    """Return how long a frame takes, ms."""
    window: Any = pl.render_window
    start = time.perf_counter()
    window.Render()
    window.WaitForCompletion()
    return 1e3 * (time.perf_counter() - start)


def _coverage(settings, results):
    """Measure what cut-outs cover at several sizes: as here, and with plain levels."""
    image = foliage()
    share = (image[..., 3] >= 128).mean()
    curves: dict = {'kept': [], 'plain': []}
    for way, cutout in (('kept', 0.5), ('plain', None)):
        for pixels in settings.sprite_sizes:
            drawn = _covered(image, pixels, cutout)
            curves[way].append((pixels, drawn / share))
        worst = max(abs(1 - c) for _, c in curves[way])
        name = 'levels that keep coverage' if way == 'kept' else 'plain levels'
        results.rows.append(
            Row(
                f'cut-outs by {name}: worst error of what they cover',
                100 * worst,
                '%',
                20 if way == 'kept' else None,
            )
        )
    results.points['coverage'] = curves


def _covered(image, pixels, cutout) -> float:
    """Return the share of its square that a cut-out covers on the screen."""
    pl = pv.Plotter(off_screen=True, window_size=[pixels + 20] * 2)
    pl.renderer.disable_anti_aliasing()
    pl.renderer.set_background('black')
    thing = pl.ibr.add_billboards(
        [[0.0, 0, 0]], image, size=pixels, size_unit='pixel', colors=[[1.0, 1.0, 1.0]]
    )
    if cutout is None:
        thing._sheet = Sheet([image])
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -5, 0), (0, 0, 0), (0, 0, 1)
    pl.show(auto_close=False)
    picture = np.asarray(pl.screenshot(return_img=True), int)
    pl.close()
    return float((picture[..., 1] > 60).sum() / pixels**2)
