"""Files of pages: their size, what they lack, and what is refused."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.refusals import refused


@pytest.fixture
def plotter():
    pl = pv.Plotter(off_screen=True, window_size=(96, 64))
    pl.add_mesh(pv.Cube(center=(0, 0, -3)), color='gold', name='box')
    mesh = pv.Sphere(theta_resolution=60, phi_resolution=60)
    places = np.random.default_rng(0).uniform(-9, 9, (50, 3))
    pl.ibr.add_instances(mesh, places, name='balls', color='red', force_level='flat')
    yield pl
    pl.close()


def test_a_page_names_no_host(plotter, tmp_path):
    plotter.ibr.export_html(tmp_path / 'page.html')
    text = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert text.startswith('<!doctype html>')
    script = text[: text.index('data-chunk')].replace('http://www.w3.org/2000/svg', '')
    assert 'http' not in script.replace('http-equiv', '')


def test_smaller_tiles_keep_the_size_and_are_said(plotter, tmp_path):
    plotter.ibr.export_html(tmp_path / 'whole.html')
    size = (tmp_path / 'whole.html').stat().st_size / 1e6
    with pytest.warns(pvibr.PvibrWarning, match='tiles of images have 1/[24] of their side'):
        plotter.ibr.export_html(tmp_path / 'small.html', megabytes=0.6 * size)
    assert (tmp_path / 'small.html').stat().st_size <= 0.6e6 * size
    export, path = plotter.ibr.export_html, tmp_path / 'no.html'
    refused('megabytes must be at least', export, path, megabytes=0.02)
    refused('megabytes', export, path, megabytes=-1)
    assert not (tmp_path / 'no.html').exists()


def test_what_is_lost_is_said(plotter, tmp_path):
    plotter.add_volume(np.random.default_rng(0).integers(0, 9, (8, 8, 8), np.uint8), name='cloud')
    plotter.ibr.add_spheres([[0, 0, 3]], name='pearls')
    plotter.ibr.add(pvibr.DepthOfField())
    report = plotter.ibr.web_report('page')
    states = {row.effect: row.state for row in report.rows}
    shown = {'balls': 'shown', 'pearls': 'shown'}
    assert states == {'DepthOfField': 'lost', 'cloud': 'lost', **shown, **states}
    assert {row.effect for row in report.missing} == {'DepthOfField', 'cloud'}
    with pytest.warns(pvibr.PvibrWarning, match='not in the page: DepthOfField .*cloud'):
        plotter.ibr.export_html(tmp_path / 'page.html')


def test_instances_keep_their_levels_under_shadows(plotter):
    shadows = plotter.ibr.add(pvibr.Shadows())
    rows = {row.effect: row.what for row in plotter.ibr.web_report('page').rows}
    assert 'levels of detail' in rows['balls']
    assert 'one light' in rows[shadows.name]


def test_a_frame_for_notebooks(plotter):
    page = plotter.ibr.show_web(height=300)
    frame = page._repr_html_()
    assert frame.startswith('<iframe sandbox="allow-scripts"')
    assert 'height: 300px' in frame
    assert '<script' not in frame
    refused('height', plotter.ibr.show_web, height=0)


def test_the_plotter_is_as_before(plotter, tmp_path):
    plotter.show(auto_close=False)
    before = plotter.screenshot(return_img=True)
    plotter.ibr.export_html(tmp_path / 'page.html')
    np.testing.assert_array_equal(plotter.screenshot(return_img=True), before)
    plotter.close()
    with pytest.raises(pvibr.ClosedError):
        plotter.ibr.export_html(tmp_path / 'page.html')
