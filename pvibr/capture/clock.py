"""The animation clock: a window's timer, a server's event loop, or the frames of a movie."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import sys
from time import perf_counter

from pvibr.core.determinism import is_deterministic
from pvibr.core.plotters import frame_callbacks, is_dragged
from pvibr.maths.arguments import checked_number, checked_positive

#: Milliseconds between two ticks.
PERIOD = 16
#: Time that a server has for other things after a frame, as a share of that of the frame.
_BREATH = 0.1
#: Seconds after which a page that takes nothing of what it is sent is given up.
_PATIENCE = 10.0
#: Loggers of page servers.
_SERVERS = 'wslink.protocol', 'aiohttp.server'
#: Modules of PyVista's trame views, which render in their callbacks.
_VIEWS = ('trame_pyvista', 'pyvista.trame')


class Clock:
    """Advances the time while a plotter is shown or recorded."""

    def __init__(self, plotter, tell):
        self._plotter, self._tell = plotter, tell
        self._ticks: Timer | Loop | None = None
        self._watched: tuple | None = None
        self._films = False
        self.running = False

    def start(self, time, *, speed=1.0, loop=None, fps=None):
        """Start at a time."""
        speed = checked_number('speed', speed)
        loop = None if loop is None else checked_positive('loop', loop)
        fps = None if fps is None else checked_positive('fps', fps)
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
        """Tick for a page that was opened after the start."""
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
        self._base = self._shown = float(time)
        self._since: float | None = None
        self._looks = 0
        self._frames = 0

    def stop(self):
        """Stop at the current time; may be called again."""
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
        """Write a frame of a movie, and advance the time by one frame."""
        fps = self._fps or _fps_of(getattr(self._plotter, 'mwriter', None))
        if self._since is not None:  # the wall clock was in charge
            self.set(self._shown)
        frame()
        if not self.running:  # an observer may have stopped it in this frame
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
        """Follow the wall clock from the first tick on: windows open late."""
        if filming(self._plotter):
            return
        if self._frames:  # a movie was in charge
            self.set(self._shown)
        now = perf_counter()
        if self._since is None:
            self._since, self._looks = now, -1
        self._looks += 1
        if self._go(self._looks / 60 if is_deterministic() else now - self._since):
            draw(self._plotter)

    def _go(self, seconds) -> bool:
        """Set the time so many seconds later; return True if it changed."""
        time = self._base + self._speed * seconds
        if self._loop is not None:
            time = self._origin + (time - self._origin) % self._loop
        if time == self._shown:
            return False
        self._shown = time
        self._tell(time)
        return True


class Timer:
    """Ticks of a window's interactor."""

    def __init__(self, interactor, tick):
        self._interactor, self._tick, self._held = interactor, tick, False
        calls = self._look_on, self._on_timer
        self._observers = [interactor.AddObserver('TimerEvent', call) for call in calls]
        # While a button is held, VTK calls only its style and passive observers.
        interactor.GetCommand(self._observers[0]).PassiveObserverOn()
        self._timer = interactor.CreateRepeatingTimer(PERIOD)

    def _look_on(self, interactor, _event):
        # The style treats any timer event as a repetition of the last mouse move.
        interactor.SetLastEventPosition(interactor.GetEventPosition())
        self._held = is_dragged(interactor.GetRenderWindow())
        if self._held:
            self._tick()

    def _on_timer(self, *_):
        if not self._held:
            self._tick()

    def stop(self):
        """Stop ticking."""
        for observer in self._observers:
            self._interactor.RemoveObserver(observer)
        self._interactor.DestroyTimer(self._timer)


class Loop:
    """Ticks of the event loop of a page server, a notebook's or an application's."""

    def __init__(self, loop, tick):
        self._loop, self._tick = loop, tick
        if loop.get_exception_handler() is None:
            loop.set_exception_handler(_say_unless_closed)
        for name in _SERVERS:
            logging.getLogger(name).addFilter(_is_news)
        self._behind: dict = {}
        self._wait()

    def _wait(self, seconds=PERIOD / 1e3):
        self._next = self._loop.call_later(seconds, self._run)

    def _run(self):
        self._wait()
        if self._waits_for_pages():
            return
        began = perf_counter()
        try:
            self._tick()
        except Exception:
            self.stop()
            raise
        if not self._next.cancelled():  # slow frames leave the server time for its pages
            took = perf_counter() - began
            self._next.cancel()
            self._wait(max(PERIOD / 1e3 - took, _BREATH * took))

    def _waits_for_pages(self) -> bool:
        """Return whether a page is behind: no frame is drawn until it has what it was sent.

        wslink sends to one page after another, so that one that takes nothing holds up all.
        """
        now = perf_counter()
        self._behind = {page: self._behind.get(page, now) for page in _pages_behind()}
        for page, since in self._behind.items():
            if now - since > _PATIENCE:
                page.transport.abort()
        return bool(self._behind)

    def stop(self):
        """Stop ticking."""
        self._next.cancel()


def _pages_behind() -> list:
    """Return the connections of trame's servers whose pages have not taken what they were sent."""
    servers = getattr(sys.modules.get('trame.app.core'), 'AVAILABLE_SERVERS', {}).values()
    webs = [s._server for s in servers if s.running]  # noqa: SLF001
    runners = [getattr(web, 'runner', None) for web in webs]
    pages = [page for r in runners if r is not None for page in r.server.connections]
    return [page for page in pages if page.writing_paused and page.connected]


def _say_unless_closed(loop, context):
    """Say what went wrong in an event loop, but not that a page closed before a frame came."""
    if not _is_of_closed_page(context.get('exception')):
        loop.default_exception_handler(context)


def _is_news(_record) -> bool:
    """Return whether what a server logs is more than that a page closed before its answer came."""
    return not _is_of_closed_page(sys.exc_info()[1])


def _is_of_closed_page(error) -> bool:
    """Return whether an error is of a closed connection, or came while one was handled."""
    while error is not None and not isinstance(error, ConnectionError):
        error = error.__context__
    return error is not None


def filming(plotter) -> bool:
    """Return True if a movie is open."""
    writer = getattr(plotter, 'mwriter', None)
    return writer is not None and not getattr(writer, 'closed', False)


def draw(plotter):
    """Render a frame, in the window or in each open page."""
    told = frame_callbacks(plotter)
    if not told or not all(tell.__module__.startswith(_VIEWS) for tell in told):
        plotter.render()
        return
    for tell in told:
        tell(plotter)


def ticks(plotter, tick):
    """Call a function periodically while a plotter is shown; None if it is not."""
    asyncio = sys.modules.get('asyncio')  # what runs a loop has imported it
    if asyncio is not None and has_page(plotter):
        with contextlib.suppress(RuntimeError):  # nothing runs
            return Loop(asyncio.get_running_loop(), tick)
    window = plotter.renderer.GetRenderWindow()
    interactor = None if window is None else window.GetInteractor()
    hidden = window is None or getattr(plotter, 'off_screen', window.GetOffScreenRendering())
    if interactor is None or hidden or getattr(plotter, 'notebook', False):
        return None
    return Timer(interactor, tick)


def has_page(plotter) -> bool:
    """Return True if callbacks, such as trame views, show the frames."""
    # If rendering is suppressed, the browser renders by itself.
    return bool(frame_callbacks(plotter)) and not getattr(plotter, 'suppress_rendering', False)


def _fps_of(writer):
    """Return the frames per second of an imageio writer."""
    given = dict(getattr(getattr(writer, 'request', None), 'kwargs', {}))
    given |= getattr(writer, 'write_args', {})
    if given.get('fps'):
        return float(given['fps'])
    if given.get('duration'):
        return 1e3 / float(given['duration'])
    raise ValueError('the frame rate of the movie is unknown: give play(fps=...)')


def checked_time(seconds) -> float:
    """Return a finite time."""
    try:
        time = float(seconds)
    except (TypeError, ValueError, OverflowError):
        time = math.nan
    if not math.isfinite(time):
        raise ValueError(f'time = {seconds!r:.60}: must be a finite number of seconds')
    return time
