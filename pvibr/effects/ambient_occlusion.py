"""Ambient occlusion: corners and contacts receive less of the light from all around."""

from __future__ import annotations

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, Texture, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.gl.target import fitting_target
from pvibr.scene.buffers import Drawn

_STEPS = 16  # on either side of a pixel along a slice
_RADIUS = 0.05  # default, over the diagonal of the scene


class AmbientOcclusion(Effect):
    """Darkening of corners and contacts, where light from all around is blocked.

    Colours are multiplied by the share of a cosine-weighted hemisphere over the surface that is
    open, where what blocks it at a distance d counts ``1 - (d / radius)**2``. Surfaces are those
    in the depth buffer: what is out of the picture, or hidden, blocks nothing. The background
    stays as it is; translucent props and volumes darken as the surface behind them does.

    Parameters
    ----------
    radius : float, optional
        Distance within which surfaces block light, world units; by default a twentieth of
        the diagonal of what is in the scene.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.ParametricRandomHills())
    >>> occlusion = pl.ibr.add(pvibr.AmbientOcclusion(2.0, strength=1.5))
    >>> occlusion.radius
    2.0
    """

    single = True
    neutral = 'strength', 0
    presets = {
        'subtle': {'strength': 0.6},
        'strong': {'strength': 2.0},
        'fast': {'samples': 32},
    }

    radius = Param(
        None,
        'Distance within which surfaces block light; a twentieth of the scene by default.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    strength = Param(1.0, 'Exponent of visibility.', range='[0, 8]')
    thickness = Param(
        None,
        'Depth of surfaces behind what is seen of them; the radius by default.',
        range='[0, inf)',
        unit='world',
        kind=float,
    )
    samples = Param(64, 'Samples per pixel.', range='[32, 512]')
    unlit = Param(True, 'Darken surfaces without lighting as well.')

    def __init__(self, radius=None, **settings):
        super().__init__(radius=radius, **settings)
        self._quads: dict[str, Quad] = {}
        self._found: Target | None = None
        self._unlit: Drawn | None = None

    @classmethod
    def sample(cls, actors):
        """Return an instance that shows."""
        return cls(0.15, strength=4.0)

    def reach(self, frame) -> float:
        """Return the radius at the near plane, where it is widest, in pixels."""
        away = 1.0 if frame.parallel else frame.near
        return self._radius(frame) * frame.pixel_scale / away + 4

    def render(self, frame, picture):
        """Darken the picture."""
        found = self._allocate(frame.window, picture.size)
        clip = frame.clip_from_view
        shift = -clip[:2, 3] if frame.parallel else clip[:2, 2]
        across = 1 / np.diag(clip)[:2]
        view = {
            'lens': (*across, *(across * shift)),
            'planes': (frame.near, frame.far),
            'parallel': int(frame.parallel),
        }
        radius = self._radius(frame)
        search = {
            'slices': max(1, round(self.samples * frame.quality / (2 * _STEPS))),
            'steps': _STEPS,
            'radius': float(radius),
            'thickness': float(radius if self.thickness is None else self.thickness),
            'vary': (*frame.vary('occlusion'), frame.vary('occlusion, sectors')[0]),
        }
        depth = {'depth': picture.depth}
        found.draw(self._quads['search'], view | search, depth)
        scene = {'color': picture.color, 'found': found.colors[0]} | depth
        shown = self._shown(frame)
        scene['unlit'] = shown or picture.depth
        uniforms = view | {
            'strength': self.strength,
            'exempts': int(shown is not None),
            'edges': int(frame.window.GetMultiSamples() > 1),
        }
        with picture.drawing():
            self._quads['apply'].draw(uniforms, scene)

    def _shown(self, frame) -> Texture | None:
        """Draw the depth of what keeps its colour, if there is any."""
        actors = [] if self.unlit else [a for a in frame.renderer.GetActors() if _keeps(a)]
        if not actors:
            release(self._unlit)
            self._unlit = None
            return None
        self._unlit = self._unlit or Drawn(frame.renderer)
        return self._unlit.draw(frame, self.pipeline.things, actors).depth

    def _radius(self, frame) -> float:
        return _RADIUS * frame.scene_size if self.radius is None else self.radius

    def _allocate(self, window, size) -> Target:
        if not self._quads:
            self._quads = quads_of(window, __file__, 'common')
        self._found = fitting_target(self._found, window, size, ('r32f',))
        return self._found

    def release(self):
        """Free GPU memory; the context is current."""
        release(self._found, self._unlit, *self._quads.values())
        self._found, self._unlit, self._quads = None, None, {}

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(self._found, self._unlit)}


def _keeps(actor) -> bool:
    """Return True if an actor is seen in its own colours."""
    return bool(actor.GetVisibility() and not actor.GetProperty().GetLighting())
