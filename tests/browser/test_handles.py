"""The bar for the time in a page: by mouse, by finger and by keys."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
pytestmark = pytest.mark.browser

APP = """
import pyvista as pv
from trame.app import get_server
from trame.ui.vuetify3 import VAppLayout
from trame.widgets import html
from trame_pyvista.ui import plotter_ui

from pvibr_widgets import page_keys, time_bar

pl = pv.Plotter(off_screen=True, window_size=(400, 300))
pl.add_mesh(pv.Sphere())
time_bar(pl, 0, 1, speed=0.3)
server = get_server(client_type='vue3')
with VAppLayout(server), html.Div(style='height: 100vh'):
    plotter_ui(pl, mode='server', add_menu=False, **page_keys(pl))
server.start()
pl.close()
"""
LOW, LEFT, BEYOND = 24, 60, 24
DONE = (255, 205, 60)


@pytest.fixture(scope='module')
def served(start, tmp_path_factory):
    path = tmp_path_factory.mktemp('app') / 'app.py'
    path.write_text(APP)
    return start(str(path), '--server', '--port', '0')


def shown(picture):
    """Return how much of the bar is done."""
    row = picture[picture.shape[0] - LOW].astype(int)
    done = np.abs(row - DONE).max(axis=1) < 60
    return (np.flatnonzero(done).max(initial=LEFT) - LEFT) / (len(row) - BEYOND - LEFT)


def test_mouse_finger_and_keys_set_the_time(page, served, picture_of, until, quiet):
    quiet.append('405')
    page.set_viewport_size({'width': 640, 'height': 440})
    page.goto(served.url)
    page.wait_for_selector('img')

    def is_at(share):
        return abs(shown(picture_of(page.locator('img'))) - share) < 0.08

    def at(share):
        box = page.locator('img').bounding_box()
        x = LEFT + share * (box['width'] - BEYOND - LEFT)
        return box['x'] + x, box['y'] + box['height'] - LOW

    until(lambda: is_at(0))
    page.mouse.move(*at(0.5))
    page.mouse.down()
    page.mouse.move(*at(0.7), steps=3)
    page.mouse.up()
    until(lambda: is_at(0.7))
    finger = page.context.new_cdp_session(page)
    for kind, share in (('Start', 0.7), ('Move', 0.5), ('Move', 0.3), ('End', None)):
        points = [] if share is None else [dict(zip('xy', at(share), strict=True))]
        finger.send('Input.dispatchTouchEvent', {'type': f'touch{kind}', 'touchPoints': points})
    until(lambda: is_at(0.3))

    page.mouse.move(*at(0.3))
    for _ in range(3):
        page.keyboard.press('PageUp')
    until(lambda: is_at(0.6))
    for key in ('Escape', '.', 'End'):
        page.keyboard.press(key)
    until(lambda: is_at(1))
    page.keyboard.press(' ')
    page.keyboard.press('Escape')
    until(lambda: is_at(0.2))
    until(lambda: is_at(0.6))
    page.keyboard.press(' ')
