"""The animation clock: a window's timer, a server's event loop, or the frames of a movie."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import sys
from time import perf_counter

from pvibr.core.arguments import checked_number, checked_positive
from pvibr.core.determinism import is_deterministic
from pvibr.core.hooks import Hooks
from pvibr.core.plotters import frame_callbacks, is_dragged, is_hidden

#: Milliseconds between two ticks.
PERIOD = 16
#: Time left to a server after each frame, as a fraction of the frame's.
_BREATH = 0.1
#: Seconds after which the connection of a page that receives nothing is aborted.
_PATIENCE = 10.0
#: Loggers of page servers.
_SERVERS = 'wslink.protocol', 'aiohttp.server'
#: Modules of PyVista's trame views, which render in their callbacks.
_VIEWS = ('trame_pyvista', 'pyvista.trame')


class Clock:
    """Advances time while a plotter is shown or recorded."""

    def __init__(self, plotter, set_time):
        self._plotter, self._set_time = plotter, set_time
        self._ticks: Timer | Loop | None = None
        self._page_observer: tuple | None = None
        self._hooks = Hooks(plotter)
        self.running = False

    def start(self, start_time, *, speed=1.0, loop=None, fps=None):
        """Start at a time."""
        speed = checked_number('speed', speed)
        loop = None if loop is None else checked_positive('loop', loop)
        fps = None if fps is None else checked_positive('fps', fps)
        self.stop()
        self._speed, self._loop, self._fps = speed, loop, fps
        self._loop_start = float(start_time)
        self.set(start_time)
        self.running = True
        self._ticks = ticks(self._plotter, self._tick)
        renderer = self._plotter.renderer
        self._page_observer = renderer, renderer.AddObserver('StartEvent', self._look_for_page)
        self._watch_movie()

    def _look_for_page(self, *_):
        """Switch to a page's event loop if a page was opened after the start."""
        if isinstance(self._ticks, Loop) or not has_page(self._plotter):
            return
        if self._ticks is not None:
            self._ticks.stop()
        self._ticks = ticks(self._plotter, self._tick)

    @property
    def ticking(self) -> bool:
        """Whether the wall clock advances the time."""
        return self._ticks is not None

    def set(self, time):
        """Continue from another time."""
        self._base_time = self._shown_time = float(time)
        self._wall_start: float | None = None
        self._tick_count = 0
        self._frame_count = 0

    def stop(self):
        """Stop at the current time; may be called again."""
        self.running = False
        ticks, self._ticks = self._ticks, None
        if ticks is not None:
            ticks.stop()
        watched, self._page_observer = self._page_observer, None
        if watched is not None:
            renderer, tag = watched
            renderer.RemoveObserver(tag)
        self._hooks.take_off()

    def write(self, write_frame):
        """Write a frame of a movie, and advance the time by one frame."""
        fps = self._fps or _fps_of(getattr(self._plotter, 'mwriter', None))
        if self._wall_start is not None:  # after ticks of the wall clock
            self.set(self._shown_time)
        write_frame()
        if not self.running:  # stopped by an observer of this frame
            return
        self._frame_count += 1
        self._advance(self._frame_count / fps)

    def _watch_movie(self):
        write_original = getattr(self._plotter, 'write_frame', None)
        if write_original is None:
            return

        # VTK and PyVista have no event for frames of movies.
        @functools.wraps(write_original)
        def write_frame():
            self.write(write_original)

        self._hooks.put({'write_frame': write_frame})

    def _tick(self):
        """Follow the wall clock from the first tick on, since windows open late."""
        if filming(self._plotter):
            return
        if self._frame_count:  # after frames of a movie
            self.set(self._shown_time)
        wall_time = perf_counter()
        if self._wall_start is None:
            self._wall_start, self._tick_count = wall_time, -1
        self._tick_count += 1
        elapsed = self._tick_count / 60 if is_deterministic() else wall_time - self._wall_start
        if self._advance(elapsed):
            draw(self._plotter)

    def _advance(self, elapsed) -> bool:
        """Advance to an elapsed time; return True if the time changed."""
        time = self._base_time + self._speed * elapsed
        if self._loop is not None:
            time = self._loop_start + (time - self._loop_start) % self._loop
        if time == self._shown_time:
            return False
        self._shown_time = time
        self._set_time(time)
        return True


class Timer:
    """Ticks of a window's interactor."""

    def __init__(self, interactor, tick):
        self._interactor, self._tick, self._is_dragging = interactor, tick, False
        callbacks = self._on_passive, self._on_timer
        self._observers = [interactor.AddObserver('TimerEvent', call) for call in callbacks]
        # While a button is held, VTK calls only the style and passive observers.
        interactor.GetCommand(self._observers[0]).PassiveObserverOn()
        self._timer = interactor.CreateRepeatingTimer(PERIOD)

    def _on_passive(self, interactor, _event):
        # The style takes any timer event for a repetition of the last mouse move.
        interactor.SetLastEventPosition(interactor.GetEventPosition())
        self._is_dragging = is_dragged(interactor.GetRenderWindow())
        if self._is_dragging:
            self._tick()

    def _on_timer(self, *_):
        if not self._is_dragging:
            self._tick()

    def stop(self):
        """Stop ticking."""
        for observer in self._observers:
            self._interactor.RemoveObserver(observer)
        self._interactor.DestroyTimer(self._timer)


class Loop:
    """Ticks of the event loop of a page server: a notebook's or an application's."""

    def __init__(self, loop, tick):
        self._loop, self._tick = loop, tick
        if loop.get_exception_handler() is None:
            loop.set_exception_handler(_report_unless_closed)
        for name in _SERVERS:
            logging.getLogger(name).addFilter(_is_relevant)
        self._behind_since: dict = {}
        self._wait()

    def _wait(self, delay=PERIOD / 1e3):
        self._next_call = self._loop.call_later(delay, self._run)

    def _run(self):
        self._wait()
        if self._waits_for_pages():
            return
        start_time = perf_counter()
        try:
            self._tick()
        except Exception:
            self.stop()
            raise
        if not self._next_call.cancelled():  # slow frames must leave time for pages
            frame_seconds = perf_counter() - start_time
            self._next_call.cancel()
            self._wait(max(PERIOD / 1e3 - frame_seconds, _BREATH * frame_seconds))

    def _waits_for_pages(self) -> bool:
        """Return True if a page has yet to receive earlier frames; give up pages that stall.

        wslink sends to pages in turn, so one that stalls holds up all.
        """
        wall_time = perf_counter()
        old_since = self._behind_since
        self._behind_since = {page: old_since.get(page, wall_time) for page in _pages_behind()}
        for page, behind_since in self._behind_since.items():
            if wall_time - behind_since > _PATIENCE:
                page.transport.abort()
        return bool(self._behind_since)

    def stop(self):
        """Stop ticking."""
        self._next_call.cancel()


def _pages_behind() -> list:
    """Return the connections of trame's servers whose send buffers are full."""
    servers = getattr(sys.modules.get('trame.app.core'), 'AVAILABLE_SERVERS', {}).values()
    web_servers = [s._server for s in servers if s.running]  # noqa: SLF001
    app_runners = [getattr(web, 'runner', None) for web in web_servers]
    connections = [page for r in app_runners if r is not None for page in r.server.connections]
    return [page for page in connections if page.writing_paused and page.connected]


def _report_unless_closed(loop, context):
    """Report errors of an event loop, except that a page closed before its frame came."""
    if not _is_of_closed_page(context.get('exception')):
        loop.default_exception_handler(context)


def _is_relevant(_record) -> bool:
    """Return False for log records of pages that closed before their answer came."""
    return not _is_of_closed_page(sys.exc_info()[1])


def _is_of_closed_page(error) -> bool:
    """Return True for an error of a closed connection, or raised while handling one."""
    while error is not None and not isinstance(error, ConnectionError):
        error = error.__context__
    return error is not None


def filming(plotter) -> bool:
    """Return True if a movie is open."""
    writer = getattr(plotter, 'mwriter', None)
    return writer is not None and not getattr(writer, 'closed', False)


def draw(plotter):
    """Render a frame in the window or in each open page."""
    callbacks = frame_callbacks(plotter)
    if not callbacks or not all(_is_view(call) for call in callbacks):
        plotter.render()
        return
    for draw_page in callbacks:
        draw_page(plotter)


def _is_view(callback) -> bool:
    """Return True if a function draws the frame of a page."""
    # Bound methods of built-in objects have no module.
    return (getattr(callback, '__module__', None) or '').startswith(_VIEWS)


def ticks(plotter, tick):
    """Call a function periodically while a plotter is shown; return None if it is not."""
    asyncio = sys.modules.get('asyncio')  # imported by whoever runs a loop
    if asyncio is not None and has_page(plotter):
        with contextlib.suppress(RuntimeError):  # no running loop
            return Loop(asyncio.get_running_loop(), tick)
    window = plotter.renderer.GetRenderWindow()
    interactor = None if window is None else window.GetInteractor()
    if interactor is None or is_hidden(plotter) or getattr(plotter, 'notebook', False):
        return None
    return Timer(interactor, tick)


def has_page(plotter) -> bool:
    """Return True if callbacks, such as trame views, show frames that are rendered here."""
    return bool(frame_callbacks(plotter)) and not getattr(plotter, 'suppress_rendering', False)


def _fps_of(writer):
    """Return an imageio writer's frames per second."""
    movie_options = dict(getattr(getattr(writer, 'request', None), 'kwargs', {}))
    movie_options |= getattr(writer, 'write_args', {})
    if movie_options.get('fps'):
        return float(movie_options['fps'])
    if movie_options.get('duration'):
        return 1e3 / float(movie_options['duration'])
    raise ValueError('fps must be given, since the movie has none: play(fps=...)')


def checked_time(seconds) -> float:
    """Return a finite time."""
    try:
        time = float(seconds)
    except (TypeError, ValueError, OverflowError):
        time = math.nan
    if not math.isfinite(time):
        raise ValueError(f'time must be a finite number of seconds, got {seconds!r:.60}')
    return time
