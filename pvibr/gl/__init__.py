"""The only code that touches VTK's OpenGL classes."""

from pvibr.gl.mipmaps import MipTexture
from pvibr.gl.quad import Quad, set_uniforms, shader_source, uniform_matrix
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture, texture_limit, texture_units

__all__ = [
    'MipTexture',
    'Quad',
    'Target',
    'Texture',
    'set_uniforms',
    'shader_source',
    'texture_limit',
    'texture_units',
    'uniform_matrix',
]
