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

#: Side of the metering target: few enough texels to read back, of 16 samples each.
_METER_SIDE = 32
_TEXTS = sections(shader_source(__file__))


class ToneMapping(Effect):
    """Exposure, and a tone curve that maps light above 1 to the range of the display.

    The default curve leaves colours in [0, 1] unchanged, so they can still be read as data; the
    others change every colour. The curves are those of :func:`pvibr.maths.tones.tone_map`.

    Automatic exposure brings the log-average luminance of the whole picture, background
    included, to middle grey (0.18); `exposure` is added. The picture is metered before bloom. The
    exposure follows ``pl.ibr.time`` with the time constant `adaptation`, independent of the frame
    rate; if time stands still or goes back, it adapts at once. Tiles of large screenshots use the
    exposure of the last frame.

    Parameters
    ----------
    curve : {'faithful', 'reinhard', 'aces', 'agx', 'neutral'}, optional
        Tone curve; only faithful leaves colours in [0, 1] unchanged.
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

    curve = Param(
        'faithful', 'Tone curve; only faithful leaves colours of data unchanged.', choices=CURVES
    )
    exposure = Param(0.0, 'Exposure; one stop doubles the light.', range='[-32, 32]', unit='stops')
    auto = Param(False, 'Automatic exposure, from the luminance of the picture.')
    adaptation = Param(1.0, 'Time constant of automatic exposure.', range='[0, inf)', unit='s')
    min_exposure = Param(-6.0, 'Least automatic exposure.', range='[-32, 32]', unit='stops')
    max_exposure = Param(6.0, 'Largest automatic exposure.', range='[-32, 32]', unit='stops')
    white = Param(4.0, 'Luminance that the reinhard curve maps to white.', range='(0, inf)')
    intensity = Param(1.0, 'Opacity of the mapped picture.', range='[0, 1]')

    def __init__(self, curve=curve.default, **settings):
        self._meter: Quad | None = None
        self._meter_target: Target | None = None
        self._adapted_from: tuple[float, float] | None = None
        self._adapted: tuple[float, float] | None = None
        self._metered_frame: int | None = None
        super().__init__(curve=curve, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance that changes every colour."""
        return cls(exposure=2, curve='aces')

    @property
    def stops(self) -> float:
        """Exposure of the last frame in stops, automatic exposure included."""
        auto_stops = self._adapted[1] if self.auto and self._adapted else 0.0
        return self.exposure + auto_stops

    def render(self, frame, picture):
        """Expose the picture and apply the curve."""
        stops = self.expose(frame, picture)
        uniforms = {'stops': stops, 'white': self.white, 'intensity': self.intensity}
        program_text = _map(CURVES.index(self.curve), int(stops != 0))
        picture.apply(Pointwise('tone_mapping map', program_text, uniforms, {}))

    def expose(self, frame, picture) -> float:
        """Return the exposure of a frame in stops, metered by the first call."""
        if self.auto and self._metered_frame != frame.index and frame.scale == 1:
            self._metered_frame = frame.index
            self._adapt(frame.time, self._metered_stops(frame.window, picture))
        return self.stops

    def _metered_stops(self, window, picture):
        """Return the exposure that brings a picture to middle grey, in stops."""
        if self._meter_target is None:
            self._meter_target = Target(window, _METER_SIDE, _METER_SIDE, ('rg32f',))
        sample_step = (0.25 / _METER_SIDE,) * 2
        with self._meter_target.drawing():
            self._meter_quad(window).draw({'step': sample_step}, {'color': picture.color})
        log_sum, sample_count = self._meter_target.colors[0].download().sum((0, 1), np.float64)
        if sample_count == 0:
            return self._adapted[1] if self._adapted else 0.0
        target_stops = np.log2(MIDDLE_GREY) - log_sum / sample_count
        lowest = self.min_exposure
        return float(np.clip(target_stops, lowest, max(lowest, self.max_exposure)))

    def _adapt(self, time, target_stops):
        """Move from the exposure at the previous time towards a target."""
        if self._adapted is not None and self._adapted[0] != time:
            self._adapted_from = self._adapted if self._adapted[0] < time else None
        stops = target_stops
        if self._adapted_from is not None and self.adaptation > 0:
            remaining = np.exp(-(time - self._adapted_from[0]) / self.adaptation)
            stops += (self._adapted_from[1] - target_stops) * remaining
        self._adapted = (time, float(stops))

    def reset(self):
        """Reset automatic exposure, as after a cut, to adapt to the next frame at once."""
        self._adapted_from = self._adapted = self._metered_frame = None

    def _meter_quad(self, window):
        if self._meter is None:
            self._meter = Quad(window, _TEXTS['light'] + _TEXTS['measure'], 'tone_mapping measure')
        return self._meter

    def release(self):
        """Free GPU memory; the context is current."""
        release(self._meter, self._meter_target)
        self._meter = self._meter_target = None
        self.reset()

    def report(self) -> dict:
        """Return the bytes of GPU memory and the exposure of the last frame in stops."""
        return {'bytes': nbytes_of(self._meter_target), 'stops': self.stops}


@cache
def _map(curve_number, is_exposed):
    """Return a program's text: one object each time, since it is a key whose hash is kept."""
    constants = f'const int CURVE = {curve_number};\nconst int EXPOSED = {is_exposed};\n'
    return constants + _TEXTS['light'] + _TEXTS['map']
