import asyncio
import gc
import weakref
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

import pvibr
from pvibr import Effect, attach
from pvibr.capture.adaptive_quality import LEVELS, SETTLE, Budget
from pvibr.core import _vtk
from tests.makers import ENABLED


class Show(Effect):
    """Keep the quality of the frames, and take the time that they are said to take."""

    wall: Any = None

    def __init__(self):
        super().__init__()
        self.seen = []

    def prepare(self, frame):
        self.seen.append(frame.quality)
        self.wall.now += self.wall.full * frame.quality


def drive(budget, cost, frames):
    """Draw moving frames that cost what a function of the quality says; return qualities."""
    seen = []
    for _ in range(frames):
        seen.append(budget.quality)
        budget.moved(cost(budget.quality))
    return seen


def test_frames_over_the_budget_lower_the_next():
    assert set(drive(Budget(100.0), lambda q: 99.0 * q, 200)) == {1.0}
    assert drive(Budget(100.0), lambda q: 150.0 * q, 3) == pytest.approx([1.0, 0.5, 0.5])


@given(st.floats(110, 1500), st.floats(0.3, 2.0), st.floats(0, 60))
def test_it_finds_a_quality_in_time_and_keeps_it(full, power, fixed):
    def cost(quality):
        return fixed + full * quality**power

    budget = Budget(100.0)
    drive(budget, cost, 20)
    seen = drive(budget, cost, 2000)
    slow = np.mean([cost(q) > 100.0 for q in seen])
    if cost(LEVELS[-1]) <= 100.0:
        assert slow <= 0.05
    turns = np.count_nonzero(np.diff(np.sign(np.diff(seen))))
    assert turns <= 100  # of 2000: it does not swing


def test_one_slow_frame_is_no_reason():
    budget = Budget(100.0)
    drive(budget, lambda q: 50.0, 10)
    budget.moved(160.0)
    assert budget.quality == 1.0
    budget.moved(160.0)
    assert budget.quality < 1.0


@pytest.mark.parametrize(('full', 'least'), [(60.0, 0.9), (150.0, 0.45), (400.0, 0.12)])
def test_noise_neither_swings_it_nor_pulls_it_down(full, least):
    rng = np.random.default_rng(0)
    seen = drive(Budget(100.0), lambda q: full * q * rng.lognormal(0, 0.15), 1000)
    assert np.mean(seen) > least
    assert np.count_nonzero(np.diff(seen)) < 30


def test_quality_rises_where_frames_become_easy():
    budget = Budget(100.0)
    drive(budget, lambda q: 400.0 * q, 20)
    assert budget.quality <= 0.25
    assert drive(budget, lambda q: 50.0 * q, 100)[-1] == 1.0


def test_where_less_quality_is_no_faster_none_is_taken():
    budget = Budget(100.0)
    seen = drive(budget, lambda q: 500.0, 200)
    assert np.mean(np.array(seen) == 1.0) > 0.8


def test_only_what_helps_is_taken():
    budget = Budget(100.0)
    seen = drive(budget, lambda q: 800.0 if q > 0.5 else 200.0, 200)
    assert budget.quality == pytest.approx(0.25)  # 0.5 was leapt over
    assert np.mean(np.array(seen) == budget.quality) > 0.8


def test_frames_at_rest_tell_what_the_first_moving_one_needs():
    budget = Budget(100.0)
    budget.rested(5000.0)  # with a bake
    assert budget.quality == LEVELS[-1]
    budget.rested(400.0)
    assert budget.quality == pytest.approx(0.25)
    budget.rested(50.0)
    assert budget.quality == 1.0


@pytest.mark.parametrize(
    ('full', 'later'), [(10.0, 1.0), (90.0, 1.0), (190.0, 0.5), (3000, 1 / 16)]
)
def test_a_first_frame_that_took_long_is_made_up_for_at_once(full, later):
    budget = Budget(100.0)
    budget.rested(5000.0)  # compiles, uploads, bakes
    assert drive(budget, lambda q: full * q, 3) == pytest.approx([1 / 16, later, later])


def test_a_first_frame_may_have_compiled_shaders():
    budget = Budget(100.0)
    budget.rested(300.0)
    assert budget.quality == 1.0
    budget.rested(200.0)
    assert budget.quality == 0.5


def test_the_first_drag_of_a_heavy_scene_is_in_time():
    budget = Budget(100.0)
    budget.rested(2600.0)
    assert max(1500.0 * q for q in drive(budget, lambda q: 1500.0 * q, 20)) <= 100.0


def test_no_budget_is_full_quality():
    budget = Budget(0.0)
    budget.rested(1e6)
    budget.rested(1e6)
    assert set(drive(budget, lambda q: 1e6, 50)) == {1.0}


@pytest.fixture
def slow(monkeypatch):
    """A clock by which a frame of full quality takes 0.4 s, and one of less its share."""
    wall = SimpleNamespace(now=100.0, full=0.4)
    for module in ('capture.adaptive_quality', 'gl.frame_timer'):
        monkeypatch.setattr(f'pvibr.{module}.perf_counter', lambda: wall.now)
    monkeypatch.setattr(Show, 'wall', wall)
    return wall


def stage(**kwargs):
    pl = pv.Plotter(off_screen=True, window_size=(96, 64), **kwargs)
    pl.enable_trackball_style()
    pl.add_mesh(pv.Cube())
    return pl


def shown_stage():
    """Return a shown plotter, and the effect that records its frames."""
    pl = stage()
    show = pl.ibr.add(Show())
    pl.show(auto_close=False)
    return pl, show


def event(pl, name, x, y=32):
    pl.iren.interactor.SetEventInformation(x, y, 0, 0)
    pl.iren.interactor.InvokeEvent(name)


def press(pl, x=40):
    event(pl, 'MouseMoveEvent', x)
    event(pl, 'LeftButtonPressEvent', x)


def drag(pl, steps=6, x=40):
    press(pl, x)
    for k in range(steps):
        event(pl, 'MouseMoveEvent', x + 2 * k + 2)


def release(pl, x=60):
    event(pl, 'LeftButtonReleaseEvent', x)


def picture(pl):
    return np.asarray(pl.image)[..., :3].copy()


def test_a_drag_lowers_and_its_end_is_full(slow):
    pl, show = shown_stage()
    assert show.seen == [1.0]
    drag(pl)
    assert show.seen[-1] == pytest.approx(0.25)
    assert pl.ibr.quality == show.seen[-1]
    assert 'interactive_frame_ms is 100' in str(pl.ibr.report())
    release(pl)
    assert show.seen[-1] == pl.ibr.quality == 1.0


def test_frames_in_time_are_full(slow):
    slow.full = 0.02
    pl, show = shown_stage()
    drag(pl, 20)
    release(pl)
    assert set(show.seen) == {1.0}
    assert 'quality' not in str(pl.ibr.report())


def test_no_limit_is_full_quality(slow):
    pl = stage()
    show = pl.ibr.add(Show())
    pl.ibr.interactive_frame_ms = 0
    pl.show(auto_close=False)
    drag(pl)
    assert set(show.seen) == {1.0}


@pytest.mark.parametrize('value', [-1, np.nan, np.inf, 'fast'])
def test_limits_that_are_none(value):
    pl = stage()
    with pytest.raises((TypeError, ValueError), match='interactive_frame_ms'):
        pl.ibr.interactive_frame_ms = value
    assert pl.ibr.interactive_frame_ms == 100.0


def test_scripts_that_move_the_camera_are_full(slow):
    pl, show = shown_stage()
    for _ in range(6):
        pl.camera.azimuth += 5
        pl.render()
    assert set(show.seen) == {1.0}


def test_the_wheel_ends_with_a_full_frame(slow):
    pl, show = shown_stage()
    for _ in range(4):
        event(pl, 'MouseWheelForwardEvent', 40)
        assert show.seen[-1] == 1.0
    assert min(show.seen) < 1.0
    assert not pl.ibr._adaptive_quality.lowered


def test_multisampling_is_back_after_each_frame(slow):
    pl = stage()
    pl.render_window.SetMultiSamples(4)
    pl.ibr.add(Show())
    pl.show(auto_close=False)
    within = []
    window = pl.render_window
    pl.renderer.AddObserver('EndEvent', lambda *_: within.append(window.GetMultiSamples()))
    drag(pl)
    assert within[-1] == 0
    assert pl.render_window.GetMultiSamples() == 4
    release(pl)
    assert within[-1] == 4


def busy(pl):
    """Have in a plotter whatever lowers something."""
    pl.ibr.add(Show())
    pl.add_light(pv.Light(position=(3, -4, 6), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=10, j_size=10))
    pl.add_mesh(pv.Sphere(center=(1, -2, 0.5)), color='orange')
    pl.ibr.add(pvibr.Shadows(method='pcss', resolution=256))
    pl.ibr.add(pvibr.DepthOfField((0, 0, 0), f_number=0.2))
    pl.camera_position = [(6, -8, 5), (0, 0, 0), (0, 0, 1)]


BESIDE = {name: ENABLED[name] for name in ('nothing', 'ssao', 'edl', 'peeling', 'ssaa')} | {
    'glass': lambda pl: pl.add_mesh(pv.Sphere(center=(-2, 0, 1)), opacity=0.5),
}


@pytest.mark.parametrize('beside', BESIDE)
def test_at_rest_every_bit_is_as_before(slow, beside):
    pl = stage()
    busy(pl)
    BESIDE[beside](pl)
    pl.show(auto_close=False)
    pl.render()
    before = picture(pl)
    camera = _vtk.vtkCamera()
    camera.DeepCopy(pl.camera)
    drag(pl)
    assert pl.ibr._adaptive_quality.lowered
    pl.camera.DeepCopy(camera)
    pl.camera.Modified()  # VTK's copy is not
    pl.render_window.Render()
    less = picture(pl)
    assert abs(less.astype(int) - before).mean() > 0.1
    assert abs(less.astype(int) - before).mean() < 12
    release(pl)
    np.testing.assert_array_equal(picture(pl), before)


def test_a_screenshot_in_a_drag_is_full(slow):
    pl = stage()
    busy(pl)
    pl.show(auto_close=False)
    drag(pl)
    assert pl.ibr._adaptive_quality.lowered
    taken = pl.screenshot(return_img=True)
    assert not pl.ibr._adaptive_quality.lowered
    release(pl)
    np.testing.assert_array_equal(taken, pl.screenshot(return_img=True))


def test_buffers_in_a_drag_are_full(slow):
    pl, show = shown_stage()
    drag(pl)
    pl.ibr.buffer('depth')
    assert show.seen[-1] == 1.0
    event(pl, 'MouseMoveEvent', 70)
    assert show.seen[-1] < 1.0


def test_frames_of_a_movie_are_full(slow, tmp_path):
    pl, show = shown_stage()
    pl.open_gif(str(tmp_path / 'drag.gif'))
    pl.write_frame()
    drag(pl)
    assert set(show.seen) == {1.0}
    pl.mwriter.close()
    drag(pl)
    assert show.seen[-1] < 1.0


def test_picking_in_a_drag_is_full_and_changes_no_quality(slow):
    pl = stage()
    show = pl.ibr.add(Show())
    show.picks = True
    pl.show(auto_close=False)
    drag(pl)
    quality = show.seen[-1]
    selector = _vtk.vtkOpenGLHardwareSelector()
    selector.SetRenderer(pl.renderer)
    selector.SetArea(0, 0, 95, 63)
    assert selector.Select().GetNumberOfNodes() == 1
    assert show.seen[-1] == 1.0
    event(pl, 'MouseMoveEvent', 70)
    assert show.seen[-1] == pytest.approx(quality)


def test_subplots_move_together(slow):
    pl = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(96, 64))
    pl.enable_trackball_style()
    shows = []
    for k in range(2):
        pl.subplot(0, k)
        pl.add_mesh(pv.Cube())
        shows.append(pl.ibr.add(Show()))
    pl.show(auto_close=False)
    drag(pl, x=10)
    assert shows[0].seen == shows[1].seen
    assert shows[0].seen[-1] < 1.0
    release(pl)
    assert [show.seen[-1] for show in shows] == [1.0, 1.0]


def test_a_plotter_at_rest_beside_one_that_moves(slow):
    moving, resting = stage(), stage()
    shows = [pl.ibr.add(Show()) for pl in (moving, resting)]
    for pl in (moving, resting):
        pl.show(auto_close=False)
    drag(moving)
    resting.render()
    assert shows[0].seen[-1] < 1.0
    assert set(shows[1].seen) == {1.0}


def test_two_that_watch_one_window(slow):
    window, renderers = _vtk.vtkRenderWindow(), [_vtk.vtkRenderer() for _ in range(2)]
    window.SetSize(96, 64)
    window.SetMultiSamples(4)
    ui = pytest.importorskip('vtkmodules.vtkRenderingUI')
    interactor = ui.vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    shows = []
    for renderer in renderers:
        window.AddRenderer(renderer)
        shows.append(attach(renderer).add(Show()))
    window.Render()
    window.SetDesiredUpdateRate(30.0)
    for _ in range(4):
        window.Render()
        assert window.GetMultiSamples() == 4
    assert all(show.seen[-1] < 1.0 for show in shows)
    for renderer in renderers:
        attach(renderer).close()
    assert window.GetMultiSamples() == 4


def test_the_wheel_in_a_page(slow):
    pl, show = shown_stage()
    # As views of trame do, which then have the server draw and send.
    pl.add_on_render_callback(lambda plotter: plotter.render_window.Render(), render_event=False)

    async def turn():
        for _ in range(4):
            event(pl, 'MouseWheelForwardEvent', 40)
        assert show.seen[-1] < 1.0
        slow.now += SETTLE
        while pl.ibr._adaptive_quality.lowered:
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(turn(), 60))
    assert show.seen[-1] == 1.0


def test_an_error_while_moving_lets_nothing_lie(slow):
    class Fail(Show):
        def prepare(self, frame):
            super().prepare(frame)
            if frame.quality < 1:
                raise RuntimeError('low')

    pl = stage()
    pl.render_window.SetMultiSamples(4)
    fail, show = pl.ibr.add(Fail()), pl.ibr.add(Show())
    pl.show(auto_close=False)
    with pytest.warns(pvibr.PvibrWarning, match='low'):
        drag(pl)
    assert not fail.enabled
    assert pl.render_window.GetMultiSamples() == 4
    release(pl)
    assert show.seen[-1] == 1.0


def test_closed_in_a_drag(slow):
    pl, _ = shown_stage()
    drag(pl)
    pl.close()
    assert 'screenshot' not in vars(pl)


#: Applications of servers that tests started. A window goes on writing into one that is freed:
#: vtkWebApplication leaves its observer behind, and VTK aborts once in 150 times.
_APPLICATIONS = []


@pytest.fixture
def server():
    """VTK's web module and an application of it that outlives its windows, as a server's does."""
    web = pytest.importorskip('vtkmodules.vtkWebCore')
    _APPLICATIONS.append(web.vtkWebApplication())
    return web, _APPLICATIONS[-1]


def test_a_page_dragged_on_a_server(slow, server):
    web, app = server
    buttons = web.vtkWebInteractionEvent.LEFT_BUTTON
    pl, show = shown_stage()
    pl.iren.interactor.EnableRenderOff()  # servers draw only to send

    def mouse(x, pressed=buttons):
        event = web.vtkWebInteractionEvent()
        event.SetButtons(pressed)
        event.SetX(x)
        event.SetY(0.5)
        app.HandleInteractionEvent(pl.render_window, event)
        app.InvalidateCache(pl.render_window)
        app.StillRenderToBuffer(pl.render_window, 0, 90)
        return show.seen[-1]

    qualities = [mouse(0.4 + 0.02 * k) for k in range(6)]
    assert qualities[-1] == pytest.approx(0.25)
    assert mouse(0.5, pressed=0) == 1.0


def test_moves_that_queue_while_a_page_is_drawn_are_one_frame(slow, server):
    web, app = server
    buttons = web.vtkWebInteractionEvent.LEFT_BUTTON

    def dragged(renders):
        pl, show = shown_stage()
        pl.iren.interactor.SetEnableRender(renders)  # trame's views are off
        press(pl)
        first = len(show.seen)
        for k in range(60):
            event = web.vtkWebInteractionEvent()
            event.SetButtons(buttons)
            event.SetX(0.4 + 0.004 * k)
            event.SetY(0.5 + 0.1 * np.sin(k / 9))
            app.HandleInteractionEvent(pl.render_window, event)
        app.InvalidateCache(pl.render_window)
        app.StillRenderToBuffer(pl.render_window, 0, 90)
        return len(show.seen) - first, np.array(pl.camera.position), picture(pl)

    (each, camera, shown), (one, newest, image) = dragged(True), dragged(False)
    assert (each > 60, one) == (True, 1)
    np.testing.assert_allclose(newest, camera, atol=1e-12)
    np.testing.assert_array_equal(image, shown)


def test_nothing_is_watched_where_nothing_is_left(slow):
    pl, show = shown_stage()
    window = pl.render_window
    assert window.HasObserver('EndEvent')
    pl.ibr.remove(show)
    pl.render()
    pl.render()
    assert not window.HasObserver('EndEvent')
    pl.ibr.add(show)
    drag(pl)
    assert show.seen[-1] < 1.0


def test_a_plotter_that_moved_is_forgotten(slow):
    pl, _ = shown_stage()
    drag(pl)
    pace = weakref.ref(pl.ibr._adaptive_quality)
    pl.close()
    del pl
    gc.collect()
    assert pace() is None


@pytest.fixture
def window(slow):
    """A window whose timers tick when they are told to."""
    ui = pytest.importorskip('vtkmodules.vtkRenderingUI')
    made, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    made.SetSize(96, 64)
    made.AddRenderer(renderer)
    interactor = ui.vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(made)
    interactor.SetInteractorStyle(_vtk.vtkInteractorStyleTrackballCamera())
    timers: list = []
    interactor.AddObserver('CreateTimerEvent', lambda *_: timers.append('on'))
    interactor.AddObserver('DestroyTimerEvent', lambda *_: timers.remove('on'))
    with attach(renderer) as ibr:
        ibr._plotter.off_screen = False  # here windows may have no screen
        show = ibr.add(Show())
        made.Render()
        yield SimpleNamespace(
            ibr=ibr,
            show=show,
            timers=timers,
            window=made,
            slow=slow,
            iren=SimpleNamespace(interactor=interactor),
            tick=lambda: interactor.InvokeEvent('TimerEvent'),
        )
    assert not timers


def test_the_wheel_is_in_time_and_full_a_moment_later(window):
    for _ in range(4):
        event(window, 'MouseWheelForwardEvent', 40)
    assert window.show.seen[-1] < 1.0
    assert window.timers == ['on']
    frames = len(window.show.seen)
    window.tick()
    assert len(window.show.seen) == frames  # not yet
    window.slow.now += SETTLE
    window.tick()
    assert window.show.seen[-1] == 1.0
    assert not window.timers
    window.tick()
    assert len(window.show.seen) == frames + 1


def test_playing_is_in_time_and_full_a_moment_later(window):
    window.ibr.play()
    for _ in range(6):
        window.window.Render()
    assert window.show.seen[-1] < 1.0
    window.ibr.stop()
    window.slow.now += SETTLE
    window.tick()
    assert window.show.seen[-1] == 1.0
    assert not window.timers


def test_time_goes_on_in_a_drag_and_turns_nothing(window, monkeypatch):
    monkeypatch.setattr('pvibr.capture.clock.perf_counter', lambda: window.slow.now)
    camera = window.window.GetRenderers().GetFirstRenderer().GetActiveCamera()
    window.ibr.play()
    window.tick()
    drag(window)
    place, time = camera.GetPosition(), window.ibr.time
    for _ in range(3):
        window.slow.now += 1.0
        window.tick()
    assert camera.GetPosition() == place
    assert window.ibr.time >= time + 3.0
    release(window)


def test_standing_still_while_playing_is_full(window):
    window.ibr.play(speed=0.0)
    for _ in range(6):
        window.window.Render()
    assert window.show.seen[-1] < 1.0
    window.slow.now += SETTLE
    window.tick()
    assert window.show.seen[-1] == 1.0


def test_a_drag_right_after_the_wheel_needs_no_timer(window):
    for _ in range(4):
        event(window, 'MouseWheelForwardEvent', 40)
    assert window.timers == ['on']
    drag(window)
    assert not window.timers
    assert window.show.seen[-1] < 1.0
    release(window)
    assert window.show.seen[-1] == 1.0


def test_a_press_ends_its_timer_before_vtk_lets_no_observer_go(window):
    window.ibr.play()
    for _ in range(6):
        window.window.Render()
    assert window.timers == ['on', 'on']
    press(window)
    assert window.timers == ['on']
    release(window)
