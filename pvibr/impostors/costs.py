"""Costs of images and meshes, as measured on this machine."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np

from pvibr.core.costs import RunningMean, expected_seconds, timed
from pvibr.core.determinism import is_deterministic
from pvibr.gl import Target

#: Seconds of a pixel of a card, before any was measured.
PIXEL = 3e-8
#: Seconds that an image takes beside its mesh, and a card beside its pixels.
_IMAGE, _CARD = 1.5e-4, 2e-6
_TRIES = 3


class Costs:
    """Times of meshes and cards, and motion of camera and actors."""

    def __init__(self):
        self.pixel, self.busy = PIXEL, np.zeros(0)
        self.step = self._last = np.zeros(3)
        self._eye: np.ndarray | None = None
        self._speed, self._ratio = RunningMean(weight=0.3), RunningMean(1.0)
        self._measured = False
        self._sums: np.ndarray | None = None

    @property
    def speed(self) -> float:
        """Speed of the camera, world units per frame."""
        return self._speed.value

    def count(self, actors):
        """Set the number of actors."""
        self.busy, self._sums = np.zeros(actors), None

    def grow(self, more):
        """Note that there may be more actors."""
        self.busy, self._sums = np.append(self.busy, np.zeros(more)), None

    def changed(self, actors):
        """Note the actors that changed since the last frame."""
        self.busy[actors] = np.minimum(self.busy[actors] + 0.3, 1.0)
        self._sums = None

    def move(self, frame):
        """Note the camera's position."""
        if self._eye is not None:
            step = frame.eye - self._eye
            size, before = np.linalg.norm(step), np.linalg.norm(self._last)
            goes_on = step @ self._last > 0.8 * size * before and size < 3 * before
            self.step = step if goes_on else np.zeros(3)
            self._last = step
            self._speed.add(float(size))
        self._eye = frame.eye
        self.busy *= 0.9

    def meshes(self, leaves, nodes) -> np.ndarray:
        """Return the seconds of the meshes under each node."""
        if self._sums is None:
            seconds = self.of(leaves)
            self._sums = nodes.tree.gather(seconds * nodes.live[: len(leaves)], np.add)
        return self._sums

    def often(self, tree) -> np.ndarray | float:
        """Return the share of frames in which each node changed."""
        return tree.gather(self.busy, np.maximum) if self.busy.max() > 1e-3 else 0.0

    def of(self, leaves) -> np.ndarray:
        """Return the measured or expected seconds of the mesh of each leaf."""
        return self._of(leaves.seconds, leaves.cells)

    def by_reason(self, leaves, why) -> dict:
        """Return the milliseconds of the leaves that are drawn as meshes, by the reason."""
        found: dict = {}
        for reason, seconds in zip(why, self.of(leaves).tolist(), strict=False):
            if reason not in ('', 'hidden', 'out of view'):
                found[reason] = found.get(reason, 0.0) + 1e3 * seconds
        return found

    def _of(self, seconds, cells):
        return np.where(seconds < np.inf, seconds, expected_seconds(cells) * self._ratio.value)

    def expected(self, leaves, rows) -> float:
        """Return the expected seconds of an image of some actors."""
        return _IMAGE + float(self._of(leaves.seconds[rows], leaves.cells[rows]).sum())

    def images(self, seconds, rate, busy, area) -> np.ndarray:
        """Return the seconds per frame spent on images, re-rendering included."""
        often = np.minimum(rate + busy, 1.0)
        return often * (seconds + _IMAGE) + _CARD + self.pixel * area

    @contextmanager
    def timed(self, window, leaves, rows):
        """Measure the seconds of the meshes of some actors."""
        expected = self.expected(leaves, rows)
        source = leaves.sources[rows[0]]
        if len(rows) != 1 or source.tries >= _TRIES or is_deterministic():
            yield SimpleNamespace(seconds=expected)
            return
        with timed(window, expected) as spent:
            yield spent
        source.tries += 1
        self._sums = None
        if source.tries > 1:  # the first draw uploads the mesh and builds its shader
            source.seconds = min(source.seconds, max(spent.seconds - _IMAGE, 1e-6))
            leaves.seconds[rows] = source.seconds
            self._ratio.add(source.seconds / expected_seconds(source.cells))

    def measure(self, frame, cards, drawer, area):
        """Measure the seconds per pixel of a card, once."""
        if self._measured or area < 2000 or is_deterministic():
            return
        self._measured = True
        width, height = frame.size
        target = Target(frame.window, width, height, ('rgba8',), depth=True)
        times = []
        for _ in range(_TRIES):
            with timed(frame.window, 0.0) as spent, target.drawing(clear=(0, 0, 0, 0)):
                drawer.look(frame.view, (0, 0, *frame.size))
                drawer.draw([cards.actor])
            times.append(spent.seconds)
        drawer.done()
        target.release()
        self.pixel = min(times) / area
