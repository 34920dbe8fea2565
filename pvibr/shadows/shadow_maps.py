"""Shadow maps: the views of a light, their filters, and the shader of receivers."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core.errors import warn
from pvibr.gl import nbytes_of, release
from pvibr.gl.feature import DITHER, declared_samplers
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.sequences import ball, disk
from pvibr.shadows.moments import KINDS, WARP, Moments
from pvibr.shadows.nearest import STEP, Nearest
from pvibr.things.depth_view import DepthView
from pvibr.things.light_views import light_views, texels_per_pixel
from pvibr.things.lights import SceneLight

#: Most views around the eye, beside those of the whole scene.
CASCADES = 6
_WINDOW = 3.0  # texels; larger filters compare at sampled positions only
_FEWEST = 16  # least texels along a side, whatever the memory
VEILS = ('tint', 'veil')


class LightMaps:
    """The shadow maps of one light."""

    light: SceneLight

    def __init__(self, drawer, owner, revision):
        self.drawer, self.owner, self.revision = drawer, owner, revision
        #: The point of the light from which the maps are drawn; varies with samples.
        self.source: Any = None
        self.view: Any = None
        self.moments: Any = None
        self.nearest: Any = None
        self.views: list = []
        self._last_update: Any = None  # frame, and bounds of its casters
        self._cascades: list = []  # around the eye; their number only grows
        self._released_bakes = 0

    @property
    def bakes(self) -> int:
        """Number of views drawn so far."""
        return self._released_bakes + (self.view.bakes if self.view else 0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._resources())

    def _resources(self):
        return self.moments, self.nearest, self.view

    def textures(self) -> dict:
        """Return the textures of receivers by name."""
        if self.view is None:
            return {}
        veils = {v: getattr(self.view, v) for v in VEILS} if self.view.veils else {}
        near = {} if self.nearest is None else {'near': self.nearest.texture}
        return {'map': (self.moments or self.view).texture} | near | veils

    def update(self, frame, casters):
        """Redraw stale views."""
        caster_bounds = casters.bounds()
        if not len(caster_bounds):
            self.release()
            return
        view_options = {'previous': self._cascades, 'square': bool(casters.thin)}
        self.source = self._source(frame, caster_bounds)
        whole_views, self._cascades = light_views(
            self.source, caster_bounds, frame, self.owner.resolution, CASCADES, **view_options
        )
        self.views = whole_views + [cascade.view for cascade in self._cascades]
        is_veiled, old_view = bool(casters.translucent), self.view
        layout = len(self.views), is_veiled
        is_new = old_view is None or (len(old_view.views), bool(old_view.veils)) != layout
        if is_new:
            self._reallocate(is_veiled)
        self._last_update = frame, caster_bounds
        redrawn = self.view.update(frame, self.views, casters, faces=self.owner.faces)
        for k in range(len(self.views)) if is_new else redrawn:
            if self.moments is not None:
                self.moments.update(k, filter_radius(self.owner))
            if self.nearest is not None and light_share(frame):  # points need none
                self.nearest.update(k)

    def _source(self, frame, bounds) -> SceneLight:
        """Return a sample point on the light, which differs per sample."""
        light, owner = self.light, self.owner
        if frame.sample is None or owner.method != 'pcss':
            return light
        x, y = frame.vary(f'light {light.number}')
        if not light.positional:
            return light.turned(*np.tan(np.radians(owner.angle / 2)) * np.array(disk(x, y)))
        light_radius = owner.radius
        if light_radius is None:
            whole_views, _ = light_views(light, bounds, frame, owner.resolution, 0)
            light_radius = _default_radius(whole_views[0])
        z, _ = frame.vary(f'light {light.number}, along')
        return light.moved(light_radius * np.array(ball(x, y, z)))

    def _reallocate(self, is_veiled):
        """Reallocate the maps of all views, and copy what old ones show."""
        resolution, byte_budget = self.owner.resolution, self.owner.bytes_of_a_light
        new_maps = self._maps(is_veiled, resolution)
        full_bytes = nbytes_of(*new_maps) * (resolution / new_maps[0].resolution) ** 2
        while nbytes_of(*new_maps) > byte_budget and new_maps[0].resolution > _FEWEST:
            shrink = 0.98 * (byte_budget / nbytes_of(*new_maps)) ** 0.5
            smaller_side = int(shrink * new_maps[0].resolution)
            release(*new_maps)
            new_maps = self._maps(is_veiled, max(smaller_side, _FEWEST))
        old_view, new_view = self.view, new_maps[0]
        if new_view.resolution < resolution:
            warn(
                f'resolution = {resolution} would take {full_bytes / 2**20:.0f} MiB for '
                f'{len(self.views)} views: using {new_view.resolution} texels, which fit textures '
                f'of the driver and the {byte_budget / 2**20:.0f} MiB per light of memory = '
                f'{self.owner.memory:g}'
            )
        has_veils = old_view is not None and (is_veiled or old_view.veils)
        if old_view is not None and not has_veils and old_view.resolution == new_view.resolution:
            new_view.take(old_view)
        self.release()
        self.view, self.moments, self.nearest = new_maps

    def _maps(self, is_veiled, resolution) -> tuple:
        """Return the depth of all views, and its moments and pyramid if the method needs them."""
        method, compares = self.owner.method, filter_of(self.owner)[0] == 'pcf'
        options = {'compare': compares, 'veiled': is_veiled}
        depth_view = DepthView(self.drawer, len(self.views), resolution, **options)
        moments = Moments(depth_view, method) if method in KINDS else None
        return depth_view, moments, Nearest(depth_view) if method == 'pcss' else None

    def in_shader(self, frame) -> list[np.ndarray]:
        """Return the view uniforms of receivers, (4, 4) each."""
        world_from_view = np.linalg.inv(frame.view_from_world)
        matrices = [in_shader(view, world_from_view) for view in self.views]
        for matrix, view in zip(matrices, self.views, strict=True):
            matrix[2:, 3] = light_size(self.owner, view, frame, self.views[0])
        return matrices

    @property
    def texels_per_pixel(self) -> float:
        """Texels per pixel in the last frame, where casters may be nearest."""
        return texels_per_pixel(self.views, self.view.resolution, *self._last_update)

    def signature(self):
        """Return the part of the key of the receivers' shader."""
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
        """Free GPU memory; the context must be current."""
        self._released_bakes = self.bakes
        release(*self._resources())
        self.view = self.moments = self.nearest = None


def filter_of(settings) -> tuple[str, int]:
    """Return the shader section of the filter, and its number of taps."""
    if settings.method != 'pcf':
        return settings.method, settings.taps or 32
    texel_radius = filter_radius(settings)
    if settings.taps is None and 0.5 <= texel_radius <= _WINDOW:
        return 'window', int(np.ceil(2 * texel_radius)) + 1
    return 'pcf', settings.taps or 16


def filter_radius(settings) -> float:
    """Return the radius of the filter or blur, in texels."""
    if settings.filter_radius is not None:
        return settings.filter_radius
    return 2.0 if settings.method in KINDS else 0.5


def _default_radius(view) -> float:
    return view.far / 50


def light_share(frame) -> float:
    """Return the share of a light's width in one frame: in samples the gap between them."""
    return 1.0 if frame.sample is None else frame.sample.gap


def light_size(settings, view, frame, whole_view) -> list[float]:
    """Return the light's size as a fraction of a view's sides."""
    view_scale = np.diag(view.clip_from_view)[:2] / 2 * light_share(frame)
    if view.parallel:
        return (np.tan(np.radians(settings.angle / 2)) * view_scale).tolist()
    return ((settings.radius or _default_radius(whole_view)) * view_scale).tolist()


def in_shader(view, world_from_view) -> np.ndarray:
    """Return a light's view as a uniform of receivers, (4, 4) in columns."""
    x, y, z, w = view.texture_from_world() @ world_from_view
    matrix = np.zeros((4, 4))
    if view.parallel:  # two axes; texture coordinates and depth per unit, and at the eye
        matrix[3, :2] = np.linalg.norm([x[:3], y[:3]], axis=1)
        matrix[:3, 0], matrix[:3, 1] = x[:3] / matrix[3, 0], y[:3] / matrix[3, 1]
        matrix[:, 2] = x[3], y[3], np.linalg.norm(z[:3]), z[3]
    else:  # rows of the matrix from the light; depth as terms of 1 and of 1 over distance
        matrix[:3, :3] = np.stack([x - 0.5 * w, y - 0.5 * w, w])[:, :3].T
        clip = view.clip_from_view
        matrix[3, :3] = clip[0, 0] / 2, (1 - clip[2, 2]) / 2, clip[2, 3] / 2
    matrix[:2, 3] = view.near, view.far
    return matrix


def map_parts(shader_texts, method, tap_count, uses_polygon_offset, lights) -> list[str]:
    """Return the declarations of the shader of receivers."""
    sampler_kind = 'sampler2DShadow' if method == 'pcf' else 'sampler2D'
    samplers = {f'ibr_shadow_map_{n}': sampler_kind for n, *_ in lights}
    if method == 'pcss':
        samplers |= {f'ibr_shadow_near_{n}': 'sampler2D' for n, *_ in lights}
    samplers |= {f'ibr_shadow_{v}_{n}': 'sampler2D' for n, *_, e in lights if e for v in VEILS}
    disk_text = ', '.join(f'vec2({x:.6f}, {y:.6f})' for x, y in vogel_disk(tap_count))
    shader_parts = [
        declared_samplers(samplers),
        f'{DITHER}#define TAPS {tap_count}\n#define WARP {WARP:.1f}\n#define STEP {STEP:.1f}\n'
        f'#define POLYGON {int(uses_polygon_offset)}\n',
        f'const vec2 ibr_shadow_disk[TAPS] = vec2[TAPS]({disk_text});\n',
        shader_texts['disk'],
        shader_texts['declare'],
        shader_texts['blocker'] if method in ('hard', 'window', 'pcss') else '',
        shader_texts['moments'] if method in KINDS else '',
        shader_texts[method],
    ]
    first_view = 0
    names = 'POSITIONAL', 'WHOLE', 'REFINED', 'COLUMNS', 'ROWS', 'VEILED'
    for light_number, *numbers in lights:
        light_defines = dict(zip(names, map(int, numbers), strict=True))
        light_defines |= {'FIRST': first_view, 'NEAREST': int(method == 'pcss')}
        shader_parts += [f'#define {k} {v}\n' for k, v in light_defines.items()]
        shader_parts.append(shader_texts['light'].replace('NUMBER', str(light_number)))
        shader_parts += [f'#undef {k}\n' for k in light_defines]
        first_view += light_defines['WHOLE'] + light_defines['REFINED']
    return shader_parts
