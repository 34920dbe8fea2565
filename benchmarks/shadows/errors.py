"""Wrong pixels and strengths of shadows: what is drawn against what rays see."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import pyvista as pv
from scipy import ndimage

import pvibr
from benchmarks.common.harness import Row
from benchmarks.common.light_scenes import SCENES, VtkShadows, light_at, measured_lit, place
from benchmarks.common.rays import Rays, Surface, edge_band, strengths, wrong
from pvibr.scenes.stage import Stage

#: What is allowed: maps, and volumes, which are exact.
WRONG = {'hard': 0.2, 'pcf': 0.2, 'volume': 0.0}
#: Pixels at the edge of a shadow that a filter may soften, and the least light without shadows
#: that tells how strong one is: colours have 255 steps.
_SOFT, _BRIGHT = 4, 0.25
#: Rays cast beside a pixel that is drawn wrong, and how far beside, in sizes of the scene.
_TRIES, _NEAR = 16, 2e-6
VTK = 'VTK'
#: How large the lights of soft shadows are: degrees, and a share of the scene's size.
EXTENTS = {'directional': 4.0, 'spot': 0.02}
#: The mean error that is allowed of soft shadows.
BAR = 0.03
_MOMENTS = ('vsm', 'evsm', 'msm')
_LEAST = 0.1  # light that is enough to tell shares of it


@dataclass(frozen=True, eq=False)
class Sight:
    """What a window shows by one light, and what rays say about it."""

    stage: Stage
    surface: Surface
    lit: np.ndarray
    away: np.ndarray
    rays: Rays
    light: pv.Light

    @cached_property
    def band(self) -> np.ndarray:
        """One pixel on each side of edges, (h, w) bool."""
        return edge_band(self.lit, self.surface)

    def unsure(self, asked) -> np.ndarray:
        """Return where the reference is not sure, for a light without size."""
        rng = np.random.default_rng(1)
        surface = self.surface
        points, normals, lit = surface.points[asked], surface.normals[asked], self.lit[asked]
        found = np.zeros(len(points), bool)
        for _ in range(_TRIES):
            aside = rng.normal(size=points.shape) * _NEAR * self.rays.size
            aside -= np.einsum('ni,ni->n', aside, normals)[:, None] * normals  # along the surface
            found |= self.rays.lit(points + aside, normals, self.light) != lit
        unsure = asked.copy()
        unsure[asked] = found
        return unsure

    @cached_property
    def wide_band(self) -> np.ndarray:
        """What a filter may soften, (h, w) bool."""
        return ndimage.binary_dilation(self.band, np.ones((3, 3)), _SOFT - 1)

    @cached_property
    def dim(self) -> np.ndarray:
        """Where there is too little light to tell how strong a shadow is, (h, w) bool."""
        return self.stage.picture().mean(-1) < _BRIGHT


@contextmanager
def sight(scene, rays, light, window, *, extent=0.0, clipping=None) -> Iterator[Sight]:
    """Show a scene by one light."""
    with scene.stage(light, window) as stage:
        if clipping:
            stage.plotter.camera.clipping_range = clipping
        surface = rays.surface(stage.frame())
        lamp = scene.lights[light]
        lit = rays.lit(surface.points, surface.normals, lamp, extent=extent)
        yield Sight(stage, surface, lit, ~(surface.facing(lamp) > 0), rays, lamp)


@contextmanager
def shown(stage, setting):
    """Add shadows for a while."""
    if setting == VTK:
        effect = VtkShadows(stage.plotter)
        yield effect
        effect.enabled = False
        return
    effect = stage.plotter.ibr.add(pvibr.Shadows(**setting))
    yield effect
    stage.plotter.ibr.remove(effect)


def drawn(found, setting, least=0.02) -> np.ndarray:
    """Return the share of light that is drawn."""
    with shown(found.stage, setting) as effect:
        return measured_lit(found.stage, effect, least)


def wrong_share(found, setting) -> float:
    """Return the percentage of pixels in the wrong light, outside a band of one pixel."""
    return _share(found, drawn(found, setting))


def _share(found, lit) -> float:
    unsure = found.unsure((np.abs(lit - found.lit) > 0.5) & ~found.band & ~found.away)
    return 100 * wrong(lit, found.lit, found.band, found.away, unsure)


def _errors(found, setting) -> tuple[float, float, float]:
    """Return percent of wrong pixels, and light within shadow and in the light."""
    dim = found.dim  # before there are shadows
    lit = drawn(found, setting)
    dark, light = strengths(lit, found.lit, found.wide_band, found.away, dim)
    return _share(found, lit), dark, light


def measure(settings, results):
    """Yield the worst of each scene, and VTK's pass for comparison."""
    every: dict = {}
    for name in settings.scenes:
        scene = SCENES[name]()
        rays = Rays(scene.meshes)
        for window, light in product(settings.windows, settings.lights):
            with sight(scene, rays, light, window) as found:
                key = f'{window[0]}x{window[1]} {light}'
                for method in WRONG:
                    wrongs = _errors(found, {'method': method})
                    every.setdefault(method, {}).setdefault(name, {})[key] = wrongs
                if light == 'spot':
                    share = wrong_share(found, VTK)
                    every.setdefault(VTK, {}).setdefault(name, {})[key] = (share, None, None)
    results.points['wrong'] = every
    for method, scenes in every.items():
        for name, views in scenes.items():
            where = max((v[0], k) for k, v in views.items())[1]
            what = f'wrong: {name}, {method} (worst: {where})'
            yield Row(what, views[where][0], '%', WRONG.get(method))
    for method in ('hard', 'pcf'):
        shares = np.array([v for views in every[method].values() for v in views.values()])
        dark, light = np.nanmax(shares[:, 1]), np.nanmin(shares[:, 2])
        yield Row(f'strength: {method}, light left in shadow', dark, '', 0.01)
        yield Row(f'strength: {method}, light where there is no shadow', light, '', 0.99, True)


def measure_extremes(settings, results):
    """Yield wrong pixels far from the origin, for odd lights and for far planes."""
    scene = SCENES[settings.extreme]()
    window = settings.windows[min(1, len(settings.windows) - 1)]
    cases: list = [
        (f'moved by {o:g} sizes, {light}', place(scene, o), light, None)
        for o in settings.moved
        for light in settings.lights
    ]
    odd = replace(scene, lights=_odd_lights(scene))
    cases += [(name, odd, name, None) for name in odd.lights]
    near = scene.size / 1e3
    far = f'near and far 1 : 1e6, {settings.lights[0]}'
    cases.append((far, scene, settings.lights[0], (near, 1e6 * near)))
    for name, placed, light, clipping in cases:
        with sight(placed, Rays(placed.meshes), light, window, clipping=clipping) as found:
            for method in WRONG:
                share = wrong_share(found, {'method': method})
                yield Row(f'extreme: {name}, {method}', share, '%', WRONG[method])


def _odd_lights(scene):
    """Return lights straight above, and in the plane of the floor."""
    middle, size = np.array(scene.camera[1], float), scene.size
    floor = np.array([*middle[:2], 0.0])
    places = {
        'straight above': floor + np.array([0, 0, size]),
        'in the plane of the floor': floor - np.array([size, 0, 0]),
    }
    return {
        f'{kind} light {where}': light_at(position, floor, cone)
        for where, position in places.items()
        for kind, cone in (('directional', None), ('spot', 30.0))
    }


# -- lights of a size, seen by 256 rays from each pixel ------------------------------------------


def measure_soft(settings, results):
    """Yield the error of each soft method, of hard shadows, and of the reference itself."""
    every: dict = {}
    for name in settings.soft:
        scene = SCENES[name]()
        rays = Rays(scene.meshes)
        for light, share in EXTENTS.items():
            extent = share * (scene.size if light == 'spot' else 1.0)
            where = f'{name}, {light}'
            with sight(scene, rays, light, settings.small, extent=extent) as found:
                for method, tried in _tried(settings).items():
                    errors = {b: soft_error(found, c, extent, _LEAST) for b, c in tried.items()}
                    every.setdefault(method, {})[where] = errors
                surface, lamp = found.surface, scene.lights[light]
                fewer = rays.lit(surface.points, surface.normals, lamp, extent=extent, samples=64)
                every.setdefault('64 rays', {})[where] = {'': light_error(found, fewer)}
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


def soft_error(found, setting, extent, least=0.02) -> float:
    """Return the error of a setting by a light of a size, as pcss takes it."""
    sized = setting if setting == VTK else setting | {'angle': extent, 'radius': extent}
    return light_error(found, drawn(found, sized, least))


def light_error(found, lit) -> float:
    """Return the mean absolute error of the share of light."""
    known = np.isfinite(lit) & np.isfinite(found.lit) & ~found.away
    return float(np.abs(lit - found.lit)[known].mean())
