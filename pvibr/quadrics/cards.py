"""Quadrics on the GPU: draw modes, and the choice of one for each block."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.gl import Texture, set_uniforms, shader_source
from pvibr.gl import enums as gl
from pvibr.gl.feature import Feature, sections
from pvibr.instances.cards import BLOCK, DULL, card_mesh, pack
from pvibr.maths.blocks import frustum_planes
from pvibr.scene.shader_actor import draw_actor, observe_shader
from pvibr.scene.translucent import MOST

ROW = 1024  # texels of a row
_LARGEST_SMALL = 4.0  # px: those are edges all over, and their depths differ by two pixels


@dataclass(frozen=True)
class Shape:
    """A type of quadric."""

    name: str
    texels: int
    looks: int = 1
    largest_point: float = 60.0
    fill: float = 1.0
    open: bool = False
    defines: tuple = ()


@dataclass(frozen=True)
class DrawMode:
    """A way to draw the items of a block."""

    name: str
    corners: int
    chunk: int
    depth: bool = True
    dots: bool = False
    blends: bool = False
    hides: bool = False

    def feature(self, shape) -> Feature:
        """Return the shader text by VTK's tags."""
        part, own = (sections(shader_source(__file__, stem)) for stem in (None, shape.name))
        values = {
            'HIDES': int(self.hides),
            'CORNERS': self.corners,
            'DEPTH': int(self.depth),
            'TEXELS': shape.texels,
            'LOOKS': shape.looks,
            'INSIDES': int(shape.open or self.corners == 4),
            **dict(shape.defines),
        }
        defines = ''.join(f'#define {name} {value}\n' for name, value in values.items())
        vertex = {
            'VTK::PositionVC::Dec': defines + part['vertex.declare'] + own['vertex.declare'],
            'VTK::PositionVC::Impl': part['vertex.position'],
        }
        fragment = {
            'VTK::PositionVC::Dec': defines + part['fragment.declare'] + own['fragment.declare'],
            'VTK::PositionVC::Impl': part['fragment.meet'],
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
        }
        if self.hides:
            tags = 'VTK::Color::Impl', 'VTK::Normal::Impl', 'VTK::Light::Impl'
            fragment |= dict.fromkeys(tags, '\n')
        if not self.dots:
            cut = part['fragment.cut'] + (part['fragment.depth'] if self.depth else '')
            # Depth peeling sets that of the card first.
            fragment['VTK::Depth::Impl'] = '//VTK::Depth::Impl\n' + cut
        return Feature(f'{shape.name}_{self.name}', vertex, fragment)


DOTS = DrawMode('dots', 1, 65_536, depth=False, dots=True)
SMALL = DrawMode('small', 1, 65_536, depth=False)
POINTS = DrawMode('points', 1, 65_536)
QUADS = DrawMode('quads', 4, 16_384)
BLENDED = DrawMode('blended', 4, 65_536, blends=True)
#: Depth prepass of point sprites and of quads.
HIDING = (
    DrawMode('hiding_points', 1, 65_536, depth=False, hides=True),
    DrawMode('hiding_quads', 4, 16_384, depth=False, hides=True),
)
#: Near ones first: they hide much, and hidden fragments are not lit.
DRAW_MODES = (QUADS, POINTS, SMALL, DOTS)
_DULL = Feature('dull', fragment={'VTK::Light::Impl': '//VTK::Light::Impl\n'.join(DULL)})


class Layer:
    """The items of one draw mode: chunks that share one mapper."""

    def __init__(self, quadrics, mode):
        self._owner = weakref.proxy(quadrics)
        self.mode = mode
        self._feature = mode.feature(quadrics.shape)
        self._landed, self._shiny = False, True
        self.failure = ''
        self.entries: Texture | None = None
        self.drawn = 0
        self._mapper = _vtk.vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        observe_shader(self._mapper, self._set_shader)
        slots = max(-(-len(quadrics) // BLOCK), 1) * BLOCK
        self._chunk = min(mode.chunk, slots)
        self.bound(quadrics.bounds)
        draws = -(-slots // self._chunk) + (MOST if mode.blends else 0)
        prop = pv.Property(lighting=False) if mode.hides else quadrics.prop
        look = {'prop': prop, 'feature': self._feature, 'translucent': mode.blends}
        self.actors = [draw_actor(self._mapper, **look) for _ in range(draws)]

    def bound(self, bounds):
        """Set the bounds that VTK culls by."""
        self._mapper.SetInputData(card_mesh(self._chunk, self.mode.corners, bounds))

    def set_shiny(self, shiny):
        """Switch specular highlights."""
        if self.failure:
            raise ShaderError(self.failure)
        if shiny != self._shiny:
            for actor in self.actors:
                (_DULL.detach if shiny else _DULL.attach)(actor)
            self._shiny = shiny

    def show(self, entries, unit=BLOCK, cuts=()):
        """Draw items."""
        count, owner = len(entries), self._owner
        self.drawn = min(count * unit, len(owner))
        if count:
            self.entries = self.entries or Texture(owner.window)
            self.entries.upload(pack(entries.astype(np.float32), ROW, 4))
        step, free = self._chunk // unit, iter(self.actors)
        parts: list = []
        for first, end in pairwise((0, *cuts, count)):
            starts = range(first, end, step)
            parts.append([_span(next(free), k * unit, min(k + step, end)) for k in starts])
        for actor in free:
            actor.VisibilityOff()
        return parts

    def _set_shader(self, program):
        """Bind textures and set uniforms of a program that is about to draw."""
        owner = self._owner
        state = owner.window.GetState()
        if self.mode.corners == 1:
            state.SetEnumState(gl.PROGRAM_POINT_SIZE, True)
        textures = {**owner.textures, 'ibr_blocks': self.entries}
        set_uniforms(program, owner.binder.bind(self, textures))
        set_uniforms(program, owner.uniforms)
        set_uniforms(program, _pixel_uniforms(state, owner.uniforms))
        if not self._landed:
            self._landed = True
            if not self._feature.landed(program):
                self.failure = f'the shader text of {self._feature.name} did not land'

    def release(self, window):
        """Free GPU memory; the context is current."""
        if window is not None:
            self._mapper.ReleaseGraphicsResources(window)
            for actor in self.actors:
                actor.ReleaseGraphicsResources(window)
        if self.entries is not None:
            self.entries.release()
            self.entries = None


def _span(actor, first, end):
    """Set the range that an actor draws."""
    actor.VisibilityOn()
    uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
    uniforms.SetUniformi('ibr_first', first)
    uniforms.SetUniformi('ibr_end', end)
    return actor


@dataclass
class Seen:
    """Blocks in view, nearest first."""

    entries: np.ndarray
    modes: np.ndarray
    around: np.ndarray
    areas: np.ndarray


def seen_blocks(blocks, frame, shape) -> Seen:
    """Return the blocks in view, nearest first, with their draw modes."""
    with np.errstate(divide='ignore', invalid='ignore'):  # the eye may be in the middle of one
        index, origins, small, large = (a[::-1] for a in blocks.seen(frame))
    around = (blocks.reach + blocks.largest)[index]
    planes = frustum_planes(frame.clip_from_view)
    inside = (planes[:, :3] @ origins.T + planes[:, 3:]).min(0) > around
    modes = np.where(
        inside & (large <= shape.largest_point), DRAW_MODES.index(POINTS), DRAW_MODES.index(QUADS)
    )
    modes[inside & (large <= _LARGEST_SMALL)] = DRAW_MODES.index(SMALL)
    modes[inside & (large <= 1.0)] = DRAW_MODES.index(DOTS)
    areas = shape.fill * BLOCK * np.pi / 16 * (small + np.minimum(large, frame.size[1])) ** 2
    return Seen(np.column_stack([origins, index]), modes, around, areas)


def view_uniforms(frame, count, unit) -> dict:
    """Return the uniforms of a view."""
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    return {
        'ibr_count': count,
        'ibr_unit': unit,
        'ibr_parallel': int(frame.parallel),
        'ibr_pixel': float(frame.scale / frame.pixel_scale),
        'ibr_near': float(frame.near),
        'ibr_ndc_from_slope': (float(m[0, 0]), float(m[1, 1]), *map(float, offset)),
        'ibr_zw_from_z': (float(m[2, 2]), float(m[2, 3]), float(m[3, 2]), float(m[3, 3])),
        'ibr_eye_from_world': frame.view_from_world[:3, :3],
    }


def _pixel_uniforms(state, uniforms) -> dict:
    """Return the uniforms of the target's pixels, whose size differs between passes."""
    found = [0, 0, 0, 0]
    state.vtkglGetIntegerv(gl.VIEWPORT, found)
    corner, size = np.array(found[:2], float), np.array(found[2:], float)
    scale, offset = np.reshape(uniforms['ibr_ndc_from_slope'], (2, 2))
    factors = 2 / size / scale
    offsets = (-1 - offset) / scale - corner * factors
    return {
        'ibr_size': tuple(size.tolist()),
        'ibr_slope_from_pixel': (*factors.tolist(), *offsets.tolist()),
    }
