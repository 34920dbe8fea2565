"""Quality that meets a frame time, from the triangles that each quality would draw."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from functools import cache

import numpy as np

from pvibr.things.frame import STEP

#: Steps of quality, finest first: within the first one detail is left out by and by.
LEVELS = tuple(STEP ** (k / 8) for k in range(8)) + tuple(STEP**k for k in range(1, 17))
#: First level without any detail.
_COARSER = LEVELS.index(STEP)
#: What a frame costs beside what is counted, in triangles: at least, and at most relative to those
#: of recent frames; and until that is known.
_BASE, _MOST_BASE, _GUESS = 10_000, 3.0, 50_000
#: Frames from which that is found, and least difference of their triangles that tells, relative.
_HISTORY, _TELLING = 24, 0.1
#: Fractions of the budget: quality is lowered beyond one, and raised if it keeps the other.
_LATE, _EASY = 1.08, 0.96
#: The same as `_LATE` for the first frame of all, which compiles and uploads.
_FIRST_LATE = 1.4
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
        #: Triangles and milliseconds of lowered frames: the last at this level, and more.
        self._frames: list[tuple[float, float]] = []
        self._history: deque[tuple[float, float]] = deque(maxlen=_HISTORY)
        #: Triangles that would take as long as what is not counted does.
        self._base: float = _GUESS
        #: Triangles of the last full frame, counted when asked for, and its milliseconds.
        self._full_frame: tuple[Callable[[], float], float] = (lambda: 0.0), 0.0
        self._drawn_level = -1
        self._level_ms: dict[int, float] = {}
        self._easy_frames = self._stuck_frames = 0
        self._is_first = True

    def choose(self, budget_ms, triangles: Callable[[float], float]) -> float:
        """Return the quality of the next moving frame, from the triangles of each quality."""

        @cache
        def load(level):
            return triangles(LEVELS[level])

        self._stuck_frames = max(0, self._stuck_frames - 1)
        if not self._stuck_frames:
            self._move(self._chosen(budget_ms, load), budget_ms)
        self._load = load(self._level)
        return LEVELS[self._level]

    def _chosen(self, budget_ms, load) -> int:
        is_first, self._is_first = self._is_first, False
        if is_first:  # as fast as the last frames, in motion or at rest
            return self._finest(budget_ms, load)
        late = _LATE if len(self._frames) == _FRAMES else _FIRST_LATE
        if self._ms(self._level, load, least=True) > late * budget_ms:
            return max(self._finest(budget_ms, load), self._level)
        if self._history:
            self._learn_base()
        base = self._base
        if not self._level or self._ms(self._level - 1, load, base) > _EASY * budget_ms:
            self._easy_frames = 0
            return self._level
        self._easy_frames += 1
        finest = self._finest(_EASY * budget_ms, load, base)
        return min(finest, self._level) if self._easy_frames >= _FRAMES else self._level

    def _finest(self, budget_ms, load, base=_BASE) -> int:
        """Return the finest level that keeps a time, or the coarsest one."""
        finer = range(len(LEVELS) - 1)
        return bisect_left(finer, True, key=lambda k: self._ms(k, load, base) <= budget_ms)

    def _ms(self, level, load, base=_BASE, *, least=False) -> float:
        """Return the milliseconds of a level by those of the last frames, at most or least."""
        frames = self._frames
        if not level or not frames:
            full_load, full_ms = self._full_frame
            frames = [(full_load(), full_ms)]
        times = [ms * (base + load(level)) / (base + triangles) for triangles, ms in frames]
        return min(times) if least else max(times)

    def _learn_base(self):
        """Find how much of the time of recent frames their triangles do not tell."""
        # By it quality rises. It falls as if there were none of it, lest one slow frame leave
        # nothing of the surface.
        triangles, times = np.transpose(self._history)
        pairs = np.triu_indices(len(times), 1)
        runs, rises = (values[pairs[1]] - values[pairs[0]] for values in (triangles, times))
        tells = np.abs(runs) > _TELLING * triangles.mean()
        if not tells.any():
            return
        # Theil's and Sen's line, which single slow frames do not turn.
        slope = np.median(rises[tells] / runs[tells])
        most = max(_BASE, _MOST_BASE * np.median(triangles))
        fixed_ms = np.median(times - slope * triangles)
        self._base = float(np.clip(fixed_ms / slope, _BASE, most)) if slope > 0 else most

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
            self._frames, self._easy_frames = self._frames[-1:], 0
        self._level = level

    def finer(self, triangles) -> float:
        """Return the quality of the next frame at rest: about twice as much, or all."""
        self._is_first = True
        allowed = _GROWTH * self._load
        finer = range(max(self._level - 1, 0))
        self._level = bisect_left(finer, True, key=lambda k: triangles(LEVELS[k]) <= allowed)
        self._load = triangles(LEVELS[self._level])
        return LEVELS[self._level]

    def drawn(self, frame_ms):
        """Record a frame of the quality that was chosen last."""
        if not self._level:
            load = self._load
            self._full_frame = (lambda: load), frame_ms
            return
        self._frames = [*self._frames[1 - _FRAMES :], (self._load, frame_ms)]
        if self._level == self._drawn_level:  # the first frame of a level uploads all of it
            self._history.append(self._frames[-1])
        self._drawn_level = self._level
        self._level_ms[self._level] = frame_ms

    def rested(self, frame_ms, triangles):
        """Record a frame at full quality that no one chose."""
        self._is_first, self._level = True, 0
        self._full_frame = cache(lambda: triangles(1.0)), frame_ms
