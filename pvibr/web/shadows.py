"""Shadows that a page draws: maps of one light, filtered by pvibr's own shader."""

from __future__ import annotations

import numpy as np

from pvibr.gl import set_fragment_uniforms, set_vertex_uniforms
from pvibr.shadows.nearest import texts
from pvibr.shadows.shadow_maps import CASCADES, filter_of, filter_radius, light_size
from pvibr.shadows.shadows import receiver_feature
from pvibr.things.casters import SPHERES, set_surface_uniforms, surface_features
from pvibr.web.programs import as_quad

#: Views around the eye, beside those of the whole scene: pages keep those of the export.
_VIEWS = 3
_RESOLUTION = 2048  # most texels along a side of each view
_FILTER = 0.5, 3.0  # least and largest radius of the filter, texels


class PageShadows:
    """The shadows of one light, and the shader of what receives them."""

    def __init__(self, effect, frame):
        self.effect = effect
        self.light, whole, cascades = effect.light_of_page(frame, CASCADES)
        finest = sorted(cascades, key=lambda cascade: cascade.level)
        kept = finest[:: max(-(-len(finest) // _VIEWS), 1)][:_VIEWS]
        self.views = [*whole, *(cascade.view for cascade in kept)]
        self.columns = int(np.ceil(np.sqrt(len(self.views))))
        self.rows = -(-len(self.views) // self.columns)
        self.resolution = min(effect.resolution, _RESOLUTION)
        radius = float(np.clip(filter_radius(effect), *_FILTER))
        self.radius = radius if effect.method == 'pcf' else _FILTER[0]
        light = (self.light.number, self.light.positional, len(whole), len(kept))
        is_soft = effect.method == 'pcss'
        self.kind = ('window', int(np.ceil(2 * self.radius)) + 1)
        if effect.method in ('hard', 'pcss'):
            self.kind = filter_of(effect)
        sizes = [light_size(effect, view, frame, whole[0]) for view in self.views]
        self.sizes = sizes if is_soft else [[0.0, 0.0]] * len(sizes)
        multisampled = frame.window.GetMultiSamples() > 1
        lights = ((*light, self.columns, self.rows, False),)
        offset = effect.bias == 'polygon_offset'
        self._feature = receiver_feature(*self.kind, offset, multisampled, lights)

    def attach(self, actor):
        """Let an actor receive the shadows."""
        features = [f for f in surface_features(actor) if f is not SPHERES]
        for feature in (self._feature, *features):
            feature.attach(actor)
        set_surface_uniforms(actor, features, casts=False)
        ahead = {'ibr_ahead': (0.0, 1.0)}
        set_vertex_uniforms([actor], {'ibr_view_from_clip': np.zeros((1, 4, 4))} | ahead)
        views = {'ibr_shadow_view': np.zeros((len(self.views), 4, 4))}
        set_fragment_uniforms([actor], ahead | views | self._uniforms())

    def _uniforms(self) -> dict:
        number = self.light.number
        return {
            'ibr_shadow_normal_bias': float(self.effect.normal_bias),
            'ibr_shadow_polygon': tuple(map(float, self.effect.polygon_offset)),
            'ibr_shadow_filter_radius': self.radius,
            'ibr_shadow_strength': float(self.effect.strength),
            'ibr_shadow_dither': 0.0,
            'ibr_shadow_taps': max(self.kind[1], 1),
            f'ibr_shadow_size_{number}': float(self.resolution),
            f'ibr_shadow_place_{number}': (0.0, 0.0, 0.0),
        }

    def tree(self) -> dict:
        """Return the light's views and the uniforms of receivers."""
        return {
            'light': self.light.number,
            'place': self.light.homogeneous().tolist(),
            'columns': self.columns,
            'rows': self.rows,
            'resolution': self.resolution,
            'uniforms': self._uniforms(),
            'views': [view_tree(view) for view in self.views],
            'sizes': self.sizes,
            'nearest': list(map(as_quad, texts())) if self.kind[0] == 'pcss' else None,
        }


def view_tree(view) -> dict:
    """Return a view of a depth map as a page holds it."""
    return {
        'eye_from_world': view.view_from_world.T.ravel().tolist(),
        'clip_from_eye': view.clip_from_view.T.ravel().tolist(),
        'near': view.near,
        'far': view.far,
        'parallel': view.parallel,
    }


def lost_of(effect) -> list[tuple[str, str]]:
    """Return what a page does not draw of shadows: names and why."""
    lost = []
    if effect.method not in ('hard', 'pcf', 'pcss'):
        why = 'pages filter maps (pcf), whose edges are sharp'
        lost.append((f'{effect.name}, method {effect.method!r}', why))
    others = effect.lights_casting - 1
    if others > 0:
        lost.append((f'{effect.name} of {others} more', 'pages draw those of one light'))
    return lost
