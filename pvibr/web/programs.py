"""VTK's own final shader sources, as GLSL ES 3.00: one source for each shader."""

from __future__ import annotations

import re

import pyvista as pv

from pvibr.core import _vtk

_HEADER = (
    '#version 300 es\nprecision highp float;\nprecision highp int;\n'
    'precision highp sampler2D;\n#define texture2D texture\n#define varying {}\n'
)
# What VTK declares for other versions of GLSL.
_OLD_LINES = re.compile(
    r'^#version.*$|^#define (attribute|varying|highp|mediump|lowp|texelFetchBuffer).*$', re.M
)
_REPLACED = (
    # A copy of a mesh for each instance: WebGL draws them instanced.
    ('int(floor((float(gl_VertexID) + 0.5) / VERTICES))', 'gl_InstanceID'),
    ('gl_VertexID - copy * int(VERTICES)', 'gl_VertexID'),
)
_SHRUNK = re.compile(r'^#define SHRUNK .*$', re.M)
_SIZE = 'uniform float ibr_point_size;\nvoid main()', '  gl_PointSize = ibr_point_size;\n'
_COMMENT = re.compile(r'^\s*//.*$\n?', re.M)


class Programs:
    """Draws actors once in a hidden window, and reads the programs that VTK made for them."""

    def __init__(self, lights, received=()):
        #: Shadows and projectors, which attach to each actor.
        self._received = received
        self._plotter = pv.Plotter(off_screen=True, window_size=[16, 16], lighting='none')
        renderer = self._plotter.renderer
        renderer.GetCullers().RemoveAllItems()
        renderer.SetUseOIT(False)
        for light in lights:
            renderer.AddLight(light.ShallowClone())
        self._sources: list[dict] = []

    def add(self, actor, *, cull=False) -> int:
        """Add an actor that draws triangles; return the number of its program."""
        number = len(self._sources)
        self._sources.append({})
        mapper = actor.GetMapper()
        inner = mapper.GetPolyDataMapper() if hasattr(mapper, 'GetPolyDataMapper') else mapper

        @_vtk.calldata_type(_vtk.VTK_OBJECT)
        def read(_mapper, _event, program):
            self._sources[number] = {
                'vertex': as_es(program.GetVertexShader().GetSource(), 'out'),
                'fragment': as_es(program.GetFragmentShader().GetSource(), 'in'),
            }

        inner.AddObserver('UpdateShaderEvent', read)
        for each in self._received:
            each.attach(actor)
        self._plotter.renderer.AddActor(actor)
        return number

    def read(self) -> list[dict]:
        """Draw all actors, and return the sources of their programs in the order of `add`."""
        self._plotter.show(auto_close=False)
        self._plotter.close()
        return self._sources


def as_es(source, varying) -> str:
    """Return a shader of GLSL 1.50 as GLSL ES 3.00."""
    source = _OLD_LINES.sub('', source)
    for text, replacement in _REPLACED:
        source = source.replace(text, replacement)
    source = _SHRUNK.sub('#define SHRUNK 1.0', source)
    if varying == 'out' and 'gl_PointSize' not in source:  # OpenGL has it as a state
        source = source.replace('void main()', _SIZE[0], 1)
        end = source.rindex('}')
        source = f'{source[:end]}{_SIZE[1]}{source[end:]}'
    return _HEADER.format(varying) + _COMMENT.sub('', source)


def as_quad(fragment) -> str:
    """Return the fragment shader of a full-screen program as GLSL ES 3.00, with one output."""
    text = _COMMENT.sub('', fragment).replace('gl_FragData[0]', 'fragOutput0')
    text = re.sub(r'^\s*gl_FragData\[1\].*$', '', text, flags=re.M)
    return f'{_HEADER.format("in")}in vec2 uv;\nout vec4 fragOutput0;\n{text}'
