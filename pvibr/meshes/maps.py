"""Normal and emission maps: drawn with any shading, without tangents."""

from __future__ import annotations

from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, replacements, sections

_LAST = 'VTK::DepthPeeling::Impl'

#: Before this VTK has computed the normal of a smooth surface, on the side that is seen.
_TURNED = 'if (gl_FrontFacing == false) { normalVCVSOutput = -normalVCVSOutput; }'
#: What VTK declares, and what is defined there.
_DECLARED = {
    'sampler2D normalTex;': 'IBR_NORMAL_MAP',
    'sampler2D emissiveTex;': 'IBR_EMISSION_MAP',
    'uniform vec3 emissiveFactorUniform;': 'IBR_PHYSICAL',
}


def emission_of(actor):
    """Return the light (r, g, b) that an actor emits by :func:`attach_maps`, or None."""
    present = replacements(actor.GetShaderProperty()).get(('Fragment', f'//{_LAST}'), '')
    shines = Feature('emission').mark in present
    return actor.GetProperty().GetEmissiveFactor() if shines else None


def attach_maps(actor, emission=None):
    """Have an actor's shader show the maps of its property, and emission (r, g, b) as light.

    The emission is the property's, too.
    """
    if emission is None and actor.GetProperty().GetTexture('normalTex') is None:
        return
    text, shader = sections(shader_source(__file__)), actor.GetShaderProperty()
    # After VTK's own: only where VTK has declared a map is it there to be sampled.
    later = {found: f'{found}\n#define {name}\n' for found, name in _DECLARED.items()}
    for found, instead in (later | {_TURNED: f'{_TURNED}\n{text["normal"]}'}).items():
        shader.AddFragmentShaderReplacement(found, False, instead, True)
    if emission is not None:
        color = ', '.join(f'{float(x):.6f}' for x in emission)
        body = text['emission'].replace('IBR_EMISSION;', f'vec3({color});')
        Feature('emission', fragment={_LAST: body}).attach(actor)
