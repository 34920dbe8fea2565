"""Bright light that spreads over what is beside it."""

from __future__ import annotations

from typing import Any

from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, shader_source
from pvibr.gl.blur import filtered
from pvibr.gl.feature import sections
from pvibr.maths.tones import to_display, to_light

_WAYS = ('subtract', 'keep', 'soft')


class Bloom(LightSpread):
    """Bright parts of the picture shine over their surroundings.

    What is brighter than a threshold is taken from a small copy of the picture, blurred by a
    chain of Gaussians on ever smaller images, and added. The blur keeps energy: the light that
    is added sums up to `intensity` times what the bright pass took. Brightness is the largest
    of red, green and blue, averaged over 2 x 2 pixels. Pixels that no light reaches keep their
    colour, to the bit. Not for pictures whose colours are read as values all over: choose a high
    `threshold`, or light by object.

    Where a :class:`pvibr.ToneMapping` exposes the picture, `threshold` and `knee` are those of
    exposed colours: what is bright on the display shines.

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

    threshold = Param(0.8, 'Brightness above which light spreads.', range='[0, inf)')
    operator = Param(
        'soft',
        'What is taken of brightness S above threshold T: subtract max(S - T, 0), keep S where '
        'S > T (heavier, and it flickers at T), soft S times a smooth step around T.',
        choices=_WAYS,
    )
    calm = Param(
        0.0,
        'How much less lone bright pixels count, so that they do not flicker: 0 as others, '
        'keeping energy, to 1 the partial average of Karis.',
        range='[0, 1]',
    )
    knee = Param(0.1, 'Half the width of the soft step.', range='(0, inf)')
    saturation = Param(1.0, 'Colour of the light: 1 its own, 0 white.', range='[0, 1]')
    background = Param(False, 'Whether a plain background shines too.')
    needs_hdr = Param(False, 'See colours above 1, which multisampling does not go with.')

    _bright: Any = None
    _made: tuple = ()

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
            'calm': self.calm,
        }
        color = picture.color
        with filtered(color):
            target.draw(quad, uniforms, {'color': color})

    def _limits(self, frame, picture):
        """Return the threshold and the ends of the soft step before exposure."""
        limits = self.threshold, self.threshold - self.knee, self.threshold + self.knee
        stops = self.pipeline.stops(frame, picture) if self.pipeline else 0.0
        if stops == 0:
            return limits
        found = to_display(to_light(limits) * 2.0**-stops)
        # The curve has no colours below 0, where a wide knee may begin.
        return [float(f) if n > 0 else n for f, n in zip(found, limits, strict=True)]

    def _quad(self, window, side, is_float):
        step = 1 if self.calm else 2
        defines = {
            'TAPS': side // step,
            'STEP': step,
            'WAY': _WAYS.index(self.operator),
            'FLOATS': int(is_float),
            'CALM': int(self.calm > 0),
        }
        made = window, defines
        if self._made != made:
            self._forget()
            text = ''.join(f'#define {name} {value}\n' for name, value in defines.items())
            text += sections(shader_source(__file__))['bright']
            self._bright, self._made = Quad(window, text, 'bloom bright'), made
        return self._bright

    def _forget(self):
        if self._bright is not None:
            self._bright.release()
        self._bright, self._made = None, ()
