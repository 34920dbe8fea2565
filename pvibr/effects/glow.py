"""Glow of chosen objects, and trails of light behind them."""

from __future__ import annotations

import math

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.arguments import as_array, checked_each
from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, Target, nbytes_of, release, set_fragment_uniforms, shader_source
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, moves_vertices, sections
from pvibr.gl.texture import filtered
from pvibr.maths.views import covered
from pvibr.things.plain_actors import is_composed
from pvibr.things.thing import Thing

_PBR = 3  # VTK_PBR
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper')
# The uniform is 0 by default, which leaves the scene's own drawing unchanged.
_DRAW = """  if (ibr_glow > 0.0) gl_FragData[0] = vec4(ibr_glow * {light}, 1.0);
//VTK::DepthPeeling::Impl
"""
# Before VTK discards transparent fragments.
_SOLID = """//VTK::TCoord::Impl
  float ibr_glow_alpha = gl_FragData[0].a;
  gl_FragData[0].a = 1.0;
"""


def _feature(name, light_code, replacements_before=()):
    draw_code = _DRAW.replace('{light}', light_code)
    return Feature(
        name, fragment={'VTK::DepthPeeling::Impl': draw_code, **dict(replacements_before)}
    )


_COLOR = _feature('glow', 'gl_FragData[0].a * gl_FragData[0].rgb')
_ALPHA = _feature(
    'glow_alpha', 'ibr_glow_alpha * gl_FragData[0].rgb', {'VTK::TCoord::Impl': _SOLID}
)
# VTK's own gamma of physically based materials.
_EMISSIVE = _feature(
    'glow_emissive', 'gl_FragData[0].a * pow(max(emissiveColor, 0.0), vec3(1.0 / 2.2))'
)


class Glow(LightSpread):
    """Chosen actors glow in their own colours.

    The actors are drawn once more, alone, at full resolution; the light of their visible parts is
    blurred and added to the picture. Nothing else glows, however bright, so colours of other
    objects can still be read as data. Volumes cannot glow.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of them
        Actors or instances of the same subplot that glow.
    weights : float or sequence of float, optional
        Factor of the light of all actors, or of each; not negative.
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        If an item of `actors` cannot glow.
    ValueError
        If weights are negative, not finite, or not one per actor.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> lamp = pl.add_mesh(pv.Sphere(), color='orange')
    >>> glow = pl.ibr.add(pvibr.Glow(lamp, intensity=2.0))
    >>> glow.weights
    (1.0,)
    """

    once = True
    presets = {
        'subtle': {'intensity': 0.5, 'spread': 0.3},
        'strong': {'intensity': 2.0, 'spread': 0.8},
    }
    source = Param(
        'color',
        'Source of the light: the drawn colour, the texture alpha (drawn opaque), or the emissive '
        'texture (PBR).',
        choices=('color', 'alpha', 'emissive'),
    )

    _gpu: _Gpu | None = None
    _glowing_actors: tuple | list = ()

    def __init__(self, actors, weights=1.0, **settings):
        super().__init__(**settings)
        allowed = 'actors, as add_mesh returns, or instances'
        self._actors = checked_each('actors', actors, _may_glow, allowed)
        self.weights = weights

    @classmethod
    def sample(cls, actors):
        """Return an instance with the first actor."""
        return cls(actors[:1])

    @property
    def actors(self) -> tuple:
        """The actors that glow."""
        return self._actors

    @property
    def weights(self) -> tuple[float, ...]:
        """Factor of each actor's light; assign one for all, or one each."""
        return self._weights

    @weights.setter
    def weights(self, weights):
        actor_count = len(self._actors)
        weight_array = as_array('weights', weights, float)
        is_valid = (np.isfinite(weight_array) & (weight_array >= 0)).all()
        if weight_array.shape not in ((), (actor_count,)) or not is_valid:
            raise ValueError(
                f'weights must be a number >= 0, or {actor_count} of them, got {weights!r}'
            )
        self._last_whole = ()  # its light had other weights
        self._weights = tuple(np.broadcast_to(weight_array, actor_count).tolist())

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        self._glowing_actors = self._glowing(frame.renderer)
        return super().needed(frame) if self._glowing_actors else 'none of its actors is visible'

    def _glowing(self, renderer):
        """Return the actors that glow in this frame, each with its weight."""
        weighted_actors = []
        for item, weight in zip(self._actors, self._weights, strict=True):
            if isinstance(item, Thing):
                actors = item.drawn() if item.pipeline is self.pipeline else []
            else:
                plain_actors = self.pipeline.surfaces.plain_actors
                actors = plain_actors.of(item) if renderer.HasViewProp(item) else []
                actors = [actor for actor in actors if actor.GetVisibility()]
            weighted_actors += [(a, weight) for a in actors if weight > 0 and self._has_source(a)]
        return weighted_actors

    def _has_source(self, actor):
        prop = actor.GetProperty()
        return self.source != 'emissive' or (
            prop.GetInterpolation() == _PBR
            and prop.GetLighting()
            and prop.GetTexture('emissiveTex') is not None
        )

    def prepare(self, frame):
        """Draw the actors alone while the textures of other effects are bound."""
        if self._reuses_light(frame):
            return
        if self._gpu is not None and self._gpu.key != (frame.renderer, frame.size):
            self._forget()
        if self._gpu is None:
            self._gpu = _Gpu(frame.renderer, frame.size)
        feature = {'color': _COLOR, 'alpha': _ALPHA, 'emissive': _EMISSIVE}[self.source]
        self._gpu.draw(frame, self._glowing_actors, feature, frame.whole[1] / self.light_rows)

    def deactivate(self):
        """Restore the shaders of the actors."""
        if self._gpu is not None:
            self._gpu.detach()

    def _draw_source(self, frame, picture, target, side):
        if self._gpu is not None:
            self._gpu.light(frame, picture, target, side)

    def _forget(self):
        release(self._gpu)
        self._gpu = None

    def report(self) -> dict:
        """Return GPU memory in bytes, and why no light was drawn."""
        details = super().report()
        details['bytes'] += nbytes_of(self._gpu)
        return details


class Afterglow(Glow):
    """A glow that fades over time, so that moving objects leave trails of light.

    Light decays exponentially in ``plotter.ibr.time``, independent of the frame rate; the maximum
    of old and new light is shown. Going back in time, resizing the picture or calling :meth:`cut`
    ends all trails.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of them
        Actors or instances of the same subplot that glow.
    weights : float or sequence of float, optional
        Factor of the light of all actors, or of each; not negative.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> trail = pl.ibr.add(pvibr.Afterglow(pl.add_mesh(pv.Sphere()), fade=0.2))
    >>> trail.cut()
    """

    presets = {
        'subtle': {'intensity': 0.5, 'fade': 0.3},
        'strong': {'intensity': 2.0, 'fade': 2.0},
    }
    fade = Param(0.5, 'Time constant of the decay.', range='(0, inf)', unit='s')

    _trail: _Trail | None = None
    _last_time = -math.inf

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run; trails outlast the actors' visibility."""
        self._glowing_actors = self._glowing(frame.renderer)
        return LightSpread.needed(self, frame)

    def cut(self):
        """End all trails, as after a cut to another scene."""
        self._last_time = -math.inf

    def _draw_source(self, frame, picture, target, side):
        if frame.scale > 1:  # tiles leave no trails
            super()._draw_source(frame, picture, target, side)
            return
        trail_size = target.width, target.height
        if self._trail is not None and self._trail.size != trail_size:
            self._forget_trail()
        if self._trail is None:
            self._trail = _Trail(frame.window, trail_size)
            self.cut()
        super()._draw_source(frame, picture, self._trail.now, side)
        elapsed = frame.time - self._last_time
        remaining = math.exp(-elapsed / self.fade) if 0 <= elapsed < math.inf else 0.0
        self._trail.fade(target, remaining)
        self._last_time = frame.time

    def _forget_trail(self):
        release(self._trail)
        self._trail = None

    def release(self):
        """Free GPU memory; the context is current."""
        super().release()
        self._forget_trail()

    def report(self) -> dict:
        """Return GPU memory in bytes, and why no light was drawn."""
        details = super().report()
        details['bytes'] += nbytes_of(self._trail)
        return details


class _Gpu:
    """Draws chosen actors alone."""

    def __init__(self, renderer, size):
        self.key = renderer, size
        self.drawer = Drawer(renderer)
        self.target = Target(self.drawer.window, size[0], size[1], ('rgba16f',), depth=True)
        self._quads: dict = {}
        self._glow_features = _GlowFeatures()
        self._within_bounds: dict = {}
        self._covered_box = 0, 0, *size
        self._box_key: tuple = ()

    @property
    def nbytes(self) -> int:
        return self.target.nbytes

    def draw(self, frame, glowing_actors, feature, texel_size):
        """Draw actors, and clear a margin around them as wide as a texel of the light."""
        self._match([actor for actor, _ in glowing_actors], feature)
        view = frame.view
        box = self._covered(frame, view)
        grown = _grown(box, math.ceil(texel_size) + 1, frame.size)
        with self.target.drawing():
            viewport = (*grown[:2], *np.subtract(grown[2:], grown[:2]).tolist())
            self.drawer.light_from()  # the renderer does so only later
            self.drawer.look(view, (0, 0, *frame.size), within=viewport)
            self.drawer.fill((0.0, 0.0, 0.0, 0.0))
            for actor, weight in glowing_actors:
                _set_glow(actor, weight)
                for translucent in (False, True):
                    self.drawer.draw([actor], translucent=translucent)
                _set_glow(actor, 0.0)
        self.drawer.done()

    def _covered(self, frame, view):
        """Return the rectangle of the picture that actors may cover."""
        actors = self._glow_features.actors()
        if frame.scale > 1 or not all(self._within_bounds[address(actor)] for actor in actors):
            self._box_key, self._covered_box = (), (0, 0, *frame.size)
            return self._covered_box
        bounds = [actor.GetBounds() for actor in actors]
        props = [actor.GetProperty() for actor in actors]
        line_widths = [max(prop.GetLineWidth(), prop.GetPointSize()) for prop in props]
        box_key = view.key(), bounds, line_widths
        if box_key != self._box_key:
            self._box_key = box_key
            self._covered_box = _covered_rect(view, bounds, line_widths, frame.size)
        return self._covered_box

    def _match(self, actors, feature):
        """Attach the feature to exactly these actors."""
        new_actors = self._glow_features.match(
            actors, lambda _: (feature,), lambda actor: (feature, *_shader_version(actor))
        )
        self._within_bounds |= {address(actor): _is_within_bounds(actor) for actor in new_actors}

    def detach(self):
        """Restore the shaders of all actors."""
        self._glow_features.clear()

    def light(self, frame, picture, target, texel_size):
        """Draw the light of visible parts into texels of `side` pixels."""
        taps = max(math.ceil(texel_size / 2), 1)
        if taps not in self._quads:
            text = sections(shader_source(__file__))['source']
            text = f'#define TAPS {taps}\n{text}'
            self._quads[taps] = Quad(frame.window, text, 'glow source')
        pixel_size = 1 / frame.pixel_scale
        uniforms = {
            'texel_size': float(texel_size),
            'picture_size': picture.size,
            'projection': frame.clip_from_view[2:, 2:].ravel().tolist(),
            'pixel_size': (pixel_size, 0.0) if frame.parallel else (0.0, pixel_size),
        }
        glow = self.target.colors[0]
        textures = {'glow': glow, 'glow_depth': self.target.depth, 'scene_depth': picture.depth}
        low = np.floor(np.divide(self._covered_box[:2], texel_size)).astype(int)
        high = np.ceil(np.divide(self._covered_box[2:], texel_size)).astype(int)
        with filtered(glow), target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            frame.window.GetState().vtkglScissor(*low.tolist(), *(high - low).tolist())
            self._quads[taps].draw(uniforms, textures)

    def release(self):
        self.detach()
        release(*self._quads.values(), self.target, self.drawer)


class _Trail:
    """The light of this frame, and what remains of earlier frames."""

    def __init__(self, window, size):
        self.size = size
        self.now, self._before, self._after = (
            Target(window, size[0], size[1], ('rgba32f',)) for _ in range(3)
        )
        self._fade = Quad(window, sections(shader_source(__file__))['fade'], 'afterglow fade')

    @property
    def nbytes(self) -> int:
        return self.now.nbytes * 3

    def fade(self, target, remaining):
        textures = {'light': self.now.colors[0], 'past': self._before.colors[0]}
        for destination in (self._after, target):
            destination.draw(self._fade, {'remaining': remaining}, textures)
        self._before, self._after = self._after, self._before

    def release(self):
        release(self.now, self._before, self._after, self._fade)


class _GlowFeatures(FeatureSet):
    """Features that draw actors as light, even fragments that VTK discards as transparent."""

    def __init__(self):
        super().__init__()
        self._force_opaque: dict = {}

    def _attach(self, actor, features):
        if _ALPHA in features:
            self._force_opaque[address(actor)] = actor.GetForceOpaque()
            actor.ForceOpaqueOn()
        super()._attach(actor, features)

    def _detach(self, actor, features):
        super()._detach(actor, features)
        if _ALPHA in features:
            actor.SetForceOpaque(self._force_opaque.pop(address(actor)))


def _may_glow(item) -> bool:
    """Return whether an object is a thing, or a prop that actors draw."""
    return isinstance(item, Thing | _vtk.vtkActor) or (
        isinstance(item, _vtk.vtkProp) and is_composed(item)
    )


def _shader_version(actor) -> tuple:
    shader = actor.GetShaderProperty()
    return actor.GetMapper(), shader, shader.GetMTime()


def _is_within_bounds(actor) -> bool:
    """Return True if an actor draws within its bounds, thick lines and points aside."""
    is_plain = actor.GetMapper().GetClassName() in _MAPPERS
    return is_plain and not moves_vertices(actor.GetShaderProperty())


def _covered_rect(view, actor_bounds, line_widths, picture_size):
    """Return the rectangle of a picture that actors with these bounds may cover."""
    if not actor_bounds:
        return 0, 0, 0, 0
    box = covered(view, actor_bounds, picture_size)
    grown = _grown(box, math.ceil(max(line_widths)) + 1, picture_size)
    return (*grown[:2], *np.maximum(grown[:2], grown[2:]).tolist())


def _grown(box, margin, size):
    """Return a rectangle with a margin around it, within a picture."""
    low = [max(edge - margin, 0) for edge in box[:2]]
    return *low, *(min(edge + margin, n) for edge, n in zip(box[2:], size, strict=True))


def _set_glow(actor, weight):
    set_fragment_uniforms([actor], {'ibr_glow': weight})
