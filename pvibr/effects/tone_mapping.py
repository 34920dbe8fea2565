"""Exposure and tone curves: map scene light to display colours."""

from __future__ import annotations

from functools import cache

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.maths.tones import CURVES, MIDDLE_GREY

#: Side of the metering target: 16 samples per texel, few enough texels to read back.
_MEASURED = 32
_TEXTS = sections(shader_source(__file__))


class ToneMapping(Effect):
    """Exposure, and a tone curve that maps light above 1 to the range of the display.

    The default curve leaves colours in [0, 1] unchanged, so that they can still be read as data;
    the others change every colour. ``'reinhard'`` is equation 4 of Reinhard et al. (2002) on
    luminance, ``'aces'`` Stephen Hill's fit, ``'agx'`` Benjamin Wrensch's fit of Troy Sobotka's
    AgX, and ``'neutral'`` Khronos PBR Neutral.

    Automatic exposure brings the log-average luminance of the whole picture, background
    included, to middle grey (0.18); `exposure` is added. If there is a bloom, the picture is
    metered before its light. The exposure follows ``pl.ibr.time`` with the time constant
    `adaptation`, independent of the frame rate; if time stands still or goes back, it adapts at
    once. Tiles of large screenshots use the exposure of the last frame.

    Parameters
    ----------
    curve : {'faithful', 'reinhard', 'aces', 'agx', 'neutral'}, optional
        Tone curve; only faithful keeps colours in [0, 1].
    **settings
        `exposure`, `auto`, `adaptation`, `min_exposure`, `max_exposure`, `white`,
        `intensity`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import ToneMapping
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> tone = pl.ibr.add(ToneMapping('aces', exposure=0.5))
    >>> pl.show()
    """

    single = True
    needs_hdr = True
    neutral = 'intensity', 0
    presets = {
        'film': {'curve': 'aces'},
        'neutral': {'curve': 'neutral'},
        'eye': {'curve': 'agx', 'auto': True},
    }

    curve = Param('faithful', 'Tone curve; only faithful keeps colours in [0, 1].', choices=CURVES)
    exposure = Param(0.0, 'Exposure compensation.', range='[-32, 32]', unit='stops')
    auto = Param(False, 'Automatic exposure from the luminance of the picture.')
    adaptation = Param(1.0, 'Time constant of automatic exposure.', range='[0, inf)', unit='s')
    min_exposure = Param(-6.0, 'Minimum automatic exposure.', range='[-32, 32]', unit='stops')
    max_exposure = Param(6.0, 'Maximum automatic exposure.', range='[-32, 32]', unit='stops')
    white = Param(4.0, 'White point of the reinhard curve, as luminance.', range='(0, inf)')
    intensity = Param(1.0, 'Opacity of the mapped picture.', range='[0, 1]')

    def __init__(self, curve=curve.default, **settings):
        self._quad: Quad | None = None
        self._measured: Target | None = None
        self._before: tuple[float, float] | None = None
        self._now: tuple[float, float] | None = None
        self._exposed: int | None = None
        super().__init__(curve=curve, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance that changes every colour."""
        return cls(exposure=2, curve='aces')

    @property
    def stops(self) -> float:
        """Exposure of the last frame in stops, automatic exposure included."""
        auto = self._now[1] if self.auto and self._now else 0.0
        return self.exposure + auto

    def render(self, frame, picture):
        """Expose the picture and apply the curve."""
        stops = self.expose(frame, picture)
        uniforms = {'stops': stops, 'white': self.white, 'intensity': self.intensity}
        text = _map(CURVES.index(self.curve), int(stops != 0))
        picture.apply(Pointwise('tone_mapping map', text, uniforms, {}))

    def expose(self, frame, picture) -> float:
        """Return the exposure of a frame in stops; it is metered by the first call."""
        if self.auto and self._exposed != frame.index and frame.scale == 1:
            self._exposed = frame.index
            self._adapt(frame.time, self._wanted(frame.window, picture))
        return self.stops

    def _wanted(self, window, picture):
        """Return the exposure that brings the picture to middle grey."""
        if self._measured is None:
            self._measured = Target(window, _MEASURED, _MEASURED, ('rg32f',))
        step = (0.25 / _MEASURED,) * 2
        with self._measured.drawing():
            self._measuring(window).draw({'step': step}, {'color': picture.color})
        total, count = self._measured.colors[0].download().sum((0, 1), np.float64)
        if count == 0:
            return self._now[1] if self._now else 0.0
        wanted = np.log2(MIDDLE_GREY) - total / count
        return float(np.clip(wanted, self.min_exposure, max(self.min_exposure, self.max_exposure)))

    def _adapt(self, time, wanted):
        """Move from the exposure at the previous time towards the wanted one."""
        if self._now is not None and self._now[0] != time:
            self._before = self._now if self._now[0] < time else None
        stops = wanted
        if self._before is not None and self.adaptation > 0:
            left = np.exp(-(time - self._before[0]) / self.adaptation)
            stops += (self._before[1] - wanted) * left
        self._now = (time, float(stops))

    def reset(self):
        """Reset automatic exposure, as after a cut: it adapts to the next frame at once."""
        self._before = self._now = self._exposed = None

    def _measuring(self, window):
        if self._quad is None:
            text = _TEXTS['light'] + _TEXTS['measure']
            self._quad = Quad(window, text, 'tone_mapping measure')
        return self._quad

    def release(self):
        """Free GPU memory; the context is current."""
        release(self._quad, self._measured)
        self._quad = self._measured = None
        self.reset()

    def report(self) -> dict:
        """Return the bytes of GPU memory and the exposure of the last frame in stops."""
        return {'bytes': nbytes_of(self._measured), 'stops': self.stops}


@cache
def _map(curve, exposed):
    """Return the program; the same object each time, since it is a key and hashed once."""
    head = f'const int CURVE = {curve};\nconst int EXPOSED = {exposed};\n'
    return head + _TEXTS['light'] + _TEXTS['map']
