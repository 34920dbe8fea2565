"""The example of an application: its slider and its switch, used with mouse and keyboard."""

from __future__ import annotations

import runpy
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from tests.browser.pages import JPEG, difference

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
pytestmark = pytest.mark.browser

APP = Path(__file__).parents[2] / 'examples' / 'trame_app.py'


@pytest.fixture(scope='module')
def served(start):
    return start(str(APP), '--server', '--port', '0')


@pytest.fixture
def off_screen(monkeypatch, cache):
    """A function: what the application draws, of some size, with some strengths of bloom."""
    monkeypatch.setattr(pv.global_theme, 'anti_aliasing', pv.themes.Theme().anti_aliasing)

    def pictures(size, strengths):
        found = []

        def serve(_server, **_):
            (pl,) = pv.plotting.plotter._ALL_PLOTTERS.values()
            pl.window_size = size
            pl.show(auto_close=False)
            bloom = next(e for e in pl.ibr.effects if e.name == 'Bloom')
            for bloom.intensity in strengths:
                pl.render()
                found.append(pl.screenshot(return_img=True))

        monkeypatch.setattr('trame_server.Server.start', serve)
        runpy.run_path(str(APP))
        return found

    return pictures


def test_the_slider_is_followed_and_time_goes_on(
    page, served, picture_of, off_screen, until, quiet
):
    quiet.append('405')
    page.set_viewport_size({'width': 640, 'height': 440})
    page.goto(served.url)
    page.wait_for_selector('img')
    size = [round(page.locator('canvas').bounding_box()[side]) for side in ('width', 'height')]
    plain, bright = off_screen(size, (0.3, 1.0))

    def seen():
        return picture_of(page.locator('img'))

    def shows(right, wrong):
        picture = seen()
        return difference(picture, right) <= min(JPEG, difference(picture, wrong) / 2)

    until(lambda: shows(plain, bright))
    page.get_by_role('slider').focus()
    page.keyboard.press('End')
    until(lambda: shows(bright, plain))

    page.locator('input[type=checkbox]').click()
    pictures = []

    def moves():
        pictures.append(seen())
        return sum(difference(a, b) > 0.1 for a, b in pairwise(pictures)) >= 3

    until(moves, every=0.2)
    page.locator('input[type=checkbox]').click()
    until(lambda: np.array_equal(seen(), seen()), every=0.5)
