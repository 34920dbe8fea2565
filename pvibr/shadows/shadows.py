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
from pvibr.scene.casters import Casters, Choice, set_surface_uniforms, surface_features
from pvibr.scene.lights import SceneLight, lights_of
from pvibr.shadows.derived_sun import DerivedSun
from pvibr.shadows.maps import (
    VEILS,
    LightMaps,
    filter_of,
    filter_radius,
    map_parts,
)
from pvibr.shadows.moments import KINDS
from pvibr.shadows.volume import ShadowVolumes, receiver_text

_GATHER = """//VTK::System::Dec
#ifdef GL_ARB_texture_gather
#extension GL_ARB_texture_gather : enable
#define IBR_GATHER
#endif
"""
_MATERIAL = 6  # texture units that are left to materials


class Shadows(Effect):
    """Cast shadows from the lights of the scene on everything that they light.

    Shadow maps (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978) are redrawn
    only when the light, the casters or the fit changed. Diffuse and specular light are scaled per
    light where VTK computes them, so shadows combine with several lights, any material and any
    other pass. Headlights cast no visible shadows. Where all lights follow the camera, as those of
    PyVista's light kit do, one sun that stands still takes a share of their light and casts.

    Parameters
    ----------
    casts : callable or sequence, optional
        Actors and things of pvibr that cast shadows, or a function that returns True for them; by
        default all that are visible and count in the scene's bounds.
    receives : callable or sequence, optional
        The same for receivers of shadows; by default all that are lit.
    **settings
        Values of the settings.

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
        'Shadow map: hard, filtered (pcf), with penumbrae (pcss) or blurred moments (vsm, evsm, '
        'msm); or shadow volumes, exact to the pixel.',
        choices=('hard', 'pcf', 'pcss', *KINDS, 'volume'),
    )
    lights = Param(
        'auto',
        'Lights that cast: those that stand still, or, where there is none, a sun derived from '
        'lights that follow the camera, which it dims; or all of them.',
        choices=('auto', 'all'),
    )
    strength = Param(1.0, 'Share of the light that a shadow takes away.', range='[0, 1]')
    ambient = Param(
        0.6,
        'Share of their brightness that lights keep which follow the camera, beside the sun that '
        'is derived from them.',
        range='(0, 1)',
    )
    resolution = Param(2048, 'Texels along a side of a shadow map.', range='[16, 16384]')
    memory = Param(
        1024.0,
        'Memory for the maps of all lights: at it, maps have fewer texels, with a warning.',
        range='[1, 65536]',
        unit='MiB',
    )
    filter_radius = Param(
        None,
        'Filter radius of pcf, by default 0.5; standard deviation of moments, by default 2.',
        range='[0, 64]',
        unit='texels',
        kind=float,
    )
    taps = Param(
        None,
        'Samples per pixel; by default one per texel of small pcf filters, else 16; 32 for pcss.',
        range='[1, 64]',
        kind=int,
    )
    angle = Param(
        0.53, 'Angular diameter of directional lights for pcss.', range='(0, 90)', unit='degrees'
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
        'Bias against self-shadowing: by the plane of the receiver, or a polygon offset.',
        choices=('plane', 'polygon_offset'),
    )
    polygon_offset = Param(
        (1.1, 4.0), 'Factor and units of the polygon offset, as in OpenGL.', range='[0, 1e6]'
    )
    faces = Param(
        'both',
        'Faces that cast; back faces avoid acne, but light leaks under thin meshes.',
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
        self._lights: list[LightMaps] = []
        self._attached = FeatureSet()
        self._drawer: Any = None
        self._volumes: Any = None
        self._seen: tuple = ()
        self._cast: set = set()
        self._sun = DerivedSun()
        self._drawn = 0
        self._most = 1
        super().__init__(**settings)

    # -- what takes part ----------------------------------------------------------------------

    def _things(self) -> list:
        return [t for t in self.pipeline.things if t.enabled]

    def _casters(self, frame) -> Casters:
        return self.pipeline.surfaces.casters(self.casts, self._things(), frame, scenery=False)

    def _receivers(self) -> dict:
        surfaces, things = self.pipeline.surfaces, self._things()
        actors, things = surfaces.chosen(self.receives, things, handles=False)
        if self.method == 'volume':  # a mask is that of the opaque surfaces
            actors = {k: a for k, a in actors.items() if not a.HasTranslucentPolygonalGeometry()}
        return actors | {address(a): a for thing in things for a in thing.actors()}

    # -- the life of an effect ----------------------------------------------------------------

    def needed(self, frame) -> bool | str:
        """Return True if any light casts shadows."""
        if has_shadows(frame.renderer):
            raise RuntimeError(
                'enable_shadows() has VTK draw shadows: call disable_shadows() for these'
            )
        self._sun.match(frame, self.lights == 'auto', self.ambient)
        self._seen = tuple(lights_of(frame.renderer))
        if self._may_cast():
            return True
        return 'no light casts shadows: headlights cast none, add a scene light'

    def prepare(self, frame):
        """Redraw stale shadow maps, and bind them for receivers."""
        if self._drawer is None or self._drawer.renderer is not frame.renderer:
            self._drawer = Drawer(frame.renderer)
        casters = self._casters(frame)
        self._cast = casters.addresses
        samplers = 1 + (self.method == 'pcss') + len(VEILS) * bool(casters.translucent)
        self._most = max((texture_units(frame.window) - _MATERIAL) // samplers, 1)
        self._match_lights()
        for maps in self._lights:
            maps.update(frame, casters)
        self._count(frame, casters)
        self._attach(frame)

    def _casting(self) -> list[SceneLight]:
        """Return the lights that cast shadows: as many as a shader may sample."""
        return self._may_cast()[: self._most]

    def _may_cast(self) -> list[SceneLight]:
        every = self.lights == 'all'
        return [x for x in self._seen if x.kind != 'headlight' and (every or x.still)]

    def _count(self, frame, casters):
        """Draw shadow volumes if that is the method."""
        if self.method == 'volume':
            self._volumes = self._volumes or ShadowVolumes(self._drawer)
            shown = self.pipeline.surfaces.casters(None, self._things())
            self._volumes.update(frame, self._casting(), casters, shown)
        else:
            release(self._volumes)
            self._volumes = None

    @property
    def bytes_of_a_light(self) -> float:
        """Bytes that the maps of one light may take."""
        return self.memory * 2**20 / max(len(self._lights), 1)

    def _match_lights(self):
        """Keep the maps of lights that are still on."""
        casting = [] if self.method == 'volume' else self._casting()
        settings = self.revision
        old = {maps.light.number: maps for maps in self._lights if maps.settings == settings}
        kept = [old.pop(light.number, None) for light in casting]
        for maps in self._lights:
            if maps not in kept:
                self._drawn += maps.bakes
                maps.release()
        self._lights = []
        for light, found in zip(casting, kept, strict=True):
            maps = found or LightMaps(self._drawer, self, settings)
            maps.light = light
            self._lights.append(maps)

    def views_of(self, light) -> list:
        """Return the views of a light's shadow maps in the last frame.

        Parameters
        ----------
        light : vtkLight
            Of the subplot.

        Returns
        -------
        list of pvibr.maths.views.View
            The first contains all casters; empty if it casts no shadow or has no maps.
        """
        if self.pipeline is None or not self.enabled:
            return []
        on = [address(x) for x in self.pipeline.renderer.GetLights() if x.GetSwitch()]
        key = address(light)
        number = on.index(key) if key in on else None
        return next((list(m.views) for m in self._lights if m.light.number == number), [])

    def _attach(self, frame):
        """Attach the shader text to receivers, and set the uniforms of this frame."""
        feature, uniforms = self._receiver(frame)
        receivers = [] if feature is None else list(self._receivers().values())

        def features_of(actor):
            return feature, *surface_features(actor)

        def version_of(actor):
            return actor.GetMTime(), feature

        for actor in self._attached.match(receivers, features_of, version_of):
            set_surface_uniforms(actor, casts=address(actor) in self._cast)
        set_fragment_uniforms(receivers, uniforms)

    def _receiver(self, frame):
        """Return the feature of receivers, None if no light casts a shadow, and its uniforms."""
        if self.method == 'volume':
            lights = tuple((light.number, light.positional) for light in self._casting())
            uniforms = self._volumes.uniforms(frame)
            uniforms['ibr_shadow_strength'] = float(self.strength)
            for light in self._casting():
                uniforms |= _place(frame, light)
            return _feature('volume', 0, False, lights), uniforms
        lit = [m for m in self._lights if m.view is not None]
        if not lit:
            return None, {}
        polygon = self.bias == 'polygon_offset'
        signature = (*filter_of(self), polygon, tuple(m.signature() for m in lit))
        return _feature(*signature), self._uniforms(frame, lit)

    def _uniforms(self, frame, lit):
        _, taps = filter_of(self)
        uniforms = {
            'ibr_shadow_view': np.stack([v for m in lit for v in m.in_shader(frame)]),
            'ibr_shadow_normal_bias': self.normal_bias,
            'ibr_shadow_polygon': self.polygon_offset,
            'ibr_shadow_filter_radius': filter_radius(self),
            'ibr_shadow_strength': float(self.strength),
            'ibr_shadow_dither': frame.vary('shadow taps')[0],
            'ibr_shadow_taps': max(1, round(taps * frame.quality)),
        }
        for maps in lit:
            n = maps.light.number
            uniforms |= _place(frame, maps.source)
            uniforms[f'ibr_shadow_size_{n}'] = float(maps.view.resolution)
            for name, texture in maps.textures().items():
                uniforms[f'ibr_shadow_{name}_{n}'] = texture.activate()
        return uniforms

    def finish(self, frame):
        """Release the texture units."""
        for maps in self._lights:
            for texture in maps.textures().values():
                texture.deactivate()
        if self._volumes is not None:
            self._volumes.finish()
        # Another subplot that shows the same actor has other lights, or no shadows.
        self._attached.leave_shared()

    def deactivate(self):
        """Detach the shader text from all receivers, and leave the lights as they were."""
        self._attached.clear()
        self._sun.remove()

    def attach(self, pipeline):
        """Add it to a pipeline that has no shadows yet."""
        if any(isinstance(effect, Shadows) for effect in pipeline.effects):
            raise ValueError(
                'Shadows are in this subplot already: change their settings, or remove them'
            )
        super().attach(pipeline)

    def detach(self):
        """Remove it from the pipeline."""
        self.deactivate()
        super().detach()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.deactivate()
        release(*self._lights, self._volumes, self._drawer)
        self._lights, self._drawer, self._volumes = [], None, None

    def bake_into(self, scene):
        """Add shadows to a scene without pvibr."""
        extents = self._extent if self.method == 'pcss' else None
        casting = [light.number for light in self._casting()]
        scene.shadow(self.casts, self.receives, casting, self.strength, extents)

    def _extent(self, light, reach):
        """Return the size of a light: degrees, or a length in world units."""
        return (self.radius or reach / 50) if light.positional else self.angle

    def _without(self) -> list[str]:
        """Return the kinds of what casts no shadow."""
        volumes = self.pipeline.renderer.GetVolumes() if self.pipeline else ()
        may = self._may_cast()
        heads = [s.kind if s.still else 'camera light' for s in self._seen if s not in may]
        beyond = len(may) - len(self._casting())
        units = [f'{beyond} lights more than the driver has texture units for'] if beyond else []
        return heads + units + ['volume' for _ in volumes]

    def report(self) -> dict:
        """Return bytes, texels, views drawn so far, and what casts no shadow."""
        lit = [m for m in self._lights if m.view is not None]
        views = [m.view for m in lit]
        dark = {'no shadows from': self._without()}
        if self._volumes is not None:
            return (
                {
                    'bytes': self._volumes.nbytes,
                    'lights': len(self._casting()),
                    'receivers': len(self._attached),
                }
                | self._volumes.report()
                | dark
            )
        return {
            'bytes': nbytes_of(*self._lights),
            'lights': len(views),
            'views': sum(len(v.views) for v in views),
            'texels': min((v.resolution for v in views), default=0),
            'texels per pixel': round(min((m.texels_per_pixel for m in lit), default=0.0), 3),
            'views drawn': self._drawn + sum(m.bakes for m in self._lights),
            'receivers': len(self._attached),
        } | dark


def _place(frame, light) -> dict:
    place = (frame.view_from_world @ light.homogeneous())[:3]
    return {f'ibr_shadow_place_{light.number}': place}


@lru_cache(maxsize=16)
def _feature(method, taps, polygon, lights) -> Feature:
    """Return the shader text for some lights, put around VTK's own light code."""
    text = sections(shader_source(__file__))
    if method == 'volume':
        samplers, body = receiver_text(lights)
        parts = [declared_samplers(samplers), text['declare'], body]
    else:
        parts = map_parts(text, method, taps, polygon, lights)
    before, after = text['apply'], ''
    for number, *_ in lights:
        call = f'ibr_shadow_{number}(ibr_shadow_p, ibr_shadow_n)'
        before += f'  vec3 ibr_shadow_lit_{number} = 1.0 - ibr_shadow_strength * (1.0 - {call});\n'
        before += f'#define lightColor{number} (ibr_shadow_lit_{number} * lightColor{number})\n'
        after += f'#undef lightColor{number}\n'
    texts = {
        'VTK::System::Dec': _GATHER,
        'VTK::CustomUniforms::Dec': ''.join(parts),
        'VTK::Light::Impl': f'{before}//VTK::Light::Impl\n{after}',
    }
    return Feature('shadows', fragment=texts)
