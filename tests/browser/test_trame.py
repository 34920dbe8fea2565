"""Pages of trame show what is drawn off screen, whatever is added, moved or resized."""

from __future__ import annotations

import contextlib
import json
import time
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
def served(start, chromium):
    """The application, which ends when its page says so."""
    program = start(str(FOLDER / 'everything.py'), '--server', '--port', '0')
    yield program
    page = chromium.new_page()
    page.goto(program.url)
    page.wait_for_function('!!window.trame?.trigger')
    page.evaluate('void trame.trigger("quit")')


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
        print(name, error, bound, view.tell('states'), time.time(), flush=True)
        if not error <= bound or view.tell('states') != ['ran']:
            far[name] = error, bound, view.tell('states')
    assert not far
