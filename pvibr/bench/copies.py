"""The measure of image effects: how many full-screen copies they take."""

from __future__ import annotations

import time

import numpy as np

from pvibr.gl import Quad, Target, Texture
from pvibr.gl.fused import Fused

_COPY = 'uniform sampler2D color; void main() { gl_FragData[0] = texture(color, uv); }'


class Stand:
    """What an effect sees of a frame and of its picture."""

    def __init__(self, window, array):
        self.window = window
        self.size = array.shape[1], array.shape[0]
        self.color = Texture(window, filter='linear').upload(array)  # as a frame's picture is
        self.depth = self.color  # whose red is as good as depth
        self.target = Target(window, *self.size, ('rgba16f',))
        self.drawing = self.target.drawing
        self.scale, self.whole, self.time = 1, self.size, 0.0
        self.tile = 0.0, 0.0, 1.0, 1.0
        self.view_from_world = self.clip_from_view = np.eye(4)
        self._ground = Target(window, *self.size)
        self._fused = Fused(window)

    def apply(self, point):
        """Draw a program at once."""
        self._fused.draw(self, [point])

    def ground(self, blend):
        """Return what is blended with, as for the last effect of a frame."""
        return self._ground

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._fused.release()
        self.color.release()
        self.target.release()
        self._ground.release()


def in_copies(stand, jobs, rounds) -> dict:
    """Time jobs and a copy of the picture, in turns."""
    quad = Quad(stand.window, _COPY, 'copy')

    def copy():
        with stand.drawing():
            quad.draw(None, {'color': stand.color})

    jobs = {**jobs, 'copy': copy}
    best = dict.fromkeys(jobs, np.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            best[name] = min(best[name], _seconds(stand.window, job))
    quad.release()
    copied = best.pop('copy')
    return {'copy_ms': 1e3 * copied} | {n: s / copied for n, s in best.items()}


def _seconds(window, job):
    window.WaitForCompletion()
    start = time.perf_counter()
    job()
    window.WaitForCompletion()
    return time.perf_counter() - start
