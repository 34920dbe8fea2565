"""Shadow maps: the views of a light, how receivers filter them, and their shader."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core.errors import warn
from pvibr.gl import release
from pvibr.gl.feature import DITHER, declared_samplers
from pvibr.maths.kernels import vogel_disk
from pvibr.scene.depth_view import DepthView, receiver_shader
from pvibr.scene.lights import SceneLight, light_views, texels_per_pixel
from pvibr.shadows.moments import KINDS, WARP, Moments
from pvibr.shadows.nearest import STEP, Nearest

#: Views around the eye at most, beside those of everything.
CASCADES = 5
_WINDOW = 3.0  # texels: a larger filter compares at some places only
VEILS = ('tint', 'veil')


class LightMaps:
    """The shadow maps of one light."""

    light: SceneLight

    def __init__(self, drawer, owner, settings):
        self.drawer, self.owner, self.settings = drawer, owner, settings
        self.view: Any = None
        self.moments: Any = None
        self.nearest: Any = None
        self.views: list = []
        self._told_by: Any = None  # the last frame, and the bounds of its casters
        self._cascades: list = []  # around the eye, as many as ever were wanted
        self._released = 0

    @property
    def bakes(self) -> int:
        """How many views were drawn."""
        return self._released + (self.view.bakes if self.view else 0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(owner.nbytes for owner in self._owners() if owner)

    def _owners(self):
        return self.moments, self.nearest, self.view

    def textures(self) -> dict:
        """Return the textures that receivers sample, by name."""
        if self.view is None:
            return {}
        veils = {v: getattr(self.view, v) for v in VEILS} if self.view.veils else {}
        near = {} if self.nearest is None else {'near': self.nearest.texture}
        return {'map': (self.moments or self.view).texture} | near | veils

    def update(self, frame, casters):
        """Draw what is stale."""
        bounds = casters.bounds()
        if not len(bounds):
            self.release()
            return
        wanted = self.owner.resolution
        shape = {'kept': self._cascades, 'square': bool(casters.thin)}
        whole, self._cascades = light_views(self.light, bounds, frame, wanted, CASCADES, **shape)
        self.views = whole + [cascade.view for cascade in self._cascades]
        veiled, old = bool(casters.translucent), self.view
        new = old is None or (len(old.views), bool(old.veils)) != (len(self.views), veiled)
        if new:
            self._make(veiled)
        self._told_by = frame, bounds
        drawn = self.view.update(frame, self.views, casters, faces=self.owner.faces)
        for k in range(len(self.views)) if new else drawn:
            if self.moments is not None:
                self.moments.update(k, filter_radius(self.owner))
            if self.nearest is not None:
                self.nearest.update(k)

    def _make(self, veiled):
        """Make the maps of all views anew, with what the old ones show."""
        method, wanted, old = self.owner.method, self.owner.resolution, self.view
        compare, views = filter_of(self.owner)[0] == 'pcf', len(self.views)
        view = DepthView(self.drawer, views, wanted, compare=compare, veiled=veiled)
        if view.resolution < wanted:
            needed = view.nbytes * (wanted / view.resolution) ** 2 / 2**20
            msg = (
                f'resolution = {wanted}: {views} views take {needed:.0f} MiB, and the driver has '
                f'room for {view.resolution} texels along a side of each'
            )
            warn(msg)
        if old is not None and not (veiled or old.veils) and old.resolution == view.resolution:
            view.take(old)
        self.release()
        self.view = view
        self.moments = Moments(view, method) if method in KINDS else None
        self.nearest = Nearest(view) if method == 'pcss' else None

    @property
    def texels_per_pixel(self) -> float:
        """How many texels a pixel spans in the last frame, where casters may be nearest."""
        return texels_per_pixel(self.views, self.view.resolution, *self._told_by)

    def signature(self):
        """Return what the shader of receivers depends on."""
        return (
            self.light.number,
            self.light.positional,
            len(self.views) - len(self._cascades),
            len(self._cascades),
            self.view.columns,
            self.view.rows,
            bool(self.view.veils),
        )

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._released = self.bakes
        release(*self._owners())
        self.view = self.moments = self.nearest = None


def filter_of(settings) -> tuple[str, int]:
    """Return the section of the shader that filters, and its number of taps."""
    if settings.method != 'pcf':
        return settings.method, settings.taps or 32
    radius = filter_radius(settings)
    if settings.taps is None and 0.5 <= radius <= _WINDOW:
        return 'window', int(np.ceil(2 * radius)) + 1
    return 'pcf', settings.taps or 16


def filter_radius(settings) -> float:
    """Return the radius of the filter or the blur, texels."""
    if settings.filter_radius is not None:
        return settings.filter_radius
    return 2.0 if settings.method in KINDS else 0.5


def light_size(settings, view) -> list[float]:
    """Return the size of the light as a fraction of a view's sides, as the shader takes it."""
    scale = np.diag(view.clip_from_view)[:2] / 2
    if view.parallel:
        return (np.tan(np.radians(settings.angle / 2)) * scale).tolist()
    return ((settings.radius or view.far / 50) * scale).tolist()


def texel_size(view, resolution) -> list[float]:
    """Return the sides of a texel in world units; at a distance of 1 where they grow with it."""
    return (2 / np.diag(view.clip_from_view)[:2] / resolution).tolist()


def map_parts(text, method, taps, lights) -> list[str]:
    """Return the declarations of the shader of receivers."""
    kind = 'sampler2DShadow' if method == 'pcf' else 'sampler2D'
    samplers = {f'ibr_shadow_map_{n}': kind for n, *_ in lights}
    if method == 'pcss':
        samplers |= {f'ibr_shadow_near_{n}': 'sampler2D' for n, *_ in lights}
    samplers |= {f'ibr_shadow_{v}_{n}': 'sampler2D' for n, *_, e in lights if e for v in VEILS}
    shared = receiver_shader()
    disk = ', '.join(f'vec2({x:.6f}, {y:.6f})' for x, y in vogel_disk(taps))
    parts = [
        declared_samplers(samplers),
        f'{DITHER}#define TAPS {taps}\n#define WARP {WARP:.1f}\n#define STEP {STEP:.1f}\n',
        f'const vec2 ibr_shadow_disk[TAPS] = vec2[TAPS]({disk});\n',
        text['disk'],
        text['declare'],
        shared['plane'],
        text['moments'] if method in KINDS else '',
        text[method],
    ]
    first = 0
    for number, positional, whole, refined, columns, rows, veiled in lights:
        values = {
            'POSITIONAL': str(bool(positional)).lower(),
            'FIRST': first,
            'WHOLE': whole,
            'REFINED': refined,
            'COLUMNS': columns,
            'ROWS': rows,
            'VEILED': int(veiled),
            'NEAREST': int(method == 'pcss'),
        }
        parts += [f'#define {k} {v}\n' for k, v in values.items()]
        parts.append(text['light'].replace('NUMBER', str(number)))
        parts += [f'#undef {k}\n' for k in values]
        first += whole + refined
    return parts
