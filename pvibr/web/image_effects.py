"""Image effects that a page draws: pvibr's own programs, pass by pass, and what feeds them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.plotters import names_of
from pvibr.effects import ambient_occlusion
from pvibr.effects.ambient_occlusion import AmbientOcclusion
from pvibr.effects.backgrounds import Sky, sky_axes
from pvibr.effects.bloom import Bloom, bright_text
from pvibr.effects.fog import Fog
from pvibr.effects.outline import Outline
from pvibr.effects.screen import Vignette
from pvibr.effects.tone_mapping import ToneMapping, map_text
from pvibr.gl import shader_source
from pvibr.gl.blur import PASSES, texts
from pvibr.gl.feature import sections
from pvibr.maths.tones import CURVES
from pvibr.maths.vectors import unit_vectors
from pvibr.things.thing import Thing
from pvibr.web.programs import as_quad


class _Recorder:
    """A picture that records pointwise programs in place of drawing them."""

    color, depth = 'color', 'depth'

    def __init__(self):
        self.points: list = []

    def apply(self, point):
        """Record a program."""
        self.points.append(point)


def is_drawn(effect) -> bool:
    """Return whether a page draws an image effect."""
    return type(effect) in _PASSES


def stage_of(effects, frame) -> dict | None:
    """Return the passes of a subplot's image effects in their order, None without any."""
    effects = [effect for effect in effects if is_drawn(effect)]
    if not effects:
        return None
    effects[0].pipeline.make_current()
    passes = [tree for effect in effects for tree in _PASSES[type(effect)](effect, frame)]
    return {
        'floats': any(effect.needs_hdr for effect in effects),
        'on_black': any(effect.draws_background for effect in effects),
        'surfaces': any(isinstance(e, Outline) and e.surfaces for e in effects),
        'passes': passes,
    }


def lost_of(effect) -> list[tuple[str, str]]:
    """Return what a page does not draw of an image effect: names and why."""
    if isinstance(effect, ToneMapping) and effect.auto:
        return [(f'{effect.name}, auto', 'the exposure stays that of the export')]
    if isinstance(effect, Outline) and effect.hidden != 'absent':
        return [(f'{effect.name}, hidden', 'pages draw visible lines only')]
    return []


def _pass(text, uniforms, textures, *, view=None, blend='', **target) -> dict:
    """Return a pass; `view` has the uniforms that the page computes, by kind and parameters."""
    view = view or {}
    return {
        'fragment': as_quad(text),
        'uniforms': {name: v for name, v in uniforms.items() if name not in view},
        'view': {name: list(kind) for name, kind in view.items()},
        'textures': textures,
        'blend': blend,
        **target,
    }


def _recorded(effect, frame, view) -> list[dict]:
    """Return the pointwise programs of an effect, of which it keeps uniforms and images."""
    recorder = _Recorder()
    effect.render(frame, recorder)
    passes = []
    for point in recorder.points:
        images = {n: _texels(t) for n, t in point.textures.items()}
        textures = {'color': 'color'} | images
        uniforms = {n: _plain(v) for n, v in point.uniforms.items()}
        passes.append(_pass(point.text, uniforms, textures, view=view, blend=point.blend))
    return passes


def _texels(texture):
    return texture if isinstance(texture, str) else np.ascontiguousarray(texture.download())


def _plain(value):
    if isinstance(value, np.ndarray):
        return value.T.ravel().tolist()
    return list(value) if isinstance(value, tuple) else value


def _fog(effect, frame):
    up = unit_vectors(effect.up)
    rise = 'rise', up.tolist(), float(effect.base)
    view = {'view_from_clip': ('view_from_clip',), 'parallel': ('parallel',), 'rise': rise}
    return _recorded(effect, frame, view)


def _sky(effect, frame):
    axes = sky_axes(effect.up, effect.turn)
    return _recorded(effect, frame, {'sky_from_clip': ('sky', axes.tolist())})


def _tone_mapping(effect, frame):
    stops = float(effect.stops)
    text = map_text(CURVES.index(effect.curve), int(stops != 0), 0)
    uniforms = {'stops': stops, 'white': effect.white, 'intensity': effect.intensity}
    return [_pass(text, uniforms, {'color': 'color'})]


def _vignette(effect, frame):
    return _recorded(effect, frame, {'corner_offset': ('half_diagonals', list(effect.center))})


def _bloom(effect, frame):
    rows, count = effect.light_rows, effect.level_count()
    programs, (halve, mix) = texts(effect.kernel), PASSES[effect.chain]
    mapping: Any = next((e for e in effect.pipeline.effects if isinstance(e, ToneMapping)), None)
    stops = 0.0 if mapping is None or not mapping.enabled else float(mapping.stops)
    defines = effect.choices() | {'FLOATS': 1, 'WHOLE': 0, 'METERED': 0}
    uniforms = {
        'limits': list(effect.limits(stops)),
        'background': float(effect.background),
        'saturation': effect.saturation,
        'firefly_reduction': effect.firefly_reduction,
    }
    view = {'picture_size': ('picture_size',), 'texel_size': ('texel_size', rows)}

    def target(name, x, y):
        return {'target': name, 'rows': rows, 'halvings': [x, y]}

    def extent(level, axis):
        return {'extent': ('extent', rows, level, axis)}

    text = bright_text(defines)
    bright = _pass(text, uniforms, {'color': 'color'}, view=view, **target('source', 0, 0))
    passes, image = [bright | {'taps': rows}], 'source'
    for k in range(count):
        steps = [(k + 1, k + 1, 2, f'small{k}')]
        if effect.chain == 'gaussian':
            steps = [(k + 1, k, 0, f'tall{k}'), (k + 1, k + 1, 1, f'small{k}')]
        for x, y, axis, name in steps:
            along = {'axis': [1 - axis, axis]} if axis < 2 else {}
            view, to = extent(k, axis), target(name, x, y)
            passes.append(_pass(programs[halve], along, {'image': image}, view=view, **to))
            image = name
    for k in reversed(range(count - 1)):
        images, to = {'image': f'small{k}', 'wide': image}, target(f'mixed{k}', k + 1, k + 1)
        share, view = {'share': effect.spread}, extent(k + 2, 2)
        passes.append(_pass(programs[mix], share, images, view=view, **to))
        image = f'mixed{k}'
    text, view = '#define WHOLE 0\n' + programs['add'], {'place': ('light_place', rows)}
    uniforms = {'shift': [0.0, 0.0], 'intensity': effect.intensity}
    light = _pass(text, uniforms, {'light': image}, view=view, blend=effect.blend)
    return [*passes, light]


def _ambient_occlusion(effect, frame):
    programs = sections(shader_source(ambient_occlusion.__file__))
    view = {'lens': ('lens',), 'planes': ('planes',), 'parallel': ('parallel',)}
    search = {'coarse': 1} | effect.search_uniforms(frame)
    search |= {'vary': [0.0, 0.0, 0.0]}
    apply = {'coarse': 1, 'strength': effect.strength, 'exempts': 0}
    apply['edges'] = int(frame.window.GetMultiSamples() > 1)
    textures = {'color': 'color', 'visibility': 'visibility', 'depth': 'depth'}
    textures['unlit_depth'] = 'depth'
    return [
        _pass(
            programs['common'] + programs['search'],
            search,
            {'depth': 'depth'},
            view=view,
            target='visibility',
        ),
        _pass(programs['common'] + programs['apply'], apply, textures, view=view),
    ]


def _outline(effect, frame):
    uniforms = effect.edge_uniforms(frame)
    surfaces: dict[str, Any] = {'surface': 'surface', 'depth': 'surface_depth', 'scene': 'depth'}
    surfaces |= {'color': 'color', 'chosen': 'white'}
    if effect.actors is not None:
        surfaces['chosen'] = {'names': _names_of(effect, frame.renderer)}
    view = {'pixel': ('pixel',), 'planes': ('planes',), 'lens': ('outline_lens',)}
    uniforms = {name: _plain(value) for name, value in uniforms.items()} | {'corner': [0.0, 0.0]}
    candidates = _pass(
        effect.program_text('candidates'),
        uniforms,
        surfaces,
        view=view,
        target='candidates',
        share=2,
    )
    passes, edges = [candidates], 'candidates'
    if effect.surfaces:
        textures = surfaces | {'candidates': 'candidates'}
        text = effect.program_text('edges')
        passes.append(_pass(text, uniforms, textures, view=view, target='edges', share=2))
        edges = 'edges'
    lines = {'width': effect.width, 'dash': effect.dash, 'ink': list(effect.ink), 'veiled': 0}
    lines |= {'corner': [0.0, 0.0], 'reach': math.ceil(effect.width / 2)}
    textures = {'edges': edges, 'squares': 'white', 'veil': 'white'}
    text = f'#define SIDE {1 << 20}\n{effect.program_text("lines")}'
    return [*passes, _pass(text, lines, textures, blend='over')]


def _names_of(effect, renderer) -> list[str]:
    names = names_of(renderer)
    chosen: Any = effect.actors
    return [e.name if isinstance(e, Thing) else names.get(address(e), '') for e in chosen]


_PASSES: dict[Any, Callable] = {
    AmbientOcclusion: _ambient_occlusion,
    Sky: _sky,
    Fog: _fog,
    Bloom: _bloom,
    ToneMapping: _tone_mapping,
    Outline: _outline,
    Vignette: _vignette,
}
