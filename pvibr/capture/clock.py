"""What moves the time: the timer of a window, the loop of a server, or the frames of a movie."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
from time import perf_counter

from pvibr.core.determinism import is_deterministic
from pvibr.core.plotters import frame_callbacks

#: Milliseconds between two looks at the clock.
PERIOD = 16
#: Modules of PyVista's views of trame, which draw when they are told.
_VIEWS = ('trame_pyvista', 'pyvista.trame')


class Clock:
    """Moves a time while a plotter is looked at or filmed."""

    def __init__(self, plotter, tell):
        self._plotter, self._tell = plotter, tell
        self._ticks: _Timer | _Loop | None = None
        self._watched: tuple | None = None
        self._films = False
        self.running = False

    def start(self, time, *, speed=1.0, loop=None, fps=None):
        """Let the time go on from some moment."""
        speed = float(speed)
        if not math.isfinite(speed):
            msg = f'speed = {speed}: must be a finite number; 0 stands still'
            raise ValueError(msg)
        _check_positive('loop', loop, 'seconds')
        _check_positive('fps', fps, 'frames a second')
        self.stop()
        self._speed, self._loop, self._fps = speed, loop, fps
        self._origin = float(time)
        self.set(time)
        self.running = True
        self._ticks = ticks(self._plotter, self._tick)
        renderer = self._plotter.renderer
        self._watched = renderer, renderer.AddObserver('StartEvent', self._look_for_page)
        self._watch_movie()

    def _look_for_page(self, *_):
        """Tick for a page, which is opened long after it was asked to play."""
        if isinstance(self._ticks, _Loop) or not has_page(self._plotter):
            return
        if self._ticks is not None:
            self._ticks.stop()
        self._ticks = ticks(self._plotter, self._tick)

    @property
    def ticking(self) -> bool:
        """Whether the wall moves the time."""
        return self._ticks is not None

    def set(self, time):
        """Go on from another moment."""
        self._base = self._shown = float(time)
        self._since: float | None = None
        self._looks = 0
        self._frames = 0

    def stop(self):
        """Stay at this moment; calling it again is fine."""
        self.running = False
        ticks, self._ticks = self._ticks, None
        if ticks is not None:
            ticks.stop()
        watched, self._watched = self._watched, None
        if watched is not None:
            renderer, tag = watched
            renderer.RemoveObserver(tag)
        if self._films:
            self._films = False
            self._plotter.__dict__.pop('write_frame', None)

    def write(self, frame):
        """Write a frame of a movie, after which it is later."""
        fps = self._fps or _fps_of(getattr(self._plotter, 'mwriter', None))
        if self._since is not None:  # the wall decided until now
            self.set(self._shown)
        frame()
        if not self.running:  # whoever looks on may have stopped it in this frame
            return
        self._frames += 1
        self._go(self._frames / fps)

    def _watch_movie(self):
        write = getattr(self._plotter, 'write_frame', None)
        if write is None:
            return

        # VTK and PyVista have no event for it.
        @functools.wraps(write)
        def write_frame():
            self.write(write)

        self._plotter.write_frame = write_frame
        self._films = True

    def _tick(self):
        """Take the time of the wall, which began with the first tick: windows open late."""
        if filming(self._plotter):
            return
        if self._frames:  # a movie decided until now
            self.set(self._shown)
        now = perf_counter()
        if self._since is None:
            self._since, self._looks = now, -1
        self._looks += 1
        if self._go(self._looks / 60 if is_deterministic() else now - self._since):
            draw(self._plotter)

    def _go(self, seconds) -> bool:
        """Take the time that is so many seconds later; tell whether it is another one."""
        time = self._base + self._speed * seconds
        if self._loop is not None:
            time = self._origin + (time - self._origin) % self._loop
        if time == self._shown:
            return False
        self._shown = time
        self._tell(time)
        return True


class _Timer:
    """Ticks of a window's interactor."""

    def __init__(self, interactor, tick):
        self._interactor, self._tick, self._held = interactor, tick, False
        calls = self._look_on, self._on_timer
        self._observers = [interactor.AddObserver('TimerEvent', call) for call in calls]
        # While a button is held, VTK tells its style alone, and those that only look on.
        interactor.GetCommand(self._observers[0]).PassiveObserverOn()
        self._timer = interactor.CreateRepeatingTimer(PERIOD)

    def _look_on(self, interactor, _event):
        # The style takes any timer's tick for one more move of the mouse, as far as the last one.
        interactor.SetLastEventPosition(interactor.GetEventPosition())
        self._held = is_dragged(interactor.GetRenderWindow())
        if self._held:
            self._tick()

    def _on_timer(self, *_):
        if not self._held:
            self._tick()

    def stop(self):
        for observer in self._observers:
            self._interactor.RemoveObserver(observer)
        self._interactor.DestroyTimer(self._timer)


class _Loop:
    """Ticks of the loop in which a server of pages runs, a notebook's or an application's."""

    def __init__(self, loop, tick):
        self._loop, self._tick = loop, tick
        self._wait()

    def _wait(self):
        self._next = self._loop.call_later(PERIOD / 1e3, self._run)

    def _run(self):
        self._wait()
        try:
            self._tick()
        except Exception:
            self.stop()
            raise

    def stop(self):
        self._next.cancel()


def filming(plotter) -> bool:
    """Tell whether a movie is open, for which frames are drawn."""
    writer = getattr(plotter, 'mwriter', None)
    return writer is not None and not getattr(writer, 'closed', False)


def draw(plotter):
    """Draw a frame, in the window or for each page that is open: they draw when they are told."""
    told = frame_callbacks(plotter)
    if not told or not all(tell.__module__.startswith(_VIEWS) for tell in told):
        plotter.render()
        return
    for tell in told:
        tell(plotter)


def ticks(plotter, tick):
    """Have a function called again and again where a plotter is looked at."""
    if has_page(plotter):
        with contextlib.suppress(RuntimeError):  # nothing runs
            return _Loop(asyncio.get_running_loop(), tick)
    window = plotter.renderer.GetRenderWindow()
    interactor = None if window is None else window.GetInteractor()
    hidden = window is None or getattr(plotter, 'off_screen', window.GetOffScreenRendering())
    if interactor is None or hidden or getattr(plotter, 'notebook', False):
        return None
    return _Timer(interactor, tick)


def is_dragged(window) -> bool:
    """Tell whether an interactor's style or a widget asks for frames in time."""
    interactor = None if window is None else window.GetInteractor()
    if interactor is None:
        return False
    return window.GetDesiredUpdateRate() > interactor.GetStillUpdateRate()


def has_page(plotter) -> bool:
    """Tell whether something that is told of frames, such as a view of trame, shows them."""
    # Views ask to be told of each ``plotter.render()``. Where rendering is suppressed, the
    # browser draws by itself.
    return bool(frame_callbacks(plotter)) and not getattr(plotter, 'suppress_rendering', False)


def _fps_of(writer):
    """Return the frames a second that a writer of imageio was opened with."""
    given = dict(getattr(getattr(writer, 'request', None), 'kwargs', {}))
    given |= getattr(writer, 'write_args', {})
    if given.get('fps'):
        return float(given['fps'])
    if given.get('duration'):
        return 1e3 / float(given['duration'])
    msg = 'the movie does not say how many frames a second has: give play(fps=...)'
    raise ValueError(msg)


def checked_time(seconds) -> float:
    """Return a finite time."""
    try:
        time = float(seconds)
    except (TypeError, ValueError, OverflowError):
        time = math.nan
    if not math.isfinite(time):
        msg = f'time = {seconds!r:.60}: must be a finite number of seconds'
        raise ValueError(msg)
    return time


def _check_positive(name, value, unit):
    if value is not None and not 0 < float(value) < math.inf:
        msg = f'{name} = {value!r}: must be {unit}, above 0'
        raise ValueError(msg)
