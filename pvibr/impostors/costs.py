"""What images and meshes take to be drawn, as measured on the machine that draws them."""

from __future__ import annotations

import time
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

from pvibr.core.determinism import is_deterministic
from pvibr.gl import Target

#: Before anything was measured, seconds: of a mesh, of each of its cells, of a pixel of a card.
ACTOR, CELL, PIXEL = 5e-5, 7e-8, 3e-8
#: Seconds that an image takes beside its mesh, and a card beside its pixels.
_IMAGE, _CARD = 1.5e-4, 2e-6
_TRIES = 3


class Costs:
    """Times of meshes and of cards, and how the eye and the actors move."""

    def __init__(self):
        self.speed, self.pixel, self.busy = 0.0, PIXEL, np.zeros(0)
        self.step = self._last = np.zeros(3)
        self._eye: Any = None
        self._ratio = [1.0]
        self._measured = False
        self._sums: Any = None

    def count(self, actors):
        """Have so many actors."""
        self.busy, self._sums = np.zeros(actors), None

    def changed(self, actors):
        """Take note of actors that changed since the last frame."""
        self.busy[actors] = np.minimum(self.busy[actors] + 0.3, 1.0)
        self._sums = None

    def move(self, frame):
        """Take note of where the eye is."""
        if self._eye is not None:
            step = frame.eye - self._eye
            size, before = np.linalg.norm(step), np.linalg.norm(self._last)
            goes_on = step @ self._last > 0.8 * size * before and size < 3 * before
            self.step = step if goes_on else np.zeros(3)
            self._last = step
            self.speed = 0.7 * self.speed + 0.3 * float(size)
        self._eye = frame.eye
        self.busy *= 0.9

    def meshes(self, leaves, nodes) -> np.ndarray:
        """Return the seconds of the meshes below each node."""
        if self._sums is None:
            seconds = np.array([self._of(source) for source in leaves.sources])
            self._sums = nodes.tree.gather(seconds * nodes.live[: len(leaves)], np.add)
        return self._sums

    def often(self, tree) -> np.ndarray | float:
        """Return for each node the share of frames in which what is below it changed."""
        return tree.gather(self.busy, np.maximum) if self.busy.max() > 1e-3 else 0.0

    def _of(self, source):
        if source.seconds < np.inf:
            return source.seconds
        return (ACTOR + CELL * source.cells) * self._ratio[0]

    def expected(self, sources) -> float:
        """Return the seconds that an image of some actors takes."""
        return _IMAGE + sum(map(self._of, sources))

    def images(self, seconds, rate, busy, area) -> np.ndarray:
        """Return the seconds per frame spent on images, re-rendering included."""
        often = np.minimum(rate + busy, 1.0)
        return often * (seconds + _IMAGE) + _CARD + self.pixel * area

    @contextmanager
    def timed(self, window, sources):
        """Measure what the meshes of some actors take."""
        known = len(sources) != 1 or sources[0].tries >= _TRIES or is_deterministic()
        spent = SimpleNamespace(seconds=self.expected(sources))
        if not known:
            window.WaitForCompletion()
        start = time.perf_counter()
        yield spent
        if known:
            return
        window.WaitForCompletion()
        spent.seconds = time.perf_counter() - start
        source = sources[0]
        source.tries += 1
        self._sums = None
        if source.tries > 1:  # the first draw uploads the mesh and builds its shader
            source.seconds = min(source.seconds, max(spent.seconds - _IMAGE, 1e-6))
            guess = ACTOR + CELL * source.cells
            self._ratio[0] += 0.2 * (source.seconds / guess - self._ratio[0])

    def measure(self, frame, cards, drawer, area):
        """Measure once what a pixel of a card takes."""
        if self._measured or area < 2000 or is_deterministic():
            return
        self._measured = True
        width, height = frame.size
        target = Target(frame.window, width, height, ('rgba8',), depth=True)
        times = []
        for _ in range(_TRIES):
            frame.window.WaitForCompletion()
            start = time.perf_counter()
            with target.drawing(clear=(0, 0, 0, 0)):
                drawer.look(frame.view, (0, 0, *frame.size))
                drawer.draw([cards.actor])
            frame.window.WaitForCompletion()
            times.append(time.perf_counter() - start)
        drawer.done()
        target.release()
        self.pixel = min(times) / area
