"""Pictures of the examples: for the gallery, and for the guides.

`python docs/pictures.py NAME ...` runs `examples/NAME.py` and writes `docs/images/NAME.jpg`, from
what the last plotter shows as it closes; or, of a name like `shadows_strip`, what that function of
`docs/strips.py` returns.
"""

from __future__ import annotations

import io
import re
import runpy
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyvista as pv
import strips
from PIL import Image

import pvibr

DOCS = Path(__file__).parent
WIDEST = 960
SAMPLES = 8  # of a pixel, unless the example accumulates more
URL = re.compile(r'http://(localhost|127[.]0[.]0[.]1):\d+/\S*')
_shown = []


def watch():
    """Keep the picture of every plotter as it closes."""
    pv.OFF_SCREEN = True
    pv.global_theme.before_close_callback = lambda pl: _shown.append(taken(pl))


def taken(plotter):
    """Return the picture that a plotter shows, with as many samples as its example asks for."""
    asked = (e.samples for e in plotter.ibr.effects if isinstance(e, pvibr.Accumulation))
    return plotter.ibr.screenshot(samples=next(asked, SAMPLES))


def save(picture, path):
    """Write a picture as JPEG, in full colour: pages with it stay light."""
    Image.fromarray(picture[..., :3]).save(path, quality=87, subsampling=0, optimize=True)


def scrape(_block, variables, conf):
    """Return what sphinx-gallery shows below a block: pictures of plotters that closed in it."""
    from sphinx_gallery.scrapers import figure_rst

    paths = []
    while _shown:
        paths.append(Path(next(variables['image_path_iterator'])).with_suffix('.jpg'))
        save(_shown.pop(0), paths[-1])
    return figure_rst([str(path) for path in paths], conf['src_dir'])


def _get_sg_image_scraper():
    """Return the scraper that this module is for sphinx-gallery."""
    watch()
    return scrape


def of_page(path):
    """Return the picture of an application's page in Chromium, with the settings of its sky."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, '-u', path, '--server', '--port', '0']
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        url = next(found[0] for line in server.stdout if (found := URL.search(line)))
        with sync_playwright() as driver:
            chromium = shutil.which('chromium') or shutil.which('chromium-browser')
            browser = driver.chromium.launch(executable_path=chromium, args=['--no-sandbox'])
            page = browser.new_page(viewport={'width': WIDEST, 'height': 540})
            page.goto(url)
            page.locator('img').wait_for()
            page.get_by_text('Sky', exact=True).click()
            page.wait_for_timeout(10_000)  # until the picture is of its size, and refined
            picture = Image.open(io.BytesIO(page.screenshot()))
            browser.close()
        server.send_signal(signal.SIGINT)
    return picture.convert('RGB')


def write(name):
    """Write the picture of an example, or a strip."""
    example = DOCS.parent / 'examples' / f'{name}.py'
    if name.endswith('_strip'):
        picture = Image.fromarray(getattr(strips, name)())
    elif name == 'panel':
        picture = of_page(example)
    else:
        runpy.run_path(str(example), run_name='__main__')
        picture = Image.fromarray(_shown[-1][..., :3])
    if picture.width > WIDEST:
        height = round(picture.height * WIDEST / picture.width)
        picture = picture.resize((WIDEST, height), Image.Resampling.LANCZOS)
    save(np.asarray(picture), DOCS / 'images' / f'{name}.jpg')


if __name__ == '__main__':
    watch()
    for name in sys.argv[1:]:
        write(name)
