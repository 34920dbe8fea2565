"""The control panel of a page, used with keys, mouse and fingers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.browser.accessibility import not_reached, problems, tree

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
pytestmark = pytest.mark.browser

APP = Path(__file__).parents[2] / 'examples' / 'panel.py'


@pytest.fixture(scope='module')
def served(start, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PVIBR_CONFIG', str(tmp_path_factory.mktemp('config')))
        yield start(str(APP), '--server', '--port', '0')


class Panel:
    """A page with a panel and a picture; one group is open."""

    def __init__(self, page, url, picture_of, until, plain=None):
        self.page, self._picture_of, self._until = page, picture_of, until
        page.set_viewport_size({'width': 700, 'height': 620})
        page.goto(url)
        page.wait_for_selector('img')
        self.plain = self.settled() if plain is None else plain
        if not self.group('Vignette').evaluate('group => group.open'):
            self.group('Vignette').locator('summary').press('Enter')

    def reset(self):
        self.page.get_by_role('button', name='Reset all').click()
        self.shows(self.plain)

    def group(self, title):
        """Find an effect's part of the panel."""
        return self.page.locator('details').filter(has=self.page.get_by_text(title, exact=True))

    def control(self, label, role='slider'):
        return self.group('Vignette').get_by_role(role, name=label, exact=True)

    @property
    def picture(self):
        return self._picture_of(self.page.locator('img')).astype(float)

    def settled(self):
        """Return the picture once it is the same twice."""
        seen = [self.picture]

        def same():
            seen.append(self.picture)
            return np.array_equal(*seen[-2:])

        self._until(same, every=0.3)
        return seen[-1]

    def shows(self, expected, near=1.5):
        """Wait for a picture."""
        self._until(lambda: np.abs(self.picture - expected).mean() <= near)

    def changed(self, since, far=3.0):
        """Wait for another picture, and return it."""
        self._until(lambda: np.abs(self.picture - since).mean() > far)
        return self.settled()


@pytest.fixture(scope='module')
def plain():
    """The picture with all defaults, as the first page has it."""
    return []


@pytest.fixture
def panel(page, served, picture_of, until, quiet, plain):
    quiet.append('405')  # wslink asks whether there is a launcher
    panel = Panel(page, served.url, picture_of, until, *plain)
    panel.reset()
    plain[:] = [panel.plain]
    return panel


def test_a_slider_by_keys_mouse_and_finger(panel):
    for move in (by_keys, by_mouse, by_finger):
        move(panel)
        panel.reset()


def by_keys(panel):
    slider = panel.control('intensity')
    slider.focus()
    panel.page.keyboard.press('End')
    dark = panel.changed(panel.plain)
    assert panel.control('intensity', 'textbox').input_value() == '1'
    panel.page.keyboard.press('Home')
    panel.changed(dark)
    assert panel.control('intensity', 'textbox').input_value() == '0'


def by_mouse(panel):
    box = panel.control('intensity').bounding_box()
    y = box['y'] + box['height'] / 2
    mouse = panel.page.mouse
    mouse.move(box['x'] + box['width'] / 2, y)
    mouse.down()
    for k in range(20):  # faster than pictures are drawn
        mouse.move(box['x'] + box['width'] * (0.5 + k / 38), y)
    mouse.up()
    panel.changed(panel.plain)
    assert float(panel.control('intensity', 'textbox').input_value()) > 0.9
    assert int(panel.control('intensity').input_value()) > 180


def by_finger(panel):
    session = panel.page.context.new_cdp_session(panel.page)
    session.send('Emulation.setTouchEmulationEnabled', {'enabled': True})
    box = panel.control('intensity').bounding_box()

    def touch(kind, share):
        point = {'x': box['x'] + share * box['width'], 'y': box['y'] + box['height'] / 2}
        points = [] if kind == 'touchEnd' else [point]
        session.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': points})

    touch('touchStart', 0.5)
    for share in (0.7, 0.9, 0.98):
        touch('touchMove', share)
    touch('touchEnd', 0)
    session.detach()
    panel.changed(panel.plain)
    assert float(panel.control('intensity', 'textbox').input_value()) > 0.9


def test_what_screen_readers_are_told(panel, until):
    """Names and values of all controls, what is wrong with a text, and that a picture is drawn."""
    assert problems(panel.page) == []
    assert not_reached(panel.page) == []
    zooms = panel.page.locator('meta[name=viewport]').get_attribute('content')
    assert 'maximum-scale' not in zooms
    slider = panel.control('intensity')
    assert (slider.get_attribute('aria-valuenow'), slider.get_attribute('aria-valuemax')) == (
        panel.control('intensity', 'textbox').input_value(),
        '1',
    )
    frame = panel.page.get_by_role('slider', name='interactive frame (ms)')
    assert frame.get_attribute('aria-valuetext') == '100 ms'
    told = {(n['role'], n['name']): n['value'] for n in tree(panel.page)}
    assert told['slider', 'interactive frame (ms)'] == pytest.approx(100)
    assert told['textbox', 'interactive frame (ms)'] == '100'
    # A sign and a fold need nobody's answer: they are there when the event is.
    at_once = """switched => {
        const root = switched.getRootNode(), group = switched.closest('details');
        switched.click();
        const signed = [...root.querySelectorAll('.sign')].map(sign => !sign.hidden);
        group.querySelector('summary').click();
        return [...signed, root.querySelector('[aria-busy=true]') !== null, !group.open];
    }"""
    switch = panel.group('Vignette').get_by_role('checkbox', name='Vignette on')
    assert switch.evaluate(at_once) == [True, True, True]
    panel.changed(panel.plain)
    until(lambda: not panel.page.locator('.sign').is_visible())
    panel.group('Vignette').locator('summary').press('Enter')
    switch.click()
    panel.shows(panel.plain)


def test_texts_switches_presets_and_colours(panel, until):
    field = panel.control('radius', 'textbox')
    field.fill('far')
    field.press('Enter')
    alert = panel.group('Vignette').get_by_role('alert').filter(has_text='must be')
    until(alert.count)
    assert "Vignette.radius must be a float in [0, 4], got 'far'" in alert.inner_text()
    assert field.input_value() == '0.4'
    field.fill('0.1')
    field.press('Enter')
    until(lambda: not alert.count())
    panel.changed(panel.plain)
    panel.reset()

    group = panel.group('Vignette')
    group.get_by_role('checkbox', name='Vignette on').click()
    without = panel.changed(panel.plain)
    group.get_by_role('checkbox', name='Vignette on').click()
    panel.shows(panel.plain)
    group.get_by_role('combobox', name='Preset of Vignette').fill('strong')
    group.get_by_role('button', name='Apply preset of Vignette').click()
    strong = panel.changed(panel.plain)
    assert strong.mean() < panel.plain.mean() < without.mean()
    group.locator('input[type=color]').fill('#ffffff')
    assert panel.changed(strong).mean() > without.mean()


def test_python_and_files_of_settings(panel, tmp_path, until):
    page = panel.page
    panel.control('intensity').press('End')
    dark = panel.changed(panel.plain)
    page.get_by_role('button', name='Copy as Python').click()
    code = page.get_by_role('textbox', name='Python')
    until(lambda: code.count() and 'intensity=1.0' in code.input_value())
    with page.expect_download() as download:
        page.get_by_role('button', name='Save').click()
    saved = Path(download.value.path()).read_text()
    assert json.loads(saved)['subplots']['0']['Vignette']['intensity'] == 1.0
    panel.reset()
    (tmp_path / 'look.json').write_text(saved)
    page.locator('input[type=file]').set_input_files(tmp_path / 'look.json')
    panel.shows(dark)
    (tmp_path / 'bad.json').write_text('{"time": NaN}')
    page.locator('input[type=file]').set_input_files(tmp_path / 'bad.json')
    status = page.get_by_role('status')
    until(lambda: 'not JSON written by pvibr' in status.inner_text())


def test_two_pages_agree(panel, served, picture_of, until):
    page = panel.page.context.new_page()
    other = Panel(page, served.url, picture_of, until, panel.plain)
    panel.control('intensity').press('End')
    panel.changed(panel.plain)
    until(lambda: other.control('intensity', 'textbox').input_value() == '1')
    other.page.set_viewport_size({'width': 420, 'height': 620})
    sides = 'i => [i.naturalWidth, i.naturalHeight, i.clientWidth, i.clientHeight]'
    both = panel, other

    def fit():
        found = [view.page.locator('img').evaluate(sides) for view in both]
        return all(sizes[:2] == sizes[2:] for sizes in found)

    # Each has a picture of its own size, also of a view that was turned in one of them.
    until(fit)
    before = [view.settled() for view in both]
    other.page.locator('img').press('ArrowLeft')
    for view, seen in zip(both, before, strict=True):
        view.changed(seen)
    until(fit)
    other.page.close()
