"""Bright light that spreads over what is beside it."""

from __future__ import annotations

import math
from typing import Any

from pvibr.effect import Effect
from pvibr.gl import Quad, Target, shader_source
from pvibr.gl.blur import Blur, filtered, halves
from pvibr.gl.feature import sections
from pvibr.params import Param

_WAYS = ('subtract', 'keep', 'soft')


class Bloom(Effect):
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

    intensity = Param(0.5, 'How much of the bright light is added; 0 adds none.', range='[0, inf)')
    threshold = Param(0.8, 'Brightness above which light spreads.', range='[0, inf)')
    operator = Param(
        'soft',
        'What is taken of brightness S above threshold T: subtract max(S - T, 0), keep S where '
        'S > T (heavier, and it flickers at T), soft S times a smooth step around T.',
        choices=_WAYS,
    )
    knee = Param(0.1, 'Half the width of the soft step.', range='(0, inf)')
    reduction = Param(
        8, 'Size of the picture to that of its first blur; less is sharper and slower.',
        choices=(4, 8, 16),
    )  # fmt: skip
    kernel = Param(5, 'Texels of each blur, odd.', choices=tuple(range(3, 33, 2)), unit='px')
    levels = Param(
        None, 'How many blurs, each on an image of half the size; from the picture unless given.',
        kind=int, range='[1, 10]',
    )  # fmt: skip
    spread = Param(0.6, 'Share of the wider blurs, 0 narrow to 1 wide.', range='[0, 1]')
    saturation = Param(1.0, 'Colour of the light: 1 its own, 0 white.', range='[0, 1]')
    blend = Param(
        'add', 'add light, or screen: it fills what is left to white.', choices=('add', 'screen')
    )
    background = Param(False, 'Whether a plain background shines too.')
    high_range = Param(False, 'See colours above 1, which multisampling does not go with.')
    debug = Param('', 'A stage to show in place of the picture.', choices=('', 'bright', 'blur'))

    _gpu: Any = None
    _dark = False

    def needed(self, frame):
        """Tell whether a frame needs it; see :meth:`pvibr.Effect.needed`."""
        return self.intensity > 0 or 'intensity is 0'

    def render(self, frame, picture):
        """Draw the picture with its light.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that was drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels.
        """
        gpu = self._ready(frame.window, picture.size)
        light = gpu.bright(picture.color, self._bright_settings())
        self._dark = gpu.is_dark()
        if self._dark and not self.debug:
            return
        scale = self.reduction // 2
        if self.debug != 'bright':
            light, scale = gpu.blur.draw(light, self.spread), self.reduction
        with picture.drawing():
            gpu.blend.draw(
                {
                    'intensity': 1.0 if self.debug else self.intensity,
                    'place': [1 / (scale * texels) for texels in light.size],
                    'screen': float(self.blend == 'screen'),
                    'keep': float(not self.debug),
                },
                {'color': picture.color, 'light': light},
            )

    def _bright_settings(self):
        return {
            'threshold': self.threshold,
            'knee': self.knee,
            'background': float(self.background),
            'saturation': self.saturation,
        }

    def _ready(self, window, size):
        key = window, size, self.reduction, self._levels(size), self.kernel
        key += (_WAYS.index(self.operator),)
        if self._gpu is not None and self._gpu.key != key:
            self.release()
        if self._gpu is None:
            self._gpu = _Gpu(*key)
        return self._gpu

    def _levels(self, size):
        """As many that the last one has about twenty rows, whatever the picture's size."""
        if self.levels is not None:
            return self.levels
        return max(1, 1 + round(math.log2(max(size[1] / self.reduction / 20, 1))))

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        if self._gpu is not None:
            self._gpu.release()
            self._gpu = None

    def report(self) -> dict:
        """Return what it has to tell; see :meth:`pvibr.Effect.report`."""
        details = {'bytes': self._gpu.nbytes if self._gpu else 0}
        return details | ({'skipped': 'nothing is above the threshold'} if self._dark else {})


class _Gpu:
    """What a bloom holds on the GPU."""

    def __init__(self, window, size, reduction, levels, kernel, way):
        self.key = window, size, reduction, levels, kernel, way
        text = sections(shader_source(__file__))
        text['bright'] = f'#define TAPS {reduction // 4}\n#define WAY {way}\n' + text['bright']
        self._bright, self._any, self.blend = (
            Quad(window, text[name], f'bloom {name}') for name in ('bright', 'any', 'blend')
        )
        times = int(math.log2(reduction)) - 1
        small = halves(size, times)
        self.source = Target(window, *small, ('rgba32f',))
        self._most = Target(window, *halves(small, 4), ('rgba32f',))
        self.blur = Blur(window, small, levels, kernel)

    @property
    def nbytes(self) -> int:
        return self.source.nbytes + self._most.nbytes + self.blur.nbytes

    def bright(self, color, settings):
        with filtered(color), self.source.drawing():
            self._bright.draw(settings, {'color': color})
        return self.source.colors[0]

    def is_dark(self):
        with self._most.drawing():
            self._any.draw(None, {'light': self.source.colors[0]})
        return not self._most.colors[0].download()[..., :3].any()

    def release(self):
        for owner in (self.source, self._most, self.blur, self._bright, self._any, self.blend):
            owner.release()
