"""Scenes of the gallery as pages, against pvibr's own pictures of them."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
import pyvista as pv

import pvibr
from tests.browser.test_pages import SIZE, flip_of, picture, show
from tests.marks import slow

pytestmark = pytest.mark.browser

FOLDER = Path(__file__).parents[2] / 'examples'
#: Largest FLIP. What is lost shows: glow, depth of field, dashes of hidden lines.
SCENES = {
    'spheres': 0.01,
    'molecules': 0.03,
    'soft_shadows': 0.03,
    'key_frames': 0.03,
    'colours': 0.03,
    'effects_lines': 0.04,
    'effects_light': 0.08,
    'crowd': 0.05,
    'island': 0.04,
    'cells': 0.11,
}


#: Scenes that SwiftShader draws for a minute.
LARGE = 'cells', 'crowd', 'island', 'molecules'


def case(name):
    """Return a case that waits for the stress tests, or for the slow ones."""
    return pytest.param(name, marks=pytest.mark.stress) if name in LARGE else slow(name)


@pytest.mark.filterwarnings('ignore:not in the page:pvibr.PvibrWarning')
@pytest.mark.parametrize('name', [case(name) for name in SCENES])
def test_a_scene_of_the_gallery_looks_as_here(name, page, tmp_path, until, monkeypatch):
    here = []

    def export(pl):
        if here:
            return
        pl.window_size = SIZE
        pl.render_window.SetMultiSamples(4)
        pl.render()
        means = [e for e in pl.ibr.effects if isinstance(e, pvibr.Accumulation)]
        while any(mean.unfinished for mean in means):
            pl.render()
        here.append(pl.screenshot(return_img=True))
        pl.ibr.export_html(tmp_path / 'page.html')

    monkeypatch.setattr(pv, 'OFF_SCREEN', True)
    monkeypatch.setattr(pv.global_theme, '_before_close_callback', export)
    runpy.run_path(str(FOLDER / f'{name}.py'), run_name='__main__')
    show(page, tmp_path / 'page.html', until)
    assert flip_of(picture(page), here[0]) < SCENES[name]
