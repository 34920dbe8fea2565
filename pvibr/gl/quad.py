"""A full-screen program: a fragment shader over a rectangle."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.gl.texture import SPARE_UNIT

_VERTEX = """//VTK::System::Dec
in vec4 ndCoordIn;
in vec2 texCoordIn;
out vec2 uv;
void main() { uv = texCoordIn; gl_Position = ndCoordIn; }
"""
_FRAGMENT_HEAD = """//VTK::System::Dec
//VTK::Output::Dec
in vec2 uv;
"""
_GEOMETRY_HEAD = '//VTK::System::Dec\n'
# GL enums of the states that a full-screen program wants off.
_BLEND, _DEPTH_TEST, _CULL_FACE, _STENCIL_TEST = 0x0BE2, 0x0B71, 0x0B44, 0x0B90
# How what is drawn is blended with what is there: factors of both, of colours and of alpha.
_ONE, _REST_OF_COLOR, _REST_OF_ALPHA = 1, 0x0307, 0x0305
_ALPHA, _REST_OF_OWN_ALPHA = 0x0302, 0x0303
_ADD = 0x8006
_WAYS = {
    'over': (_ALPHA, _REST_OF_OWN_ALPHA, _ONE, _REST_OF_OWN_ALPHA),
    'add': (_ONE, _ONE, _REST_OF_ALPHA, _ONE),
    'screen': (_REST_OF_COLOR, _ONE, _REST_OF_ALPHA, _ONE),
}
_SETTERS = {2: 'SetUniform2f', 3: 'SetUniform3f', 4: 'SetUniform4f'}
_MOST_LINES = 8  # of a driver's log in a message


def shader_source(module_file, stem=None) -> str:
    """Return the text of the shader that lies beside a module."""
    path = Path(module_file)
    return path.with_name(f'{stem or path.stem}.glsl').read_text(encoding='utf-8')


def set_uniforms(program, uniforms):
    """Set uniforms of a program by the type of each value."""
    for name, value in uniforms.items():
        kind = type(value)
        if kind is float:  # most are of these kinds; dozens are set in a frame
            program.SetUniformf(name, value)
        elif kind is tuple or kind is list:
            getattr(program, _SETTERS[len(value)])(name, value)
        elif isinstance(value, (int, np.integer)):
            program.SetUniformi(name, int(value))
        elif isinstance(value, np.floating):
            program.SetUniformf(name, float(value))
        elif hasattr(value, 'GetElement'):
            program.SetUniformMatrix(name, value)
        else:
            values = [float(v) for v in value]
            getattr(program, _SETTERS[len(values)])(name, values)


def uniform_matrix(rows):
    """Return a matrix as :func:`set_uniforms` takes it."""
    matrix = _vtk.vtkMatrix3x3() if len(rows) == 3 else _vtk.vtkMatrix4x4()
    matrix.DeepCopy(np.asarray(rows, float).T.ravel().tolist())
    return matrix


def _log(fragment):
    """Return what the driver says of a text, compiled alone since VTK keeps no log of failures."""
    outputs = sorted(set(re.findall(r'gl_FragData\[(\d+)\]', fragment)))
    head = ''.join(f'out vec4 fragOutput{n};\n' for n in outputs)
    text = re.sub(r'gl_FragData\[(\d+)\]', r'fragOutput\1', fragment)
    shader = _vtk.vtkShader()
    shader.SetType(shader.Fragment)
    shader.SetSource(f'#version 150\nin vec2 uv;\n{head}{text}')
    compiled = shader.Compile()
    log = 'it does not link; is there a main?' if compiled else shader.GetError().strip()
    shader.Cleanup()
    return log


class Quad:
    """A fragment shader drawn over the whole of whatever target is bound."""

    def __init__(self, window, fragment, name='quad', geometry=''):
        self.window, self.name = window, name
        geometry = geometry and _GEOMETRY_HEAD + geometry
        texts = _VERTEX, _FRAGMENT_HEAD + fragment, geometry
        cache = window.GetShaderCache()
        cache.ReleaseCurrentShader()  # so that what is bound afterwards is this one, or none
        warned = _vtk.vtkObject.GetGlobalWarningDisplay()
        _vtk.vtkObject.SetGlobalWarningDisplay(False)  # VTK would print the whole text
        try:
            self.helper = _vtk.vtkOpenGLQuadHelper(window, *texts)
        finally:
            _vtk.vtkObject.SetGlobalWarningDisplay(warned)
        self.program = cache.GetLastShaderBound()
        self._shaders, self._state = cache, window.GetState()
        if self.program is None:
            log = _log(fragment)
            most = '\n'.join(log.splitlines()[:_MOST_LINES])
            msg = f'shader {name!r} does not compile: {most}'
            raise ShaderError(msg, log)

    def draw(self, uniforms=None, textures=None, blend=None):
        """Draw once; depth test and culling are off meanwhile."""
        self._state.Push()
        try:
            self.draw_alone(uniforms or {}, textures or {}, blend)
        finally:
            self._state.Pop()

    def draw_alone(self, uniforms, textures, blend=None):
        """Draw, and leave the states that it needs behind: the caller puts them back."""
        state = self._state
        for flag in (_DEPTH_TEST, _CULL_FACE, _STENCIL_TEST):
            state.SetEnumState(flag, False)
        state.SetEnumState(_BLEND, blend is not None)
        if blend is not None:
            state.vtkglBlendEquation(_ADD)
            state.vtkglBlendFuncSeparate(*_WAYS[blend])
        program = self.program
        self._shaders.ReadyShaderProgram(program)
        objects = [texture.object for texture in textures.values()]
        for name, texture in zip(textures, objects, strict=True):
            texture.Activate()
            program.SetUniformi(name, texture.GetTextureUnit())
        state.vtkglActiveTexture(SPARE_UNIT)
        set_uniforms(program, uniforms)
        try:
            self.helper.Render()
        finally:
            for texture in objects:
                texture.Deactivate()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.helper.ReleaseGraphicsResources(self.window)
