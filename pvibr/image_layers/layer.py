"""One layer: its actors, its image, and whether that is valid."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pvibr.core.costs import Backoff, RunningMean
from pvibr.core.determinism import elapsed
from pvibr.core.frame import Frame
from pvibr.image_layers.members import Lighting
from pvibr.image_layers.picture import Fit, LayerPicture, Settings
from pvibr.maths.layers import split_by_depth
from pvibr.maths.views import View, may_see
from pvibr.scene.casters import sized
from pvibr.scene.thing import joined_bounds

#: Frames that a layer is left to VTK at most.
REST = 64
# What layers gain before they are used, as a factor.
_GAIN = 1.1


class Now(NamedTuple):
    """The state of a frame that layers depend on."""

    frame: Frame
    view: View
    light: Lighting
    effects: list
    key: tuple
    max_error: float
    max_shade: float
    warp: str
    only_if_faster: bool


class Layer:
    """Some actors, their image, and its error."""

    _want: Settings
    _light: Lighting

    def __init__(self, members):
        self.members, self.picture = members, LayerPicture()
        self.fit: Fit | None = None
        self.wrong, self.residual = False, 0.0
        self.residual_shown = 0.0
        self.why, self.state = '', 'new'
        self.taken = self.frames = 0
        self.reasons: Counter = Counter()
        self._rate, self._seconds = RunningMean(1.0), RunningMean()
        self._alone = RunningMean()  # seconds of the actors in it
        self._pause = Backoff(4, REST)
        self._key: tuple = ()
        self._start: list = []
        self._used: Settings | None = None

    # -- its actors -------------------------------------------------------------------------------

    @property
    def bounds(self) -> np.ndarray:
        """World bounds of the actors that it shows, shape (n, 6)."""
        return np.array([m.bounds for m in self.members if not m.why]).reshape(-1, 6)

    def keep(self, members):
        """Keep only these members."""
        self.members = [m for m in self.members if m.key in members]

    def _motion(self):
        """Return the rigid motion of all actors, None without any; False if they differ."""
        now = [m.matrix for m in self.members if not m.why]
        if all(map(np.array_equal, now, self._start)):
            return None
        motion = now[0] @ np.linalg.inv(self._start[0])
        scale = max(np.abs(now[0]).max(), 1.0)
        alike = all(
            np.allclose(motion @ a, b, rtol=0, atol=1e-9 * scale)
            for a, b in zip(self._start, now, strict=True)
        )
        square = motion[:3, :3] @ motion[:3, :3].T
        rigid = np.allclose(square, np.eye(3), atol=1e-6) and np.linalg.det(motion[:3, :3]) > 0
        return motion if alike and rigid else False

    # -- whether its picture serves ---------------------------------------------------------------

    def judge(self, now, settings):
        """Warp the image to a frame, and judge whether it is valid."""
        self._want, self.wrong, self.fit = settings, False, None
        self.residual = self.residual_shown = 0.0
        bounds = self.bounds
        if not len(bounds):
            self.state = 'empty'
            return
        if not may_see(now.view, bounds).any():
            self.state = 'out of view'
            return
        self.frames += 1
        if not settings.blur and self._pause.waits():
            return
        if now.only_if_faster and not settings.blur and self._is_dear():
            self._rest()
            return
        self.why = self._stale(now)
        self.wrong = bool(self.why)
        if self.why in ('new', 'changed', 'settings'):
            self.residual = np.inf
        self._rate.add(float(self.wrong))
        self.residual_shown = 0.0 if self.fit is None else self.fit.residual
        if not self.wrong:
            self._pause.succeeded()
            self.state = 'warped'

    def _content_key(self, now) -> tuple:
        return tuple((m.key, m.version) for m in self.members if not m.why), now.key

    def _stale(self, now) -> str:
        """Return why the image is invalid, empty if it is valid."""
        if not self.picture.alive:
            return 'new'
        if self._want != self._used:
            return 'settings'
        motion = self._motion() if self._content_key(now) == self._key else False
        if motion is False or (motion is not None and now.key):
            return 'changed'
        fit = self.picture.fit(now.frame, motion, now.warp)
        self.residual = fit.residual
        if fit.why == 'window':
            return 'window'
        self.fit = fit
        if self._shade(now, fit.turn, motion) > now.max_shade:
            return 'light'
        return fit.why or ('geometry' if fit.residual > now.max_error else '')

    def _shade(self, now, turn, motion) -> float:
        """Return the change of shading, as a share of white."""
        dull = max((m.dull for m in self.members if not m.why), default=0.0)
        gloss = max((m.gloss for m in self.members if not m.why), default=0.0)
        if not dull and not gloss:
            return 0.0
        box = np.reshape(joined_bounds(self.bounds.tolist()), (3, 2))
        radius = np.linalg.norm(np.ptp(box, axis=1)) / 2
        color, turned = now.light.change(self._light, box.mean(1), radius)
        if color == np.inf:  # of which a share of none is none
            return color
        if motion is not None:
            turned += now.light.strength * _angle(motion)
        return dull * (color + turned) + gloss * (turned + self._seen_otherwise(now, turn))

    def _seen_otherwise(self, now, turn) -> float:
        """Return the change of the view direction, radians times light."""
        if now.frame.parallel:
            return now.light.strength * _angle(turn)
        if self.picture.empty:
            return 0.0
        went = np.linalg.norm(turn[:3, 3]) / max(self.picture.nearest, 1e-300)
        return now.light.strength * min(float(went), np.pi)

    # -- taking it --------------------------------------------------------------------------------

    def late(self):
        """Keep an invalid image: the budget of the frame is spent."""
        self.state = 'late'

    def take(self, now, drawer) -> float:
        """Renew the image, warp it to the frame, and return the seconds that it took."""
        shown = [m for m in self.members if not m.why]
        self.reasons[self.why] += 1
        start = time.perf_counter()
        view, alone = self.picture.aim(now.frame, self.bounds, self._want), 0.0
        if view is not None:
            alone = self._draw(now, drawer, view, [m.actor for m in shown])
        spent = elapsed(start, alone)
        self.taken += 1
        # The first ones upload meshes and build shaders.
        weight = 1.0 if self.taken <= 2 else None
        self._seconds.add(spent, weight)
        self._alone.add(alone, weight)
        self._key, self._start = self._content_key(now), [m.matrix for m in shown]
        self._light, self._used = now.light, self._want
        self.fit = self.picture.fit(now.frame, None, now.warp)
        self.residual_shown = self.fit.residual
        self.state = 'taken'
        return spent

    def _draw(self, now, drawer, view, actors) -> float:
        picture, frame = self.picture, now.frame
        seen = replace(frame, size=tuple(picture.texels), origin=(0, 0), view=view)
        effects = [e for e in now.effects if e.needed(seen) is True]
        for effect in effects:
            effect.prepare(seen)
        with sized(actors if picture.scale != 1 else (), frame, seen, 1.0):
            seconds = picture.draw(drawer, view, actors)
        for effect in effects:
            effect.finish(seen)
        return seconds

    def _is_dear(self) -> bool:
        """Return True if the image costs more than it saves."""
        draws = 2 if self.picture.blends else 1  # core and fringe
        cost = self._rate.value * self.seconds + draws * self.picture.pixel * self.picture.area
        return self.taken > 1 and cost * _GAIN > self._alone.value

    def _rest(self):
        """Leave the layer to VTK for a while, longer each time."""
        self._pause.failed()
        self._rate.value, self.state = 0.5, 'left to VTK'

    @property
    def seconds(self) -> float:
        """Expected seconds of a new image."""
        return self._seconds.value

    def away(self, fit) -> float:
        """Return how far the layer reaches along the view.

        By this they are sorted: what lies around or under the others is behind them.
        """
        return -float(fit.turn[2] @ [0, 0, -self.picture.farthest, 1])

    def report(self) -> dict:
        """Return how often the image is renewed and why, and its error."""
        return {
            'actors': len(self.members),
            'state': self.state,
            'rate': round(self.taken / max(self.frames, 1), 3),
            'residual_px': round(float(self.residual_shown), 3),
            'ms': round(1e3 * self.seconds, 2),
            'texels': tuple(self.picture.texels),
            'taken for': dict(self.reasons),
            'as VTK draws it': dict(Counter(m.why for m in self.members if m.why)),
        }


def _angle(matrix) -> float:
    """Return the rotation angle of a matrix, radians."""
    return float(np.arccos(np.clip((np.trace(matrix[:3, :3]) - 1) / 2, -1, 1)))


def numbers_by_depth(frame, bounds, count) -> tuple[list, list]:
    """Split boxes into layers by their distance from the eye."""
    ends = np.reshape(bounds, (-1, 3, 2)).astype(float)
    if not len(ends):
        return [], []
    middle, half = ends.mean(2) - frame.eye, np.ptp(ends, axis=2) / 2
    if frame.parallel:
        along = -(middle @ frame.view_from_world[2, :3])
        reach = half @ np.abs(frame.view_from_world[2, :3])
        numbers = split_by_depth(along - reach, along + reach, count, ratio=False)
        return numbers.tolist(), [np.inf] * len(ends)
    nearest = np.linalg.norm(np.maximum(np.abs(middle) - half, 0), axis=1)
    farthest = np.linalg.norm(np.abs(middle) + half, axis=1)
    nearest = np.clip(nearest, frame.near, None)
    numbers = split_by_depth(nearest, np.maximum(farthest, nearest), count)
    return numbers.tolist(), np.linalg.norm(middle, axis=1).tolist()
