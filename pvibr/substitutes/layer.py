"""One layer: its actors, its image, and whether that is valid."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pvibr.core.costs import Backoff, RunningMean
from pvibr.core.determinism import elapsed
from pvibr.maths.views import may_see
from pvibr.substitutes.layer_maths import split_by_depth
from pvibr.substitutes.layer_members import Lighting
from pvibr.substitutes.layer_picture import Fit, LayerPicture, Settings
from pvibr.things.casters import sized
from pvibr.things.frame import Frame
from pvibr.things.thing import joined_bounds

#: Most frames that a layer is left to VTK.
REST = 64
# Least speed-up at which a layer is used.
_GAIN = 1.1


class FrameState(NamedTuple):
    """The state of a frame that layers depend on."""

    frame: Frame
    light: Lighting
    effects: list
    key: tuple
    max_error: float
    max_shade: float
    warp: str
    only_if_faster: bool


class Layer:
    """Actors, their image, and its error."""

    _settings: Settings
    _light: Lighting

    def __init__(self, members):
        self.members, self.picture = members, LayerPicture()
        self.fit: Fit | None = None
        self.is_invalid, self.residual = False, 0.0
        self.residual_shown = 0.0
        self.why, self.state = '', 'new'
        self.taken = self.frames = 0
        self.reasons: Counter = Counter()
        #: Mean seconds of a new image.
        self._renewal_rate, self.seconds = RunningMean(1.0), RunningMean()
        self._actor_seconds = RunningMean()  # seconds of the actors in it
        self._pause = Backoff(4, REST)
        self._key: tuple = ()
        self._start_matrices: list = []
        self._image_settings: Settings | None = None

    # -- actors -----------------------------------------------------------------------------------

    @property
    def bounds(self) -> np.ndarray:
        """World bounds of the visible members, shape (n, 6)."""
        return np.array([m.bounds for m in self.members if not m.why]).reshape(-1, 6)

    def keep(self, members):
        """Drop all but these members."""
        self.members = [m for m in self.members if m.key in members]

    def _motion(self):
        """Return the rigid motion of all actors, None without any; False if they differ."""
        current = [m.matrix for m in self.members if not m.why]
        start = self._start_matrices
        if all(map(np.array_equal, current, start)):
            return None
        motion = current[0] @ np.linalg.inv(start[0])
        tolerance = 1e-9 * max(np.abs(current[0]).max(), 1.0)
        pairs = zip(start, current, strict=True)
        same_motion = all(np.allclose(motion @ a, b, rtol=0, atol=tolerance) for a, b in pairs)
        rotation = motion[:3, :3]
        is_orthogonal = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        is_rigid = is_orthogonal and np.linalg.det(rotation) > 0
        return motion if same_motion and is_rigid else False

    # -- validity ---------------------------------------------------------------------------------

    def judge(self, now, settings):
        """Warp the image to a frame and decide whether it is valid."""
        self._settings, self.is_invalid, self.fit = settings, False, None
        self.picture.settle()
        self.residual = self.residual_shown = 0.0
        bounds = self.bounds
        if not len(bounds):
            self.state = 'empty'
            return
        if not may_see(now.frame.view, bounds).any():
            self.state = 'out of view'
            return
        self.frames += 1
        if not settings.blur and self._pause.waits():
            return
        if now.only_if_faster and not settings.blur and self._is_too_costly():
            self._rest()
            return
        self.why = self._stale(now)
        self.is_invalid = bool(self.why)
        if self.why in ('new', 'changed', 'settings'):
            self.residual = np.inf
        self._renewal_rate.add(float(self.is_invalid))
        self.residual_shown = 0.0 if self.fit is None else self.fit.residual
        if not self.is_invalid:
            self._pause.succeeded()
            self.state = 'warped'

    def _content_key(self, now) -> tuple:
        return tuple((m.key, m.version) for m in self.members if not m.why), now.key

    def _stale(self, now) -> str:
        """Return why the image is invalid, empty if it is valid."""
        if not self.picture.alive:
            return 'new'
        if self._settings != self._image_settings:
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
        scene_box = np.reshape(joined_bounds(self.bounds.tolist()), (3, 2))
        radius = np.linalg.norm(np.ptp(scene_box, axis=1)) / 2
        color_change, angle_change = now.light.change(self._light, scene_box.mean(1), radius)
        if color_change == np.inf:  # times 0 would be NaN
            return color_change
        if motion is not None:
            angle_change += now.light.strength * _angle(motion)
        highlight_change = angle_change + self._view_change(now, turn)
        return dull * (color_change + angle_change) + gloss * highlight_change

    def _view_change(self, now, turn) -> float:
        """Return the change of the view direction, radians times light."""
        if now.frame.parallel:
            return now.light.strength * _angle(turn)
        if self.picture.empty:
            return 0.0
        eye_angle = np.linalg.norm(turn[:3, 3]) / max(self.picture.nearest, 1e-300)
        return now.light.strength * min(float(eye_angle), np.pi)

    # -- rendering --------------------------------------------------------------------------------

    def late(self):
        """Keep an invalid image, as the frame's budget is spent."""
        self.state = 'late'

    def take(self, now, drawer) -> float:
        """Renew the image and warp it to the frame; return the seconds spent."""
        shown_members = [m for m in self.members if not m.why]
        self.reasons[self.why] += 1
        start_time = time.perf_counter()
        view, actor_seconds = self.picture.aim(now.frame, self.bounds, self._settings), 0.0
        if view is not None:
            actor_seconds = self._draw(now, drawer, view, [m.actor for m in shown_members])
        spent = elapsed(start_time, actor_seconds)
        self.taken += 1
        # The first images upload meshes and build shaders.
        weight = 1.0 if self.taken <= 2 else None
        self.seconds.add(spent, weight)
        self._actor_seconds.add(actor_seconds, weight)
        self._key, self._start_matrices = self._content_key(now), [m.matrix for m in shown_members]
        self._light, self._image_settings = now.light, self._settings
        self.fit = self.picture.fit(now.frame, None, now.warp)
        self.residual_shown = self.fit.residual
        self.state = 'taken'
        return spent

    def _draw(self, now, drawer, view, actors) -> float:
        picture, frame = self.picture, now.frame
        image_frame = replace(frame, size=tuple(picture.texels), origin=(0, 0), view=view)
        effects = [e for e in now.effects if e.needed(image_frame) is True]
        for effect in effects:
            effect.prepare(image_frame)
        with sized(actors if picture.scale != 1 else (), frame, image_frame, 1.0):
            seconds = picture.draw(drawer, view, actors)
        for effect in effects:
            effect.finish(image_frame)
        return seconds

    def _is_too_costly(self) -> bool:
        """Return True if the image costs more than its actors."""
        draw_count = 2 if self.picture.blends else 1  # core and fringe
        card_cost = draw_count * self.picture.pixel * self.picture.area
        image_cost = self._renewal_rate.value * self.seconds.value + card_cost
        return self.taken > 1 and image_cost * _GAIN > self._actor_seconds.value

    def _rest(self):
        """Leave the layer to VTK for some frames, more each time."""
        self._pause.failed()
        self._renewal_rate.value, self.state = 0.5, 'left to VTK'

    def away(self, fit) -> float:
        """Return the layer's farthest depth, by which layers are sorted: ground comes last."""
        return -float(fit.turn[2] @ [0, 0, -self.picture.farthest, 1])

    def report(self) -> dict:
        """Return state, error and renewals with their reasons."""
        return {
            'actors': len(self.members),
            'state': self.state,
            'rate': round(self.taken / max(self.frames, 1), 3),
            'residual_px': round(float(self.residual_shown), 3),
            'ms': round(1e3 * self.seconds.value, 2),
            'texels': tuple(self.picture.texels),
            'taken for': dict(self.reasons),
            'as VTK draws it': dict(Counter(m.why for m in self.members if m.why)),
        }


def _angle(matrix) -> float:
    """Return the rotation angle of a matrix, radians."""
    return float(np.arccos(np.clip((np.trace(matrix[:3, :3]) - 1) / 2, -1, 1)))


def numbers_by_depth(frame, bounds, count) -> tuple[list, list]:
    """Split boxes into layers by their distance from the eye."""
    box_ends = np.reshape(bounds, (-1, 3, 2)).astype(float)
    if not len(box_ends):
        return [], []
    box_center, half_size = box_ends.mean(2) - frame.eye, np.ptp(box_ends, axis=2) / 2
    if frame.parallel:
        center_depth = -(box_center @ frame.view_from_world[2, :3])
        half_depth = half_size @ np.abs(frame.view_from_world[2, :3])
        ends = center_depth - half_depth, center_depth + half_depth
        numbers = split_by_depth(*ends, count, ratio=False)
        return numbers.tolist(), [np.inf] * len(box_ends)
    nearest = np.linalg.norm(np.maximum(np.abs(box_center) - half_size, 0), axis=1)
    farthest = np.linalg.norm(np.abs(box_center) + half_size, axis=1)
    nearest = np.clip(nearest, frame.near, None)
    numbers = split_by_depth(nearest, np.maximum(farthest, nearest), count)
    return numbers.tolist(), np.linalg.norm(box_center, axis=1).tolist()
