"""Pages of trame show what is drawn off screen, whatever is added, moved or resized."""

from __future__ import annotations

import contextlib
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.browser import everything

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
pytestmark = pytest.mark.browser

FOLDER = Path(__file__).parent
#: Mean difference of 8-bit colours that JPEG may make.
JPEG = 3.0


def difference(a, b):
    return np.abs(np.subtract(a, b, dtype=float)).mean() if a.shape == b.shape else np.inf


@pytest.fixture(autouse=True)
def _lighter(cache):
    with everything.lighter():
        yield


@pytest.fixture(scope='module')
def served(start):
    """The application."""
    return start(str(FOLDER / 'everything.py'), '--server', '--port', '0')


class View:
    """The view in a page, and the picture that it should show."""

    def __init__(self, page, program, picture_of, until):
        self.page, self._picture_of, self._until = page, picture_of, until
        page.set_viewport_size({'width': 480, 'height': 320})
        page.goto(program.url)
        page.wait_for_selector('img')

    def tell(self, name, *args):
        """Call a trigger of the application."""
        return self.page.evaluate(f'trame.trigger({json.dumps(name)}, {json.dumps(args)})')

    @property
    def picture(self):
        return self._picture_of(self.page.locator('img'))

    def shows(self, expected, bound=JPEG):
        """Wait until the page shows a picture; return how far it is from it."""
        seen = []

        def near():
            seen.append(difference(self.picture, expected))
            return seen[-1] <= bound

        with contextlib.suppress(AssertionError):
            self._until(near, 10)
        return min(seen)


@pytest.fixture
def view(page, served, picture_of, until, quiet):
    quiet.append('405')  # wslink asks whether there is a launcher
    return View(page, served, picture_of, until)


def off_screen(look, name, settings=None):
    """Return the picture of the same scene, drawn here."""
    pl = everything.plotter(size=look['size'])
    pl.camera_position = look['camera']
    pl.ibr.time = look['time']
    everything.show_only(pl, name)
    for key, value in (settings or {}).items():
        setattr(pl.ibr.effects[0], key, value)
    pl.show(auto_close=False)
    picture = pl.screenshot(return_img=True)
    pl.close()
    return picture


def test_everything_is_seen(view):
    """Each of pvibr's effects and things, as off screen, and not as without it."""
    look = view.tell('look')
    plain = off_screen(look, '')
    assert view.shows(plain) <= JPEG
    far = {}
    for name in everything.EVERYTHING:
        expected = off_screen(look, name)
        bound = min(JPEG, difference(expected, plain) / 3)
        view.tell('show', name)
        error = view.shows(expected, bound)
        if not error <= bound or view.tell('states') != ['ran']:
            far[name] = error, bound, view.tell('states')
    assert not far


def drag(view, start, end, steps=4):
    """Drag with the left button, positions as shares of the view."""
    box = view.page.locator('canvas').bounding_box()
    places = np.linspace(start, end, steps + 1) * [box['width'], box['height']]
    places += [box['x'], box['y']]
    mouse = view.page.mouse
    mouse.move(*places[0])
    mouse.down()
    for place in places[1:]:
        mouse.move(*place)
    mouse.up()


def settled(view, until):
    """Return how it is looked at once that has stood still."""
    looks = []

    def still():
        looks.append(view.tell('look'))
        return len(looks) > 2 and looks[-1] == looks[-2] == looks[-3]

    until(still, every=0.3)
    return looks[-1]


def test_twenty_interactions(view, until):
    """Drags, turns of the wheel and settings, after each of which the picture is right."""
    view.tell('show', 'Bloom')
    before = view.tell('look')
    rng = np.random.default_rng(1)
    for k in range(20):
        if k % 4 == 3:
            view.page.mouse.wheel(0, (-1) ** (k // 4) * 100)
        elif k % 4 == 1:
            view.tell('change', 'intensity', k / 20)
        else:
            start, way = rng.uniform(0.4, 0.6, 2), rng.uniform(-0.05, 0.05, 2)
            drag(view, start, start + way)
        if k % 5 == 4:
            look = settled(view, until)
            assert look['camera'] != before['camera']
            intensity = max(j for j in range(k + 1) if j % 4 == 1) / 20
            expected = off_screen(look, 'Bloom', {'intensity': intensity})
            assert view.shows(expected) <= JPEG
            before = look


@pytest.mark.parametrize('size', [(300, 420), (640, 200)])
def test_another_size_of_the_window(view, until, size):
    view.tell('show', 'DepthOfField')
    view.page.set_viewport_size(dict(zip(('width', 'height'), size, strict=True)))
    until(lambda: view.tell('look')['size'] == list(size))
    assert view.shows(off_screen(view.tell('look'), 'DepthOfField')) <= JPEG


def test_two_tabs_and_a_page_that_is_opened_again(view, served, picture_of, until):
    """Both show the same; one goes, is opened again, and shows what changed meanwhile."""
    view.tell('show', 'Outline')
    other = View(view.page.context.new_page(), served, picture_of, until)
    for name in ('Outline', 'Vignette'):
        view.tell('show', name)
        expected = off_screen(view.tell('look'), name)
        assert view.shows(expected) <= JPEG
        assert other.shows(expected) <= JPEG
    other.page.close()
    view.tell('show', 'Iris')
    expected = off_screen(view.tell('look'), 'Iris')
    assert view.shows(expected) <= JPEG
    other = View(view.page.context.new_page(), served, picture_of, until)
    assert other.shows(expected) <= JPEG


def test_time_goes_on_in_the_page(view, until):
    view.tell('show', 'FigureActor')
    begin = view.tell('look')['time']
    view.tell('play', 1.0)
    pictures = []

    def moved():
        pictures.append(view.picture)
        return sum(difference(a, b) > 0.2 for a, b in pairwise(pictures)) >= 3

    until(moved, every=0.2)
    view.tell('play', 0)
    look = view.tell('look')
    assert begin + 0.3 < look['time'] < begin + 30
    assert view.shows(off_screen(look, 'FigureActor'), 1.0) <= 1.0
    assert view.tell('look') == look
