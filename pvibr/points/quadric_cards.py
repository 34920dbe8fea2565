"""Quadrics on the GPU: draw modes and the choice of one for each block."""

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
from pvibr.maths.blocks import BLOCK
from pvibr.maths.views import frustum_planes
from pvibr.things.clipping import KEPT
from pvibr.things.depth_prepass import DEPTH_ONLY
from pvibr.things.draw_order import PARTS
from pvibr.things.shader_draws import DULL_FEATURE, ShaderDraws

_GIANT = 300.0  # largest size over the near distance at which floats are good to 1e-5
# Largest sizes in pixels that are drawn as single pixels, and with one depth for all pixels.
SMALLEST_PX = 1.0, 4.0


@dataclass(frozen=True)
class Shape:
    """A type of quadric."""

    name: str
    texels: int
    looks: int = 1
    #: Largest size in pixels that is drawn as a point sprite; larger ones are quads.
    largest_sprite_px: float = 60.0
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
    residuals: bool = False

    def feature(self, shape, *, clips=False) -> Feature:
        """Return the shader text by VTK's tags."""
        shared_parts = sections(shader_source(__file__))
        shape_parts = sections(shader_source(__file__, shape.name))
        define_values = {
            'HIDES': int(self.hides),
            'CORNERS': self.corners,
            'DEPTH': int(self.depth),
            'RESIDUALS': int(self.residuals),
            'TEXELS': shape.texels,
            'LOOKS': shape.looks,
            'INSIDES': int(shape.open or self.corners == 4 or clips),
            'CLIPS': int(clips),
            **dict(shape.defines),
        }
        defines = ''.join(f'#define {name} {value}\n' for name, value in define_values.items())
        vertex = {
            'VTK::PositionVC::Dec': defines
            + shared_parts['vertex.declare']
            + shape_parts['vertex.declare'],
            'VTK::PositionVC::Impl': shared_parts['vertex.position'],
        }
        fragment = {
            'VTK::PositionVC::Dec': defines
            + (KEPT if clips else '')
            + shared_parts['fragment.declare']
            + shape_parts['fragment.declare'],
            'VTK::PositionVC::Impl': shared_parts['fragment.meet'],
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + shared_parts['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
        }
        if self.hides:
            fragment |= DEPTH_ONLY
        if not self.dots:
            discard_code = shared_parts['fragment.cut'] + (
                shared_parts['fragment.depth'] if self.depth else ''
            )
            # After depth peeling's own, which sets the depth of the card.
            fragment['VTK::Depth::Impl'] = '//VTK::Depth::Impl\n' + discard_code
        name = f'{shape.name}_{self.name}' + '_clipped' * clips
        return Feature(name, vertex, fragment)


DOTS = DrawMode('dots', 1, 65_536, depth=False, dots=True)
SMALL = DrawMode('small', 1, 65_536, depth=False)
POINTS = DrawMode('points', 1, 65_536)
QUADS = DrawMode('quads', 4, 16_384)
BLENDED = DrawMode('blended', 4, 65_536, blends=True, residuals=True)
#: Giants beside the eye and all items of their blocks, in one draw.
GIANTS = DrawMode('giants', 4, 4096, residuals=True)
#: Depth prepass of point sprites and of quads.
HIDING = (
    DrawMode('hiding_points', 1, 65_536, depth=False, hides=True),
    DrawMode('hiding_quads', 4, 16_384, depth=False, hides=True),
)
#: Near ones first: they hide the most, and hidden fragments are not lit.
DRAW_MODES = (GIANTS, QUADS, POINTS, SMALL, DOTS)


class Layer(ShaderDraws):
    """The items of one draw mode."""

    def __init__(self, quadrics, mode):
        self._owner, self.mode = weakref.proxy(quadrics), mode
        slot_count = max(-(-quadrics.room // BLOCK), 1) * BLOCK
        chunk = min(mode.chunk, slot_count)
        draw_count = 1 if mode is GIANTS else -(-slot_count // chunk)
        super().__init__(
            draws=draw_count + (PARTS if mode.blends else 0),
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
        """Use the shader with or without clipping."""
        self.set_feature(self.mode.feature(self._owner.shape, clips=self._owner.clips))

    def set_shiny(self, shiny):
        """Switch specular highlights."""
        if self.failure:
            raise ShaderError(self.failure)
        if shiny != self._shiny:
            for actor in self.actors:
                (DULL_FEATURE.detach if shiny else DULL_FEATURE.attach)(actor)
            self._shiny = shiny

    def show(self, entries, unit=BLOCK, cuts=(), residuals=None):
        """Draw entries of `unit` items; return the actors of the parts between cuts."""
        self.drawn = min(len(entries) * unit, len(self._owner))
        self._unit, self._stride = unit, 1 if residuals is None else 2
        texels = entries
        if residuals is not None:
            texels = np.concatenate([entries, residuals], 1).reshape(-1, 4)
        self.upload(self._owner.item_textures.window, texels.astype(np.float32))
        return self.show_parts((0, *cuts, len(entries)), unit)

    def _inputs(self):
        owner = self._owner
        pixel_uniforms = _pixel_uniforms(owner.item_textures.window.GetState(), owner.uniforms)
        entry_uniforms = {'ibr_unit': self._unit, 'ibr_stride': self._stride}
        return owner.item_textures.by_name, owner.uniforms | pixel_uniforms | entry_uniforms


@dataclass
class VisibleBlocks:
    """Blocks in view, nearest first."""

    entries: np.ndarray
    modes: np.ndarray
    radii: np.ndarray
    areas: np.ndarray


def visible_blocks(blocks, frame, shape) -> VisibleBlocks:
    """Return the blocks in view, nearest first, with their draw modes."""
    with np.errstate(divide='ignore', invalid='ignore'):  # the eye may be in a centre
        block_ids, origins, smallest_px, largest_px = (a[::-1] for a in blocks.seen(frame)[:4])
    block_radii = blocks.bounding_radii[block_ids]
    planes = frustum_planes(frame.clip_from_view)
    is_inside = (planes[:, :3] @ origins.T + planes[:, 3:]).min(0) > block_radii
    modes = np.full(len(block_ids), DRAW_MODES.index(QUADS))
    limits = (POINTS, shape.largest_sprite_px), *zip((SMALL, DOTS), SMALLEST_PX[::-1], strict=True)
    for mode, limit_px in limits:
        modes[is_inside & (largest_px <= limit_px)] = DRAW_MODES.index(mode)
    if has_shadows(frame.renderer):  # VTK's shadow maps draw the actors of the frame
        modes[:] = DRAW_MODES.index(QUADS)
    modes[giant_blocks(blocks, frame, origins, block_ids)] = DRAW_MODES.index(GIANTS)
    mean_px = (smallest_px + np.minimum(largest_px, frame.size[1])) / 2
    areas = shape.fill * BLOCK * np.pi / 4 * mean_px**2
    return VisibleBlocks(np.column_stack([origins, block_ids]), modes, block_radii, areas)


def giant_blocks(blocks, frame, origins, index) -> np.ndarray:
    """Return the blocks with surfaces beside the eye too large for float precision."""
    largest = blocks.largest[index]
    scene_depth = frame.far - frame.near if frame.parallel else frame.near
    is_near = np.linalg.norm(origins, axis=1) < blocks.reach[index] + 1.01 * largest
    return np.flatnonzero(is_near & (largest > _GIANT * scene_depth))[: GIANTS.chunk // BLOCK]


def with_eye_at_origin(frame):
    """Return a frame with the eye at the origin of view space, as VTK's stereo shifts it."""
    clip = frame.clip_from_view
    if frame.parallel or not clip[:2, 3].any():
        return frame
    eye_shift = np.eye(4)
    eye_shift[:2, 3] = clip[:2, 3] / np.diag(clip)[:2]
    view = replace(
        frame.view,
        view_from_world=eye_shift @ frame.view_from_world,
        clip_from_view=clip @ np.linalg.inv(eye_shift),
    )
    return replace(frame, view=view)


def eye_of(frame) -> np.ndarray:
    """Return the eye in world space."""
    view = frame.view_from_world
    return -view[:3, :3].T @ view[:3, 3]


def residual_texels(residuals, scale, heights=0.0) -> np.ndarray:
    """Return texels of residuals, heights of both ends, and 1 if the eye is inside or near."""
    texels = np.zeros((len(residuals), 4))
    texels[:, 0], texels[:, 1:3], texels[:, 3] = residuals, heights, residuals < 0.05 * scale
    return texels


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
        'ibr_shear': float(m[0, 1] / m[0, 0]),
        'ibr_zw_from_z': (float(m[2, 2]), float(m[2, 3]), float(m[3, 2]), float(m[3, 3])),
        'ibr_eye_from_world': frame.view_from_world[:3, :3],
    }


def _pixel_uniforms(state, uniforms) -> dict:
    """Return uniforms of the target's pixels, whose size differs between passes."""
    viewport, sample_count = [0, 0, 0, 0], [0]
    state.vtkglGetIntegerv(gl.VIEWPORT, viewport)
    state.vtkglGetIntegerv(gl.SAMPLES, sample_count)
    corner, size = np.array(viewport[:2], float), np.array(viewport[2:], float)
    scale, offset = np.reshape(uniforms['ibr_ndc_from_slope'], (2, 2))
    slope_factors = 2 / size / scale
    slope_offsets = (-1 - offset) / scale - corner * slope_factors
    return {
        'ibr_size': tuple(size.tolist()),
        # Rays pass through pixel centres, but cards must cover all samples.
        'ibr_margin': 0.5 if sample_count[0] > 1 else 0.0,
        'ibr_slope_from_pixel': (*slope_factors.tolist(), *slope_offsets.tolist()),
    }
