"""Quality that meets a frame time, from the triangles that each quality would draw."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from functools import cache

from pvibr.things.frame import STEP

#: Steps of quality, finest first: within the first one detail is left out by and by.
LEVELS = tuple(STEP ** (k / 8) for k in range(8)) + tuple(STEP**k for k in range(1, 17))
#: First level without any detail.
_COARSER = LEVELS.index(STEP)
#: What a frame costs beside what is counted, in triangles, at least.
_BASE = 10_000
#: Fractions of the budget: quality is lowered beyond one, and raised if it keeps the other.
_LATE, _EASY = 1.08, 0.96
#: Frames that tell how fast triangles are; quality rises after so many.
_FRAMES = 2
#: Frames until lower quality is tried again, after none was fast enough.
_STUCK = 60
#: Least speed-up that justifies lower quality.
_GAIN = 1.25
#: Most growth of the triangles from one frame at rest to the next.
_GROWTH = 2.0


class LoadBudget:
    """Quality of frames whose triangles are known before they are drawn."""

    def __init__(self):
        self._level = 0
        self._load = 0.0
        #: Milliseconds per triangle of the last lowered frames.
        self._rates: list[float] = []
        #: Milliseconds of the last full frame, and its triangles, counted when asked for.
        self._full_frame: tuple[float, Callable[[], float]] = 0.0, lambda: _BASE
        self._level_ms: dict[int, float] = {}
        self._easy_frames = self._stuck_frames = 0
        self._is_first = True

    def choose(self, budget_ms, triangles: Callable[[float], float]) -> float:
        """Return the quality of the next moving frame, from the triangles of each quality."""

        @cache
        def load(level):
            return _BASE + triangles(LEVELS[level])

        self._stuck_frames = max(0, self._stuck_frames - 1)
        if not self._stuck_frames:
            self._move(self._chosen(budget_ms, load), budget_ms)
        self._load = load(self._level)
        return LEVELS[self._level]

    def _chosen(self, budget_ms, load) -> int:
        is_first, self._is_first = self._is_first, False
        if is_first:  # as fast as the last frames, in motion or at rest
            return self._finest(budget_ms, load)
        if self._ms(self._level, load, min) > _LATE * budget_ms:
            return max(self._finest(budget_ms, load), self._level)
        if not self._level or self._ms(self._level - 1, load) > _EASY * budget_ms:
            self._easy_frames = 0
            return self._level
        self._easy_frames += 1
        finest = self._finest(_EASY * budget_ms, load)
        return min(finest, self._level) if self._easy_frames >= _FRAMES else self._level

    def _finest(self, budget_ms, load) -> int:
        """Return the finest level that keeps a time, or the coarsest one."""
        finer = range(len(LEVELS) - 1)
        return bisect_left(finer, True, key=lambda level: self._ms(level, load) <= budget_ms)

    def _ms(self, level, load, of=max) -> float:
        """Return the milliseconds of a level, if they are as its triangles."""
        if not level or not self._rates:
            full_ms, full_load = self._full_frame
            return full_ms / full_load() * load(level)
        return of(self._rates) * load(level)

    def _move(self, level, budget_ms):
        """Take another level, or one that is as fast where none is fast enough."""
        last_ms = self._level_ms.get(self._level, 0.0)
        if level == self._level == len(LEVELS) - 1 and last_ms > budget_ms:
            level = _COARSER  # to be compared
            if level in self._level_ms:
                times = self._level_ms.items()
                level = min(k for k, ms in times if ms <= _GAIN * last_ms)
                self._stuck_frames = _STUCK
        if level != self._level:
            self._rates, self._easy_frames = self._rates[-1:], 0
        self._level = level

    def finer(self, triangles) -> float:
        """Return the quality of the next frame at rest: about twice as much, or all."""
        self._is_first = True
        allowed = _GROWTH * (self._load - _BASE)
        finer = range(max(self._level - 1, 0))
        self._level = bisect_left(finer, True, key=lambda k: triangles(LEVELS[k]) <= allowed)
        self._load = _BASE + triangles(LEVELS[self._level])
        return LEVELS[self._level]

    def drawn(self, frame_ms):
        """Record a frame of the quality that was chosen last."""
        if not self._level:
            load = self._load
            self._full_frame = frame_ms, lambda: load
            return
        self._rates = [*self._rates[1 - _FRAMES :], frame_ms / self._load]
        self._level_ms[self._level] = frame_ms

    def rested(self, frame_ms, triangles):
        """Record a frame at full quality that no one chose."""
        self._is_first, self._level = True, 0
        self._full_frame = frame_ms, cache(lambda: _BASE + triangles(1.0))
