"""Full-screen programs: a fragment shader over a rectangle."""

from __future__ import annotations

import re
from pathlib import Path

from pvibr.core import _vtk
from pvibr.core.counts import count_draw
from pvibr.core.errors import ShaderError
from pvibr.gl import enums as gl
from pvibr.gl.feature import sections
from pvibr.gl.texture import SPARE_UNIT
from pvibr.gl.uniforms import set_uniforms

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
# Blend factors of source and target, for colours and for alpha.
_BLENDS = {
    'over': gl.OVER,
    'add': (gl.ONE, gl.ONE, gl.ONE_MINUS_DST_ALPHA, gl.ONE),
    'sum': (gl.ONE, gl.ONE, gl.ONE, gl.ONE),
    'screen': (gl.ONE_MINUS_DST_COLOR, gl.ONE, gl.ONE_MINUS_DST_ALPHA, gl.ONE),
}
_MAX_LINES = 8  # of the driver's log in a message


def shader_source(module_file, stem=None) -> str:
    """Return the source of the shader beside a module."""
    path = Path(module_file)
    return path.with_name(f'{stem or path.stem}.glsl').read_text(encoding='utf-8')


def quads_of(window, module_file, shared='') -> dict[str, Quad]:
    """Return the programs of the shader beside a module; a shared section is prepended to each."""
    texts, name = sections(shader_source(module_file)), Path(module_file).stem
    head = texts.pop(shared, '')
    return {n: Quad(window, head + text, f'{name}.glsl, {n}') for n, text in texts.items()}


def _log(fragment):
    """Return the driver's log of a fragment shader, compiled alone since VTK keeps none."""
    output_numbers = sorted(set(re.findall(r'gl_FragData\[(\d+)\]', fragment)))
    output_lines = ''.join(f'out vec4 fragOutput{n};\n' for n in output_numbers)
    text = re.sub(r'gl_FragData\[(\d+)\]', r'fragOutput\1', fragment)
    shader = _vtk.vtkShader()
    shader.SetType(shader.Fragment)
    shader.SetSource(f'#version 150\nin vec2 uv;\n{output_lines}{text}')
    is_compiled = shader.Compile()
    driver_log = shader.GetError().strip()
    if is_compiled:
        driver_log = 'it does not link; is main() missing?'
    shader.Cleanup()
    return driver_log


class Quad:
    """A fragment shader drawn over the whole bound target."""

    def __init__(self, window, fragment, name='quad', geometry=''):
        self.window, self.name = window, name
        geometry = geometry and _GEOMETRY_HEAD + geometry
        shader_texts = _VERTEX, _FRAGMENT_HEAD + fragment, geometry
        shader_cache = window.GetShaderCache()
        shader_cache.ReleaseCurrentShader()  # the next one bound is this program, or none
        shows_warnings = _vtk.vtkObject.GetGlobalWarningDisplay()
        _vtk.vtkObject.SetGlobalWarningDisplay(False)  # VTK would print the source
        try:
            self.helper = _vtk.vtkOpenGLQuadHelper(window, *shader_texts)
        finally:
            _vtk.vtkObject.SetGlobalWarningDisplay(shows_warnings)
        self.program = shader_cache.GetLastShaderBound()
        self._shaders, self._state = shader_cache, window.GetState()
        if self.program is None:
            log = _log(fragment)
            first_lines = '\n'.join(log.splitlines()[:_MAX_LINES])
            raise ShaderError(f'shader {name!r} does not compile: {first_lines}', log)

    def draw(self, uniforms=None, textures=None, blend=None):
        """Draw once, without depth test and culling."""
        self._state.Push()
        try:
            self.draw_alone(uniforms or {}, textures or {}, blend)
        finally:
            self._state.Pop()

    def draw_alone(self, uniforms, textures, blend=None):
        """Draw without restoring GL state, which the caller does."""
        state = self._state
        for flag in (gl.DEPTH_TEST, gl.CULL_FACE, gl.STENCIL_TEST):
            state.SetEnumState(flag, False)
        state.SetEnumState(gl.BLEND, blend is not None)
        if blend is not None:
            state.vtkglBlendEquation(gl.FUNC_ADD)
            state.vtkglBlendFuncSeparate(*_BLENDS[blend])
        program = self.program
        self._shaders.ReadyShaderProgram(program)
        count_draw(program)
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
