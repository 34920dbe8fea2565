"""The shader text of billboards."""

from __future__ import annotations

from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.things.clipping import KEPT


def billboard_feature(clips) -> Feature:
    """Return the shader text by VTK's tags, with or without clipping planes."""
    shader_parts = sections(shader_source(__file__, 'billboards'))
    vertex = {
        'VTK::PositionVC::Dec': shader_parts['vertex.declare'],
        'VTK::PositionVC::Impl': shader_parts['vertex.position'],
    }
    fragment = {
        'VTK::PositionVC::Dec': clips * f'#define CLIPS 1\n{KEPT}'
        + shader_parts['fragment.declare'],
        'VTK::PositionVC::Impl': shader_parts['fragment.sample'],
        'VTK::Color::Impl': '//VTK::Color::Impl\n' + shader_parts['fragment.color'],
        'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
    }
    return Feature('billboards' + '_clipped' * clips, vertex, fragment)
