"""Fog by depth and by height."""

from __future__ import annotations

import numpy as np

from pvibr.core.colors import Color
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import shader_source
from pvibr.gl.fused import Pointwise
from pvibr.maths.vectors import unit_vectors

_TEXT = shader_source(__file__)
_DIAGONALS = 3.0  # default visibility; PyVista's first view is from two diagonals away


class Fog(Effect):
    """Fog that hides distant surfaces, and with a height low ones.

    A fraction ``exp(-distance / visibility)`` of a surface's light comes through; the rest is the
    colour of the fog. With a `height`, that density holds at the height `base`, and falls by
    ``exp(-h / height)`` at h above it. The background is unchanged; translucent props and volumes
    fade like the surface behind them.

    Parameters
    ----------
    visibility : float, optional
        Distance at which 37 % of the light comes through, world units; by default three times
        the scene's diagonal, which half hides it in PyVista's first view.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> fog = pl.ibr.add(pvibr.Fog(2.0, height=0.3))
    >>> fog.visibility
    2.0
    """

    single = True
    neutral = 'intensity', 0
    presets = {
        'haze': {'intensity': 0.5},
        'valley': {'height': 0.2},
    }

    visibility = Param(
        None,
        'Distance at which 37 % of the light comes through; by default three diagonals of the '
        'scene.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    begin = Param(0.0, 'Distance at which fog begins.', range='[0, inf)', unit='world')
    height = Param(
        None,
        'Height over which density falls to 37 %, for ground fog; uniform by default.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    base = Param(0.0, 'Height at which `visibility` holds, with a `height`.', unit='world')
    up = Param((0.0, 0.0, 1.0), 'Up direction in world space.')
    color = Color(
        None, 'Colour of the fog; by default that of the horizon of a `Sky`, else the background.'
    )
    intensity = Param(1.0, 'Opacity of the fog.', range='[0, 1]')

    def __init__(self, visibility=None, **settings):
        super().__init__(visibility=visibility, **settings)

    @classmethod
    def sample(cls, actors):
        """Return dense fog in a vivid colour."""
        return cls(2.0, color=(1, 0, 1))

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        return super().needed(frame) if np.any(self.up) else 'up is (0, 0, 0): give a direction'

    def render(self, frame, picture):
        """Draw the fog."""
        up = unit_vectors(self.up)
        uniforms = {
            'view_from_clip': np.linalg.inv(frame.clip_from_view),
            'parallel': int(frame.parallel),
            'tint': (*(self.color or self.pipeline.horizon_color(frame)), self.intensity),
            'air': (
                self.begin,
                1 / (self.visibility or _DIAGONALS * frame.scene_size),
                1 / self.height if self.height else 0,
            ),
            'rise': (*frame.view_from_world[:3, :3] @ up, float(frame.eye @ up) - self.base),
        }
        picture.apply(Pointwise('fog', _TEXT, uniforms, {'depth': picture.depth}))
