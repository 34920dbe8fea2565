"""Depth maps: depth in views of lights, projectors and queries."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.gl import (
    Target,
    nbytes_of,
    release,
    set_fragment_uniforms,
    shader_source,
    texture_limit,
)
from pvibr.gl.enums import DEPTH_BUFFER_BIT
from pvibr.gl.feature import Feature, FeatureSet, sections
from pvibr.gl.target import blit
from pvibr.things.casters import SPHERES, draws_spheres, sized
from pvibr.things.seen_from import seen_from

# What a translucent caster leaves of the light, and how near it is: one pass each, since the
# two blend in different ways.
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
    """Depth of one or more views in one texture, redrawn only when stale."""

    def __init__(self, drawer, views, resolution, *, compare=False, veiled=False):
        self.drawer = drawer
        self.columns = int(np.ceil(np.sqrt(views)))
        self.rows = -(-views // self.columns)
        limit = texture_limit(drawer.window)
        self.resolution = min(int(resolution), limit // self.columns)
        size = self.columns * self.resolution, self.rows * self.resolution
        self.target = Target(drawer.window, *size, (), depth=True)
        if compare:
            self.texture.compare()
        self.veils: list = []
        if veiled:
            formats = ('rgba8', 'r32f')
            self.veils = [Target(drawer.window, *size, (f,), depth=self.texture) for f in formats]
        self.views: list = [None] * views
        self.key: tuple = ()  # of all casters
        self.keys: list = [None] * views  # of each view, and of the casters in it
        self._attached = FeatureSet()
        self.bakes = 0

    @property
    def texture(self) -> Any:
        """The depth texture: 0 near, 1 far."""
        return self.target.depth

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self.target, *self.veils)

    @property
    def tint(self):
        """Transmittance of translucent casters, RGB; if veiled."""
        return self.veils[0].colors[0]

    @property
    def veil(self):
        """Depth of the nearest translucent caster; if veiled."""
        return self.veils[1].colors[0]

    def corner(self, k) -> tuple[int, int]:
        """Return the lower left texel of a view in the texture."""
        return k % self.columns * self.resolution, k // self.columns * self.resolution

    def take(self, other):
        """Copy the views that another has drawn, of as many texels each and without veils."""
        side, state = self.resolution, self.drawer.window.GetState()
        for k in range(min(len(other.views), len(self.views))):
            at = [(x, y, x + side, y + side) for x, y in (other.corner(k), self.corner(k))]
            blit(state, other.target.object, self.target.object, DEPTH_BUFFER_BIT, *at)
            self.keys[k] = other.keys[k]
        self.key = other.key

    def update(self, frame, views, casters, *, faces='both') -> list[int]:
        """Draw the views that are stale."""
        stale = self._stale(views, casters)
        self.views = list(views)
        if not stale:
            return []
        self._attached.match(casters.actors, self._features_of)
        with self.target.drawing():
            for k in stale:
                self._draw(frame, k, casters, faces)
        for mode, target in enumerate(self.veils, 1):
            with target.drawing():
                for k in stale:
                    self._draw_veil(views[k], k, casters, mode)
        self.drawer.doubles.keep(casters.actors, self.drawer.window)
        self.drawer.done()
        # Taken again: things may have made actors for these views.
        self.key = casters.settled()
        for k in stale:
            self.keys[k] = (views[k].key(), casters.seen(views[k]).key())
        self.bakes += len(stale)
        return stale

    def _stale(self, views, casters) -> list[int]:
        """Return the views that are others, or that see others than when they were drawn."""
        same = casters.key() == self.key
        self.key = casters.key()
        found = []
        for k, view in enumerate(views):
            at, seen = self.keys[k] or (None, None)
            if at != view.key() or (not same and seen != casters.seen(view).key()):
                found.append(k)
        return found

    def _draw(self, frame, k, casters, faces):
        view, size = self.views[k], (self.resolution, self.resolution)
        casters, seen = casters.seen(view), frame.elsewhere(view, size, casting=True)
        with seen_from(casters.things, seen):
            drawn = [thing.draws(seen, depth=True) for thing in casters.things]
            self.drawer.look(view, (*self.corner(k), *size))
            # In a parallel view VTK has spheres bulge twice as far.
            bulge = self.drawer.inner.GetSize()[0] / size[0] * (0.5 if view.parallel else 1.0)
            with sized(casters.actors, frame, seen, bulge):
                self.drawer.draw_depth(casters.actors, faces=faces)
            for actors in drawn:
                self.drawer.draw(actors)

    def _features_of(self, actor):
        features = {SPHERES: draws_spheres(actor), _VEIL: self._is_veil(actor)}
        return [feature for feature, wanted in features.items() if wanted]

    def _is_veil(self, actor):
        return bool(self.veils) and actor.HasTranslucentPolygonalGeometry()

    def _draw_veil(self, view, k, casters, mode):
        rect = (*self.corner(k), self.resolution, self.resolution)
        self.drawer.look(view, rect, clear=False)
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
    """Return the sections of ``receiver.glsl``, which looks points up in depth views."""
    return sections(shader_source(__file__, 'receiver'))
