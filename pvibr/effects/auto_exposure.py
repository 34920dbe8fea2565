"""Automatic exposure: metered and adapted on the GPU, which no frame waits for."""

from __future__ import annotations

import numpy as np

from pvibr.gl import Quad, Target, Texture, nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.maths.tones import MIDDLE_GREY

#: Side of the metering target, of 16 samples per texel.
_METER_SIDE = 32
_TEXTS = sections(shader_source(__file__, 'tone_mapping'))


class AutoExposure:
    """The exposure that brings pictures to middle grey, in a texture of one texel."""

    def __init__(self, window):
        head = f'#define SIDE {_METER_SIDE}\n' + _TEXTS['light']
        self._measure, self._adapt = (
            Quad(window, head + _TEXTS[name], f'tone_mapping {name}')
            for name in ('measure', 'adapt')
        )
        self._meter = Target(window, _METER_SIDE, _METER_SIDE, ('rg32f',), filter='nearest')
        # Of the previous time, of the last frame, and one to draw into.
        self._targets = [Target(window, 1, 1, ('r32f',), filter='nearest') for _ in range(3)]
        self._past: Target | None = None
        self._last: Target | None = None
        self._past_time = self._last_time = 0.0

    @property
    def texture(self) -> Texture | None:
        """Its stops, in one texel; None before the first frame."""
        return None if self._last is None else self._last.colors[0]

    @property
    def stops(self) -> float:
        """Its stops; waits for the GPU."""
        if self._last is None:
            return 0.0
        self._last.window.MakeCurrent()
        return float(self._last.colors[0].download()[0, 0, 0])

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._meter, *self._targets)

    def follow(self, picture, time, adaptation, stop_range):
        """Adapt to a picture at a time, in seconds with a time constant."""
        if self._last is not None and self._last_time != time:
            self._past = self._last if self._last_time < time else None
            self._past_time = self._last_time
        remaining = 0.0
        if self._past is not None and adaptation > 0:
            remaining = float(np.exp(-(time - self._past_time) / adaptation))
        sample_step = (0.25 / _METER_SIDE,) * 2
        self._meter.draw(self._measure, {'step': sample_step}, {'color': picture.color})
        target = next(t for t in self._targets if t is not self._past and t is not self._last)
        uniforms = {
            'is_first': int(self._last is None),
            'remaining': remaining,
            'stop_range': stop_range,
            'middle_grey': MIDDLE_GREY,
        }
        textures = {
            'measured': self._meter.colors[0],
            # Not read if there is none.
            'last': (self._last or self._meter).colors[0],
            'past': (self._past or self._meter).colors[0],
        }
        target.draw(self._adapt, uniforms, textures)
        self._last, self._last_time = target, time

    def reset(self):
        """Forget the exposure so far, as after a cut."""
        self._past = self._last = None

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._measure, self._adapt, self._meter, *self._targets)
        self.reset()
