"""Gaussian points in targets of floats: there, colours below 0 and alphas of light would count."""

from __future__ import annotations

from pvibr.core._vtk import method
from pvibr.gl.feature import Feature, FeatureSet

_TAG = 'VTK::DepthPeeling::Impl'
# PyVista's points as spheres have negative rims, which targets of bytes clamp.
_CLAMPED = Feature(
    'clamped_splats',
    fragment={_TAG: f'  gl_FragData[0] = max(gl_FragData[0], vec4(0.0));\n//{_TAG}'},
)
# VTK adds alpha times the colour, and alpha times alpha: a thousandth of alpha and a thousand
# times the colour are as much light, and hide nothing of what will be put behind.
_LIGHT = Feature(
    'light_splats',
    fragment={
        _TAG: f"""  {{
    vec4 splat = max(gl_FragData[0], vec4(0.0));
    gl_FragData[0] = vec4(splat.rgb * splat.a * 1e3, 1e-3);
  }}
//{_TAG}"""
    },
)


class Splats:
    """What Gaussian points of a renderer write while its scene is drawn into floats."""

    def __init__(self, renderer):
        self._renderer = renderer
        self._attached = FeatureSet()
        self._found: list = []
        self._time = -1

    def look(self):
        """Look for them anew if props came or went since the last frame: mappers are asked."""
        props = self._renderer.GetViewProps()
        if props.GetMTime() != self._time:
            self._found = [p for p in props if p.IsA('vtkActor') and _splats(p.GetMapper())]

    def settle(self):
        """Take the props for unchanged: a frame takes some out, and puts them back."""
        self._time = self._renderer.GetViewProps().GetMTime()

    def shine(self) -> bool:
        """Return whether any adds light."""
        return any(a.GetMapper().GetEmissive() for a in self._visible())

    def _visible(self) -> list:
        return [actor for actor in self._found if method(actor, 'GetVisibility')()]

    def match(self, floats):
        """Have them write what the target of this frame needs."""
        peeling = self._renderer.GetUseDepthPeeling()
        splats = self._visible() if floats else ()
        light = () if peeling else {id(a) for a in splats if a.GetMapper().GetEmissive()}
        self._attached.match(splats, lambda a: (_LIGHT if id(a) in light else _CLAMPED,))


def _splats(mapper) -> bool:
    return mapper is not None and mapper.IsA('vtkPointGaussianMapper')
