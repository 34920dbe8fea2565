"""Pages that draw by themselves, opened from disk: what they show, and what they say."""

from __future__ import annotations

import io

import imageio.v3 as imageio
import numpy as np
import pytest
import pyvista as pv

from pvibr.maths.flip import flip

pytestmark = pytest.mark.browser

SIZE = (480, 360)
#: Samples a pixel that SwiftShader has.
SAMPLES = 4


def plotter(**options):
    pl = pv.Plotter(off_screen=True, window_size=SIZE, **options)
    pl.render_window.SetMultiSamples(SAMPLES)
    return pl


def opened(page, pl, path, until, hash_='#bare'):
    """Export a plotter, open the page, and return the picture of pvibr."""
    pl.show(auto_close=False)
    here = pl.screenshot(return_img=True)
    pl.ibr.export_html(path)
    show(page, path, until, hash_)
    return here


def show(page, path, until, hash_='#bare'):
    """Open a page from disk at the size of the plotter, without any request."""
    page.set_viewport_size({'width': SIZE[0], 'height': SIZE[1]})
    asked = []
    page.on('request', lambda r: asked.append(r.url))
    page.goto(f'{path.as_uri()}{hash_}')
    until(lambda: page.evaluate('document.documentElement.dataset.state'))
    assert not [url for url in asked if not url.startswith(('file:', 'data:', 'blob:'))]


def picture(page):
    """Return what a page shows after its next frame."""
    page.evaluate('new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))')
    return imageio.imread(io.BytesIO(page.screenshot()))[..., :3]


def flip_of(there, here):
    assert there.shape == here.shape
    return float(flip(there / 255, here / 255).mean())


def status(page):
    return page.evaluate("document.querySelector('.status').textContent")


def message(page):
    return page.evaluate("document.getElementById('message').textContent")


def meshes(pl):
    """Every way to colour a mesh."""
    pl.set_background('#405060', top='#8090a0')
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='tan')
    ball = pv.Sphere(center=(-1, -1, 1), radius=0.8)
    pl.add_mesh(ball, color='orange', smooth_shading=True, specular=0.5, name='ball')
    cube = pv.Cube(center=(1.5, -1, 0.6))
    cube.cell_data['side'] = np.arange(6.0)
    pl.add_mesh(cube, scalars='side', show_scalar_bar=False, show_edges=True)
    ring = pv.ParametricTorus(ringradius=0.7, crosssectionradius=0.25).translate((0, 1.5, 0.5))
    ring['height'] = ring.points[:, 2]
    pl.add_mesh(ring, scalars='height', show_scalar_bar=False, name='ring')
    pane = pv.Plane(center=(1.5, -2, 1), direction=(0, 1, 0), i_size=1.5, j_size=1.5)
    pl.add_mesh(pane, color='cyan', opacity=0.4)
    points = np.random.default_rng(0).uniform((-2, -2, 1), (2, 2, 5), (8, 3))
    pl.add_mesh(pv.Spline(points, 200), color='red', line_width=3)
    pl.add_mesh(points, color='white', point_size=6)
    spotted = pv.Sphere(center=(-2, 1.5, 1), radius=0.7)
    colors = np.random.default_rng(2).integers(0, 255, (spotted.n_points, 3), dtype=np.uint8)
    spotted['rgb'] = colors
    pl.add_mesh(spotted, scalars='rgb', rgb=True)
    map_ = pv.Plane(center=(-2.5, -2, 1), direction=(0, -1, 0), i_size=1.4, j_size=1.4)
    pl.add_mesh(map_, texture=pv.examples.load_globe_texture())
    pl.add_mesh(pv.Cone(center=(3, 1, 1)), style='wireframe', color='blue', line_width=2)
    cut = pl.add_mesh(pv.Sphere(center=(0, -3, 0.6), radius=0.5), color='pink')
    cut.mapper.AddClippingPlane(_plane((0, -3, 0.6), (0, 0, -1)))
    pl.camera_position = [(2, -11, 6), (0, 0, 0.5), (0, 0, 1)]


def _plane(origin, normal):
    from pvibr.core import _vtk

    plane = _vtk.vtkPlane()
    plane.SetOrigin(origin)
    plane.SetNormal(normal)
    return plane


def cones(pl, **options):
    """Cones that grow toward the eye: cards, and meshes of several levels."""
    mesh = pv.Cone(resolution=200, direction=(0, 0, 1)).triangulate().subdivide(2)
    places = np.random.default_rng(3).uniform((-20, -5, 0), (20, 60, 0), (400, 3))
    pl.add_mesh(pv.Plane(center=(0, 30, -0.5), i_size=80, j_size=90), color='tan')
    instances = pl.ibr.add_instances(mesh, places, name='cones', **options)
    pl.camera_position = [(0, -14, 6), (0, 10, 0), (0, 0, 1)]
    return instances


@pytest.mark.parametrize('lighting', ['light kit', 'three lights', 'scene'])
def test_meshes_look_as_here(lighting, page, tmp_path, until):
    pl = plotter(lighting='none' if lighting == 'scene' else lighting)
    meshes(pl)
    if lighting == 'scene':
        pl.add_light(pv.Light(position=(4, -3, 8), light_type='scene light', intensity=0.9))
        pl.add_light(pv.Light(light_type='headlight', intensity=0.3))
        spot = pv.Light(position=(0, 0, 5), positional=True, cone_angle=40, exponent=8)
        pl.add_light(spot)
    here = opened(page, pl, tmp_path / 'meshes.html', until)
    assert flip_of(picture(page), here) < 0.025
    pl.close()


@pytest.mark.parametrize('looks', ['plain', 'colors', 'scalars', 'some'])
def test_instances_look_as_here(looks, page, tmp_path, until):
    pl = plotter()
    random = np.random.default_rng(4)
    options = {
        'plain': {'color': 'green'},
        'colors': {'colors': random.integers(0, 255, (400, 3))},
        'scalars': {'scalars': random.random(400), 'cmap': 'plasma', 'show_scalar_bar': False},
        'some': {'color': 'orange'},
    }[looks]
    instances = cones(pl, **options)
    if looks == 'some':
        instances.visible = np.arange(400) % 3 > 0
    here = opened(page, pl, tmp_path / 'cones.html', until)
    assert flip_of(picture(page), here) < 0.03
    assert np.ptp(here.mean(2)) > 100
    pl.close()
