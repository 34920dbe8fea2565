"""Costs of images and meshes, as measured on this machine."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np

from pvibr.core.costs import RunningMean
from pvibr.core.determinism import is_deterministic
from pvibr.core.passes import supersampling_of
from pvibr.gl import Target
from pvibr.gl.driver import SOFTWARE, Driver, driver_of, timed
from pvibr.substitutes.impostor_limits import LAYERS
from pvibr.substitutes.impostor_tree import FARTHEST
from pvibr.substitutes.leaves import UNDRAWN

# Overhead in seconds: of an image beyond its mesh, and of a card beyond its pixels.
_IMAGE, _CARD = 1.5e-4, 2e-6
_TRIES = 3
#: Least camera speed assumed, in scene radii per frame.
_SLOWEST = 1e-4
_RARE = 1e-3  # share of frames in which an actor changes, below which it counts as still


class Costs:
    """Times of meshes and cards, and motion of camera and actors."""

    def __init__(self):
        self._driver: Driver = SOFTWARE  # until the first frame
        self._measured_pixel_s: float | None = None
        self.samples = 1  # times the seconds of a mesh in the window, in those of its image
        self.busy = np.zeros(0)
        self.step = self._last_step = np.zeros(3)
        self._eye: np.ndarray | None = None
        #: Mean speed of the camera, world units per frame.
        self.speed, self._ratio = RunningMean(weight=0.3), RunningMean(1.0)
        self._node_seconds: np.ndarray | None = None

    def count(self, actors):
        """Set the number of actors."""
        self.busy, self._node_seconds = np.zeros(actors), None

    def grow(self, extra_actors):
        """Add actors."""
        self.busy, self._node_seconds = np.append(self.busy, np.zeros(extra_actors)), None

    def changed(self, actors):
        """Note the actors that changed since the last frame."""
        self.busy[actors] = np.minimum(self.busy[actors] + 0.3, 1.0)
        self._node_seconds = None

    def are_at_rest(self, nodes) -> bool:
        """Return whether the camera and the actors have rested so long that choices stay."""
        return self.speed.value <= _SLOWEST * nodes.radius.max() and self.busy.max() <= _RARE

    def key(self, frame) -> tuple:
        """Return a value that changes with the driver and the pixels that it draws."""
        return driver_of(), self.pixel, supersampling_of(frame.renderer)

    @property
    def pixel(self) -> float:
        """Seconds per pixel of a card."""
        return self._measured_pixel_s or self._driver.pixel_s

    def move(self, frame):
        """Track the camera's motion, on the window's driver."""
        driver = driver_of(frame.window)
        if driver is not self._driver:
            self._driver, self._node_seconds = driver, None
        # GPUs hardly slow down with more samples per pixel.
        self.samples = max(frame.window.GetMultiSamples(), 1) if driver.is_software else 1
        if self._eye is not None:
            step = frame.eye - self._eye
            step_length, last_length = np.linalg.norm(step), np.linalg.norm(self._last_step)
            same_way = step @ self._last_step > 0.8 * step_length * last_length
            is_steady = same_way and step_length < 3 * last_length
            self.step = step if is_steady else np.zeros(3)
            self._last_step = step
            self.speed.add(float(step_length))
        self._eye = frame.eye
        self.busy *= 0.9

    def meshes(self, leaves, nodes) -> np.ndarray:
        """Return the seconds of the meshes under each node."""
        if self._node_seconds is None:
            live_seconds = self.of(leaves) * nodes.live[: len(leaves)]
            self._node_seconds = nodes.tree.gather(live_seconds, np.add)
        return self._node_seconds

    def plain(self, leaves, mesh_seconds, size_px, card_area) -> np.ndarray:
        """Return the seconds of each leaf drawn without an image."""
        n = len(leaves)
        window_seconds = self.samples * mesh_seconds[:n]
        return leaves.plain(window_seconds, size_px[:n], card_area[:n], self.pixel)

    def often(self, tree) -> np.ndarray | float:
        """Return the share of frames in which each node changed."""
        return tree.gather(self.busy, np.maximum) if self.busy.max() > _RARE else 0.0

    def of(self, leaves) -> np.ndarray:
        """Return the measured or expected seconds of the mesh of each leaf."""
        return self._of(leaves.seconds, leaves.cells)

    def by_reason(self, leaves, mesh_reasons) -> dict:
        """Return the milliseconds of the leaves drawn as meshes, by reason."""
        milliseconds: dict = {}
        for reason, seconds in zip(mesh_reasons, self.of(leaves).tolist(), strict=False):
            if reason and reason not in UNDRAWN:
                milliseconds[reason] = milliseconds.get(reason, 0.0) + 1e3 * self.samples * seconds
        return milliseconds

    def _of(self, seconds, cells):
        expected_seconds = self._driver.expected_seconds(cells) * self._ratio.value
        return np.where(seconds < np.inf, seconds, expected_seconds)

    def expected(self, leaves, leaf_ids) -> float:
        """Return the expected seconds of rendering an image of some leaves."""
        return _IMAGE + float(self._of(leaves.seconds[leaf_ids], leaves.cells[leaf_ids]).sum())

    def images(self, nodes, mesh_seconds, renewals, has_image, card_area) -> np.ndarray:
        """Return the seconds per frame of each node's image, at `renewals` per unit of motion."""
        # A camera at rest may start again.
        speed = max(self.speed.value, _SLOWEST * nodes.radius.max())
        renewal_rate = speed * renewals + np.where(has_image, 0.0, 1 / FARTHEST)
        change_rate = self.often(nodes.tree)
        render_share = np.minimum(renewal_rate + change_rate, 1.0)
        mesh_seconds = mesh_seconds * np.where(nodes.is_clear, LAYERS, 1)
        return render_share * (mesh_seconds + _IMAGE) + _CARD + self.pixel * card_area

    @contextmanager
    def timed(self, window, leaves, leaf_ids):
        """Measure the seconds of rendering the meshes of some leaves."""
        expected = self.expected(leaves, leaf_ids)
        source = leaves.sources[leaf_ids[0]]
        if len(leaf_ids) != 1 or source.tries >= _TRIES or not self._measures():
            yield SimpleNamespace(seconds=expected)
            return
        with timed(window, expected) as spent:
            yield spent
        source.tries += 1
        self._node_seconds = None
        if source.tries > 1:  # the first draw uploads the mesh and builds its shader
            draws = LAYERS if source.opacity < 1 else 1
            mesh_seconds = (spent.seconds - _IMAGE) / draws
            source.seconds = min(source.seconds, max(mesh_seconds, 1e-6))
            leaves.seconds[leaf_ids] = source.seconds
            self._ratio.add(source.seconds / self._driver.expected_seconds(source.cells))

    def measure(self, frame, cards, drawer, area):
        """Measure the seconds per pixel of a card, once."""
        if self._measured_pixel_s is not None or area < 2000 or not self._measures():
            return
        width, height = frame.size
        target = Target(frame.window, width, height, ('rgba8',), depth=True)
        draw_seconds = []
        for _ in range(_TRIES):
            with timed(frame.window, 0.0) as spent, target.drawing(clear=(0, 0, 0, 0)):
                drawer.look(frame.view, (0, 0, *frame.size))
                drawer.draw([cards.actor])
            draw_seconds.append(spent.seconds)
        drawer.done()
        target.release()
        self._measured_pixel_s = min(draw_seconds) / area

    def _measures(self) -> bool:
        """Return whether times are measured; on a GPU that would wait for it."""
        return self._driver.is_software and not is_deterministic()
