"""Quadrics on the GPU: draw modes, and the choice of one for each block."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace

import numpy as np
import pyvista as pv

from pvibr.core.errors import ShaderError
from pvibr.core.passes import has_shadows
from pvibr.gl import enums as gl
from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.maths.blocks import BLOCK, frustum_planes
from pvibr.scene.clipping import KEPT
from pvibr.scene.draw_order import PARTS
from pvibr.scene.shader_draws import DULL, ShaderDraws

_GIANT = 300.0  # largest size over the distance of the near plane: floats are good to 1e-5
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
    gaps: bool = False

    def feature(self, shape, *, clips=False) -> Feature:
        """Return the shader text by VTK's tags."""
        part, own = (sections(shader_source(__file__, stem)) for stem in (None, shape.name))
        values = {
            'HIDES': int(self.hides),
            'CORNERS': self.corners,
            'DEPTH': int(self.depth),
            'GAPS': int(self.gaps),
            'TEXELS': shape.texels,
            'LOOKS': shape.looks,
            'INSIDES': int(shape.open or self.corners == 4 or clips),
            'CLIPS': int(clips),
            **dict(shape.defines),
        }
        defines = ''.join(f'#define {name} {value}\n' for name, value in values.items())
        vertex = {
            'VTK::PositionVC::Dec': defines + part['vertex.declare'] + own['vertex.declare'],
            'VTK::PositionVC::Impl': part['vertex.position'],
        }
        fragment = {
            'VTK::PositionVC::Dec': defines
            + (KEPT if clips else '')
            + part['fragment.declare']
            + own['fragment.declare'],
            'VTK::PositionVC::Impl': part['fragment.meet'],
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
        }
        if self.hides:
            fragment |= dict.fromkeys(('VTK::Color::Impl', 'VTK::Normal::Impl'), '\n')
            # VTK discards where alpha is 0, and some drivers take what is not written for 0.
            fragment['VTK::Light::Impl'] = 'gl_FragData[0] = vec4(1.0);\n'
        if not self.dots:
            cut = part['fragment.cut'] + (part['fragment.depth'] if self.depth else '')
            # Depth peeling sets that of the card first.
            fragment['VTK::Depth::Impl'] = '//VTK::Depth::Impl\n' + cut
        name = f'{shape.name}_{self.name}' + '_clipped' * clips
        return Feature(name, vertex, fragment)


DOTS = DrawMode('dots', 1, 65_536, depth=False, dots=True)
SMALL = DrawMode('small', 1, 65_536, depth=False)
POINTS = DrawMode('points', 1, 65_536)
QUADS = DrawMode('quads', 4, 16_384)
BLENDED = DrawMode('blended', 4, 65_536, blends=True, gaps=True)
#: Giants beside the eye, and what is in their blocks; one draw of them.
GIANTS = DrawMode('giants', 4, 4096, gaps=True)
#: Depth prepass of point sprites and of quads.
HIDING = (
    DrawMode('hiding_points', 1, 65_536, depth=False, hides=True),
    DrawMode('hiding_quads', 4, 16_384, depth=False, hides=True),
)
#: Near ones first: they hide much, and hidden fragments are not lit.
DRAW_MODES = (GIANTS, QUADS, POINTS, SMALL, DOTS)
_DULL = Feature('dull', fragment={'VTK::Light::Impl': '//VTK::Light::Impl\n'.join(DULL)})


class Layer(ShaderDraws):
    """The items of one draw mode."""

    def __init__(self, quadrics, mode):
        self._owner, self.mode = weakref.proxy(quadrics), mode
        slots = max(-(-len(quadrics) // BLOCK), 1) * BLOCK
        chunk = min(mode.chunk, slots)
        draws = 1 if mode is GIANTS else -(-slots // chunk)
        super().__init__(
            draws=draws + (PARTS if mode.blends else 0),
            chunk=chunk,
            prop=pv.Property(lighting=False) if mode.hides else quadrics.prop,
            feature=mode.feature(quadrics.shape, clips=quadrics.clips),
            translucent=mode.blends,
            binder=quadrics.binder,
        )
        self._shiny = True
        self.drawn, self._stride = 0, 1
        self.bound(quadrics.bounds)

    def bound(self, bounds):
        """Set the bounds that VTK culls by."""
        self.place_cards(bounds, self.mode.corners)

    def clip(self):
        """Have a shader that clips, or one that does not."""
        self.set_feature(self.mode.feature(self._owner.shape, clips=self._owner.clips))

    def set_shiny(self, shiny):
        """Switch specular highlights."""
        if self.failure:
            raise ShaderError(self.failure)
        if shiny != self._shiny:
            for actor in self.actors:
                (_DULL.detach if shiny else _DULL.attach)(actor)
            self._shiny = shiny

    def show(self, entries, unit=BLOCK, cuts=(), gaps=None):
        """Draw items; return the actors of the parts between cuts."""
        self.drawn = min(len(entries) * unit, len(self._owner))
        self._unit, self._stride = unit, 1 if gaps is None else 2
        rows = entries if gaps is None else np.concatenate([entries, gaps], 1).reshape(-1, 4)
        self.upload(self._owner.window, rows.astype(np.float32))
        return self.show_parts((0, *cuts, len(entries)), unit)

    def _inputs(self):
        owner = self._owner
        pixels = _pixel_uniforms(owner.window.GetState(), owner.uniforms)
        own = {'ibr_unit': self._unit, 'ibr_stride': self._stride}
        return owner.textures, owner.uniforms | pixels | own


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
    if has_shadows(frame.renderer):  # VTK draws its shadow maps with the actors of the frame
        modes[:] = DRAW_MODES.index(QUADS)
    modes[giant_blocks(blocks, frame, origins, index)] = DRAW_MODES.index(GIANTS)
    areas = shape.fill * BLOCK * np.pi / 16 * (small + np.minimum(large, frame.size[1])) ** 2
    return Seen(np.column_stack([origins, index]), modes, around, areas)


def giant_blocks(blocks, frame, origins, index) -> np.ndarray:
    """Return the numbers of blocks with surfaces beside the eye that are too large for floats."""
    largest = blocks.largest[index]
    scene = frame.far - frame.near if frame.parallel else frame.near
    near = np.linalg.norm(origins, axis=1) < blocks.reach[index] + 1.01 * largest
    return np.flatnonzero(near & (largest > _GIANT * scene))[: GIANTS.chunk // BLOCK]


def from_its_eye(frame):
    """Return a frame whose view space has the eye at its origin.

    In stereo, VTK shears the projection instead: rays leave from beside the origin.
    """
    clip = frame.clip_from_view
    if frame.parallel or not clip[:2, 3].any():
        return frame
    shift = np.eye(4)
    shift[:2, 3] = clip[:2, 3] / np.diag(clip)[:2]
    view = replace(
        frame.view,
        view_from_world=shift @ frame.view_from_world,
        clip_from_view=clip @ np.linalg.inv(shift),
    )
    return replace(frame, view=view)


def eye_of(frame) -> np.ndarray:
    """Return the origin of eye space, world units."""
    view = frame.view_from_world
    return -view[:3, :3].T @ view[:3, 3]


def gap_rows(gaps, scale, heights=0.0) -> np.ndarray:
    """Return rows of gaps at the eye, to be used within or a little outside of what they are."""
    rows = np.zeros((len(gaps), 4))
    rows[:, 0], rows[:, 1:3], rows[:, 3] = gaps, heights, gaps < 0.05 * scale
    return rows


def view_uniforms(frame, count) -> dict:
    """Return the uniforms of a view."""
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    return {
        'ibr_count': count,
        'ibr_parallel': int(frame.parallel),
        'ibr_pixel': float(frame.scale / frame.pixel_scale),
        'ibr_near': float(frame.near),
        'ibr_ndc_from_slope': (float(m[0, 0]), float(m[1, 1]), *map(float, offset)),
        'ibr_zw_from_z': (float(m[2, 2]), float(m[2, 3]), float(m[3, 2]), float(m[3, 3])),
        'ibr_eye_from_world': frame.view_from_world[:3, :3],
    }


def _pixel_uniforms(state, uniforms) -> dict:
    """Return the uniforms of the target's pixels, whose size differs between passes."""
    found, samples = [0, 0, 0, 0], [0]
    state.vtkglGetIntegerv(gl.VIEWPORT, found)
    state.vtkglGetIntegerv(gl.SAMPLES, samples)
    corner, size = np.array(found[:2], float), np.array(found[2:], float)
    scale, offset = np.reshape(uniforms['ibr_ndc_from_slope'], (2, 2))
    factors = 2 / size / scale
    offsets = (-1 - offset) / scale - corner * factors
    return {
        'ibr_size': tuple(size.tolist()),
        # A fragment is met at its middle and covers the samples that its card covers.
        'ibr_margin': 0.5 if samples[0] > 1 else 0.0,
        'ibr_slope_from_pixel': (*factors.tolist(), *offsets.tolist()),
    }
