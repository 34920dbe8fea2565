"""The bar for the time: by mouse, by keys, and while it plays."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr_widgets import pick_focus, time_bar
from tests.refusals import refused
from tests.widgets.conftest import colour

SIZE = 480, 160
LOW, LEFT, RIGHT = 24, 60, SIZE[0] - 24
YELLOW, BLUE, GREY = [255, 205, 60], [90, 220, 255], [150, 150, 150]


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=SIZE)
    pl.add_mesh(pv.Sphere())
    return pl


def at(share):
    return LEFT + share * (RIGHT - LEFT), LOW


def test_a_click_and_a_drag_set_the_time(pl, hand):
    told = []
    bar = time_bar(pl, 10, 20, callback=told.append)
    pl.show(auto_close=False)
    place = pl.camera.position
    hand(pl).drag(at(0.25))
    assert np.isclose(pl.ibr.time, 12.5, atol=0.02)
    hand(pl).drag(at(0.25), at(0.5), at(0.75))
    assert np.isclose(pl.ibr.time, 17.5, atol=0.02)
    hand(pl).drag(at(0.75), at(2))
    assert pl.ibr.time == 20
    hand(pl).drag(at(1), (0, 100))
    assert pl.ibr.time == 10
    assert told[-1] == 10
    assert pl.camera.position == place
    assert not bar.playing


def test_fingers_find_it_and_beside_it_the_camera_turns(pl, hand):
    time_bar(pl, 0, 1)
    pl.show(auto_close=False)
    hand(pl).drag((at(0.5)[0], LOW + 12))
    assert np.isclose(pl.ibr.time, 0.5, atol=0.01)
    place = pl.camera.position
    hand(pl).drag((at(0.7)[0], LOW + 30), (200, 90))
    assert np.isclose(pl.ibr.time, 0.5, atol=0.01)
    assert pl.camera.position != place


def test_it_follows_the_time_that_code_sets(pl):
    time_bar(pl, 0, 4)
    pl.show(auto_close=False)
    for time in (1.0, 3.0):
        pl.ibr.time = time
        assert colour(pl, at(time / 4)) == YELLOW  # the knob
        assert colour(pl, at(time / 4 - 0.2)) == YELLOW
        assert colour(pl, at(time / 4 + 0.2)) == GREY
    pl.ibr.time = 99
    assert colour(pl, at(1)) == YELLOW
    assert pl.ibr.time == 99


def test_the_button_and_the_space_bar_play_and_pause(pl, hand):
    bar = time_bar(pl, 0, 4)
    pl.show(auto_close=False)
    hand(pl).drag((24, LOW))
    assert bar.playing
    hand(pl).keys('space')
    assert not bar.playing
    hand(pl).keys('space')
    assert pl.ibr.playing
    hand(pl).drag((24, LOW))
    assert not pl.ibr.playing
    assert pl.ibr.time == 0


def test_a_held_bar_waits_and_goes_on(pl, hand):
    bar, mouse = time_bar(pl, 0, 4), hand(pl)
    pl.show(auto_close=False)
    bar.play()
    mouse.press(at(0.5))
    assert not pl.ibr.playing
    mouse.move(at(0.75))
    mouse.release(at(0.75))
    assert pl.ibr.playing
    assert np.isclose(pl.ibr.time, 3, atol=0.02)


def test_keys_move_it(pl, hand):
    time_bar(pl, 0, 100)
    pl.show(auto_close=False)
    keys = hand(pl)
    keys.keys('Tab', 'Right', 'Right')
    assert np.isclose(pl.ibr.time, 2)
    assert colour(pl, at(0.02)) == BLUE
    keys.keys('Left', shift=True)
    assert np.isclose(pl.ibr.time, 1.9)
    keys.keys('Prior', 'End')
    assert pl.ibr.time == 100
    keys.keys('Home')
    assert pl.ibr.time == 0
    keys.keys('Escape', 'Right')
    assert pl.ibr.time == 0


def film(pl, tmp_path, frames):
    pl.open_gif(tmp_path / 'film.gif', fps=10)
    seen = []
    pl.renderer.AddObserver('EndEvent', lambda *_: seen.append(round(pl.ibr.time, 6)))
    for _ in range(frames):
        pl.write_frame()
    return seen


def test_it_begins_again(pl, tmp_path):
    bar = time_bar(pl, 1, 1.35)
    pl.show(auto_close=False)
    bar.play()
    assert bar.playing
    seen = film(pl, tmp_path, 7)
    assert [*dict.fromkeys(seen)] == [1, 1.1, 1.2, 1.3, 1.05, 1.15, 1.25]


def test_it_stops_at_its_end_and_starts_over(pl, tmp_path):
    bar = time_bar(pl, 0, 0.25, loop=False)
    pl.show(auto_close=False)
    bar.play()
    film(pl, tmp_path, 6)
    assert pl.ibr.time == 0.25
    assert not bar.playing
    bar.toggle()
    assert bar.playing
    assert pl.ibr.time == 0


def test_it_plays_backward(pl, tmp_path):
    bar = time_bar(pl, 0, 0.25, loop=False, speed=-1)
    pl.show(auto_close=False)
    bar.play()
    assert pl.ibr.time == 0.25
    film(pl, tmp_path, 6)
    assert pl.ibr.time == 0


def test_what_code_plays_is_not_bent(pl, tmp_path):
    time_bar(pl, 0, 0.25)
    pl.show(auto_close=False)
    pl.ibr.play()
    film(pl, tmp_path, 6)
    pl.render()
    assert np.isclose(pl.ibr.time, 0.6)


def test_in_a_subplot_with_effects_it_is_as_sharp(hand):
    pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]))
    pl.subplot(0, 1)
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.Bloom(threshold=0.0, intensity=3.0))
    time_bar(pl, 0, 1)
    pl.show(auto_close=False)
    hand(pl).drag((SIZE[0] + at(0.5)[0], LOW))
    assert np.isclose(pl.ibr.time, 0.5, atol=0.01)
    pl.iren.interactor.SetKeySym('Escape')
    pl.iren.interactor.KeyPressEvent()
    hand(pl).move((SIZE[0] + at(0.5)[0], SIZE[1] - 5))  # what it is over is bright
    assert colour(pl, (SIZE[0] + at(0.5)[0], LOW)) == YELLOW
    picture = pl.screenshot(scale=2)
    assert picture[2 * (SIZE[1] - LOW), 2 * round(SIZE[0] + at(0.5)[0])].tolist() == YELLOW


def test_it_goes_before_what_takes_the_whole_scene(pl, hand):
    lens = pl.ibr.add(pvibr.DepthOfField())
    pick_focus(pl, lens)
    time_bar(pl, 0, 1)
    pl.add_mesh(pv.Plane(i_size=9, j_size=9), color='white')
    pl.view_xy()
    pl.camera.zoom(4)
    pl.show(auto_close=False)
    hand(pl).drag(at(0.5))
    assert np.isclose(pl.ibr.time, 0.5, atol=0.01)
    assert lens.distance is None
    hand(pl).drag((200, 100))
    assert lens.distance is not None


def test_coming_and_going(pl, hand):
    bar = time_bar(pl, 0, 1)
    pl.show(auto_close=False)
    bar.enabled = False
    hand(pl).keys('Tab', 'Right', 'space')
    hand(pl).drag(at(0.5))
    assert pl.ibr.time == 0
    assert not pl.ibr.playing
    bar.enabled = True
    hand(pl).drag(at(0.5))
    assert pl.ibr.time > 0
    bar.remove()
    bar.remove()
    assert not [p for p in pl.renderer.GetViewProps() if p.IsA('vtkActor2D')]
    again = time_bar(pl, 0, 1)
    pl.close()
    assert not again.enabled


@pytest.mark.parametrize('ends', [(1, 1), (2, 1), (0, np.inf), (np.nan, 1)])
def test_bad_ends_are_named(pl, ends):
    refused('start below stop', time_bar, pl, *ends)
    refused('callback = 1', time_bar, pl, 0, 1, kind=TypeError, callback=1)
