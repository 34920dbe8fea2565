"""A notebook as people have it: executed by itself, and in JupyterLab in Chromium."""

from __future__ import annotations

import base64
import io
import json
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import imageio.v3 as imageio
import pytest

from tests.browser import everything
from tests.browser.accessibility import not_reached, problems
from tests.browser.pages import JPEG, Reference, View, difference, pixels_of

for _name in ('trame_pyvista', 'nbclient', 'jupyterlab', 'anywidget'):
    if find_spec(_name) is None:  # imported where it is used: nbclient takes two seconds
        pytest.skip(f"needs {_name}: pip install 'pvibr[test]'", allow_module_level=True)

FOLDER = Path(__file__).parent
BEGIN = f"""
import sys
sys.path.insert(0, {str(FOLDER)!r})
import pyvista as pv
import everything
from everything import plotter, show_only
pl = plotter(size=(400, 300))
"""
STOP = """
import json, socket
from trame.app import get_server
pl.close()
server = get_server(pv.global_theme.trame.jupyter_server_name)
port = server.port
await server.stop()
json.dumps([server.running, bool(socket.socket().connect_ex(('127.0.0.1', port)))])
"""


def notebook(*cells):
    import nbformat

    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(c.strip()) for c in cells])
    made.metadata.kernelspec = {'name': 'python3', 'display_name': 'Python 3'}
    return made


@pytest.fixture(autouse=True)
def _own_folders(monkeypatch, tmp_path):
    """Have Jupyter read and write nothing of who runs the tests."""
    for name in ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR', 'IPYTHONDIR'):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    monkeypatch.setenv('JUPYTER_PLATFORM_DIRS', '1')


@pytest.fixture
def look():
    pl = everything.plotter(size=(400, 300))
    yield everything.view_of(pl)
    pl.close()


def test_executed(look):
    """A still picture, a server that plays, and nothing of both once it is stopped."""
    from nbclient import NotebookClient

    made = notebook(
        BEGIN,
        "show_only(pl, 'Vignette')\npl.show(jupyter_backend='static')",
        "pl.show(jupyter_backend='server')\npl.ibr.play()\npl.ibr.playing",
        STOP,
    )
    NotebookClient(made, timeout=120, kernel_name='python3').execute()
    # VTK may say that there is no display, in any cell.
    still, shown, ended = ([o for o in c.outputs if 'data' in o] for c in made.cells[1:])
    picture = imageio.imread(io.BytesIO(base64.b64decode(still[0].data['image/png'])))
    assert difference(picture, Reference().picture(look, 'Vignette')) <= 1
    assert 'iframe' in shown[0].data['text/plain']
    assert shown[1].data['text/plain'] == 'True'
    assert json.loads(ended[0].data['text/plain'].strip("'")) == [False, True]


class Lab:
    """A notebook in JupyterLab, whose cells are run one by one."""

    def __init__(self, page, url):
        self.page = page
        page.set_viewport_size({'width': 900, 'height': 900})
        page.goto(url)
        page.locator('.jp-Notebook-cell').first.wait_for(timeout=60_000)
        page.get_by_text('Python 3 (ipykernel) | Idle').wait_for(timeout=60_000)
        self._cell = 0

    def run(self):
        """Run the next cell to its end, and return its outputs."""
        cell = self.page.locator(f'.jp-Notebook-cell[data-windowed-list-index="{self._cell}"]')
        cell.locator('.jp-InputPrompt').click()
        self.page.keyboard.press('Shift+Enter')
        self._cell += 1
        cell.locator('.jp-InputPrompt', has_text=f'[{self._cell}]:').wait_for(timeout=60_000)
        warned = cell.locator('.jp-RenderedText[data-mime-type*=stderr]')
        # trame-vtklocal, where it is, looks for a file of its own in the network.
        assert [t for t in warned.all_inner_texts() if 'setup_wasm_directory' not in t] == []
        return cell.locator('.jp-Cell-outputArea')


@pytest.mark.browser
def test_in_the_browser(page, start, picture_of, until, quiet, tmp_path, look):
    """Cells are run; their pictures are right, follow cells and the mouse, play, and end."""
    import nbformat

    # Of the server that is stopped, to which pages connect again.
    quiet += ['405', 'connection not open', '^Object$', '^WebSocket .*ERR_CONNECTION_REFUSED']
    made = notebook(
        BEGIN + "options = {'add_menu': False}",
        "show_only(pl, 'DepthOfField')\npl.show(jupyter_backend='server', jupyter_kwargs=options)",
        "show_only(pl, 'Vignette')\npl.render()",
        'import json\nprint(json.dumps(everything.view_of(pl)))',
        "show_only(pl, 'AnimatedActor')\npl.ibr.play()",
        'pl.close()',
        "pl = plotter(size=(400, 300))\nshow_only(pl, 'Outline')\n"
        "pl.show(jupyter_backend='trame', jupyter_kwargs=options)",
        "pl.close()\npl = plotter(size=(400, 300))\nshow_only(pl, 'Sky')\n"
        "pl.show(jupyter_backend='static')",
        "show_only(pl, 'Vignette')\nimport pvibr_widgets\npvibr_widgets.panel(pl)",
        STOP.replace('json.dumps', 'print').replace('json, ', ''),
    )
    nbformat.write(made, tmp_path / 'a.ipynb')
    program = start(
        '-m',
        'jupyterlab',
        '--no-browser',
        '--allow-root',
        '--ServerApp.ip=127.0.0.1',
        '--ServerApp.port=0',
        '--IdentityProvider.token=',
        f'--ServerApp.root_dir={tmp_path}',
        '--LabApp.extension_manager=readonly',
        '--LabApp.news_url=None',
        own=False,
    )
    reference = Reference()
    lab = Lab(page, f'{program.url.removesuffix("lab")}doc/tree/a.ipynb')
    lab.run()

    def opened():
        return View(page, picture_of, until, lab.run().frame_locator('iframe'))

    view = opened()
    look['size'] = view.size
    assert view.shows(reference.picture(look, 'DepthOfField')) <= JPEG
    lab.run()
    assert view.shows(reference.picture(look, 'Vignette')) <= JPEG
    view.drag((0.5, 0.5), (0.6, 0.4))
    dragged = json.loads(lab.run().inner_text())
    assert dragged['camera'] != look['camera']
    assert view.shows(reference.picture(dragged, 'Vignette')) <= JPEG

    lab.run()
    pictures = []

    def moves():
        pictures.append(view.picture)
        return sum(difference(a, b) > 0.2 for a, b in pairwise(pictures)) >= 3

    until(moves, every=0.2)
    lab.run()
    view.drag((0.5, 0.5), (0.6, 0.4))  # what is closed hears of it no more

    assert opened().shows(reference.picture(look, 'Outline')) <= JPEG
    still = pixels_of(lab.run().locator('img'))
    look['size'] = still.shape[1::-1]
    assert difference(still, reference.picture(look, 'Sky')) <= 1
    panel_beside_the_picture(lab.run(), page, until)
    assert lab.run().inner_text().strip() == '[False, True]'


def panel_beside_the_picture(cell, page, until):
    """Each control is named, typing is not JupyterLab's, and the picture follows and turns."""
    image = cell.get_by_role('application')
    picture = [pixels_of(image)]

    def changes():
        if difference(pixels_of(image), picture[-1]) > 0.5:
            picture.append(pixels_of(image))
            return True
        return False

    assert problems(page) == []
    assert not_reached(page) == []
    image.press('Tab')  # keys go from the picture to the panel
    assert page.evaluate('document.activeElement.localName') == 'pvibr-panel'
    panel = cell.locator('pvibr-panel')
    group = panel.locator('details').filter(has=page.get_by_text('Vignette', exact=True))
    field = group.get_by_role('textbox', name='intensity', exact=True)
    cells = page.locator('.jp-Notebook-cell').count()
    field.fill('')
    field.press('0')  # JupyterLab's shortcuts would be of the notebook
    field.press('.')
    field.press('1')
    field.press('Enter')
    until(changes)
    slider = group.get_by_role('slider', name='intensity')
    until(lambda: slider.get_attribute('aria-valuetext') == '0.1')
    group.get_by_role('slider', name='intensity').press('Home')
    until(changes)
    assert page.locator('.jp-Notebook-cell').count() == cells
    image.press('ArrowLeft')
    until(changes)
    box = image.bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] * 0.7, box['y'] + box['height'] / 2, steps=4)
    page.mouse.up()
    until(changes)
