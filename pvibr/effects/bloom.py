"""Bright light that spreads over what is beside it."""

from __future__ import annotations

from typing import Any

from pvibr.gl import Quad, shader_source
from pvibr.gl.blur import filtered
from pvibr.gl.feature import sections
from pvibr.params import Param
from pvibr.shine import Shine

_WAYS = ('subtract', 'keep', 'soft')


class Bloom(Shine):
    """Bright parts of the picture shine over their surroundings.

    What is brighter than a threshold is taken from a small copy of the picture, blurred by a
    chain of Gaussians on ever smaller images, and added. The blur keeps energy: the light that
    is added sums up to `intensity` times what the bright pass took. Brightness is the largest
    of red, green and blue, averaged over 2 x 2 pixels. Pixels that no light reaches keep their
    colour, to the bit. Not for pictures whose colours are read as values all over: choose a high
    `threshold`, or light by object.

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
    knee = Param(0.1, 'Half the width of the soft step.', range='(0, inf)')
    saturation = Param(1.0, 'Colour of the light: 1 its own, 0 white.', range='[0, 1]')
    background = Param(False, 'Whether a plain background shines too.')
    high_range = Param(False, 'See colours above 1, which multisampling does not go with.')

    _bright: Any = None
    _made: tuple = ()

    def _draw_source(self, frame, picture, target):
        made = frame.window, self.reduction // 4, _WAYS.index(self.operator)
        if self._made != made:
            self._forget()
            text = sections(shader_source(__file__))['bright']
            text = f'#define TAPS {made[1]}\n#define WAY {made[2]}\n{text}'
            self._bright, self._made = Quad(frame.window, text, 'bloom bright'), made
        uniforms = {
            'threshold': self.threshold,
            'knee': self.knee,
            'background': float(self.background),
            'saturation': self.saturation,
        }
        with filtered(picture.color), target.drawing():
            self._bright.draw(uniforms, {'color': picture.color})

    def _forget(self):
        if self._bright is not None:
            self._bright.release()
        self._bright, self._made = None, ()
