"""Shadow maps: the views of a light, how receivers filter them, and their shader."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core.errors import warn
from pvibr.gl import nbytes_of, release
from pvibr.gl.feature import DITHER, declared_samplers
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.sequences import ball, disk
from pvibr.scene.depth_view import DepthView
from pvibr.scene.lights import SceneLight, light_views, texels_per_pixel
from pvibr.shadows.moments import KINDS, WARP, Moments
from pvibr.shadows.nearest import STEP, Nearest

#: Views around the eye at most, beside those of everything.
CASCADES = 6
_WINDOW = 3.0  # texels: a larger filter compares at some places only
_FEWEST = 16  # texels along a side, whatever the memory
VEILS = ('tint', 'veil')


class LightMaps:
    """The shadow maps of one light."""

    light: SceneLight

    def __init__(self, drawer, owner, settings):
        self.drawer, self.owner, self.settings = drawer, owner, settings
        #: The point of the light that the maps are seen from: in samples it varies.
        self.source: Any = None
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
        return nbytes_of(*self._owners())

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
        shape = {'previous': self._cascades, 'square': bool(casters.thin)}
        self.source = self._source(frame, bounds)
        whole, self._cascades = light_views(self.source, bounds, frame, wanted, CASCADES, **shape)
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
            if self.nearest is not None and light_share(frame):  # what points have no use for
                self.nearest.update(k)

    def _source(self, frame, bounds) -> SceneLight:
        """Return the light as a point of what it spans, of which each sample has another."""
        light, owner = self.light, self.owner
        if frame.sample is None or not is_soft(owner):
            return light
        x, y = frame.vary(f'light {light.number}')
        if not light.positional:
            return light.turned(*np.tan(np.radians(owner.angle / 2)) * np.array(disk(x, y)))
        radius = owner.radius
        if radius is None:
            whole, _ = light_views(light, bounds, frame, owner.resolution, 0)
            radius = _default_radius(whole[0])
        z, _ = frame.vary(f'light {light.number}, along')
        return light.moved(radius * np.array(ball(x, y, z)))

    def _make(self, veiled):
        """Make the maps of all views anew, with what the old ones show."""
        wanted, room, old = self.owner.resolution, self.owner.bytes_of_a_light, self.view
        made = self._maps(veiled, wanted)
        first, taken = made[0].resolution, nbytes_of(*made)
        while nbytes_of(*made) > room and made[0].resolution > _FEWEST:
            side = int(0.98 * made[0].resolution * (room / nbytes_of(*made)) ** 0.5)
            release(*made)
            made = self._maps(veiled, max(side, _FEWEST))
        view = made[0]
        if view.resolution < wanted:
            warn(
                f'resolution = {wanted}: {len(self.views)} views take '
                f'{taken * (wanted / first) ** 2 / 2**20:.0f} MiB; there is room for '
                f'{view.resolution} texels along a side of each, in textures of the driver and in '
                f'the {room / 2**20:.0f} MiB that memory = {self.owner.memory:g} leaves'
            )
        if old is not None and not (veiled or old.veils) and old.resolution == view.resolution:
            view.take(old)
        self.release()
        self.view, self.moments, self.nearest = made

    def _maps(self, veiled, resolution) -> tuple:
        """Return the depth of all views, and what is made of it for the method."""
        method, compare = self.owner.method, filter_of(self.owner)[0] == 'pcf'
        depth = DepthView(self.drawer, len(self.views), resolution, compare=compare, veiled=veiled)
        moments = Moments(depth, method) if method in KINDS else None
        return depth, moments, Nearest(depth) if method == 'pcss' else None

    def in_shader(self, frame) -> list[np.ndarray]:
        """Return what receivers need to know of each view, (4, 4) each."""
        world_from_view = np.linalg.inv(frame.view_from_world)
        found = [in_shader(view, world_from_view) for view in self.views]
        for one, view in zip(found, self.views, strict=True):
            one[2:, 3] = light_size(self.owner, view, frame, self.views[0])
        return found

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


def is_soft(settings) -> bool:
    """Return whether shadows have the penumbrae of lights of some size."""
    return settings.method == 'pcss'


def _default_radius(view) -> float:
    return view.far / 50


def light_share(frame) -> float:
    """Return the share of a light's width that a frame sees: in samples what is between them."""
    return 1.0 if frame.sample is None else frame.sample.gap


def light_size(settings, view, frame, whole) -> list[float]:
    """Return the light's size as a fraction of a view's sides; by default it depends on all's."""
    scale = np.diag(view.clip_from_view)[:2] / 2 * light_share(frame)
    if view.parallel:
        return (np.tan(np.radians(settings.angle / 2)) * scale).tolist()
    return ((settings.radius or _default_radius(whole)) * scale).tolist()


def in_shader(view, world_from_view) -> np.ndarray:
    """Return what receivers need to know of a light's view, (4, 4) in columns."""
    x, y, z, w = view.texture_from_world() @ world_from_view
    found = np.zeros((4, 4))
    if view.parallel:  # two axes; texture coordinates and depth: per unit, and at the eye
        found[3, :2] = np.linalg.norm([x[:3], y[:3]], axis=1)
        found[:3, 0], found[:3, 1] = x[:3] / found[3, 0], y[:3] / found[3, 1]
        found[:, 2] = x[3], y[3], np.linalg.norm(z[:3]), z[3]
    else:  # rows of the matrix from the light; depth as a sum of 1 and of 1 over distance
        found[:3, :3] = np.stack([x - 0.5 * w, y - 0.5 * w, w])[:, :3].T
        clip = view.clip_from_view
        found[3, :3] = clip[0, 0] / 2, (1 - clip[2, 2]) / 2, clip[2, 3] / 2
    found[:2, 3] = view.near, view.far
    return found


def map_parts(text, method, taps, polygon, lights) -> list[str]:
    """Return the declarations of the shader of receivers."""
    kind = 'sampler2DShadow' if method == 'pcf' else 'sampler2D'
    samplers = {f'ibr_shadow_map_{n}': kind for n, *_ in lights}
    if method == 'pcss':
        samplers |= {f'ibr_shadow_near_{n}': 'sampler2D' for n, *_ in lights}
    samplers |= {f'ibr_shadow_{v}_{n}': 'sampler2D' for n, *_, e in lights if e for v in VEILS}
    disk = ', '.join(f'vec2({x:.6f}, {y:.6f})' for x, y in vogel_disk(taps))
    parts = [
        declared_samplers(samplers),
        f'{DITHER}#define TAPS {taps}\n#define WARP {WARP:.1f}\n#define STEP {STEP:.1f}\n'
        f'#define POLYGON {int(polygon)}\n',
        f'const vec2 ibr_shadow_disk[TAPS] = vec2[TAPS]({disk});\n',
        text['disk'],
        text['declare'],
        text['moments'] if method in KINDS else '',
        text[method],
    ]
    first = 0
    for number, positional, whole, refined, columns, rows, veiled in lights:
        values = {
            'POSITIONAL': int(positional),
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
