"""Glow of chosen objects, and trails of light behind them."""

from __future__ import annotations

import math

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, Target, nbytes_of, release, set_fragment_uniforms, shader_source
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, replacements, sections
from pvibr.gl.texture import filtered
from pvibr.maths.arguments import as_array, checked_each
from pvibr.maths.views import covered
from pvibr.scene.thing import Thing

_PBR = 3  # VTK_PBR
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper')
# Uniforms begin at 0, which leaves the scene's own drawing as it is.
_DRAW = """  if (ibr_glow > 0.0) gl_FragData[0] = vec4(ibr_glow * {light}, 1.0);
//VTK::DepthPeeling::Impl
"""
# Before VTK discards transparent fragments.
_SOLID = """//VTK::TCoord::Impl
  float ibr_glow_alpha = gl_FragData[0].a;
  gl_FragData[0].a = 1.0;
"""


def _feature(name, light, texts=()):
    draw = _DRAW.replace('{light}', light)
    return Feature(name, fragment={'VTK::DepthPeeling::Impl': draw, **dict(texts)})


_COLOR = _feature('glow', 'gl_FragData[0].a * gl_FragData[0].rgb')
_ALPHA = _feature(
    'glow_alpha', 'ibr_glow_alpha * gl_FragData[0].rgb', {'VTK::TCoord::Impl': _SOLID}
)
# VTK's own gamma of physically based materials.
_EMISSIVE = _feature(
    'glow_emissive', 'gl_FragData[0].a * pow(max(emissiveColor, 0.0), vec3(1.0 / 2.2))'
)


class Glow(LightSpread):
    """Chosen actors glow in the colours in which they are drawn.

    The actors are drawn once more, alone, at full resolution; the light of their visible parts is
    blurred and added to the picture. Nothing else glows, however bright it is, so that colours of
    other objects can still be read as data. Volumes cannot glow.

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
        If `actors` has something that is no actor.
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
        'Source of the light: colour, texture alpha (drawn opaque), or emissive texture (PBR).',
        choices=('color', 'alpha', 'emissive'),
    )

    _gpu: _Gpu | None = None
    _lit: tuple | list = ()

    def __init__(self, actors, weights=1.0, **settings):
        super().__init__(**settings)
        self._actors = _checked_actors(actors)
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
        """Factor of the light of each actor; assign one number for all, or one each."""
        return self._weights

    @weights.setter
    def weights(self, weights):
        count = len(self._actors)
        values = as_array('weights', weights, float)
        if values.shape not in ((), (count,)) or not (np.isfinite(values) & (values >= 0)).all():
            raise ValueError(f'weights = {weights!r}: must be a number >= 0, or {count} of them')
        self._seen = ()  # the light of other weights
        self._weights = tuple(np.broadcast_to(values, count).tolist())

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        self._lit = self._glowing(frame.renderer)
        return super().needed(frame) if self._lit else 'none of its actors is visible here'

    def _glowing(self, renderer):
        """Return the actors that glow now, each with its weight."""
        found = []
        for one, weight in zip(self._actors, self._weights, strict=True):
            if isinstance(one, Thing):
                drawn = one.drawn() if one.pipeline is self.pipeline else []
            else:
                drawn = [one] if one.GetVisibility() and renderer.HasViewProp(one) else []
            found += [(a, weight) for a in drawn if weight > 0 and self._has_source(a)]
        return found

    def _has_source(self, actor):
        prop = actor.GetProperty()
        return self.source != 'emissive' or (
            prop.GetInterpolation() == _PBR
            and prop.GetLighting()
            and prop.GetTexture('emissiveTex') is not None
        )

    def prepare(self, frame):
        """Draw the actors alone, while textures of other effects are bound."""
        if self._is_part(frame):
            return
        if self._gpu is not None and self._gpu.key != (frame.renderer, frame.size):
            self._forget()
        if self._gpu is None:
            self._gpu = _Gpu(frame.renderer, frame.size)
        feature = {'color': _COLOR, 'alpha': _ALPHA, 'emissive': _EMISSIVE}[self.source]
        self._gpu.draw(frame, self._lit, feature, frame.whole[1] / self._rows)

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
        """Return the bytes of GPU memory, and why no light was drawn."""
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

    _past: _Past | None = None
    _when = -math.inf

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run; trails outlast the actors' visibility."""
        self._lit = self._glowing(frame.renderer)
        return LightSpread.needed(self, frame)

    def cut(self):
        """End all trails, as after a cut to another scene."""
        self._when = -math.inf

    def _draw_source(self, frame, picture, target, side):
        if frame.scale > 1:  # a tile has no part in what other frames leave
            super()._draw_source(frame, picture, target, side)
            return
        if self._past is not None and self._past.size != (target.width, target.height):
            self._forget_past()
        if self._past is None:
            self._past = _Past(frame.window, (target.width, target.height))
            self.cut()
        super()._draw_source(frame, picture, self._past.now, side)
        passed = frame.time - self._when
        left = math.exp(-passed / self.fade) if 0 <= passed < math.inf else 0.0
        self._past.fade(target, left)
        self._when = frame.time

    def _forget_past(self):
        release(self._past)
        self._past = None

    def release(self):
        """Free GPU memory; the context is current."""
        super().release()
        self._forget_past()

    def report(self) -> dict:
        """Return the bytes of GPU memory, and why no light was drawn."""
        details = super().report()
        details['bytes'] += nbytes_of(self._past)
        return details


class _Gpu:
    """Draws chosen actors alone."""

    def __init__(self, renderer, size):
        self.key = renderer, size
        self.drawer = Drawer(renderer)
        self.target = Target(self.drawer.window, size[0], size[1], ('rgba16f',), depth=True)
        self._quads: dict = {}
        self._attached = _GlowFeatures()
        self._bounded: dict = {}
        self._box = 0, 0, *size
        self._seen: tuple = ()

    @property
    def nbytes(self) -> int:
        return self.target.nbytes

    def draw(self, frame, glowing, feature, side):
        """Draw actors, and nothing around them as far as squares of light reach."""
        self._match([actor for actor, _ in glowing], feature)
        view = frame.view
        around, box = math.ceil(side) + 1, self._covered(frame, view)
        left, bottom = (max(edge - around, 0) for edge in box[:2])
        right, top = (min(edge + around, n) for edge, n in zip(box[2:], frame.size, strict=True))
        with self.target.drawing():
            within = left, bottom, right - left, top - bottom
            self.drawer.light_from()  # the renderer itself does so only after this
            self.drawer.look(view, (0, 0, *frame.size), within=within)
            self.drawer.fill((0.0, 0.0, 0.0, 0.0))
            for actor, weight in glowing:
                _set_glow(actor, weight)
                for translucent in (False, True):
                    self.drawer.draw([actor], translucent=translucent)
                _set_glow(actor, 0.0)
        self.drawer.done()

    def _covered(self, frame, view):
        """Return the part of the picture that actors may cover."""
        actors = self._attached.actors()
        if frame.scale > 1 or not all(self._bounded[address(actor)] for actor in actors):
            self._seen, self._box = (), (0, 0, *frame.size)
            return self._box
        bounds = [actor.GetBounds() for actor in actors]
        thickness = [_thickness(actor.GetProperty()) for actor in actors]
        seen = view.view_from_world.tobytes(), view.clip_from_view.tobytes(), bounds, thickness
        if seen != self._seen:
            self._seen, self._box = seen, _box(view, bounds, thickness, frame.size)
        return self._box

    def _match(self, actors, feature):
        """Attach the feature to exactly these actors."""
        changed = self._attached.match(
            actors, lambda _: (feature,), lambda actor: (feature, *_shader_version(actor))
        )
        self._bounded |= {address(actor): _is_within_bounds(actor) for actor in changed}

    def detach(self):
        """Restore the shaders of all actors."""
        self._attached.clear()

    def light(self, frame, picture, target, side):
        """Draw the light of visible parts, in squares of so many pixels along each side."""
        taps = max(math.ceil(side / 2), 1)
        if taps not in self._quads:
            text = sections(shader_source(__file__))['source']
            text = f'#define TAPS {taps}\n{text}'
            self._quads[taps] = Quad(frame.window, text, 'glow source')
        one = 1 / frame.pixel_scale
        uniforms = {
            'side': float(side),
            'pixels': picture.size,
            'projection': frame.clip_from_view[2:, 2:].ravel().tolist(),
            'pixel_size': (one, 0.0) if frame.parallel else (0.0, one),
        }
        glow = self.target.colors[0]
        textures = {'glow': glow, 'own': self.target.depth, 'scene': picture.depth}
        left, bottom = (math.floor(edge / side) for edge in self._box[:2])
        right, top = (math.ceil(edge / side) for edge in self._box[2:])
        with filtered(glow), target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            frame.window.GetState().vtkglScissor(left, bottom, right - left, top - bottom)
            self._quads[taps].draw(uniforms, textures)

    def release(self):
        self.detach()
        release(*self._quads.values(), self.target, self.drawer)


class _Past:
    """Light of this frame and of earlier ones."""

    def __init__(self, window, size):
        self.size = size
        self.now, self._before, self._after = (
            Target(window, size[0], size[1], ('rgba32f',)) for _ in range(3)
        )
        text = sections(shader_source(__file__))['fade']
        self._fade = Quad(window, text, 'afterglow fade')

    @property
    def nbytes(self) -> int:
        return self.now.nbytes * 3

    def fade(self, target, left):
        for drawn in (self._after, target):
            textures = {'light': self.now.colors[0], 'past': self._before.colors[0]}
            drawn.draw(self._fade, {'left': left}, textures)
        self._before, self._after = self._after, self._before

    def release(self):
        release(self.now, self._before, self._after, self._fade)


def _checked_actors(actors):
    return checked_each('actors', actors, _can_glow, 'actors, as add_mesh returns, or instances')


def _can_glow(one) -> bool:
    return isinstance(one, Thing | _vtk.vtkActor)


class _GlowFeatures(FeatureSet):
    """Draws actors as light, including fragments that VTK would discard as transparent."""

    def __init__(self):
        super().__init__()
        self._opaque: dict = {}

    def _attach(self, actor, features):
        if _ALPHA in features:
            self._opaque[address(actor)] = actor.GetForceOpaque()
            actor.ForceOpaqueOn()
        super()._attach(actor, features)

    def _detach(self, actor, features):
        super()._detach(actor, features)
        if _ALPHA in features:
            actor.SetForceOpaque(self._opaque.pop(address(actor)))


def _shader_version(actor) -> tuple:
    shader = actor.GetShaderProperty()
    return actor.GetMapper(), shader, shader.GetMTime()


def _is_within_bounds(actor) -> bool:
    """Return True if an actor draws within its bounds, but for thick lines and points."""
    shader = actor.GetShaderProperty()
    moved = shader.HasVertexShaderCode() or any(
        stage == 'Vertex' for stage, _ in replacements(shader)
    )
    return actor.GetMapper().GetClassName() in _MAPPERS and not moved


def _box(view, bounds, thickness, size):
    """Return the part of a picture within bounds."""
    if not bounds:
        return 0, 0, 0, 0
    around = math.ceil(max(thickness)) + 1
    box = covered(view, bounds, size)
    left, bottom = (max(edge - around, 0) for edge in box[:2])
    right, top = (min(edge + around, n) for edge, n in zip(box[2:], size, strict=True))
    return left, bottom, max(right, left), max(top, bottom)


def _thickness(prop):
    return max(prop.GetLineWidth(), prop.GetPointSize())


def _set_glow(actor, weight):
    set_fragment_uniforms([actor], {'ibr_glow': weight})
