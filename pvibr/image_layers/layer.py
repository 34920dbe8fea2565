"""One layer: its actors, its picture, and whether that serves."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pvibr.core.determinism import elapsed
from pvibr.image_layers.picture import LayerPicture
from pvibr.maths.layers import split_by_depth
from pvibr.maths.views import may_see
from pvibr.scene.casters import sized

#: Frames that a layer is left to VTK at most.
REST = 64
# Shares of the new value in running means; what layers gain before they are used, as a factor.
_NEWS, _GAIN = 0.2, 1.1


class Now(NamedTuple):
    """What layers ask for in a frame."""

    frame: Any
    view: Any
    light: Any
    effects: list
    key: tuple
    owner: Any


class Layer:
    """Some actors, their picture, and how well it serves."""

    def __init__(self, members):
        self.members, self.picture = members, LayerPicture()
        self.fit: Any = None
        self.wrong, self.residual = False, 0.0
        self.residual_shown = 0.0
        self.why, self.state = '', 'new'
        self.taken = self.frames = 0
        self.reasons: Counter = Counter()
        self.rate, self.seconds = 1.0, 0.0
        self._alone = 0.0  # seconds of the actors in it
        self._rests = self._pause = 0
        self._key: tuple = ()
        self._start: list = []
        self._light: Any = None
        self._used: Any = None

    # -- its actors -------------------------------------------------------------------------------

    @property
    def bounds(self) -> np.ndarray:
        """World bounds of the actors that it shows, shape (n, 6)."""
        return np.array([m.bounds for m in self.members if not m.why]).reshape(-1, 6)

    def keep(self, members):
        """Forget the actors that are not among these."""
        self.members = [m for m in self.members if m.key in members]

    def _motion(self):
        """Return what moved all actors alike since, None where none; False where not alike."""
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
        """Warp the picture to a frame, and tell whether it serves."""
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
        if self._rests and not settings.blur:
            self._rests -= 1
            return
        if now.owner.only_if_faster and not settings.blur and self._is_dear():
            self._rest()
            return
        self.why = self._stale(now)
        self.wrong = bool(self.why)
        if self.why in ('new', 'changed', 'settings'):
            self.residual = np.inf
        self.rate += _NEWS * (self.wrong - self.rate)
        self.residual_shown = 0.0 if self.fit is None else self.fit.residual
        if not self.wrong:
            self._pause = max(self._pause - 1, 0)
            self.state = 'warped'

    def _content_key(self, now) -> tuple:
        return tuple((m.key, m.version) for m in self.members if not m.why), now.key

    def _stale(self, now) -> str:
        """Return why the picture does not serve, or nothing."""
        if not self.picture.alive:
            return 'new'
        if self._want != self._used:
            return 'settings'
        motion = self._motion() if self._content_key(now) == self._key else False
        if motion is False or (motion is not None and now.key):
            return 'changed'
        fit = self.picture.fit(now.frame, motion, now.owner.warp)
        self.residual = fit.residual
        if fit.why == 'window':
            return 'window'
        self.fit = fit
        if self._shade(now, fit.turn, motion) > now.owner.max_shade:
            return 'light'
        return fit.why or ('geometry' if fit.residual > now.owner.max_error else '')

    def _shade(self, now, turn, motion) -> float:
        """Return how much lighter or darker its surfaces are now, of white."""
        dull = max((m.dull for m in self.members if not m.why), default=0.0)
        gloss = max((m.gloss for m in self.members if not m.why), default=0.0)
        if not dull and not gloss:
            return 0.0
        box = np.reshape(around(self.bounds), (3, 2))
        radius = np.linalg.norm(np.ptp(box, axis=1)) / 2
        color, turned = now.light.change(self._light, box.mean(1), radius)
        if motion is not None:
            turned += now.light.strength * _angle(motion)
        return dull * (color + turned) + gloss * (turned + self._seen_otherwise(now, turn))

    def _seen_otherwise(self, now, turn) -> float:
        """Return by how much the direction to the eye turned, radians times light."""
        if now.frame.parallel:
            return now.light.strength * _angle(turn)
        if self.picture.empty:
            return 0.0
        went = np.linalg.norm(turn[:3, 3]) / max(self.picture.nearest, 1e-300)
        return now.light.strength * min(float(went), np.pi)

    # -- taking it --------------------------------------------------------------------------------

    def late(self):
        """Go on with a picture that is wrong: the budget of the frame is spent."""
        self.state = 'late'

    def take(self, now, drawer) -> float:
        """Take the picture, warp it to the frame, and return the seconds that it took."""
        shown = [m for m in self.members if not m.why]
        self.reasons[self.why] += 1
        start = time.perf_counter()
        view, alone = self.picture.aim(now.frame, self.bounds, self._want), 0.0
        if view is not None:
            alone = self._draw(now, drawer, view, [m.actor for m in shown])
        spent = elapsed(start, alone)
        self.taken += 1
        # The first ones upload meshes and build shaders.
        news = 1.0 if self.taken <= 2 else _NEWS
        self.seconds += news * (spent - self.seconds)
        self._alone += news * (alone - self._alone)
        for member in shown:  # what drawing them did to them is no change
            member.settle()
        self._key, self._start = self._content_key(now), [m.matrix for m in shown]
        self._light, self._used = now.light, self._want
        self.fit = self.picture.fit(now.frame, None, now.owner.warp)
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
        """Tell whether the picture costs more than it saves."""
        cost = self.rate * self.seconds + self.picture.pixel * self.picture.area
        return self.taken > 1 and cost * _GAIN > self._alone

    def _rest(self):
        """Leave the layer to VTK for a while, each time for longer."""
        self._pause = min(2 * self._pause + 4, REST)
        self._rests, self.rate, self.state = self._pause, 0.5, 'left to VTK'

    def away(self) -> float:
        """Return how far the layer reaches along the view.

        By this they are sorted: what lies around or under the others is behind them.
        """
        return -float(self.fit.turn[2] @ [0, 0, -self.picture.farthest, 1])

    def report(self) -> dict:
        """Return how often its picture is taken and why, and how wrong it is."""
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
    """Return how far a matrix turns, radians."""
    return float(np.arccos(np.clip((np.trace(matrix[:3, :3]) - 1) / 2, -1, 1)))


def around(boxes) -> tuple:
    """Return the bounds of all of some boxes."""
    found = np.array([b for b in boxes if b[0] <= b[1]]).reshape(-1, 6)
    if not len(found):
        return (1.0, -1.0) * 3
    ends = np.stack([found[:, ::2].min(0), found[:, 1::2].max(0)], 1)
    return tuple(ends.ravel().tolist())


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
