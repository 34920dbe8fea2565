"""The measure of image effects: how many full-screen copies they take."""

from __future__ import annotations

from functools import partial

import numpy as np

from pvibr.bench.common.timing import least, seconds
from pvibr.core.effect import Effect
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


class Copy(Effect):
    """One full-screen copy: what other effects are measured in."""

    _quad: Quad | None = None

    def render(self, frame, picture):
        """Draw the picture once more."""
        if self._quad is None:
            self._quad = Quad(frame.window, _COPY, 'copy')
        with picture.drawing():
            self._quad.draw(textures={'color': picture.color})

    def release(self):
        """Free the GPU's memory."""
        if self._quad is not None:
            self._quad.release()
            self._quad = None


def in_copies(stand, jobs, rounds) -> tuple[dict, float]:
    """Return the times of jobs in copies of the picture, and the ms of a copy, taken in turns."""
    copy = Copy()
    jobs = {**jobs, 'copy': partial(copy.render, stand, stand)}
    best = least(rounds, {n: partial(seconds, stand.window, job) for n, job in jobs.items()})
    copy.release()
    copied = best.pop('copy')
    return {name: s / copied for name, s in best.items()}, 1e3 * copied
