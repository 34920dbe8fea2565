"""Bloom: bright light spreads over its surroundings."""

from __future__ import annotations

import math

from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.texture import filtered
from pvibr.maths.tones import to_display, to_light

_OPERATORS = ('subtract', 'keep', 'soft')


class Bloom(LightSpread):
    """Light from bright parts of the picture spreads over their surroundings.

    The bright pass extracts light above a threshold at reduced resolution; a chain of Gaussian
    blurs on ever smaller images spreads it, and it is added to the picture. The blur conserves
    energy: the added light sums up to `intensity` times that of the bright pass, and is as wide,
    in shares of the height, in a window of any size. Brightness is the luminance of a pixel
    (Rec. 709); its light has its hue. Pixels that no light reaches keep their colour exactly.

    By default light above 1 spreads: highlights, bright lamps, a bright :class:`pvibr.Sky`.
    Colours of data are below, and stay as they are. A lower `threshold` lets them shine;
    :class:`pvibr.Glow` lets chosen objects shine, whatever their colours.

    If a :class:`pvibr.ToneMapping` exposes the picture, `threshold` and `knee` apply to exposed
    colours.

    Parameters
    ----------
    threshold : float, optional
        Luminance above which light spreads; by default that of white, so that colours of data
        stay as they are.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> bloom = pl.ibr.add(pvibr.Bloom(0.9, intensity=0.4))
    >>> bloom.operator
    'soft'
    """

    single = True
    presets = {
        'subtle': {'intensity': 0.4, 'spread': 0.3},
        'strong': {'threshold': 0.5, 'intensity': 2.0, 'spread': 0.8},
    }
    threshold = Param(1.0, 'Luminance above which light spreads.', range='[0, inf)')
    operator = Param(
        'soft',
        'Bright pass of S above a threshold T: S - T; S (may flicker); S times a smooth step.',
        choices=_OPERATORS,
    )
    firefly_reduction = Param(
        0.0,
        'Attenuation of isolated bright pixels, up to the partial Karis average.',
        range='[0, 1]',
    )
    knee = Param(0.2, 'Width of the soft threshold, above it.', range='(0, inf)')
    saturation = Param(1.0, 'Saturation of the light; 0 is white.', range='[0, 1]')
    background = Param(False, 'Include a plain background in the bright pass.')
    needs_hdr = Param(True, 'Use colours above 1.')

    _bright: Quad | None = None
    _made: tuple = ()

    def __init__(self, threshold=threshold.default, **settings):
        super().__init__(threshold=threshold, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance with a low threshold."""
        return cls(threshold=0.2)

    def _draw_source(self, frame, picture, target, side):
        quad = self._quad(frame.window, picture, side)
        threshold, low, high = self._limits(frame, picture)
        factor = 1 / max(high - low, 1e-6)
        uniforms = {
            'size': picture.size,
            'side': float(side),
            'threshold': threshold,
            'ramp': (factor, -low * factor),
            'background': float(self.background),
            'saturation': self.saturation,
            'firefly_reduction': self.firefly_reduction,
        }
        color = picture.color
        with filtered(color, 'nearest'):
            target.draw(quad, uniforms, {'color': color})

    def _limits(self, frame, picture):
        """Return the threshold and the ends of the soft step, before exposure."""
        limits = self.threshold, self.threshold, self.threshold + self.knee
        stops = self.pipeline.stops(frame, picture) if self.pipeline else 0.0
        if stops == 0:
            return limits
        return [float(f) for f in to_display(to_light(limits) * 2.0**-stops)]

    def _quad(self, window, picture, side):
        whole = float(side).is_integer() and not any(n % side for n in picture.size)
        defines = {
            'OPERATOR': _OPERATORS.index(self.operator),
            'FLOATS': int(picture.color.is_float),
            'FIREFLIES': int(self.firefly_reduction > 0),
            'TAPS': math.ceil(side) + (not whole),
            'WHOLE': int(whole),
        }
        made = window, defines
        if self._bright is None or self._made != made:
            self._forget()
            text = ''.join(f'#define {name} {value}\n' for name, value in defines.items())
            text += sections(shader_source(__file__))['bright']
            self._bright, self._made = Quad(window, text, 'bloom bright'), made
        return self._bright

    def _forget(self):
        release(self._bright)
        self._bright, self._made = None, ()
