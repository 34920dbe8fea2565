"""What tone mapping and the billboards cost in full-screen copies."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from pvibr.effects.screen import Flash, Iris, NightVision, Picture, Sky, Vignette
from pvibr.effects.tone_mapping import ToneMapping
from pvibr.frame import Frame
from pvibr.gl import Quad, Target, Texture
from pvibr.gl.offscreen import hidden_window
from pvibr.maths.tones import CURVES

_COPY = 'uniform sampler2D color; void main() { gl_FragData[0] = texture(color, uv); }'


class _Picture:
    """What an effect sees of a picture."""

    def __init__(self, window, size):
        array = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 4), np.uint8)
        self.size = size
        self.color = Texture(window, filter='linear').upload(array)
        self.target = Target(window, size[0], size[1], ('rgba16f',))
        self.drawing = self.target.drawing

    def release(self):
        self.color.release()
        self.target.release()


def screen_times(size=(1280, 720), rounds=9) -> dict:
    """Time every curve and billboard and a copy of the picture, in turns.

    Parameters
    ----------
    size : tuple of 2 int
        Width and height in pixels.
    rounds : int
        How often; the least of each counts.

    Returns
    -------
    dict
        ``copy_ms``, and each effect as a multiple of the copy.
    """
    with hidden_window() as (window, renderer):
        picture, copy = _Picture(window, size), Quad(window, _COPY, 'copy')
        frame, effects = Frame.of(renderer), _effects(size)
        effects['Sky'].prepare(frame)
        jobs: dict[str, Any] = {n: partial(e.render, frame, picture) for n, e in effects.items()}
        jobs['copy'] = partial(_copy, picture, copy)
        best = dict.fromkeys(jobs, np.inf)
        for _ in range(rounds):
            for name, job in jobs.items():
                best[name] = min(best[name], _seconds(window, job))
        for owner in (picture, copy, *effects.values()):
            owner.release()
    copied = best.pop('copy')
    return {'copy_ms': 1e3 * copied} | {n: s / copied for n, s in best.items()}


def _effects(size) -> dict[str, Any]:
    image = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 4), np.uint8)
    found: dict[str, Any] = {f'ToneMapping {c}': ToneMapping(curve=c) for c in CURVES}
    others: tuple[Any, ...] = (
        ToneMapping(auto=True),
        Vignette(),
        Flash(at=0),
        NightVision(),
        Iris(),
        Sky(),
    )
    found |= {e.name if e.name != 'ToneMapping' else 'ToneMapping auto': e for e in others}
    return found | {'Picture': Picture(image)}


def _copy(picture, quad):
    with picture.drawing():
        quad.draw(None, {'color': picture.color})


def _seconds(window, job):
    window.WaitForCompletion()
    start = time.perf_counter()
    job()
    window.WaitForCompletion()
    return time.perf_counter() - start
