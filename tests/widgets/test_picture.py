"""Pictures of plotters elsewhere: frames as they are, stills of other sizes, mouse and keys."""

import asyncio
from types import SimpleNamespace

import imageio.v3 as imageio
import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr_widgets.picture import Picture

SIZE = 96, 64
OTHER = 50, 90


def scene(size=SIZE):
    pl = pv.Plotter(off_screen=True, window_size=size)
    pl.add_mesh(pv.Cube(), color='tomato', show_edges=True)
    pl.enable_trackball_style()
    pl.camera_position = [(3, -4, 2), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    return pl


@pytest.fixture
def pl():
    pl = scene()
    yield pl
    pl.close()


@pytest.fixture
def picture(pl):
    picture = Picture(pl)
    pl.render_window.AddObserver('EndEvent', lambda *_: picture.count())
    return picture


def pixels(jpeg):
    return imageio.imread(jpeg).astype(float)


def test_the_frame_as_it_is_and_once(pl, picture):
    """Also one of lower quality, that a screenshot would draw again."""
    pl.render()
    assert np.abs(pixels(picture.jpeg()) - pl.screenshot(return_img=True)).mean() < 2
    pl.ibr.add(pvibr.Vignette())
    pl.ibr.interactive_frame_ms = 1e-3
    picture.point('press', 0.5, 0.5)
    for x in (0.55, 0.6, 0.65):
        picture.point('move', x, 0.5)
    assert pl.ibr.quality < 1
    frame, moving = picture.frame, picture.jpeg()
    assert (picture.frame, picture.jpeg()) == (frame, moving)
    picture.point('release', 0.65, 0.5)
    assert (pl.ibr.quality, picture.frame) == (1, frame + 1)


def test_a_still_of_another_size_leaves_the_window_alone(pl, picture):
    pl.render()
    frame, own = picture.frame, picture.jpeg()
    still = picture.jpeg(OTHER)
    other = scene(OTHER)
    assert np.abs(pixels(still) - other.screenshot(return_img=True)).mean() < 2
    other.close()
    assert (picture.frame, picture.size, picture.jpeg()) == (frame, SIZE, own)
    drawn = []
    pl.render_window.AddObserver('EndEvent', lambda *_: drawn.append(1))
    assert picture.jpeg(OTHER) == still
    assert drawn == []
    pl.camera.Azimuth(40)
    pl.render()
    assert picture.jpeg(OTHER) != still


def dragged(pl, picture, button, keys):
    """Return how a drag changed position, focal point and distance of the camera."""
    before = np.array(pl.camera_position[:2]), pl.camera.distance
    for action, x in (('press', 0.5), ('move', 0.6), ('release', 0.6)):
        picture.point(action, x, 0.5 + (x - 0.5) / 2, button, keys)
    moved = np.abs(np.array(pl.camera_position[:2]) - before[0]).max(1) > 1e-3
    return [*moved.tolist(), abs(pl.camera.distance - before[1]) > 1e-3]


@pytest.mark.parametrize(
    ('button', 'keys', 'expected'),
    [
        (0, '', [True, False, False]),  # turns
        (0, 's', [True, True, False]),  # pans
        (1, '', [True, True, False]),
        (2, '', [True, False, True]),  # zooms
    ],
)
def test_buttons_and_keys_are_those_of_windows(pl, picture, button, keys, expected):
    pl.render()
    assert dragged(pl, picture, button, keys) == expected


class Tab:
    """A tab of a page: it asks as `picture.js` does, once told."""

    def __init__(self, page, size):
        self._page, self._size, self._has, self.shown = page, size, None, None
        self.ask()

    def ask(self, action='', x=0.5):
        answer = self._page.ask(action, x, 0.5, 0, '', *self._size, self._has)
        self._has = answer['has']
        if answer['picture'] is not None:
            self.shown = pixels(answer['picture'])

    @property
    def fits(self):
        return self.shown.shape[1::-1] == self._size


class State(dict):
    """The state of a server, that tells tabs of changes."""

    tabs = ()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for tab in self.tabs:
            tab.ask()


@pytest.fixture
def page(pl, monkeypatch):
    from pvibr_widgets.model import Model
    from pvibr_widgets.pages import PagePicture

    monkeypatch.setattr('pvibr_widgets.pages._REST', 0.1)
    controller = SimpleNamespace(trigger=lambda _name: lambda function: function)
    return PagePicture(Model(pl), SimpleNamespace(state=State(), controller=controller))


def test_each_tab_has_its_size_at_rest(pl, page):
    """While one moves the other shows that; what converges after a still comes to an end."""
    frames = []
    pl.render_window.AddObserver('EndEvent', lambda *_: frames.append(1))
    pl.ibr.add(pvibr.Accumulation(samples=4))
    pl.camera.Azimuth(20)
    tabs = page._server.state.tabs = [Tab(page, SIZE), Tab(page, OTHER)]

    async def use():
        first, second = tabs
        first.ask('press')
        first.ask('move', 0.7)
        await asyncio.sleep(0.01)
        assert (first.fits, second.fits) == (True, False)
        assert np.array_equal(first.shown, second.shown)
        first.ask('release', 0.7)
        while not second.fits:
            await asyncio.sleep(0.02)
        count = -1
        while count < len(frames):
            count = len(frames)
            await asyncio.sleep(0.4)
        assert first.fits
        second.ask('enter')
        assert (second.fits, tuple(pl.window_size)) == (True, OTHER)
        pl.ibr.clear()

    asyncio.run(asyncio.wait_for(use(), 60))
    frames.clear()
    expected = tabs[1].shown
    pl.render()
    assert np.abs(expected - pl.screenshot(return_img=True)).mean() < 4
    assert page.ask('', 0, 0, 0, '', *OTHER, None)['picture']
    pl.close()
    assert page.ask('move', 0, 0, 0, '', *OTHER, None)['picture'] is None


def test_time_goes_on_in_all_tabs_and_stops(pl, page):
    """In the size of the tab used last; each has its own again once it stops."""
    tabs = page._server.state.tabs = [Tab(page, SIZE), Tab(page, OTHER)]

    async def play():
        pl.ibr.play()
        while pl.ibr.time < 0.2 or tabs[1].fits:
            await asyncio.sleep(0.02)
        assert tabs[0].fits
        assert np.array_equal(tabs[0].shown, tabs[1].shown)
        pl.ibr.stop()
        while not tabs[1].fits:
            await asyncio.sleep(0.02)

    asyncio.run(asyncio.wait_for(play(), 30))
