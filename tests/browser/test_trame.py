"""Pages of trame show what is drawn off screen, whatever is added, moved or resized."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pvibr.api.plotter_component import IBRComponent
from pvibr.effects import ORDER
from tests.browser import everything
from tests.browser.pages import JPEG, Reference, View, difference

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
pytestmark = pytest.mark.browser

FOLDER = Path(__file__).parent


@pytest.fixture(autouse=True)
def _lighter(cache):
    with everything.lighter():
        yield


@pytest.fixture(scope='module')
def served(start):
    """The application."""
    return start(str(FOLDER / 'everything.py'), '--server', '--port', '0')


@pytest.fixture(scope='module')
def beside(start):
    """The application with two subplots, multisampled."""
    options = '--server --port 0 --columns 2 --multi-samples 4'
    return start(str(FOLDER / 'everything.py'), *options.split())


@pytest.fixture
def view(page, served, picture_of, until, quiet):
    quiet.append('405')  # wslink asks whether there is a launcher
    view = View.opened(page, served, picture_of, until)
    view.tell('begin')
    return view


@pytest.fixture
def off_screen():
    """A function: the picture that a page should show."""
    return Reference().picture


def test_nothing_is_left_out():
    """What users can add is in the scene: effects by their order, things by how they are added."""
    assert set(ORDER) - {'Substitute', 'Tap'} <= set(everything.EFFECTS)
    text = Path(everything.__file__).read_text()
    adding = [name for name in dir(IBRComponent) if name.startswith('add_')]
    assert [name for name in adding if f'.{name}(' not in text] == []


def test_everything_is_seen(off_screen, view):
    """Each of pvibr's effects and things, as off screen, and not as without it."""
    look = view.tell('look')
    plain = off_screen(look, '')
    assert view.shows(plain) <= JPEG
    far = {}
    for name in everything.EVERYTHING:
        if name in ('AmbientOcclusion', 'Accumulation'):
            continue  # what floats alone has none that JPEG would show; and edges alone are smooth
        expected = off_screen(look, name)
        bound = min(JPEG, difference(expected, plain) / 3)
        view.tell('show', name)
        error = view.shows(expected, bound)
        if not error <= bound or view.tell('states') != ['ran']:
            far[name] = error, bound, view.tell('states')
    assert not far


def test_a_still_page_converges(off_screen, view, until):
    """Frames come by themselves after a drag, until all samples are taken."""
    view.tell('show', 'Accumulation')
    before = view.tell('look')
    view.drag((0.4, 0.5), (0.5, 0.6))
    until(lambda: view.tell('details')[0]['samples'] == 64)
    look = view.tell('look')
    assert look['camera'] != before['camera']
    assert view.shows(off_screen(look, '')) <= JPEG


def settled(view, until):
    """Return how it is looked at once that has stood still."""
    looks = []

    def still():
        looks.append(view.tell('look'))
        return len(looks) > 2 and looks[-1] == looks[-2] == looks[-3]

    until(still, every=0.3)
    return looks[-1]


def test_twenty_interactions(off_screen, view, until):
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
            view.drag(start, start + way)
        if k % 5 == 4:
            look = settled(view, until)
            assert look['camera'] != before['camera']
            intensity = max(j for j in range(k + 1) if j % 4 == 1) / 20
            expected = off_screen(look, 'Bloom', intensity=intensity)
            assert view.shows(expected) <= JPEG
            before = look


@pytest.mark.parametrize('size', [(300, 420), (640, 200)])
def test_another_size_of_the_window(off_screen, view, size):
    view.tell('show', 'DepthOfField')
    view.resize(*size)
    assert view.shows(off_screen(view.tell('look'), 'DepthOfField')) <= JPEG


def test_two_tabs_and_a_page_that_is_opened_again(off_screen, view, served, picture_of, until):
    """Both show the same; one goes, is opened again, and shows what changed meanwhile."""
    view.tell('show', 'Outline')
    other = View.opened(view.page.context.new_page(), served, picture_of, until)
    for name in ('Outline', 'Vignette'):
        view.tell('show', name)
        expected = off_screen(view.tell('look'), name)
        assert view.shows(expected) <= JPEG
        assert other.shows(expected) <= JPEG
    other.page.close()
    view.tell('show', 'Iris')
    expected = off_screen(view.tell('look'), 'Iris')
    assert view.shows(expected) <= JPEG
    other = View.opened(view.page.context.new_page(), served, picture_of, until)
    assert other.shows(expected) <= JPEG


def test_time_goes_on_in_the_page(off_screen, view, until):
    view.tell('show', 'AnimatedActor')
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
    assert view.shows(off_screen(look, 'AnimatedActor'), 1.0) <= 1.0
    assert view.tell('look') == look


def test_ten_tabs_come_and_go_while_time_goes_on(off_screen, view, served, picture_of, until):
    """Most close before their first picture; the one that stays is right in the end."""
    view.tell('show', 'AnimatedActor')
    view.tell('play', 1.0)
    for k in range(10):
        tab = view.page.context.new_page()
        tab.set_default_timeout(180_000)
        tab.set_viewport_size({'width': 480, 'height': 320})  # a plotter has one size
        tab.goto(served.url, wait_until='commit' if k % 2 else 'load')
        if k in (0, 8):
            View(tab, picture_of, until)
        tab.close()
    begin = view.tell('look')['time']
    until(lambda: view.tell('look')['time'] > begin + 0.2)
    view.tell('play', 0)
    # A tab first asks for 400 x 400, which stays where it is closed before it asks for its own.
    view.resize(500, 330)
    look = view.tell('look')
    assert view.shows(off_screen(look, 'AnimatedActor'), 1.0) <= 1.0
    assert not re.search(r'Traceback|Error|ERR[|]', served.said), served.said


@pytest.mark.parametrize('name', ['Shadows', 'DepthOfField'])
def test_one_of_two_subplots_with_multisampling(page, beside, picture_of, until, quiet, name):
    quiet.append('405')
    view = View.opened(page, beside, picture_of, until)
    view.tell('show', name, 1)
    expected = Reference(shape=(1, 2), multi_samples=4).picture(view.tell('look'), name, column=1)
    assert view.shows(expected) <= JPEG
    assert view.tell('states') == ['ran']


def test_an_area_of_rca(page, start, picture_of, until, quiet):
    """The other kind of view that PyVista has: its own capture, which plays as well."""
    pytest.importorskip('trame_rca', reason="needs trame-rca: pip install 'trame-pyvista[rca]'")
    quiet.append('405')
    program = start(str(FOLDER / 'everything.py'), '--server', '--port', '0', '--rca')
    view = View.opened(page, program, picture_of, until)
    view.tell('show', 'Outline')
    assert view.shows(Reference().picture(view.tell('look'), 'Outline')) <= JPEG
    begin = view.tell('look')['time']
    view.tell('play', 1.0)
    until(lambda: view.tell('look')['time'] > begin + 0.2)
    view.tell('play', 0)


def test_ten_tabs_of_a_panel_come_and_go_while_time_goes_on(
    off_screen, page, start, picture_of, until, quiet
):
    """Each tab of this page has a size of its own; most close before their first picture."""
    quiet.append('405')
    program = start(str(FOLDER / 'everything.py'), '--server', '--port', '0', '--panel')
    view = View.opened(page, program, picture_of, until)
    view.tell('show', 'AnimatedActor')
    view.tell('play', 1.0)
    stayed = []
    for k in range(10):
        tab = page.context.new_page()
        tab.set_default_timeout(180_000)
        tab.set_viewport_size({'width': 400 + 30 * k, 'height': 500 - 20 * k})
        tab.goto(program.url, wait_until='commit' if k % 2 else 'load')
        if k in (0, 4, 8):
            stayed.append(View(tab, picture_of, until))
        if k not in (4, 8):
            tab.close()
    begin = view.tell('look')['time']
    until(lambda: view.tell('look')['time'] > begin + 0.2)
    view.tell('play', 0)
    shown = [view, *stayed[1:]]
    assert len({tuple(one.size) for one in shown}) == 3
    for one in shown:
        expected = off_screen(view.tell('look') | {'size': one.size}, 'AnimatedActor')
        assert one.shows(expected) <= JPEG
    assert not re.search(r'Traceback|Error|ERR[|]', program.said), program.said
