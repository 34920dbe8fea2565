"""Ambient occlusion: corners and contacts receive less ambient light."""

from __future__ import annotations

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, Texture, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.gl.target import fitting_target
from pvibr.things.buffers import Drawn

_STEPS = 16  # along a slice, on either side of a pixel
_COARSEST_FROM = 0.3  # quality up to which one pixel of 4 x 4 is searched, not of 2 x 2
_RADIUS = 0.05  # default, as a fraction of the scene's diagonal


class AmbientOcclusion(Effect):
    """Darkening of corners and contacts, where light from all around is blocked.

    Colours are multiplied by the open fraction of a cosine-weighted hemisphere over the surface,
    where a blocker at a distance d counts ``1 - (d / radius)**2``. Surfaces are those in the depth
    buffer: hidden ones and those outside of the picture block nothing. The background is
    unchanged; translucent props and volumes darken with the surface behind them.

    Parameters
    ----------
    radius : float, optional
        Distance within which surfaces block light, world units; by default a twentieth of
        the scene's diagonal.
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
        'Distance within which surfaces block light; by default 1/20 of the scene. Small radii '
        'show fine relief, large ones the shape of rooms.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    strength = Param(1.0, 'Exponent of visibility: above 1 darkens more.', range='[0, 8]')
    thickness = Param(
        None,
        'Assumed thickness of surfaces; the radius by default. Lower it if thin objects cast too '
        'wide a darkening.',
        range='[0, inf)',
        unit='world',
        kind=float,
    )
    samples = Param(64, 'Samples per pixel: fewer are faster, and noisier.', range='[32, 512]')
    unlit = Param(True, 'Whether to darken surfaces without lighting too.')

    def __init__(self, radius=None, **settings):
        super().__init__(radius=radius, **settings)
        self._quads: dict[str, Quad] = {}
        self._visibility: Target | None = None
        self._unlit_buffer: Drawn | None = None

    @classmethod
    def sample(cls, actors):
        """Return a strong instance."""
        return cls(0.15, strength=4.0)

    def reach(self, frame) -> float:
        """Return the radius at the near plane, where it is largest, in pixels."""
        near_distance = 1.0 if frame.parallel else frame.near
        return self._world_radius(frame) * frame.pixel_scale / near_distance + 4

    def render(self, frame, picture):
        """Darken the picture."""
        coarse = _coarseness(frame.quality)
        square_counts = tuple(-(-pixels // coarse) for pixels in picture.size)
        visibility = self._allocate(frame.window, square_counts)
        clip_from_view = frame.clip_from_view
        center_shift = -clip_from_view[:2, 3] if frame.parallel else clip_from_view[:2, 2]
        half_extents = 1 / np.diag(clip_from_view)[:2]
        view_uniforms = {
            'lens': (*half_extents, *(half_extents * center_shift)),
            'planes': (frame.near, frame.far),
            'parallel': int(frame.parallel),
            'coarse': coarse,
        }
        search_uniforms = self.search_uniforms(frame)
        depth_texture = {'depth': picture.depth}
        visibility.draw(self._quads['search'], view_uniforms | search_uniforms, depth_texture)
        apply_textures = {
            'color': picture.color,
            'visibility': visibility.colors[0],
        } | depth_texture
        unlit_depth = self._draw_unlit(frame)
        apply_textures['unlit_depth'] = unlit_depth or picture.depth
        uniforms = view_uniforms | {
            'strength': self.strength,
            'exempts': int(unlit_depth is not None),
            'edges': int(frame.window.GetMultiSamples() > 1),
        }
        with picture.drawing():
            self._quads['apply'].draw(uniforms, apply_textures)

    def search_uniforms(self, frame) -> dict:
        """Return the uniforms of the search that depend on settings and on the frame's quality."""
        radius = self._world_radius(frame)
        return {
            'slices': max(1, round(self.samples * _share(frame.quality) / (2 * _STEPS))),
            'steps': _STEPS,
            'radius': float(radius),
            'thickness': float(radius if self.thickness is None else self.thickness),
            'vary': (*frame.vary('occlusion'), frame.vary('occlusion, sectors')[0]),
        }

    def _draw_unlit(self, frame) -> Texture | None:
        """Draw the depth of unlit actors that keep their colour, if there are any."""
        actors = () if self.unlit else frame.renderer.GetActors()
        unlit_actors = [a for a in actors if _is_unlit(a)]
        if not unlit_actors:
            release(self._unlit_buffer)
            self._unlit_buffer = None
            return None
        self._unlit_buffer = self._unlit_buffer or Drawn(
            frame.renderer, self.pipeline.surfaces.plain_actors
        )
        return self._unlit_buffer.draw(frame, self.pipeline.things, unlit_actors).depth

    def _world_radius(self, frame) -> float:
        return _RADIUS * frame.scene_size if self.radius is None else self.radius

    def _allocate(self, window, size) -> Target:
        if not self._quads:
            self._quads = quads_of(window, __file__, 'common')
        self._visibility = fitting_target(self._visibility, window, size, ('r32f',))
        return self._visibility

    def release(self):
        """Free GPU memory; the context is current."""
        release(self._visibility, self._unlit_buffer, *self._quads.values())
        self._visibility, self._unlit_buffer, self._quads = None, None, {}

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(self._visibility, self._unlit_buffer)}


def _coarseness(quality) -> int:
    """Return the side of the squares of pixels of which one is searched."""
    return 1 if quality >= 1 else 2 if quality > _COARSEST_FROM else 4


def _share(quality) -> float:
    """Return the share of samples of a pixel that is searched."""
    return min(quality * _coarseness(quality) ** 2, 1.0)


def _is_unlit(actor) -> bool:
    return bool(actor.GetVisibility() and not actor.GetProperty().GetLighting())
