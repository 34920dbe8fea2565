"""Impostors on the GPU: one draw of many cards that share a pool of tiles."""

from __future__ import annotations

import numpy as np

from pvibr.gl import Texture, shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.scene.shader_draws import DULL, ShaderDraws

_ROW, _TEXELS = 128, 5  # cards of a row of the table, texels of a card


def card_feature(*, depth, shiny, several) -> Feature:
    """Return the shader text of cards by VTK's tags."""
    part = sections(shader_source(__file__, 'impostor'))
    light = '//VTK::Light::Impl\n'
    return Feature(
        f'impostor_{int(depth)}{int(shiny)}{int(several)}',
        {
            'VTK::PositionVC::Dec': part['vertex.declare'],
            'VTK::PositionVC::Impl': part['vertex.position'],
        },
        {
            'VTK::PositionVC::Dec': f'#define MATERIALS {int(several)}\n'
            + part['fragment.declare'],
            'VTK::PositionVC::Impl': part['fragment.sample'],
            'VTK::Depth::Impl': (part['fragment.depth'] if depth else '') + '//VTK::Depth::Impl\n',
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
            'VTK::Light::Impl': light.join(_SHINY if shiny else DULL),
        },
    )


# VTK declares both only where there is a light.
_SHINY = (
    '#define specularColor ibr_specular\n#define specularPower ibr_matter.w\n',
    '#undef specularColor\n#undef specularPower\n',
)


class ImpostorCards(ShaderDraws):
    """The actor that draws all cards."""

    def __init__(self):
        super().__init__(chunk=0)
        self._bounds = np.array([1.0, -1.0] * 3)
        self._gpu: tuple[Texture, Texture] | None = None  # a row per card, and materials
        self._table: np.ndarray | None = None  # as it is on the GPU
        self._known = 0

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, without the pool."""
        return sum(texture.nbytes for texture in self._gpu or ())

    def fit(self, count, bounds):
        """Reserve cards within bounds."""
        low, high = (
            np.minimum(bounds[::2], self._bounds[::2]),
            np.maximum(bounds[1::2], self._bounds[1::2]),
        )
        kept = self._bounds
        if self.chunk:
            inside = (bounds[::2] >= kept[::2]).all() and (bounds[1::2] <= kept[1::2]).all()
            if count <= self.chunk and inside:
                return
        else:
            low, high = bounds[::2], bounds[1::2]
        self.chunk = max(self.chunk, count)
        self._bounds = np.stack([low, high], 1).ravel()
        self.place_cards(self._bounds)

    def attach(self, *, depth, materials):
        """Attach the shader text, and set the materials."""
        several = len(materials) > 1
        self.set_feature(card_feature(depth=depth, shiny=materials.shiny, several=several))
        if self._gpu is not None and len(materials) != self._known:
            self._gpu[1].upload(materials.table())
        self._known = len(materials)
        self._materials = materials

    def show(self, frame, rows, pool):
        """Draw cards in a frame."""
        if self._gpu is None:
            matter = Texture(frame.window).upload(self._materials.table())
            self._gpu = Texture(frame.window), matter
        cards, matter = self._gpu
        height = max(1, -(-len(rows) // _ROW))
        table = np.zeros((height * _ROW, _TEXELS, 4), np.float32)
        table[: len(rows)] = rows
        if self._table is None or not np.array_equal(table, self._table):
            self._table = table
            cards.upload(table.reshape(height, _ROW * _TEXELS, 4))
        clip, view = frame.clip_from_view, frame.view_from_world
        self.textures = {**pool.textures, 'ibr_cards': cards, 'ibr_materials': matter}
        self.uniforms = {
            'ibr_count': len(rows),
            'ibr_clip_from_eye': clip,
            'ibr_eye_from_world': view[:3, :3],
            'ibr_clip_depth': (clip[2, 2], clip[2, 3], clip[3, 2], clip[3, 3]),
        }
        self.show_spans([(0, len(rows))])

    def release(self, window):
        """Free GPU memory; the context is current."""
        super().release(window)
        for texture in self._gpu or ():
            texture.release()
        self._gpu = self._table = None
