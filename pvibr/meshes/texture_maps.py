"""Normal and emission maps with any shading, without tangents."""

from __future__ import annotations

from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, replacements, sections

_LAST = 'VTK::DepthPeeling::Impl'

#: VTK's code after which the normal of a smooth surface is final.
_TURNED = 'if (gl_FrontFacing == false) { normalVCVSOutput = -normalVCVSOutput; }'
#: VTK's declarations, and the macro defined after each.
_DECLARED = {
    'sampler2D normalTex;': 'IBR_NORMAL_MAP',
    'sampler2D emissiveTex;': 'IBR_EMISSION_MAP',
    'uniform vec3 emissiveFactorUniform;': 'IBR_PHYSICAL',
}


def emission_of(actor):
    """Return the emission (r, g, b) that :func:`attach_maps` set, or None."""
    present = replacements(actor.GetShaderProperty()).get(('Fragment', f'//{_LAST}'), '')
    shines = Feature('emission').mark in present
    return actor.GetProperty().GetEmissiveFactor() if shines else None


def attach_maps(actor, emission=None):
    """Make an actor's shader show the maps of its property, and its emission (r, g, b)."""
    if emission is None and actor.GetProperty().GetTexture('normalTex') is None:
        return
    section, shader = sections(shader_source(__file__)), actor.GetShaderProperty()
    # After VTK's declarations: a map that VTK does not declare cannot be sampled.
    defines = {vtk_text: f'{vtk_text}\n#define {name}\n' for vtk_text, name in _DECLARED.items()}
    for vtk_text, replacement in (defines | {_TURNED: f'{_TURNED}\n{section["normal"]}'}).items():
        shader.AddFragmentShaderReplacement(vtk_text, False, replacement, True)
    if emission is not None:
        color = ', '.join(f'{float(x):.6f}' for x in emission)
        body = section['emission'].replace('IBR_EMISSION;', f'vec3({color});')
        Feature('emission', fragment={_LAST: body}).attach(actor)
