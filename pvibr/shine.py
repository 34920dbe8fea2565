"""Light that spreads over a picture: what bloom and glow share."""

from __future__ import annotations

import math
from typing import Any

from pvibr.effect import Effect
from pvibr.gl.blur import Blur, halves
from pvibr.params import Param


class Shine(Effect):
    """Light, blurred by Gaussians on ever smaller images, on a picture.

    A subclass has ``_draw_source(frame, picture, target)``, which draws the light at
    2 / `reduction` of the picture's size, and ``_forget()``, which frees what that takes.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    intensity = Param(1.0, 'How much of the light is added; 0 adds none.', range='[0, inf)')
    reduction = Param(
        8, 'Size of the picture to that of its first blur; less is sharper and slower.',
        choices=(4, 8, 16),
    )  # fmt: skip
    kernel = Param(5, 'Texels of each blur, odd.', choices=tuple(range(3, 33, 2)), unit='px')
    levels = Param(
        None, 'How many blurs, each on an image of half the size; from the picture unless given.',
        kind=int, range='[1, 10]',
    )  # fmt: skip
    spread = Param(0.5, 'Share of the wider blurs, 0 narrow to 1 wide.', range='[0, 1]')
    blend = Param(
        'add', 'add light, or screen: it fills what is left to white.', choices=('add', 'screen')
    )
    debug = Param('', 'A stage to show in place of the picture.', choices=('', 'bright', 'blur'))

    _blur: Any = None
    _window: Any = None
    _dark = False

    def needed(self, frame):
        """Tell whether a frame needs it.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
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
        blur = self._ready(frame.window, picture.size)
        self._draw_source(frame, picture, blur.source)
        self._dark = blur.is_dark()
        if self._dark and not self.debug:
            return
        light, scale = blur.source.colors[0], self.reduction // 2
        if self.debug != 'bright':
            light, scale = blur.draw(light, self.spread), self.reduction
        blur.blend(
            picture, light, scale,
            intensity=1.0 if self.debug else self.intensity,
            screen=self.blend == 'screen', alone=bool(self.debug),
        )  # fmt: skip

    def _draw_source(self, frame, picture, target):
        raise NotImplementedError

    def _ready(self, window, size):
        small = halves(size, int(math.log2(self.reduction)) - 1)
        key = small, self._levels(size), self.kernel
        if self._blur is not None and (self._window is not window or self._blur.key != key):
            self._forget_blur()
        if self._blur is None:
            self._blur, self._window = Blur(window, *key), window
        return self._blur

    def _levels(self, size):
        """As many that the last one has about twenty rows, whatever the picture's size."""
        if self.levels is not None:
            return self.levels
        return max(1, 1 + round(math.log2(max(size[1] / self.reduction / 20, 1))))

    def _forget(self):
        """Free what `_draw_source` made."""

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self._forget()
        self._forget_blur()

    def _forget_blur(self):
        if self._blur is not None:
            self._blur.release()
            self._blur = None

    def report(self) -> dict:
        """Return what it has to tell; see :meth:`pvibr.Effect.report`."""
        details = {'bytes': self._blur.nbytes if self._blur else 0}
        return details | ({'skipped': 'there is no light to spread'} if self._dark else {})
