"""Adaptive quality: lowered to meet a frame time while the view moves, full at rest."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from operator import attrgetter
from time import perf_counter
from typing import Any

from pvibr.capture.clock import Loop, Timer, draw, filming, ticks
from pvibr.capture.load_budget import LoadBudget
from pvibr.core import _vtk
from pvibr.core.costs import RunningMean
from pvibr.core.determinism import is_deterministic
from pvibr.core.effect import switch_off
from pvibr.core.errors import warn
from pvibr.core.hooks import Hooks
from pvibr.core.plotters import is_dragged
from pvibr.gl.frame_timer import FrameTimer

#: Levels of quality, 3 dB apart.
LEVELS = tuple(2 ** (-k / 2) for k in range(9))
_COARSEST = len(LEVELS) - 1
_ROUNDING = 1e-6  # levels: clocks count in steps
#: A window's first frame tells something from so many budgets on: shaders are compiled in it.
_TELLING = 4
#: Most levels by which one slow frame lowers quality.
_LEAP = 4
#: Fraction of the budget below which a frame is easy; easy frames until quality rises.
_EASY, _PATIENCE = 0.6, 5
#: Moving frames for which a level's time is remembered; doubled after each premature rise.
_MEMORY = 60
#: Weight of the last frame in a level's running mean.
_WEIGHT = 0.4
#: Least speed-up that justifies lower quality.
_GAIN = 1.25
#: Seconds after the last moving frame until the view is at rest.
SETTLE = 0.2
_PENDING = attrgetter('pending')
#: By which effects ask for more frames.
_MORE = attrgetter('rests', 'pending', 'unfinished')
_WHEELS = ('Forward', 'Backward', 'Left', 'Right')
_BUTTONS = ('Left', 'Middle', 'Right')


class Budget:
    """Quality that meets a frame time, from the times of past frames."""

    def __init__(self, ms=100.0):
        self.ms = ms
        self._forget()

    def _forget(self):
        self._level = self._frame_number = self._easy_frames = self._stuck_frames = 0
        self._was_raised = self._is_guess = False
        self._memory_frames = _MEMORY
        self._level_means: dict[int, tuple[float, int]] = {}
        self._rest_times: list[float] = []

    @property
    def quality(self) -> float:
        """Quality of the next moving frame, in (0, 1]."""
        return LEVELS[self._level] if self.ms else 1.0

    def rested(self, frame_ms):
        """Record a frame at rest, drawn at full quality."""
        # The faster of two frames: the first compiles shaders and uploads, and one may bake.
        self._rest_times = [*self._rest_times[-1:], frame_ms]
        full_ms = min(self._rest_times)
        if full_ms <= _EASY * self.ms:
            self._forget()
            self._rest_times = [frame_ms]
            return
        if len(self._rest_times) < 2 and full_ms <= _TELLING * self.ms:
            return
        if self.ms and not self._stuck_frames and (self._is_guess or not self._level):
            self._level = self._level_for(full_ms)
            self._is_guess = self._level > 0

    def moved(self, frame_ms):
        """Record a moving frame, drawn at `quality`."""
        if not self.ms:
            return
        self._frame_number += 1
        self._stuck_frames = max(0, self._stuck_frames - 1)
        old_mean = self._mean_of(self._level)
        mean_ms = RunningMean(frame_ms if old_mean is None else old_mean, _WEIGHT).add(frame_ms)
        self._level_means[self._level] = mean_ms, self._frame_number
        if self._is_guess and self._correct(frame_ms):
            return
        was_raised, self._was_raised = self._was_raised, False
        self._easy_frames = self._easy_frames + 1 if mean_ms < _EASY * self.ms else 0
        if min(frame_ms, mean_ms) > self.ms:
            if was_raised:  # raised too early
                self._memory_frames *= 2
            self._lower(mean_ms)
        elif self._easy_frames >= _PATIENCE:
            self._raise()

    def _correct(self, frame_ms) -> bool:
        """Rise from a level guessed at rest to that of the first moving frame."""
        self._is_guess = False
        guessed_level = self._level
        self._level = min(guessed_level, self._level_for(frame_ms / self.quality))
        return self._level < guessed_level

    def _level_for(self, full_ms) -> int:
        """Return the finest level in time, if time is linear in quality."""
        return _steps(full_ms / self.ms, _COARSEST) if full_ms > self.ms else 0

    def _lower(self, mean_ms):
        if self._stuck_frames:
            return
        if self._level < _COARSEST:
            self._level = min(self._level + _steps(mean_ms / self.ms), _COARSEST)
            return
        means = {k: self._mean_of(k) for k in self._level_means}
        self._level = min(k for k, ms in means.items() if ms is not None and ms <= _GAIN * mean_ms)
        self._stuck_frames = _MEMORY

    def _raise(self):
        if not self._level:
            return
        finer_ms = self._mean_of(self._level - 1)
        if finer_ms is None or finer_ms <= self.ms:
            self._level, self._easy_frames, self._was_raised = self._level - 1, 0, True

    def _mean_of(self, level):
        """Return the mean milliseconds of a level, None if unknown or outdated."""
        level_ms, frame_number = self._level_means.get(level, (0.0, -math.inf))
        return level_ms if self._frame_number - frame_number < self._memory_frames else None


def _steps(ratio, most=_LEAP) -> int:
    """Return the levels to lower for a speed-up, if time is linear in quality."""
    return min(most, max(1, math.ceil(2 * math.log2(ratio) - _ROUNDING)))


class AdaptiveQuality:
    """Detects and times a window's moving frames, and sets their quality."""

    def __init__(self, plotter, budget_ms, playing=lambda: False, effects=list):
        self._plotter, self._budget_ms, self._playing = plotter, budget_ms, playing
        self._list_effects = effects
        self._effects: Sequence[Any] = ()  # of the frame being drawn
        self.budget = Budget()
        #: That of scenes whose triangles are known.
        self.load_budget = LoadBudget()
        self.lowered = False
        self.why = ''
        #: Quality of the current or last frame.
        self.latest = 1.0
        self._is_moving_frame = self._is_full = self._draw_pending = False
        #: Triangles of the current frame by its quality, None where not known.
        self._triangles: Callable[[float], float] | None = None
        self._window: _vtk.vtkRenderWindow | None = None
        self._observers: list = []
        self._is_asked = False
        self._hooks = Hooks(plotter)
        self._timer = FrameTimer()
        self._last_move = -math.inf
        self._wheel_turned = False
        self._multi_samples = 0
        self._ticks: Timer | Loop | None = None

    def quality(self, renderer) -> float:
        """Return the quality of the frame about to be drawn."""
        self._is_asked = True
        self._watch(renderer.GetRenderWindow())
        return self.latest

    @contextmanager
    def full(self):
        """Draw all frames at full quality."""
        was_full, self._is_full = self._is_full, True
        try:
            yield
        finally:
            self._is_full = was_full

    # -- the window's frames ---------------------------------------------------------------------

    def _watch(self, window):
        if window is self._window:
            return
        self.release()
        self._window, self._last_move = window, perf_counter()
        interactor = window.GetInteractor()
        observers = [
            (window, 'StartEvent', self._on_start, 1.0),  # before, and after, all others
            (window, 'EndEvent', self._on_end, -1.0),
        ]
        if interactor is not None:
            interactor_events = [(f'MouseWheel{w}Event', self._on_wheel) for w in _WHEELS]
            interactor_events += [(f'{b}ButtonPressEvent', self._on_press) for b in _BUTTONS]
            observers += [(interactor, *event, 1.0) for event in interactor_events]
        self._observers = [(owner, owner.AddObserver(*call)) for owner, *call in observers]
        self._timer.start(window)  # its first frame has begun

    def release(self):
        """Stop watching the window; may be called again."""
        self._stop()
        if self._window is not None:
            self._restore_samples(self._window)
        for owner, tag in self._observers:
            owner.RemoveObserver(tag)
        self._hooks.take_off()
        self._observers, self._window = [], None
        self._timer.release()
        self.latest = 1.0
        self._is_moving_frame = self.lowered = False

    def _on_start(self, window, _event):
        if not self._is_asked:  # nobody asked in the last frame: pvibr left the window
            self.release()
            return
        self._is_asked = False
        self._effects = self._list_effects()
        self.budget.ms = self._budget_ms(self._effects)
        last_ms = self._timer.start(window)
        if last_ms is not None:
            self._record(last_ms)
        self._triangles = self._count_triangles(window)
        self._is_moving_frame = self._is_moving(window)
        self.latest = self._choose()
        if self.latest < 1:
            # Multisamples are expensive on CPUs, and least visible in motion.
            self._multi_samples = window.GetMultiSamples()
            window.SetMultiSamples(0)

    def _count_triangles(self, window):
        """Return the triangles of the frame by its quality, None unless an effect knows them."""
        counting = [effect for effect in self._effects if effect.triangles_of is not None]
        if not counting or _is_partial(window):
            return None
        counts = []
        for effect in counting:
            if effect.enabled:
                frame = effect.pipeline.view()
                try:
                    if effect.needed(frame) is True:
                        counts.append(effect.triangles_of(frame))
                except Exception as error:
                    warn(switch_off(effect, error))
        return (lambda quality: sum(count(quality) for count in counts)) if counts else None

    def _choose(self) -> float:
        """Return the quality of the frame that begins."""
        if not self._is_moving_frame:
            is_refining = self.lowered and self._is_refining()
            return self.load_budget.finer(self._triangles) if is_refining else 1.0
        if self._triangles is None:
            return self.budget.quality
        return self.load_budget.choose(self.budget.ms, self._triangles)

    def _is_refining(self) -> bool:
        """Return True if a frame at rest, after a lowered one, is not the last of this view."""
        return self._triangles is not None and not self._stays_full() and self._start_ticks()

    def _on_end(self, window, _event):
        effects, self._effects = self._effects, ()
        self._restore_samples(window)
        if not self._timer.is_running or _is_picking(window):
            self._timer.cancel()
            return
        frame_ms = self._timer.end(window)
        if frame_ms is not None:
            self._record(frame_ms)
        self.lowered = self.latest < 1
        self._draw_pending = False
        if self.lowered:
            self._watch_screenshots()
        try:
            running = [effect for effect in effects if effect.enabled]
            if self._is_moving_frame or False in [effect.rests for effect in running]:
                self._last_move = perf_counter()
            if True in [effect.pending for effect in running] or self._may_refine():
                self._start_ticks()
        except Exception:
            _switch_off_failing(effects)

    def _restore_samples(self, window):
        if self._multi_samples:
            window.SetMultiSamples(self._multi_samples)
            self._multi_samples = 0

    def _record(self, frame_ms):
        quality = self.latest
        if not self._is_moving_frame:
            self._record_rest(frame_ms)
            return
        if self._triangles is None:
            self.budget.moved(frame_ms)
        else:
            self.load_budget.drawn(frame_ms)
        if quality < 1 or frame_ms > self.budget.ms > 0:
            budget_text = f'interactive_frame_ms is {self.budget.ms:g}'
            self.why = f'{quality:.2g} while moving: {frame_ms:.0f} ms, {budget_text}'

    def _record_rest(self, frame_ms):
        if self._triangles is None:
            self.budget.rested(frame_ms)
        elif self.latest < 1:
            self.load_budget.drawn(frame_ms)
        else:
            self.load_budget.rested(frame_ms, self._triangles)

    # -- motion ----------------------------------------------------------------------------------

    def _is_moving(self, window) -> bool:
        is_dragging = is_dragged(window)
        if not (is_dragging or self._wheel_turned or self._playing()):
            return False
        if self._stays_full() or not self.budget.ms:
            return False
        if _is_partial(window):
            return False
        if is_dragging:
            # VTK's styles render a still at the end, and take timer events for moves.
            self._stop()
            return True
        is_lowered = self._triangles is not None or self.budget.quality < 1
        # No style renders a still at the end: lower quality only if a timer will.
        has_timer = is_lowered and self._start_ticks()
        self._wheel_turned = self._wheel_turned and has_timer
        return has_timer if is_lowered else True

    def _stays_full(self) -> bool:
        return self._is_full or filming(self._plotter) or is_deterministic()

    def _on_wheel(self, *_):
        self._wheel_turned = True

    def _on_press(self, *_):
        self._wheel_turned = False
        self._stop()  # observers must not be removed while a button is held

    def _start_ticks(self) -> bool:
        """Start a timer that waits for rest; return False if there is none."""
        if self._ticks is None:
            self._ticks = ticks(self._plotter, self._tick)
        return self._ticks is not None

    def _tick(self):
        if perf_counter() - self._last_move < SETTLE:
            return
        self._wheel_turned = False
        if self.lowered and self._triangles is None:
            self._stop()
            self._draw_full()
            return
        may_refine = self.lowered or self._may_refine()
        if not (may_refine or self._is_pending()):
            self._stop()
        if may_refine and not self._draw_pending:  # pages may draw later, or never
            self._draw_pending = True
            draw(self._plotter)

    def _may_refine(self) -> bool:
        """Return True if more frames of the same view refine it, and may be drawn unprompted."""
        if True not in [e.unfinished for e in self._list_effects() if e.enabled]:
            return False
        if is_dragged(self._window) or filming(self._plotter) or is_deterministic():
            return False
        return not self._playing()

    def _is_pending(self) -> bool:
        """Return True if something in the background will refine the view."""
        return any(map(_PENDING, self._list_effects()))

    def _stop(self):
        old_ticks, self._ticks = self._ticks, None
        if old_ticks is not None:
            old_ticks.stop()

    def _draw_full(self):
        with self.full():
            draw(self._plotter)

    # -- screenshots -----------------------------------------------------------------------------

    def _watch_screenshots(self):
        take_screenshot = getattr(self._plotter, 'screenshot', None)
        if take_screenshot is None or self._hooks:
            return

        # Screenshots show the last frame; VTK and PyVista have no event for them.
        @functools.wraps(take_screenshot)
        def screenshot(*args, **kwargs):
            if self.lowered:
                self._draw_full()
            return take_screenshot(*args, **kwargs)

        self._hooks.put({'screenshot': screenshot})


def _switch_off_failing(effects):
    """Disable the effects that raise an error when asked for more frames, and tell why."""
    for effect in effects:
        try:
            _MORE(effect)
        except Exception as error:
            warn(switch_off(effect, error))


def _is_partial(window) -> bool:
    """Return True if the frame is for a pick, or a tile of a larger picture."""
    return _is_picking(window) or tuple(window.GetTileScale()) != (1, 1)


def _is_picking(window) -> bool:
    get = object.__getattribute__  # PyVista's lookup is in Python
    return any(get(r, 'GetSelector')() is not None for r in window.GetRenderers())
