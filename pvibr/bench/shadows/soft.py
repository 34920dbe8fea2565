"""Soft shadows against a light of a size, seen by 256 rays from each pixel."""

from __future__ import annotations

import numpy as np

from pvibr.bench.common.harness import Row
from pvibr.bench.common.light_scenes import SCENES
from pvibr.bench.common.rays import Rays
from pvibr.bench.shadows.errors import VTK, drawn, sight

#: How large the lights are: degrees, and a share of the scene's size.
EXTENTS = {'directional': 4.0, 'spot': 0.02}
BAR = 0.03
_MOMENTS = ('vsm', 'evsm', 'msm')
_LEAST = 0.1  # light that is enough to tell shares of it


def measure(settings, results):
    """Yield the error of each soft method, of hard shadows, and of the reference itself."""
    every: dict = {}
    for name in settings.soft:
        scene = SCENES[name]()
        rays = Rays(scene.meshes)
        for light, share in EXTENTS.items():
            extent = share * (scene.size if light == 'spot' else 1.0)
            with sight(scene, rays, light, settings.small, extent=extent) as found:
                for method, tried in _tried(settings).items():
                    errors = {
                        blur: error(found, drawn(found, sized(c, extent), _LEAST))
                        for blur, c in tried.items()
                    }
                    every.setdefault(method, {})[f'{name}, {light}'] = errors
                surface, lamp = found.surface, scene.lights[light]
                fewer = rays.lit(surface.points, surface.normals, lamp, extent=extent, samples=64)
                every.setdefault('64 rays', {})[f'{name}, {light}'] = {'': error(found, fewer)}
    results.points['soft'] = every
    for method, views in every.items():
        # The blur that fits best in each view; of the views, the worst.
        least = {where: min((e, blur) for blur, e in by.items()) for where, by in views.items()}
        where = max(least, key=least.__getitem__)
        worst, blur = least[where]
        note = f', blur {blur:g} texels' if method in _MOMENTS else ''
        bar = BAR if method in ('pcss', *_MOMENTS) else None
        yield Row(f'soft: {method} (worst: {where}{note})', worst, '', bar)


def _tried(settings) -> dict:
    """Return settings by blur, by method."""
    blurred = {m: {b: {'method': m, 'filter_radius': b} for b in settings.blurs} for m in _MOMENTS}
    plain = {m: {'': {'method': m}} for m in ('pcss', 'hard')}
    return plain | blurred | {VTK: {'': VTK}}


def sized(setting, extent):
    """Return a setting with the size of a light, as pcss takes it."""
    return setting if setting == VTK else setting | {'angle': extent, 'radius': extent}


def error(found, lit) -> float:
    """Return the mean absolute error of the share of light."""
    known = np.isfinite(lit) & np.isfinite(found.lit) & ~found.away
    return float(np.abs(lit - found.lit)[known].mean())
