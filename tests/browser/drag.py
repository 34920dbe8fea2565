"""Measure a drag in Chromium: 1 500 instances of a heavy mesh with shadows, at 720x480.

``python -m tests.browser.drag`` prints drags of a page of `pvibr_widgets.trame_panel`, and of one
with PyVista's view. Wall-clock numbers need a quiet machine, those of the processor hardly do.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import imageio.v3 as imageio
import numpy as np
import pyvista as pv

import pvibr
from tests.browser.conftest import FLAGS
from tests.browser.pages import JPEG, difference

COUNT, SIZE, MOVES, SECONDS = 1500, (720, 480), 60, 3.0
#: Seconds without a picture after which none is expected.
QUIET = 3.0
#: How wide a page is whose picture is as wide as `SIZE`.
WIDTHS = {'panel': 1205, 'pyvista': 720}
#: Each picture that a page gets, with the time in milliseconds.
WATCH = """
window.got = [];
const make = URL.createObjectURL.bind(URL);
URL.createObjectURL = blob => { got.push([performance.timeOrigin + performance.now(), blob]);
                                return make(blob); };
"""
READ = """() => Promise.all(got.map(async ([at, blob]) =>
  [at / 1e3, [...new Uint8Array(await blob.arrayBuffer())]]))"""


def scene():
    """Return a plotter with bumpy balls above a floor."""
    ball = pv.Sphere(theta_resolution=200, phi_resolution=200)
    ball.points *= 1 + 0.1 * np.sin(20 * ball.points[:, 2:])
    side = int(np.ceil(COUNT**0.5))
    row, column = np.divmod(np.arange(COUNT), side)
    jitter = np.random.default_rng(0).uniform(-0.4, 0.4, (COUNT, 2))
    places = np.column_stack([2 * np.column_stack([column, row]) + jitter, np.full(COUNT, 0.5)])
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    pl.ibr.add_instances(ball, places, color='tan')
    floor = pv.Plane(center=(side, side, 0), i_size=3 * side, j_size=3 * side)
    pl.add_mesh(floor, color='white')
    pl.ibr.add(pvibr.Shadows())
    pl.camera_position = [(side, -1.5 * side, side), (side, side, 0), (0, 0, 1)]
    return pl


def serve(view):
    """Serve the scene until Ctrl+C; ``spent`` tells frames and processor seconds."""
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame_pyvista.ui import plotter_ui

    from pvibr_widgets import trame_panel

    pl, server, frames = scene(), get_server(client_type='vue3'), []
    with VAppLayout(server):
        if view == 'panel':
            trame_panel(pl, server, picture=True)
        else:
            plotter_ui(pl, mode='server', server=server, add_menu=False)
    pl.render_window.AddObserver('EndEvent', lambda *_: frames.append(pl.ibr.quality))
    server.trigger('spent')(lambda: [len(frames), time.process_time()])
    server.trigger('still')(lambda: list(still(pl)))
    server.start(port=0, open_browser=False)


def still(pl):
    """Return the view at full quality, as an encoded picture."""
    return imageio.imwrite('<bytes>', pl.screenshot(return_img=True), extension='.png')


def measure(page, sign) -> str:
    """Drag to the right or to the left; return what came of it."""
    page.evaluate('got.length = 0')
    begun = page.evaluate("trame.trigger('spent')")
    x, y = (side / 2 for side in SIZE)
    page.mouse.move(x, y)
    page.mouse.down()
    start = time.time()
    for k in range(1, MOVES + 1):
        page.mouse.move(x + 3 * sign * k, y + k % 20)
        time.sleep(max(0, start + SECONDS * k / MOVES - time.time()))
    released = time.time()
    page.mouse.up()
    wait_for_rest(page)
    got = [(at, bytes(blob)) for at, blob in page.evaluate(READ)]
    ended = page.evaluate("trame.trigger('spent')")
    final = imageio.imread(bytes(page.evaluate("trame.trigger('still')")))
    frames, spent = np.subtract(ended, begun)
    moving = len({blob for at, blob in got if at < released})
    errors = [difference(imageio.imread(blob), final) for _, blob in got]
    full = next(
        at for (at, _), error in zip(got, errors, strict=True) if error < min(errors) + 0.3
    )
    after = f'{full - released:.2f} s after release' if min(errors) <= JPEG else 'never'
    return (
        f'{moving / (released - start):.1f} pictures/s while dragged, the final one {after}; '
        f'{frames:.0f} frames drawn in {spent:.1f} processor seconds'
    )


def wait_for_rest(page):
    """Wait until no picture has come for some seconds."""
    seen = -1
    while (count := page.evaluate('got.length')) != seen:
        seen = count
        time.sleep(QUIET)


def main():
    """Measure one view after the other."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which('chromium'), args=FLAGS)
        for view, width in WIDTHS.items():
            command = [sys.executable, '-m', 'tests.browser.drag', '--serve', view]
            server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            url = next(m[0] for line in server.stdout if (m := re.search(r'http://\S+', line)))
            page = browser.new_page(viewport={'width': width, 'height': SIZE[1]})
            page.add_init_script(WATCH)
            page.goto(url)
            page.locator('img').wait_for(timeout=300_000)
            wait_for_rest(page)
            for sign in (1, -1, 1):
                row = f'{view}, load {os.getloadavg()[0]:.1f}: {measure(page, sign)}\n'
                sys.stdout.write(row)
                sys.stdout.flush()
            page.close()
            server.send_signal(signal.SIGINT)
            server.wait(60)
        browser.close()


if __name__ == '__main__':
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument('--serve', choices=WIDTHS)
    given, _ = asked.parse_known_args()
    serve(given.serve) if given.serve else main()
