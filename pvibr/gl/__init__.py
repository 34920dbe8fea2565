"""The only code that touches VTK's OpenGL classes."""

from pvibr.gl.mipmaps import MipTexture
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture, nbytes_of, release, texture_limit, texture_units
from pvibr.gl.uniforms import (
    set_fragment_uniforms,
    set_shared_uniforms,
    set_uniforms,
    set_vertex_uniforms,
)

__all__ = [
    'MipTexture',
    'Quad',
    'Target',
    'Texture',
    'nbytes_of',
    'release',
    'set_fragment_uniforms',
    'set_shared_uniforms',
    'set_uniforms',
    'set_vertex_uniforms',
    'shader_source',
    'texture_limit',
    'texture_units',
]
