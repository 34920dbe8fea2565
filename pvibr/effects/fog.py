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
# PyVista's first view is from two diagonals away.
_DIAGONALS = 3.0


class Fog(Effect):
    """Fog that hides what is far away, and with a height what is low.

    A share ``exp(-distance / visibility)`` of the light of a surface is seen, and the colour of
    the fog for the rest. With a `height`, air is as dense as that at the height `base`, and
    thinner by ``exp(-h / height)`` at h above it. The background stays as it is; translucent
    props and volumes fade as the surface behind them does.

    Parameters
    ----------
    visibility : float, optional
        Distance at which 37 % of the light is left, world units; by default three times the
        diagonal of what is in the scene, which half hides it in PyVista's first view.
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
        'Distance at which 37 % of the light is left; three diagonals of the scene by default.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    begin = Param(0.0, 'Distance where fog begins.', range='[0, inf)', unit='world')
    height = Param(
        None,
        'Height over which density falls to 37 %; equally dense everywhere by default.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    base = Param(0.0, 'Height of the density that `visibility` is about.', unit='world')
    up = Param((0.0, 0.0, 1.0), 'Up direction in world space.')
    color = Color(
        None, 'Colour; by default that of the horizon of a `Sky`, else of the background.'
    )
    intensity = Param(1.0, 'Opacity of the fog.', range='[0, 1]')

    def __init__(self, visibility=None, **settings):
        super().__init__(visibility=visibility, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance that shows."""
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
