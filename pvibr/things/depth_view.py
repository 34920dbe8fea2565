"""Depth maps of lights, projectors and queries."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.gl import (
    Target,
    nbytes_of,
    release,
    set_fragment_uniforms,
    set_vertex_uniforms,
    shader_source,
    texture_limit,
)
from pvibr.gl.enums import DEPTH_BUFFER_BIT
from pvibr.gl.feature import Feature, FeatureSet, sections
from pvibr.gl.target import blit
from pvibr.things.casters import SPHERES, draws_spheres, sized
from pvibr.things.seen_from import seen_from

# The transmittance of translucent casters, and the depth of the nearest: one pass each, since
# they blend differently.
_VEIL = Feature(
    'veil',
    fragment={
        'VTK::DepthPeeling::Impl': """  if (ibr_veil == 1)
  {
    float thin = 1.0 - gl_FragData[0].a;
    vec3 color = diffuseColor / max(diffuseIntensity, 1e-6);
    gl_FragData[0] = vec4(thin * mix(color, vec3(1.0), thin), 1.0);
  }
  else if (ibr_veil == 2)
    gl_FragData[0] = vec4(gl_FragCoord.z);
//VTK::DepthPeeling::Impl
"""
    },
)


class DepthView:
    """Depth of one or more views in one texture; only stale views are redrawn."""

    def __init__(self, drawer, views, resolution, *, compare=False, veiled=False):
        self.drawer = drawer
        self.columns = int(np.ceil(np.sqrt(views)))
        self.rows = -(-views // self.columns)
        size_limit = texture_limit(drawer.window)
        self.resolution = min(int(resolution), size_limit // self.columns)
        size = self.columns * self.resolution, self.rows * self.resolution
        self.target = Target(drawer.window, *size, (), depth=True)
        if compare:
            self.texture.compare()
        formats = ('rgba8', 'r32f') if veiled else ()
        self.veils = [Target(drawer.window, *size, (f,), depth=self.texture) for f in formats]
        self.views: list = [None] * views
        self.key: tuple = ()  # of all casters
        self.keys: list = [None] * views  # of each view and the casters in it
        self._attached = FeatureSet()
        self.bakes = 0

    @property
    def texture(self) -> Any:
        """The depth texture: 0 at the near plane, 1 at the far plane."""
        return self.target.depth

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self.target, *self.veils)

    @property
    def tint(self):
        """Transmittance of the translucent casters, RGB, if veiled."""
        return self.veils[0].colors[0]

    @property
    def veil(self):
        """Depth of the nearest translucent caster, if veiled."""
        return self.veils[1].colors[0]

    def corner(self, k) -> tuple[int, int]:
        """Return the lower left texel of a view."""
        return k % self.columns * self.resolution, k // self.columns * self.resolution

    def take(self, source):
        """Copy the views of another map of the same resolution, without veils."""
        texels, state = self.resolution, self.drawer.window.GetState()
        for k in range(min(len(source.views), len(self.views))):
            corners = source.corner(k), self.corner(k)
            rects = [(x, y, x + texels, y + texels) for x, y in corners]
            blit(state, source.target.object, self.target.object, DEPTH_BUFFER_BIT, *rects)
            self.keys[k] = source.keys[k]
        self.key = source.key

    def update(self, frame, views, casters, *, faces='both') -> list[int]:
        """Redraw the stale views; return their indices."""
        stale_views = self._stale(views, casters)
        self.views = list(views)
        if not stale_views:
            return []
        self._attached.match(casters.actors, self._features_of)
        with self.target.drawing():
            for k in stale_views:
                self._draw(frame, k, casters, faces)
        for mode, target in enumerate(self.veils, 1):
            with target.drawing():
                for k in stale_views:
                    self._draw_veil(views[k], k, casters, mode)
        self.drawer.doubles.keep(casters.actors, self.drawer.window)
        self.drawer.done()
        # Evaluated again: things may have created actors for these views.
        self.key = casters.settled()
        for k in stale_views:
            self.keys[k] = (views[k].key(), casters.seen(views[k]).key())
        self.bakes += len(stale_views)
        return stale_views

    def _stale(self, views, casters) -> list[int]:
        """Return the views that changed, or see other casters than when drawn."""
        has_changed = casters.key() != self.key
        self.key = casters.key()
        stale_views = []
        for k, view in enumerate(views):
            view_key, casters_key = self.keys[k] or (None, None)
            if view_key != view.key() or (has_changed and casters_key != casters.seen(view).key()):
                stale_views.append(k)
        return stale_views

    def _draw(self, frame, k, casters, faces):
        view, tile_size = self.views[k], (self.resolution, self.resolution)
        casters, casting_frame = casters.seen(view), frame.elsewhere(view, tile_size, casting=True)
        with seen_from(casters.things, casting_frame):
            thing_actors = [thing.draws(casting_frame, depth=True) for thing in casters.things]
            self.drawer.look(view, (*self.corner(k), *tile_size))
            # In a parallel view VTK's spheres bulge twice as far.
            bulge = self.drawer.inner.GetSize()[0] / tile_size[0] * (0.5 if view.parallel else 1.0)
            with sized(casters.actors, frame, casting_frame, bulge):
                self.drawer.draw_depth(casters.actors, faces=faces)
            for actors in thing_actors:
                self.drawer.draw(actors)

    def _features_of(self, actor):
        veiled = self.veils and actor.HasTranslucentPolygonalGeometry()
        features = {SPHERES: draws_spheres(actor), _VEIL: veiled}
        return [feature for feature, is_needed in features.items() if is_needed]

    def _draw_veil(self, view, k, casters, mode):
        view_rect = (*self.corner(k), self.resolution, self.resolution)
        self.drawer.look(view, view_rect, clear=False)
        self.drawer.fill((1.0, 1.0, 1.0, 1.0))
        actors = casters.seen(view).translucent
        set_fragment_uniforms(actors, {'ibr_veil': mode})
        with self.drawer.blending('multiply' if mode == 1 else 'least'):
            self.drawer.draw(actors, translucent=True)
        set_fragment_uniforms(actors, {'ibr_veil': 0})

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._attached.clear()
        release(*self.veils, self.target)


def receiver_shader() -> dict[str, str]:
    """Return the sections of ``receiver.glsl``: where receivers are, and who sees them."""
    return sections(shader_source(__file__, 'receiver'))


def receiver_declarations(multisampled) -> str:
    """Return what fragments declare for the positions of receivers."""
    return '#define IBR_MULTISAMPLED\n' * multisampled + receiver_shader()['fragment.declare']


def receiver_stages() -> dict[str, dict]:
    """Return the texts before the fragment stage, which hand positions on, for a feature."""
    text, names = receiver_shader(), {'Dec': 'declare', 'Impl': 'position'}
    return {
        stage: {
            f'VTK::PositionVC::{tag}': f'//VTK::PositionVC::{tag}\n{text[f"{stage}.{name}"]}'
            for tag, name in names.items()
        }
        for stage in ('vertex', 'geometry')
    }


def set_receiver_uniforms(actors, frame):
    """Set the uniforms of :func:`receiver_stages`."""
    view_from_clip = np.linalg.inv(frame.pixel_from_view)[None]
    ahead = {'ibr_ahead': (1.0, 0.0) if frame.parallel else (0.0, 1.0)}
    set_vertex_uniforms(actors, {'ibr_view_from_clip': view_from_clip} | ahead)
    set_fragment_uniforms(actors, ahead)
