"""Gaussian points in float targets, where negative colours and accumulated alpha would show."""

from __future__ import annotations

from pvibr.core._vtk import method
from pvibr.gl.feature import Feature, FeatureSet

_TAG = 'VTK::DepthPeeling::Impl'
# PyVista's sphere points have negative rims, which 8-bit targets clamp.
_CLAMPED = Feature(
    'clamped_splats',
    fragment={_TAG: f'  gl_FragData[0] = max(gl_FragData[0], vec4(0.0));\n//{_TAG}'},
)
# VTK adds alpha times colour, and alpha times alpha. A thousandth of the alpha with a thousand
# times the colour gives the same light and hides nothing composited behind it.
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
    """Sets what a renderer's Gaussian points write while the scene is drawn into floats."""

    def __init__(self, renderer, plain_actors):
        self._renderer, self._plain_actors = renderer, plain_actors
        self._attached = FeatureSet()
        self._splat_actors: list = []
        self._props_key: tuple = ()

    def look(self):
        """Find them again if props were added or removed since the last frame."""
        if self._key() != self._props_key:
            props, plain_actors = self._renderer.GetViewProps(), self._plain_actors
            actors = [a for p in props for a in plain_actors.of(p) if a.IsA('vtkActor')]
            self._splat_actors = [a for a in actors if _draws_splats(a.GetMapper())]

    def settle(self):
        """Treat the props as unchanged: a frame removes and restores some."""
        self._props_key = self._key()

    def _key(self):
        return self._renderer.GetViewProps().GetMTime(), self._plain_actors.version()

    def shine(self) -> bool:
        """Return whether any is emissive."""
        return any(is_emissive(a.GetMapper()) for a in self._visible())

    def _visible(self) -> list:
        return [actor for actor in self._splat_actors if method(actor, 'GetVisibility')()]

    def match(self, floats):
        """Attach the shader text that this frame's target needs."""
        splats, additive = self._visible() if floats else (), set()
        if not self._renderer.GetUseDepthPeeling():
            additive = {id(a) for a in splats if is_emissive(a.GetMapper())}
        self._attached.match(splats, lambda a: (_LIGHT if id(a) in additive else _CLAMPED,))


def is_emissive(mapper) -> bool:
    """Return whether a mapper draws Gaussian points that add their light."""
    return _draws_splats(mapper) and bool(mapper.GetEmissive())


def _draws_splats(mapper) -> bool:
    return mapper is not None and mapper.IsA('vtkPointGaussianMapper')
