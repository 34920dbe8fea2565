"""Exposure and tone curves: light of any strength on a display."""

from __future__ import annotations

from functools import cache

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.maths.tones import CURVES, MIDDLE_GREY

#: Side of the target that is measured: 16 looks a texel, and few enough texels to read back.
_MEASURED = 32
_TEXTS = sections(shader_source(__file__))


class ToneMapping(Effect):
    """Expose the picture and bring light that is brighter than the display into its range.

    As it comes, no colour in [0, 1] is changed, so that values can still be read off colours;
    the other curves give a look, and change every colour. The curves are those of
    :func:`pvibr.maths.tones.tone_map`.

    Parameters
    ----------
    **settings
        `curve`, `exposure`, `auto`, `adaptation`, `least`, `most`, `white`, `intensity`.

    Notes
    -----
    With `auto`, the mean of the logarithm of luminance over the whole picture, background and
    all, is brought to middle grey (0.18), and `exposure` is added. Where there is a bloom, whose
    threshold follows the exposure, the picture is measured before its light. It follows
    ``pl.ibr.time`` with the time constant `adaptation`: what a frame shows depends on the times
    and pictures before it, and not on how often it is drawn. Where time stands still or goes
    back, the exposure is that of the picture at once. Large screenshots in tiles keep the
    exposure of the frame before.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import ToneMapping
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> tone = pl.ibr.add(ToneMapping(curve='aces', exposure=0.5))
    >>> pl.show()
    """

    needs_hdr = True

    curve = Param(
        'faithful',
        'How light becomes colour. faithful leaves [0, 1] alone; the others change '
        'every colour: not where values are read off colours.',
        choices=CURVES,
    )
    exposure = Param(
        0.0, 'How much more light; each stop doubles it.', range='[-32, 32]', unit='stops'
    )
    auto = Param(False, 'Whether the exposure follows how bright the picture is.')
    adaptation = Param(
        1.0,
        'Time in which automatic exposure goes 63 % of its way; 0 is at once.',
        range='[0, inf)',
        unit='s',
    )
    least = Param(-6.0, 'Least automatic exposure.', range='[-32, 32]', unit='stops')
    most = Param(6.0, 'Largest automatic exposure.', range='[-32, 32]', unit='stops')
    white = Param(4.0, 'Luminance that reinhard makes white.', range='(0, inf)')
    intensity = Param(1.0, 'Share of the mapped picture in what is shown.', range='[0, 1]')

    def __init__(self, **settings):
        self._quad: Quad | None = None
        self._measured: Target | None = None
        self._before: tuple[float, float] | None = None
        self._now: tuple[float, float] | None = None
        self._exposed: int | None = None
        super().__init__(**settings)

    @property
    def stops(self) -> float:
        """The exposure of the last frame, the automatic part included, in stops."""
        auto = self._now[1] if self.auto and self._now else 0.0
        return self.exposure + auto

    def needed(self, frame) -> bool | str:
        """Tell whether anything is mapped."""
        return self.intensity > 0 or 'intensity is 0'

    def render(self, frame, picture):
        """Measure the picture where that is wanted, and map it."""
        stops = self.expose(frame, picture)
        uniforms = {
            'stops': stops,
            'white': self.white,
            'intensity': self.intensity,
        }
        text = _map(CURVES.index(self.curve), int(stops != 0))
        picture.apply(Pointwise('tone_mapping map', text, uniforms, {}))

    def expose(self, frame, picture) -> float:
        """Return the exposure of a frame; automatic exposure is measured when first asked.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            The frame that was drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels so far.

        Returns
        -------
        float
            In stops.
        """
        if self.auto and self._exposed != frame.index and frame.scale == 1:
            self._exposed = frame.index
            self._adapt(frame.time, self._wanted(frame.window, picture))
        return self.stops

    def _wanted(self, window, picture):
        """Return the stops that bring the picture to middle grey."""
        if self._measured is None:
            self._measured = Target(window, _MEASURED, _MEASURED, ('rg32f',))
        step = (0.25 / _MEASURED,) * 2
        with self._measured.drawing():
            self._measuring(window).draw({'step': step}, {'color': picture.color})
        total, count = self._measured.colors[0].download().sum((0, 1), np.float64)
        if count == 0:
            return self._now[1] if self._now else 0.0
        wanted = np.log2(MIDDLE_GREY) - total / count
        return float(np.clip(wanted, self.least, max(self.least, self.most)))

    def _adapt(self, time, wanted):
        """Move from the exposure of the last other time towards what is wanted."""
        if self._now is not None and self._now[0] != time:
            self._before = self._now if self._now[0] < time else None
        stops = wanted
        if self._before is not None and self.adaptation > 0:
            left = np.exp(-(time - self._before[0]) / self.adaptation)
            stops += (self._before[1] - wanted) * left
        self._now = (time, float(stops))

    def reset(self):
        """Forget what the exposure was: the next frame is exposed at once, as after a cut."""
        self._before = self._now = self._exposed = None

    def _measuring(self, window):
        if self._quad is None:
            text = _TEXTS['light'] + _TEXTS['measure']
            self._quad = Quad(window, text, 'tone_mapping measure')
        return self._quad

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        for owner in (self._quad, self._measured):
            if owner is not None:
                owner.release()
        self._quad = self._measured = None
        self.reset()

    def report(self) -> dict:
        """Return the bytes on the GPU and the exposure of the last frame in stops."""
        return {'bytes': self._measured.nbytes if self._measured else 0, 'stops': self.stops}


@cache
def _map(curve, exposed):
    """Return the program that maps, the same object each time: it is a key, and hashed once."""
    head = f'const int CURVE = {curve};\nconst int EXPOSED = {exposed};\n'
    return head + _TEXTS['light'] + _TEXTS['map']
