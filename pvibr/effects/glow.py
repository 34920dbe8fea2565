"""Chosen objects shine, and may leave trails of light."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, Target, set_fragment_uniforms, shader_source
from pvibr.gl.blur import filtered
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet, replacements, sections
from pvibr.maths.views import View, covered
from pvibr.scene.thing import Thing

_PBR = 3  # VTK_PBR
_STEP = 16  # pixels: of the largest squares of light, a multiple of all others
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper')
# Zero, as any uniform is at first, leaves the scene's own drawing alone.
_DRAW = """  if (ibr_glow > 0.0) gl_FragData[0] = vec4(ibr_glow * {light}, 1.0);
//VTK::DepthPeeling::Impl
"""
# Before VTK leaves out what has no alpha.
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
# VTK's own way from light to the display for physically based materials.
_EMISSIVE = _feature(
    'glow_emissive', 'gl_FragData[0].a * pow(max(emissiveColor, 0.0), vec3(1.0 / 2.2))'
)


class Glow(LightSpread):
    """Chosen actors shine over their surroundings, in the colours in which they are drawn.

    They are drawn once more, alone, and their light is blurred and added where something else
    does not hide them. Nothing else shines, however bright it is, so that colours that are read
    as values stay. Volumes cannot be chosen. Drawn at the picture's own size: an actor of many
    triangles costs its time again.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of them
        What shines; of the same subplot.
    strengths : float or sequence of float, optional
        How much each does, from 0; one for all, or one each.
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        Where something is no actor.
    ValueError
        Where strengths are negative, not finite, or not as many as actors.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> lamp = pl.add_mesh(pv.Sphere(), color='orange')
    >>> glow = pl.ibr.add(pvibr.Glow(lamp, intensity=2.0))
    >>> glow.strengths
    (1.0,)
    """

    source = Param(
        'color',
        'What shines: the colours that are drawn, by their opacity; the same, by the '
        'alpha of a texture, which is then drawn opaque; or the emissive texture of physically '
        'based materials alone.',
        choices=('color', 'alpha', 'emissive'),
    )

    _gpu: Any = None
    _lit: tuple | list = ()

    def __init__(self, actors, strengths=1.0, **settings):
        super().__init__(**settings)
        self._actors = _checked_actors(actors)
        self.strengths = strengths

    @property
    def actors(self) -> tuple:
        """What shines."""
        return self._actors

    @property
    def strengths(self) -> tuple[float, ...]:
        """How much each actor shines; set one number for all, or one each."""
        return self._strengths

    @strengths.setter
    def strengths(self, strengths):
        count = len(self._actors)
        values = np.asarray(strengths, float)
        if values.shape not in ((), (count,)) or not (np.isfinite(values) & (values >= 0)).all():
            msg = f'strengths = {strengths!r}: must be a number from 0, or {count} of them'
            raise ValueError(msg)
        self._seen = ()  # light of other strengths
        self._strengths = tuple(np.broadcast_to(values, count).tolist())

    def needed(self, frame):
        """Tell whether a frame needs it."""
        self._lit = self._shining(frame.renderer)
        if not self._lit:
            return 'none of its actors is in the subplot, visible and of any strength'
        return super().needed(frame)

    def _shining(self, renderer):
        """Return the actors that shine now, each with its strength."""
        found = []
        for one, strength in zip(self._actors, self._strengths, strict=True):
            if isinstance(one, Thing):
                drawn = one.drawn() if one.pipeline is self.pipeline else []
            else:
                drawn = [one] if one.GetVisibility() and renderer.HasViewProp(one) else []
            found += [(a, strength) for a in drawn if strength > 0 and self._has_source(a)]
        return found

    def _has_source(self, actor):
        prop = actor.GetProperty()
        return self.source != 'emissive' or (
            prop.GetInterpolation() == _PBR
            and prop.GetLighting()
            and prop.GetTexture('emissiveTex') is not None
        )

    def prepare(self, frame):
        """Draw the actors alone, while the textures of other effects are bound."""
        if self._is_part(frame):
            return
        if self._gpu is not None and self._gpu.key != (frame.renderer, frame.size):
            self._forget()
        if self._gpu is None:
            self._gpu = _Gpu(frame.renderer, frame.size)
        feature = {'color': _COLOR, 'alpha': _ALPHA, 'emissive': _EMISSIVE}[self.source]
        self._gpu.draw(frame, self._lit, feature)

    def deactivate(self):
        """Draw the actors as they are: frames are drawn without it now."""
        if self._gpu is not None:
            self._gpu.detach()

    def _draw_source(self, frame, picture, target, side):
        self._gpu.light(frame, picture, target, side // 2)

    def _forget(self):
        if self._gpu is not None:
            self._gpu.release()
            self._gpu = None

    def report(self) -> dict:
        """Return what it has to tell; see :meth:`pvibr.Effect.report`."""
        details = super().report()
        details['bytes'] += self._gpu.nbytes if self._gpu else 0
        return details


class Afterglow(Glow):
    """A glow that fades in time: what moves, or is passed by the camera, leaves a trail.

    Light falls to 1 / e of itself in `fade` seconds of ``plotter.ibr.time``, in however many
    frames; where it is shown again, the brighter one counts. Time that goes back, another size of
    the picture, or :meth:`cut` ends all trails.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of them
        What shines; of the same subplot.
    strengths : float or sequence of float, optional
        How much each does, from 0; one for all, or one each.
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

    fade = Param(0.5, 'Time in which a trail falls to 1 / e.', range='(0, inf)', unit='s')

    _past: Any = None

    def needed(self, frame):
        """Tell whether a frame needs it."""
        # Trails outlast what made them.
        self._lit = self._shining(frame.renderer)
        return self.intensity > 0 or 'intensity is 0'

    def cut(self):
        """End all trails: what was drawn so far is another scene."""
        self._when = -math.inf

    _when = -math.inf

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
        if self._past is not None:
            self._past.release()
            self._past = None

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        super().release()
        self._forget_past()

    def report(self) -> dict:
        """Return what it has to tell; see :meth:`pvibr.Effect.report`."""
        details = super().report()
        details['bytes'] += self._past.nbytes if self._past else 0
        return details


class _Gpu:
    """Chosen actors drawn alone."""

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

    def draw(self, frame, shining, feature):
        self._match([actor for actor, _ in shining], feature)
        view = View(
            frame.view_from_world, frame.clip_from_view, frame.near, frame.far, frame.parallel
        )
        left, bottom, right, top = self._covered(frame, view)
        with self.target.drawing():
            within = left, bottom, right - left, top - bottom
            self.drawer.look(view, (0, 0, *frame.size), within=within)
            self.drawer.fill((0.0, 0.0, 0.0, 0.0))
            for actor, strength in shining:
                _set_glow(actor, strength)
                for translucent in (False, True):
                    self.drawer.draw([actor], translucent=translucent)
                _set_glow(actor, 0.0)
        self.drawer.done()

    def _covered(self, frame, view):
        """Return which part of the picture actors may cover, in whole squares of light."""
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
        """Have these actors, and no others, drawn as light."""
        changed = self._attached.match(
            actors, lambda _: (feature,), lambda actor: (feature, *_shader_version(actor))
        )
        self._bounded |= {address(actor): _is_within_bounds(actor) for actor in changed}

    def detach(self):
        """Have no actor drawn as light."""
        self._attached.clear()

    def light(self, frame, picture, target, taps):
        """Draw the light where nothing hides it, in squares of twice as many pixels as taps."""
        if taps not in self._quads:
            text = sections(shader_source(__file__))['source']
            text = f'#define TAPS {taps}\n{text}'
            self._quads[taps] = Quad(frame.window, text, 'glow source')
        one = 1 / frame.pixel_scale
        uniforms = {
            'pixels': picture.size,
            'projection': frame.clip_from_view[2:, 2:].ravel().tolist(),
            'pixel_size': (one, 0.0) if frame.parallel else (0.0, one),
        }
        glow = self.target.colors[0]
        textures = {'glow': glow, 'own': self.target.depth, 'scene': picture.depth}
        left, bottom, right, top = (-(-edge // (2 * taps)) for edge in self._box)
        with filtered(glow), target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            frame.window.GetState().vtkglScissor(left, bottom, right - left, top - bottom)
            self._quads[taps].draw(uniforms, textures)

    def release(self):
        self.detach()
        for owner in (*self._quads.values(), self.target, self.drawer):
            owner.release()


class _Past:
    """Light of this frame and of those before."""

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
        for owner in (self.now, self._before, self._after, self._fade):
            owner.release()


def _checked_actors(actors):
    actors = (actors,) if _shines(actors) else tuple(actors)
    for actor in actors:
        if not _shines(actor):
            msg = f'actors: {actor!r} must be an actor, as add_mesh returns it, or instances'
            raise TypeError(msg)
    return actors


def _shines(one) -> bool:
    return isinstance(one, Thing | _vtk.vtkActor)


class _GlowFeatures(FeatureSet):
    """What has actors drawn as light, also those of which VTK would leave out fragments."""

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
    """Return whether an actor draws nothing beyond its bounds; lines and points are thick."""
    shader = actor.GetShaderProperty()
    moved = shader.HasVertexShaderCode() or any(
        stage == 'Vertex' for stage, _ in replacements(shader)
    )
    return actor.GetMapper().GetClassName() in _MAPPERS and not moved


def _box(view, bounds, thickness, size):
    """Return the part of a picture that is within bounds, in whole squares of light."""
    if not bounds:
        return 0, 0, 0, 0
    around = math.ceil(max(thickness)) + 1
    box = covered(view, bounds, size)
    low = [max(edge - around, 0) // _STEP * _STEP for edge in box[:2]]
    high = [
        min(-(-(edge + around) // _STEP) * _STEP, side)
        for edge, side in zip(box[2:], size, strict=True)
    ]
    return low[0], low[1], max(high[0], low[0]), max(high[1], low[1])


def _thickness(prop):
    return max(prop.GetLineWidth(), prop.GetPointSize())


def _set_glow(actor, strength):
    set_fragment_uniforms([actor], {'ibr_glow': strength})
