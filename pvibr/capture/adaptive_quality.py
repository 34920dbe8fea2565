"""Adaptive quality: what the frame time allows while the view moves, full and refined at rest."""

from __future__ import annotations

import functools
import math
from contextlib import contextmanager
from time import perf_counter

from pvibr.capture.clock import Loop, Timer, draw, filming, ticks
from pvibr.core import _vtk
from pvibr.core.costs import RunningMean
from pvibr.core.determinism import is_deterministic
from pvibr.core.plotters import is_dragged

#: Levels of quality, 3 dB apart.
LEVELS = tuple(2 ** (-k / 2) for k in range(9))
#: Maximum number of levels that one slow frame lowers.
_LEAP = 4
#: Fraction of the budget below which a frame is easy, and easy frames until quality rises.
_EASY, _PATIENCE = 0.6, 5
#: Moving frames for which the time of a level is remembered; doubled after each mistake.
_MEMORY = 60
#: Weight of the last frame in the running mean of a level.
_WEIGHT = 0.4
#: Speed-up that justifies lower quality.
_GAIN = 1.25
#: Seconds after the last moving frame until the view is at rest.
SETTLE = 0.2
_WHEELS = ('Forward', 'Backward', 'Left', 'Right')
_BUTTONS = ('Left', 'Middle', 'Right')


class Budget:
    """Quality within a frame time, from the times of past frames."""

    def __init__(self, ms=100.0):
        self.ms = ms
        self._forget()

    def _forget(self):
        self._level = self._frame = self._easy = self._stuck = 0
        self._raised = False
        self._memory = _MEMORY
        self._took: dict[int, tuple[float, int]] = {}
        self._rests: list[float] = []

    @property
    def quality(self) -> float:
        """Quality of the next moving frame, in (0, 1]."""
        return LEVELS[self._level] if self.ms else 1.0

    def rested(self, ms):
        """Record a frame at rest, drawn at full quality."""
        # The faster of two: a frame may include a bake.
        self._rests = [*self._rests[-1:], ms]
        full = min(self._rests)
        if full <= _EASY * self.ms:
            self._forget()
            self._rests = [ms]
        elif full > self.ms > 0 and len(self._rests) > 1 and not self._level and not self._stuck:
            self._level = _steps(full / self.ms)

    def moved(self, ms):
        """Record a moving frame, drawn at `quality`."""
        if not self.ms:
            return
        self._frame += 1
        self._stuck = max(0, self._stuck - 1)
        before = self._known(self._level)
        mean = RunningMean(ms if before is None else before, _WEIGHT).add(ms)
        self._took[self._level] = mean, self._frame
        raised, self._raised = self._raised, False
        self._easy = self._easy + 1 if mean < _EASY * self.ms else 0
        if min(ms, mean) > self.ms:
            if raised:  # too early
                self._memory *= 2
            self._lower(mean)
        elif self._easy >= _PATIENCE:
            self._raise()

    def _lower(self, ms):
        if self._stuck:
            return
        last = len(LEVELS) - 1
        if self._level < last:
            self._level = min(self._level + _steps(ms / self.ms), last)
            return
        times = {k: self._known(k) for k in self._took}
        self._level = min(k for k, t in times.items() if t is not None and t <= _GAIN * ms)
        self._stuck = _MEMORY

    def _raise(self):
        if not self._level:
            return
        finer = self._known(self._level - 1)
        if finer is None or finer <= self.ms:
            self._level, self._easy, self._raised = self._level - 1, 0, True

    def _known(self, level):
        """Return the milliseconds of a level, None if unknown or outdated."""
        ms, frame = self._took.get(level, (0.0, -math.inf))
        return ms if self._frame - frame < self._memory else None


def _steps(ratio) -> int:
    """Return how many levels lower are so many times faster, if time is linear in quality."""
    return min(_LEAP, max(1, math.ceil(2 * math.log2(ratio))))


class AdaptiveQuality:
    """Detects and times moving frames of a window, and sets their quality."""

    def __init__(self, plotter, budget, playing=lambda: False, effects=list):
        self._plotter, self._asked_ms, self._playing = plotter, budget, playing
        self._effects = effects
        self.budget = Budget()
        self.lowered = False
        self.why = ''
        self._quality = 1.0
        self._moves = self._full = self._drawing = False
        self._window: _vtk.vtkRenderWindow | None = None
        self._tags: list = []
        self._asked = self._takes = False
        self._began: float | None = None
        self._moved = -math.inf
        self._wheels = False
        self._samples = 0
        self._ticks: Timer | Loop | None = None

    @property
    def latest(self) -> float:
        """Quality of the current or last frame."""
        return self._quality

    def quality(self, renderer) -> float:
        """Return the quality of the frame that a renderer is about to draw."""
        self._asked = True
        self._watch(renderer.GetRenderWindow())
        return self._quality

    @contextmanager
    def full(self):
        """Draw all frames at full quality."""
        before, self._full = self._full, True
        try:
            yield
        finally:
            self._full = before

    # -- the window's frames ---------------------------------------------------------------------

    def _watch(self, window):
        if window is self._window:
            return
        self.release()
        self._window, self._moved = window, perf_counter()
        interactor = window.GetInteractor()
        calls = [
            (window, 'StartEvent', self._on_start, 1.0),  # before and after all others
            (window, 'EndEvent', self._on_end, -1.0),
        ]
        if interactor is not None:
            events = [(f'MouseWheel{w}Event', self._on_wheel) for w in _WHEELS]
            events += [(f'{b}ButtonPressEvent', self._on_press) for b in _BUTTONS]
            calls += [(interactor, *event, 1.0) for event in events]
        self._tags = [(owner, owner.AddObserver(*call)) for owner, *call in calls]

    def release(self):
        """Stop watching the window; may be called again."""
        self._stop()
        if self._window is not None:
            self._put_back(self._window)
        for owner, tag in self._tags:
            owner.RemoveObserver(tag)
        if self._takes:
            self._plotter.__dict__.pop('screenshot', None)
        self._tags, self._window, self._takes = [], None, False
        self._quality, self._began, self._moves, self.lowered = 1.0, None, False, False

    def _on_start(self, window, _event):
        if not self._asked:  # in the last frame: pvibr is no longer in the window
            self.release()
            return
        self._asked = False
        self.budget.ms = self._asked_ms()
        self._moves = self._is_moving(window)
        self._quality = self.budget.quality if self._moves else 1.0
        if self._quality < 1:
            # Expensive on a CPU, and least visible in motion.
            self._samples = window.GetMultiSamples()
            window.SetMultiSamples(0)
        self._began = perf_counter()

    def _on_end(self, window, _event):
        self._put_back(window)
        began, self._began = self._began, None
        if began is None or _is_picking(window):
            return
        window.WaitForCompletion()
        now = perf_counter()
        self._note(1e3 * (now - began))
        self.lowered = self._quality < 1
        self._drawing = False
        if self._moves or not all(effect.rests for effect in self._effects()):
            self._moved = now
        if self.lowered:
            self._watch_screenshots()
        if self._may_refine():
            self._follows()

    def _put_back(self, window):
        if self._samples:
            window.SetMultiSamples(self._samples)
            self._samples = 0

    def _note(self, ms):
        quality = self._quality
        if not self._moves:
            self.budget.rested(ms)
            return
        self.budget.moved(ms)
        if quality < 1 or ms > self.budget.ms > 0:
            budget = f'interactive_frame_ms is {self.budget.ms:g}'
            self.why = f'{quality:.2g} while moving: {ms:.0f} ms, {budget}'

    # -- motion ----------------------------------------------------------------------------------

    def _is_moving(self, window) -> bool:
        if self._full or not self.budget.ms or filming(self._plotter) or is_deterministic():
            return False
        if _is_picking(window) or tuple(window.GetTileScale()) != (1, 1):
            return False
        if is_dragged(window):
            # VTK's styles render a still at the end, and treat any timer event as a move.
            self._stop()
            return True
        moves = self._wheels or self._playing()
        lowers = moves and self.budget.quality < 1
        # No style renders a still at the end: lower the quality only if a timer will.
        follows = lowers and self._follows()
        self._wheels = self._wheels and follows
        return follows if lowers else moves

    def _on_wheel(self, *_):
        self._wheels = True

    def _on_press(self, *_):
        self._wheels = False
        self._stop()  # while a button is held, no observer may go

    def _follows(self) -> bool:
        """Start a timer that waits for rest; return True if there is one."""
        if self._ticks is None:
            self._ticks = ticks(self._plotter, self._tick)
        return self._ticks is not None

    def _tick(self):
        if perf_counter() - self._moved < SETTLE:
            return
        if self.lowered or not self._may_refine():
            self._stop()
        self._wheels = False
        if self.lowered:
            self._draw_full()
        elif self._may_refine() and not self._drawing:  # pages draw later, or never
            self._drawing = True
            draw(self._plotter)

    def _may_refine(self) -> bool:
        """Return True if further frames of the same view are of use, and may be drawn unasked."""
        if is_dragged(self._window) or filming(self._plotter) or is_deterministic():
            return False
        return not self._playing() and any(effect.unfinished for effect in self._effects())

    def _stop(self):
        stopped, self._ticks = self._ticks, None
        if stopped is not None:
            stopped.stop()

    def _draw_full(self):
        with self.full():
            draw(self._plotter)

    # -- screenshots -----------------------------------------------------------------------------

    def _watch_screenshots(self):
        take = getattr(self._plotter, 'screenshot', None)
        if take is None or self._takes:
            return

        # They show the last frame, and VTK and PyVista have no event for them.
        @functools.wraps(take)
        def screenshot(*args, **kwargs):
            if self.lowered:
                self._draw_full()
            return take(*args, **kwargs)

        self._plotter.screenshot = screenshot
        self._takes = True


def _is_picking(window) -> bool:
    return any(r.GetSelector() is not None for r in window.GetRenderers())
