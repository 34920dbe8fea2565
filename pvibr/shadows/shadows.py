"""Shadows of a renderer's lights."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.core.passes import has_shadows
from pvibr.gl import nbytes_of, release, set_fragment_uniforms, shader_source, texture_units
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, declared_samplers, sections
from pvibr.shadows.derived_sun import DerivedSun
from pvibr.shadows.moments import KINDS
from pvibr.shadows.shadow_maps import (
    VEILS,
    LightMaps,
    filter_of,
    filter_radius,
    map_parts,
)
from pvibr.shadows.volume import ShadowVolumes, receiver_text
from pvibr.things.casters import Casters, Choice, set_surface_uniforms, surface_features
from pvibr.things.depth_view import (
    receiver_declarations,
    receiver_stages,
    set_receiver_uniforms,
)
from pvibr.things.light_views import light_views
from pvibr.things.lights import SceneLight, lights_of

_GATHER = """//VTK::System::Dec
#ifdef GL_ARB_texture_gather
#extension GL_ARB_texture_gather : enable
#define IBR_GATHER
#endif
"""
_MATERIAL = 6  # texture units reserved for materials


class Shadows(Effect):
    """Cast shadows from the scene's lights on everything that they light.

    Shadow maps (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978) are redrawn
    only when the light, the casters or the fit changed. Diffuse and specular light are scaled per
    light where VTK computes them, so shadows combine with several lights, any material and any
    other pass. Headlights cast no visible shadows. If all lights follow the camera, like those of
    PyVista's light kit, a static sun takes a share of their light and casts shadows.

    Parameters
    ----------
    casts : callable or sequence, optional
        Actors and things that cast shadows, or a predicate of them; by default all that are
        visible and count in the scene's bounds.
    receives : callable or sequence, optional
        The same for receivers; by default all that are lit.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True, lighting='none')
    >>> pl.add_light(pv.Light(position=(1, 1, 3), light_type='scene light'))
    >>> _ = pl.add_mesh(pv.Plane(i_size=4, j_size=4))
    >>> _ = pl.add_mesh(pv.Sphere(center=(0, 0, 1)))
    >>> shadows = pl.ibr.add(pvibr.Shadows())
    >>> pl.show(auto_close=False)
    >>> shadows.report()['views drawn']
    1
    >>> pl.close()
    """

    single = True
    web = 'baked', 'darker colours of surfaces'
    presets = {
        'crisp': {'method': 'pcf', 'resolution': 4096, 'filter_radius': 0.5},
        'soft': {'method': 'pcss', 'angle': 3.0},
        'fast': {'method': 'hard', 'resolution': 1024},
    }
    method = Param(
        'pcf',
        'Shadow maps, hard (fastest), filtered (pcf), with penumbrae (pcss) or as blurred moments '
        '(vsm, evsm, msm); or shadow volumes, exact to the pixel.',
        choices=('hard', 'pcf', 'pcss', *KINDS, 'volume'),
    )
    lights = Param(
        'auto',
        'Lights that cast: auto are static ones, or without any a sun derived from the lights '
        'that follow the camera, which it dims; all includes the latter.',
        choices=('auto', 'all'),
    )
    strength = Param(
        1.0,
        'Share of the light that a shadow removes; lower it for lighter shadows.',
        range='[0, 1]',
    )
    ambient = Param(
        0.6,
        'Share of brightness that lights that follow the camera keep beside the sun derived from '
        'them: lower makes shadows darker.',
        range='(0, 1)',
    )
    resolution = Param(
        2048, 'Texels along a side of a shadow map: more sharpens edges.', range='[16, 16384]'
    )
    memory = Param(
        1024.0,
        'Memory limit for the maps of all lights; beyond it they have fewer texels, with a '
        'warning.',
        range='[1, 65536]',
        unit='MiB',
    )
    filter_radius = Param(
        None,
        'Radius of the pcf filter, by default 0.5; standard deviation of the blur of moments, by '
        'default 2. Larger softens edges.',
        range='[0, 64]',
        unit='texels',
        kind=float,
    )
    taps = Param(
        None,
        'Samples per pixel; by default one per texel for small pcf filters, else 16; 32 for pcss.',
        range='[1, 64]',
        kind=int,
    )
    angle = Param(
        0.53,
        'Angular diameter of directional lights for pcss, by default that of the sun.',
        range='(0, 90)',
        unit='degrees',
    )
    radius = Param(
        None,
        "Radius of positional lights for pcss; by default 1/50 of the farthest caster's distance.",
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    bias = Param(
        'plane',
        "Bias against self-shadowing: the receiver's plane, or a polygon offset.",
        choices=('plane', 'polygon_offset'),
    )
    polygon_offset = Param(
        (1.1, 4.0), 'Factor and units of the polygon offset, as in OpenGL.', range='[0, 1e6]'
    )
    faces = Param(
        'both',
        'Faces that cast: back faces avoid acne, but let light leak under thin meshes.',
        choices=('both', 'back'),
    )
    normal_bias = Param(
        0.35,
        'Offset of receivers along their normal: too low shows acne, too high detaches shadows.',
        range='[0, 16]',
        unit='texels',
    )

    casts, receives = Choice(), Choice()

    def __init__(self, *, casts=None, receives=None, **settings):
        self.casts, self.receives = casts, receives
        self._light_maps: list[LightMaps] = []
        self._receiver_features = FeatureSet()
        self._drawer: Any = None
        self._volumes: Any = None
        self._scene_lights: tuple = ()
        self._caster_addresses: set = set()
        self._sun = DerivedSun()
        self._released_bakes = 0
        self._light_limit = 1
        super().__init__(**settings)

    def _things(self) -> list:
        return [t for t in self.pipeline.things if t.enabled]

    def _casters(self, frame) -> Casters:
        return self.pipeline.surfaces.casters(self.casts, self._things(), frame, scenery=False)

    def _receivers(self) -> dict:
        surface_set, things = self.pipeline.surfaces, self._things()
        actors, things = surface_set.chosen(self.receives, things, handles=False)
        if self.method == 'volume':  # masks are those of opaque surfaces
            actors = {k: a for k, a in actors.items() if not a.HasTranslucentPolygonalGeometry()}
        return actors | {address(a): a for thing in things for a in thing.actors()}

    def needed(self, frame) -> bool | str:
        """Return True if any light casts shadows."""
        if has_shadows(frame.renderer):
            raise RuntimeError(
                "shadows must not be VTK's too, got enable_shadows(): call disable_shadows()"
            )
        self._sun.match(frame, self.lights == 'auto', self.ambient)
        self._scene_lights = tuple(lights_of(frame.renderer))
        if self._may_cast():
            return True
        return 'no light casts shadows: headlights cast none, add a scene light'

    def prepare(self, frame):
        """Redraw stale shadow maps and bind them for receivers."""
        if self._drawer is None or self._drawer.renderer is not frame.renderer:
            self._drawer = Drawer(frame.renderer)
        casters = self._casters(frame)
        self._caster_addresses = casters.addresses
        samplers_per_light = 1 + (self.method == 'pcss') + len(VEILS) * bool(casters.translucent)
        self._light_limit = max((texture_units(frame.window) - _MATERIAL) // samplers_per_light, 1)
        self._match_lights()
        for maps in self._light_maps:
            maps.update(frame, casters)
        self._update_volumes(frame, casters)
        self._attach(frame)

    def _casting(self) -> list[SceneLight]:
        """Return the lights that cast shadows, at most as many as a shader may sample."""
        return self._may_cast()[: self._light_limit]

    @property
    def lights_casting(self) -> int:
        """Number of lights that cast shadows in the last frame."""
        return len(self._casting())

    def light_of_page(self, frame, cascades=0) -> tuple | None:
        """Return a light that casts, a sun or spot if any, its views of all casters, cascades."""
        bounds, casting = self._casters(frame).bounds(), self._casting()
        if not casting or not len(bounds):
            return None
        light = min(casting, key=lambda light: light.kind == 'point')
        return light, *light_views(light, bounds, frame, self.resolution, cascades)

    def _may_cast(self) -> list[SceneLight]:
        casts_all = self.lights == 'all'
        return [x for x in self._scene_lights if x.kind != 'headlight' and (casts_all or x.still)]

    def _update_volumes(self, frame, casters):
        """Draw shadow volumes with method volume, or release them."""
        if self.method == 'volume':
            self._volumes = self._volumes or ShadowVolumes(self._drawer)
            visible = self.pipeline.surfaces.casters(None, self._things())
            self._volumes.update(frame, self._casting(), casters, visible)
        else:
            release(self._volumes)
            self._volumes = None

    @property
    def bytes_of_a_light(self) -> float:
        """Most bytes of one light's maps."""
        return self.memory * 2**20 / max(len(self._light_maps), 1)

    def _match_lights(self):
        """Match maps to lights: keep those of lights that are still on, release others."""
        casting = [] if self.method == 'volume' else self._casting()
        revision = self.revision
        old = {maps.light.number: maps for maps in self._light_maps if maps.revision == revision}
        matched = [old.pop(light.number, None) for light in casting]
        for maps in self._light_maps:
            if maps not in matched:
                self._released_bakes += maps.bakes
                maps.release()
        self._light_maps = [maps or LightMaps(self._drawer, self, revision) for maps in matched]
        for maps, light in zip(self._light_maps, casting, strict=True):
            maps.light = light

    def views_of(self, light) -> list:
        """Return the views of a light's shadow maps in the last frame.

        Parameters
        ----------
        light : vtkLight
            A light of the subplot.

        Returns
        -------
        list of pvibr.maths.views.View
            The first contains all casters; empty if the light has no maps.
        """
        if self.pipeline is None or not self.enabled:
            return []
        lights_on = [address(x) for x in self.pipeline.renderer.GetLights() if x.GetSwitch()]
        light_address = address(light)
        light_number = lights_on.index(light_address) if light_address in lights_on else None
        maps = (m for m in self._light_maps if m.light.number == light_number)
        return next((list(m.views) for m in maps), [])

    def _attach(self, frame):
        """Attach the shader to receivers, and set this frame's uniforms."""
        receiver_feature, uniforms = self._receiver_shader(frame)
        receivers = [] if receiver_feature is None else list(self._receivers().values())

        def features_of(actor):
            return receiver_feature, *surface_features(actor)

        def version_of(actor):
            return actor.GetMTime(), receiver_feature

        for actor in self._receiver_features.match(receivers, features_of, version_of):
            features = self._receiver_features.of(actor)
            casts = address(actor) in self._caster_addresses
            set_surface_uniforms(actor, features, casts=casts)
        set_receiver_uniforms(receivers, frame)
        set_fragment_uniforms(receivers, uniforms)

    def _receiver_shader(self, frame):
        """Return the receivers' feature, None without shadows, and its uniforms."""
        multisampled = frame.window.GetMultiSamples() > 1
        if self.method == 'volume':
            volume_lights = tuple((light.number, light.positional) for light in self._casting())
            uniforms = self._volumes.uniforms(frame)
            uniforms['ibr_shadow_strength'] = float(self.strength)
            for light in self._casting():
                uniforms |= _place(frame, light)
            return receiver_feature('volume', 0, False, multisampled, volume_lights), uniforms
        light_maps = [m for m in self._light_maps if m.view is not None]
        if not light_maps:
            return None, {}
        uses_polygon_offset = self.bias == 'polygon_offset'
        signatures = tuple(m.signature() for m in light_maps)
        feature = receiver_feature(*filter_of(self), uses_polygon_offset, multisampled, signatures)
        return feature, self._uniforms(frame, light_maps)

    def _uniforms(self, frame, light_maps):
        _, tap_count = filter_of(self)
        uniforms = {
            'ibr_shadow_view': np.stack([v for m in light_maps for v in m.in_shader(frame)]),
            'ibr_shadow_normal_bias': self.normal_bias,
            'ibr_shadow_polygon': self.polygon_offset,
            'ibr_shadow_filter_radius': filter_radius(self),
            'ibr_shadow_strength': float(self.strength),
            'ibr_shadow_dither': frame.vary('shadow taps')[0],
            'ibr_shadow_taps': max(1, round(tap_count * frame.quality)),
        }
        for maps in light_maps:
            light_number = maps.light.number
            uniforms |= _place(frame, maps.source)
            uniforms[f'ibr_shadow_size_{light_number}'] = float(maps.view.resolution)
            for name, texture in maps.textures().items():
                uniforms[f'ibr_shadow_{name}_{light_number}'] = texture.activate()
        return uniforms

    def finish(self, frame):
        """Release the texture units."""
        for maps in self._light_maps:
            for texture in maps.textures().values():
                texture.deactivate()
        if self._volumes is not None:
            self._volumes.finish()
        # Other subplots may show the same actors with other lights, or without shadows.
        self._receiver_features.leave_shared(self.pipeline.surfaces.plain_actors.prop_of)

    def deactivate(self):
        """Detach the shader from receivers, and restore the lights."""
        self._receiver_features.clear()
        self._sun.remove()

    def attach(self, pipeline):
        """Join a pipeline, which may have one such effect."""
        if any(isinstance(effect, Shadows) for effect in pipeline.effects):
            raise ValueError(
                'Shadows are in this subplot already: change their settings, or remove them'
            )
        super().attach(pipeline)

    def detach(self):
        """Leave the pipeline."""
        self.deactivate()
        super().detach()

    def release(self):
        """Free GPU memory; the context must be current."""
        self.deactivate()
        release(*self._light_maps, self._volumes, self._drawer)
        self._light_maps, self._drawer, self._volumes = [], None, None

    def bake_into(self, scene):
        """Add shadows to a scene without pvibr."""
        extents = self._extent if self.method == 'pcss' else None
        casting = [light.number for light in self._casting()]
        scene.shadow(self.casts, self.receives, casting, self.strength, extents)

    def _extent(self, light, scene_distance):
        """Return the size of a light: degrees, or world units for positional ones."""
        return (self.radius or scene_distance / 50) if light.positional else self.angle

    def _not_casting(self) -> list[str]:
        """Return the kinds of lights and props that cast no shadow."""
        volumes = self.pipeline.renderer.GetVolumes() if self.pipeline else ()
        casting = self._may_cast()
        dark_lights = [x for x in self._scene_lights if x not in casting]
        kinds = [x.kind if x.still else 'camera light' for x in dark_lights]
        beyond = len(casting) - len(self._casting())
        if beyond:
            kinds.append(f'{beyond} lights more than the driver has texture units for')
        return kinds + ['volume'] * len(list(volumes))

    def report(self) -> dict:
        """Return bytes, texels, views drawn so far, and which lights and props cast no shadow."""
        light_maps = [m for m in self._light_maps if m.view is not None]
        depth_views = [m.view for m in light_maps]
        texels_per_pixel = min((m.texels_per_pixel for m in light_maps), default=0.0)
        dark_lights = {'no shadows from': self._not_casting()}
        if self._volumes is not None:
            counts = {'lights': len(self._casting()), 'receivers': len(self._receiver_features)}
            return {'bytes': self._volumes.nbytes} | counts | self._volumes.report() | dark_lights
        return {
            'bytes': nbytes_of(*self._light_maps),
            'lights': len(depth_views),
            'views': sum(len(v.views) for v in depth_views),
            'texels': min((v.resolution for v in depth_views), default=0),
            'texels per pixel': round(texels_per_pixel, 3),
            'views drawn': self._released_bakes + sum(m.bakes for m in self._light_maps),
            'receivers': len(self._receiver_features),
        } | dark_lights


def _place(frame, light) -> dict:
    return {f'ibr_shadow_place_{light.number}': (frame.view_from_world @ light.homogeneous())[:3]}


@lru_cache(maxsize=16)
def receiver_feature(method, tap_count, uses_polygon_offset, multisampled, lights) -> Feature:
    """Return the receivers' shader for these lights, around VTK's own light code."""
    shader_texts = sections(shader_source(__file__))
    if method == 'volume':
        samplers, body = receiver_text(lights)
        declarations = [declared_samplers(samplers), shader_texts['declare'], body]
    else:
        declarations = map_parts(shader_texts, method, tap_count, uses_polygon_offset, lights)
    declarations.insert(1, receiver_declarations(multisampled))  # after samplers
    light_prefix, light_suffix = shader_texts['apply'], ''
    for number, *_ in lights:
        hidden = f'(1.0 - ibr_shadow_{number}(ibr_shadow_p, ibr_shadow_n))'
        light_prefix += (
            f'  vec3 ibr_shadow_lit_{number} = 1.0 - ibr_shadow_strength * {hidden};\n'
            f'#define lightColor{number} (ibr_shadow_lit_{number} * lightColor{number})\n'
        )
        light_suffix += f'#undef lightColor{number}\n'
    fragment_texts = {
        'VTK::System::Dec': _GATHER,
        'VTK::CustomUniforms::Dec': ''.join(declarations),
        'VTK::Light::Impl': f'{light_prefix}//VTK::Light::Impl\n{light_suffix}',
    }
    stages = receiver_stages() if multisampled else {}
    return Feature('shadows', fragment=fragment_texts, **stages)
