"""What a bloom costs in full-screen copies."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from pvibr.effects.bloom import Bloom
from pvibr.gl import Quad, Target, Texture
from pvibr.gl.offscreen import hidden_window

_COPY = 'uniform sampler2D color; void main() { gl_FragData[0] = texture(color, uv); }'


class _Stand:
    """What a bloom sees of a frame and of its picture."""

    def __init__(self, window, array):
        self.window = window
        self.size = array.shape[1], array.shape[0]
        self.color = Texture(window, filter='linear').upload(array)  # as a frame's picture is
        self.target = Target(window, *self.size, ('rgba16f',))
        self.drawing = self.target.drawing

    def release(self):
        self.color.release()
        self.target.release()


def bloom_times(size=(1280, 720), rounds=15, **settings) -> dict:
    """Time a bloom, one that finds nothing bright, and a copy of the picture, in turns.

    Parameters
    ----------
    size : tuple of 2 int
        Width and height in pixels.
    rounds : int
        How often; the least of each counts.
    **settings
        Of the bloom.

    Returns
    -------
    dict
        ``copy_ms``, and ``bloom`` and ``dark``, as multiples of the copy.
    """
    rng = np.random.default_rng(0)
    array = np.kron(rng.uniform(0, 255, (-(-size[1] // 20), -(-size[0] // 20), 4)),
                    np.ones((20, 20, 1)))[: size[1], : size[0]]  # fmt: skip
    array[..., 3] = 255
    with hidden_window() as (window, _):
        stand = _Stand(window, array.astype(np.uint8))
        copy = Quad(window, _COPY, 'copy')
        blooms = {'bloom': Bloom(**settings), 'dark': Bloom(**(settings | {'threshold': 2.0}))}
        jobs = {n: partial(b.render, stand, stand) for n, b in blooms.items()}
        jobs['copy'] = partial(_copy, stand, copy)
        best = dict.fromkeys(jobs, np.inf)
        for _ in range(rounds):
            for name, job in jobs.items():
                best[name] = min(best[name], _seconds(window, job))
        owners: list[Any] = [stand, copy, *blooms.values()]
        for owner in owners:
            owner.release()
    copied = best.pop('copy')
    return {'copy_ms': 1e3 * copied} | {n: s / copied for n, s in best.items()}


def _copy(stand, quad):
    with stand.drawing():
        quad.draw(None, {'color': stand.color})


def _seconds(window, job):
    window.WaitForCompletion()
    start = time.perf_counter()
    job()
    window.WaitForCompletion()
    return time.perf_counter() - start
