"""Shader text without what a material does not have, which VTK computes for each fragment."""

from __future__ import annotations

from pvibr.gl.feature import Feature
from pvibr.things.shader_draws import DULL_FEATURE, is_shiny

# The compiler then drops what discards fragments without alpha.
_OPAQUE = Feature(
    'opaque', fragment={'VTK::TCoord::Impl': '//VTK::TCoord::Impl\n  gl_FragData[0].a = 1.0;\n'}
)


def leave_out_unused(*actors):
    """Let actors draw the same with less: no highlights and no alpha where there are none."""
    for actor in actors:
        has_alpha = actor.GetForceOpaque() or actor.HasTranslucentPolygonalGeometry()
        has_highlights = is_shiny(actor.GetProperty(), actor.GetBackfaceProperty())
        for feature, is_used in ((DULL_FEATURE, has_highlights), (_OPAQUE, has_alpha)):
            (feature.detach if is_used else feature.attach)(actor)
