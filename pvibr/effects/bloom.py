"""Bloom: bright light spreads over its surroundings."""

from __future__ import annotations

from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, release, shader_source
from pvibr.gl.blur import filtered
from pvibr.gl.feature import sections
from pvibr.maths.tones import to_display, to_light

_OPERATORS = ('subtract', 'keep', 'soft')


class Bloom(LightSpread):
    """Light from bright parts of the picture spreads over their surroundings.

    The bright pass extracts light above a threshold at reduced resolution; a chain of Gaussian
    blurs on ever smaller images spreads it, and it is added to the picture. The blur conserves
    energy: the added light sums up to `intensity` times that of the bright pass. Brightness is
    the maximum of red, green and blue, averaged over 2 x 2 pixels. Pixels that no light reaches
    keep their colour exactly. If colours encode data, choose a high `threshold`, or use
    :class:`pvibr.Glow` for chosen objects.

    If a :class:`pvibr.ToneMapping` exposes the picture, `threshold` and `knee` apply to exposed
    colours.

    Parameters
    ----------
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> bloom = pl.ibr.add(pvibr.Bloom(threshold=0.9, intensity=0.4))
    >>> bloom.operator
    'soft'
    """

    presets = {
        'subtle': {'threshold': 0.9, 'intensity': 0.4, 'spread': 0.3},
        'strong': {'threshold': 0.6, 'intensity': 2.0, 'spread': 0.8},
    }
    threshold = Param(0.8, 'Brightness above which light spreads.', range='[0, inf)')
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
    knee = Param(0.1, 'Half width of the soft threshold.', range='(0, inf)')
    saturation = Param(1.0, 'Saturation of the light; 0 is white.', range='[0, 1]')
    background = Param(False, 'Include a plain background in the bright pass.')
    needs_hdr = Param(False, 'Use colours above 1.')

    _bright: Quad | None = None
    _made: tuple = ()

    @classmethod
    def sample(cls, actors):
        """Return an instance with a low threshold."""
        return cls(threshold=0.2)

    def _draw_source(self, frame, picture, target, side):
        quad = self._quad(frame.window, side, picture.color.is_float)
        threshold, low, high = self._limits(frame, picture)
        factor = 1 / max(high - low, 1e-6)
        uniforms = {
            'pixel': [1 / n for n in picture.size],
            'threshold': threshold,
            'ramp': (factor, -low * factor),
            'background': float(self.background),
            'saturation': self.saturation,
            'firefly_reduction': self.firefly_reduction,
        }
        color = picture.color
        with filtered(color):
            target.draw(quad, uniforms, {'color': color})

    def _limits(self, frame, picture):
        """Return the threshold and the ends of the soft step, before exposure."""
        limits = self.threshold, self.threshold - self.knee, self.threshold + self.knee
        stops = self.pipeline.stops(frame, picture) if self.pipeline else 0.0
        if stops == 0:
            return limits
        found = to_display(to_light(limits) * 2.0**-stops)
        # The curve has no colours below 0, where a wide knee may begin.
        return [float(f) if n > 0 else n for f, n in zip(found, limits, strict=True)]

    def _quad(self, window, side, is_float):
        step = 1 if self.firefly_reduction else 2
        defines = {
            'TAPS': side // step,
            'STEP': step,
            'OPERATOR': _OPERATORS.index(self.operator),
            'FLOATS': int(is_float),
            'FIREFLIES': int(self.firefly_reduction > 0),
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
