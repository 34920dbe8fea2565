"""Impostors on the GPU: one draw of many cards that share a pool of tiles."""

from __future__ import annotations

from functools import cache

import numpy as np

from pvibr.gl import Texture, release, shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.substitutes.impostor_limits import LAYERS
from pvibr.things.shader_draws import DULL, ShaderDraws

_ROW = 128  # cards per row of the table


@cache
def card_feature(*, depth, shiny, several, tinted, clear) -> Feature:
    """Return the shader of cards by VTK's tags."""
    shader_parts = sections(shader_source(__file__, 'impostor'))
    light_tag = '//VTK::Light::Impl\n'
    return Feature(
        f'impostor_{int(depth)}{int(shiny)}{int(several)}{int(tinted)}{int(clear)}',
        {
            'VTK::PositionVC::Dec': f'#define CLEAR {int(clear)}\n'
            + shader_parts['vertex.declare'],
            'VTK::PositionVC::Impl': shader_parts['vertex.position'],
        },
        {
            'VTK::System::Dec': _SAMPLE_MASK,
            'VTK::PositionVC::Dec': f'#define MATERIALS {int(several)}\n'
            f'#define TINTED {int(tinted)}\n#define CLEAR {int(clear)}\n'
            + shader_parts['fragment.declare'],
            'VTK::PositionVC::Impl': shader_parts['fragment.sample'],
            # After depth peeling's own, which sets the depth of the card.
            'VTK::Depth::Impl': '//VTK::Depth::Impl\n' + depth * shader_parts['fragment.depth'],
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + shader_parts['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
            'VTK::Light::Impl': light_tag.join(_SHINY if shiny else DULL),
        },
    )


# Where a driver has it, outlines are as smooth as those of meshes.
_SAMPLE_MASK = '//VTK::System::Dec\n#extension GL_ARB_sample_shading : enable\n'
# VTK declares both only if there is a light.
_SHINY = (
    '#define specularColor ibr_specular\n#define specularPower ibr_matter.w\n',
    '#undef specularColor\n#undef specularPower\n',
)


class ImpostorCards:
    """The cards of opaque images, and of the layers of translucent ones."""

    def __init__(self):
        self.draws = [CardDraws(clear=False), CardDraws(clear=True)]

    @property
    def actor(self):
        """The actor of opaque cards."""
        return self.draws[0].actor

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, without the pool."""
        return sum(draws.nbytes for draws in self.draws)

    def fit(self, count, bounds):
        """Make room for cards of so many images within bounds."""
        for draws, layers in zip(self.draws, (1, LAYERS), strict=True):
            draws.fit(layers * count, bounds)

    def attach(self, pool, *, depth, materials):
        """Attach the shader and set the materials."""
        tinted = pool is not None and pool.tinted
        for draws in self.draws:
            draws.attach(depth=depth, materials=materials, tinted=tinted)

    def show(self, frame, card_rows, pool):
        """Draw cards in a frame."""
        for draws, rows in zip(self.draws, card_rows, strict=True):
            draws.show(frame, rows, pool)

    def show_again(self):
        """Draw the same cards."""
        for draws in self.draws:
            draws.show_again()

    def hide(self):
        """Draw nothing in this frame."""
        for draws in self.draws:
            draws.hide()

    def empty(self):
        """Have no cards to show again."""
        for draws in self.draws:
            draws.empty()

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self.draws:
            draws.release(window)


class CardDraws(ShaderDraws):
    """The actor that draws all cards of one kind."""

    def __init__(self, *, clear):
        super().__init__(chunk=0, translucent=clear)
        self._is_clear, self._shown_count = clear, 0
        self._bounds = np.array([1.0, -1.0] * 3)
        self._textures: tuple[Texture, Texture] | None = None  # a row per card, and materials
        self._card_table: np.ndarray | None = None  # as it is on the GPU
        self._material_count = 0

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, without the pool."""
        return sum(texture.nbytes for texture in self._textures or ())

    def fit(self, count, bounds):
        """Make room for cards within bounds."""
        low, high = bounds[::2], bounds[1::2]
        if self.chunk:
            low, high = np.minimum(low, self._bounds[::2]), np.maximum(high, self._bounds[1::2])
        new_bounds = np.stack([low, high], 1).ravel()
        if count <= self.chunk and np.array_equal(new_bounds, self._bounds):
            return
        self.chunk, self._bounds = max(self.chunk, count), new_bounds
        self.place_cards(self._bounds)

    def attach(self, *, depth, materials, tinted):
        """Attach the shader and set the materials."""
        kind = {'depth': depth or self._is_clear, 'shiny': materials.shiny, 'tinted': tinted}
        several = len(materials) > 1
        self.set_feature(card_feature(**kind, several=several, clear=self._is_clear))
        if self._textures is not None and len(materials) != self._material_count:
            self._textures[1].upload(materials.table())
        self._material_count = len(materials)
        self._materials = materials

    def show(self, frame, card_rows, pool):
        """Draw cards in a frame."""
        if not len(card_rows):
            self.empty()
            return
        self._shown_count = len(card_rows)
        if self._textures is None:
            materials = Texture(frame.window).upload(self._materials.table())
            self._textures = Texture(frame.window), materials
        cards, materials = self._textures
        table_height = max(1, -(-len(card_rows) // _ROW))
        texel_count = card_rows.shape[1]
        table = np.zeros((table_height * _ROW, texel_count, 4), np.float32)
        table[: len(card_rows)] = card_rows
        if self._card_table is None or not np.array_equal(table, self._card_table):
            self._card_table = table
            cards.upload(table.reshape(table_height, _ROW * texel_count, 4))
        clip, view = frame.clip_from_view, frame.view_from_world
        self.textures = {**pool.textures, 'ibr_cards': cards, 'ibr_materials': materials}
        self.uniforms = {
            'ibr_count': len(card_rows),
            'ibr_clip_from_eye': clip,
            'ibr_eye_from_world': view[:3, :3],
            'ibr_clip_depth': (clip[2, 2], clip[2, 3], clip[3, 2], clip[3, 3]),
        }
        self.show_again()

    def empty(self):
        """Have no cards to show again."""
        self._shown_count = 0
        self.hide()

    def show_again(self):
        """Draw the same cards."""
        if self._shown_count:
            self.show_spans([(0, self._shown_count)])

    def release(self, window):
        """Free GPU memory; the context is current."""
        super().release(window)
        release(*self._textures or ())
        self._textures = self._card_table = None
