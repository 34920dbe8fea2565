import asyncio
import gc
import logging
import sys
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import ClosedError, Effect, attach
from pvibr.capture.clock import Clock, Loop
from pvibr.core import _vtk
from tests.refusals import refused


class Count(Effect):
    """Keep the times of the frames."""

    def __init__(self):
        super().__init__()
        self.times = []

    def prepare(self, frame):
        self.times.append(frame.time)


class Standin(SimpleNamespace):
    """What a clock asks of a plotter; unlike its base, it may be referred to weakly."""


@pytest.fixture
def wall(monkeypatch):
    """A clock on the wall that goes when it is told to."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr('pvibr.capture.clock.perf_counter', lambda: now.seconds)
    return now


@pytest.fixture
def window():
    """A window whose timer ticks when it is told to."""
    ui = pytest.importorskip('vtkmodules.vtkRenderingUI')
    made = _vtk.vtkRenderWindow()
    made.SetSize(32, 24)
    renderer = _vtk.vtkRenderer()
    made.AddRenderer(renderer)
    interactor = ui.vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(made)
    timers = []
    interactor.AddObserver('CreateTimerEvent', lambda *_: timers.append('on'))
    interactor.AddObserver('DestroyTimerEvent', lambda *_: timers.append('off'))
    with attach(renderer) as ibr:
        ibr._plotter.off_screen = False  # here windows may have no screen
        yield SimpleNamespace(
            ibr=ibr, tick=lambda: interactor.InvokeEvent('TimerEvent'), timers=timers, window=made
        )


def test_a_window_shows_the_time_of_the_wall(window, wall):
    seen = window.ibr.add(Count())
    window.ibr.time = 5.0
    window.ibr.play(speed=2.0)
    assert window.ibr.playing
    for wall.seconds in (200.0, 200.5, 201.0):  # the first tick is when it opens
        window.tick()
    assert seen.times == [6.0, 7.0]
    window.ibr.stop()
    window.tick()
    assert not window.ibr.playing
    assert window.ibr.time == 7.0
    assert window.timers == ['on', 'off']


def test_a_time_that_is_set_is_where_it_goes_on(window, wall):
    window.ibr.play()
    for wall.seconds in (1.0, 3.0):
        window.tick()
    assert window.ibr.time == 2.0
    window.ibr.time = 50.0
    for wall.seconds in (4.0, 4.5):
        window.tick()
    assert window.ibr.time == 50.5


def test_nothing_is_drawn_when_the_time_stands(window, wall):
    seen = window.ibr.add(Count())
    window.ibr.play(speed=0.0)
    for wall.seconds in (1.0, 2.0):
        window.tick()
    assert seen.times == []


@pytest.mark.parametrize(('speed', 'expected'), [(1.0, [2.5, 2.25]), (-1.0, [2.5, 2.75])])
def test_a_loop_begins_again(window, wall, speed, expected):
    window.ibr.time = 2.0
    window.ibr.play(speed, loop=1.0)
    wall.seconds = 0.0
    window.tick()
    for wall.seconds, time in zip((10.5, 11.25), expected, strict=True):
        window.tick()
        assert window.ibr.time == time


def test_closing_ends_it(window, wall):
    window.ibr.play()
    window.ibr.close()
    assert window.timers == ['on', 'off']
    assert not window.ibr.playing
    wall.seconds += 1
    window.tick()
    assert window.ibr.time == 0.0


def test_playing_again_replaces_it(window, wall):
    window.ibr.play()
    window.ibr.play(speed=3.0)
    assert window.timers == ['on', 'off', 'on']
    for wall.seconds in (0.0, 1.0):
        window.tick()
    assert window.ibr.time == 3.0


def test_off_screen_only_frames_of_a_movie_move_it(tmp_path, wall):
    pl = pv.Plotter(off_screen=True, window_size=(32, 32))
    seen = pl.ibr.add(Count())
    pl.ibr.time = 1.0
    pl.ibr.play(speed=2.0)
    pl.show(auto_close=False)
    wall.seconds += 10
    pl.screenshot(return_img=True)
    assert set(seen.times) == {1.0}
    pl.open_gif(tmp_path / 'a.gif', fps=4)
    for _ in range(3):
        pl.write_frame()
    assert sorted(set(seen.times)) == [1.0, 1.5, 2.0]
    assert pl.ibr.time == 2.5
    pl.ibr.stop()
    pl.write_frame()
    assert pl.ibr.time == 2.5
    assert 'write_frame' not in vars(pl)


def test_a_method_of_the_user_comes_back(tmp_path):
    pl = pv.Plotter(off_screen=True, window_size=(32, 32))
    pl.open_gif(tmp_path / 'a.gif', fps=4)
    frames, write_frame = [], pl.write_frame
    vars(pl)['write_frame'] = mine = lambda: frames.append(write_frame())
    pl.ibr.play()
    pl.write_frame()
    assert len(frames) == 1
    assert pl.ibr.time == 0.25
    pl.ibr.stop()
    assert pl.write_frame is mine


def test_a_movie_decides_in_a_window_as_well(window, wall):
    """Frames are one apart, however long they take."""
    plotter = Standin(
        renderer=window.ibr._plotter.renderer, mwriter=SimpleNamespace(write_args={'fps': 10})
    )
    times = []
    clock = Clock(plotter, times.append)
    clock.start(0.0)
    for wall.seconds in (1.0, 2.0):
        window.tick()
    assert times == []
    for _ in range(30):
        clock.write(lambda: None)
    assert times[-1] == 3.0  # not thirty times a rounded tenth
    clock.stop()


def test_wall_and_movie_go_on_where_the_other_ends(window, wall):
    writer = SimpleNamespace(closed=True, write_args={'fps': 10})
    plotter = Standin(
        renderer=window.ibr._plotter.renderer,
        mwriter=writer,
        render=lambda: None,
        off_screen=False,
    )
    times = []
    clock = Clock(plotter, times.append)
    clock.start(0.0)
    for wall.seconds in (1.0, 3.0):
        window.tick()
    writer.closed = False
    for wall.seconds in (10.0, 20.0):
        window.tick()
        clock.write(lambda: None)
    writer.closed = True
    for wall.seconds in (30.0, 30.5):
        window.tick()
    np.testing.assert_allclose(times, [2.0, 2.1, 2.2, 2.7])
    clock.stop()


def test_movies_know_their_frames_a_second(tmp_path):
    pytest.importorskip('imageio_ffmpeg')
    pl = pv.Plotter(off_screen=True, window_size=(32, 32))
    pl.ibr.play()
    pl.open_movie(tmp_path / 'a.mp4', framerate=25)
    pl.write_frame()
    assert pl.ibr.time == 1 / 25
    pl.close()
    with pytest.raises(ClosedError):
        pl.ibr.play()


def test_a_movie_that_does_not_say_is_asked_about():
    plotter = Standin(renderer=_vtk.vtkRenderer(), mwriter=object())
    clock = Clock(plotter, print)
    clock.start(0.0)
    refused('fps', clock.write, lambda: None)


def page_of(times):
    """A plotter that a view of trame shows, which notes when it was told to draw."""
    shown = []

    def tell(_plotter):
        shown.append(times[-1])

    tell.__module__ = 'trame_pyvista.widgets'
    plotter = Standin(
        renderer=_vtk.vtkRenderer(),
        _on_render_callbacks={tell},
        suppress_rendering=False,
        off_screen=True,
        render=lambda: pytest.fail('the view draws by itself'),
    )
    return plotter, shown


def test_a_page_ticks_in_the_loop_of_its_server():
    times = []
    plotter, shown = page_of(times)

    async def server():
        clock = Clock(plotter, times.append)
        clock.start(0.0)
        assert clock.ticking
        while len(shown) < 3:
            await asyncio.sleep(0.01)
        clock.stop()
        await asyncio.sleep(0.1)

    asyncio.run(server())
    assert shown == times
    assert len(times) == 3
    assert times == sorted(set(times))


def test_a_page_that_opens_late_begins_with_its_first_frame():
    times = []
    plotter, shown = page_of(times)
    views, plotter._on_render_callbacks = plotter._on_render_callbacks, set()
    clock = Clock(plotter, times.append)
    clock.start(0.0)

    async def server():
        plotter.renderer.InvokeEvent('StartEvent')  # of a picture that nobody looks at
        await asyncio.sleep(0.1)
        assert not clock.ticking
        plotter._on_render_callbacks = views
        plotter.renderer.InvokeEvent('StartEvent')
        assert clock.ticking
        while not shown:
            await asyncio.sleep(0.01)
        clock.stop()
        shown.clear()
        plotter.renderer.InvokeEvent('StartEvent')
        assert not clock.ticking

    asyncio.run(server())


def test_what_is_told_and_does_not_draw_is_drawn_for():
    times, drawn = [], []
    plotter, shown = page_of(times)
    plotter._on_render_callbacks.add(lambda _: None)
    plotter.render = lambda: drawn.append(times[-1])

    async def server():
        clock = Clock(plotter, times.append)
        clock.start(0.0)
        while not drawn:
            await asyncio.sleep(0.01)
        clock.stop()

    asyncio.run(server())
    assert not shown


def test_a_window_ticks_though_something_is_told(window, wall):
    window.ibr._plotter.show_by(window.window.Render)
    window.ibr.play()
    for wall.seconds in (1.0, 3.0):
        window.tick()
    assert window.ibr.time == 2.0


def test_a_page_that_draws_by_itself_is_not_told():
    plotter, _ = page_of([])
    plotter.suppress_rendering = True

    async def server():
        clock = Clock(plotter, print)
        clock.start(0.0)
        assert not clock.ticking
        clock.stop()

    asyncio.run(server())


def test_views_hear_of_each_moment():
    """As they ask PyVista to be told, and with what they draw by."""
    sent = []

    async def notebook():
        pl = pv.Plotter(notebook=True, off_screen=True, window_size=(32, 32))
        pl.ibr.play()
        pl.show(jupyter_backend='none', auto_close=False)
        assert not pl.ibr.pipeline.time
        pl.add_on_render_callback(lambda pl: sent.append(pl.ibr.time), render_event=False)
        pl.render()
        while len(sent) < 4:
            await asyncio.sleep(0.01)
        pl.close()

    asyncio.run(notebook())
    assert sent == sorted(set(sent))


def test_a_notebook_without_a_loop_only_films():
    writer = SimpleNamespace(write_args={'fps': 2})
    plotter = Standin(notebook=True, mwriter=writer, renderer=_vtk.vtkRenderer())
    clock = Clock(plotter, print)
    clock.start(0.0)
    assert clock.running


@pytest.mark.parametrize(
    'wrong',
    [
        {'speed': float('nan')},
        {'loop': 0},
        {'loop': -1},
        {'fps': 0},
        {'fps': 'inf'},
        {'speed': 1j},
    ],
)
def test_numbers_that_are_not_allowed(wrong):
    pl = pv.Plotter(off_screen=True)
    refused(next(iter(wrong)), pl.ibr.play, kind=(TypeError, ValueError), **wrong)
    assert not pl.ibr.playing


def test_a_window_shows_sixtieths_where_nothing_may_be_measured(window, wall):
    seen = window.ibr.add(Count())
    with pvibr.deterministic():
        window.ibr.play()
        for wall.seconds in (200.0, 200.5, 207.0, 207.1):
            window.tick()
    assert seen.times == pytest.approx([1 / 60, 2 / 60, 3 / 60])


def test_a_loop_says_errors_but_not_that_a_page_closed(caplog):
    async def fail(error):
        raise error

    async def play():
        loop = Loop(asyncio.get_running_loop(), lambda: None)
        gone = asyncio.create_task(fail(ConnectionResetError('closing transport')))
        wrong = asyncio.create_task(fail(ValueError('wrong')))
        await asyncio.sleep(0)
        for error in (ConnectionResetError('closing transport'), ValueError('of a request')):
            try:
                await fail(error)
            except Exception:
                logging.getLogger('wslink.protocol').exception('Exception raised')
        try:
            try:
                await fail(ConnectionResetError('closing transport'))
            finally:
                await fail(KeyError('the page, which wslink does not know yet'))
        except KeyError:
            logging.getLogger('aiohttp.server').exception('Exception raised')
        del gone, wrong  # nobody retrieves what they raised
        gc.collect()
        loop.stop()

    asyncio.run(play())
    assert [str(record.exc_info[1]) for record in caplog.records] == ['of a request', 'wrong']


def test_slow_frames_leave_a_server_time_for_its_pages():
    """Whoever opens a page while time goes on has it served between two frames."""
    frames, hops = [], []

    async def serve():
        ticks = Loop(asyncio.get_running_loop(), lambda: (sleep(0.03), frames.append(1)))
        while len(frames) < 5:
            await asyncio.sleep(0)
            hops.extend([1] * bool(frames))
        ticks.stop()

    asyncio.run(serve())
    assert len(hops) > 10 * len(frames)


def test_a_page_that_takes_nothing_holds_up_the_others_no_longer_than_patience(monkeypatch):
    """Its frames are not piled up; it is given up, and they go on."""
    aiohttp = pytest.importorskip('aiohttp')
    from aiohttp import web

    frames = []

    async def flood(request):
        page = web.WebSocketResponse()
        await page.prepare(request)
        for _ in range(1000):
            await page.send_bytes(bytes(100_000))

    async def serve():
        app = web.Application()
        app.router.add_get('/', flood)
        runner = web.AppRunner(app)
        await runner.setup()
        await web.TCPSite(runner, '127.0.0.1', 0).start()
        server = SimpleNamespace(running=True, _server=SimpleNamespace(runner=runner))
        module = SimpleNamespace(AVAILABLE_SERVERS={'page': server})
        monkeypatch.setitem(sys.modules, 'trame.app.core', module)
        url = f'http://127.0.0.1:{runner.addresses[0][1]}/'
        soon = aiohttp.ClientWSTimeout(ws_close=0.1)
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(url, timeout=soon) as page,
        ):
            page._response.connection.transport.pause_reading()
            await _until(lambda: any(p.writing_paused for p in runner.server.connections))
            ticks = Loop(asyncio.get_running_loop(), lambda: frames.append(1))
            await asyncio.sleep(0.2)
            assert not frames
            monkeypatch.setattr('pvibr.capture.clock._PATIENCE', 0.1)
            await _until(lambda: frames)
            ticks.stop()
            assert not runner.server.connections
        await runner.cleanup()

    asyncio.run(asyncio.wait_for(serve(), 30))


async def _until(true):
    while not true():
        await asyncio.sleep(0.01)
