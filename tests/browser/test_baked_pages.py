"""What is baked, as a page that draws by itself and as a glTF file that a page reads."""

from __future__ import annotations

import shutil
import subprocess
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import numpy as np
import pytest
import pyvista as pv

import pvibr

pytestmark = pytest.mark.browser

SIZE = (480, 360)
#: Where a page of vtk.js looks for what is not there without a network.
_OFFLINE = 'ERR_NAME_NOT_RESOLVED|ERR_INTERNET_DISCONNECTED|ERR_CONNECTION|ERR_PROXY'
_PAGE = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
<body style="margin:0"><script type="importmap">{"imports": {
"three": "./node_modules/three/build/three.module.js",
"three/addons/": "./node_modules/three/examples/jsm/"}}</script><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
renderer.setSize(innerWidth, innerHeight);
renderer.setClearColor(0xffffff);
document.body.appendChild(renderer.domElement);
const gltf = await new GLTFLoader().loadAsync('scene.glb');
const scene = new THREE.Scene();
scene.add(gltf.scene);
const sun = new THREE.DirectionalLight(0xffffff, 0.8 * Math.PI);
sun.position.set(2, 5, 3);
scene.add(sun);
renderer.render(scene, gltf.cameras[0]);
document.title = 'drawn';
</script>"""


@pytest.fixture
def plotter():
    pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
    pl.set_background('white')
    pl.add_light(pv.Light(position=(2, -3, 5), light_type='scene light', intensity=0.8))
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='tan')
    pl.add_mesh(pv.Sphere(radius=0.8, center=(0, 0, 1)), color='orange', smooth_shading=True)
    pl.camera_position = [(5, -8, 5), (0, 0, 0), (0, 0, 1)]
    yield pl
    pl.close()


@pytest.fixture(scope='session')
def three(tmp_path_factory):
    """A folder with three.js in it."""
    npm = shutil.which('npm')
    if npm is None:
        pytest.skip('needs npm')
    folder = tmp_path_factory.mktemp('three')
    command = [npm, 'install', 'three@0.160.0', '--no-audit', '--no-fund', '--prefix', str(folder)]
    try:
        subprocess.run(command, capture_output=True, timeout=60, check=True)
    except subprocess.SubprocessError as error:
        pytest.skip(f'needs a registry of npm packages: {error}')
    return folder


def fill(pl):
    image = np.zeros((32, 32, 4), np.uint8)
    y, x = np.mgrid[:32, :32]
    image[..., 0], image[..., 1] = 255, 8 * y
    image[..., 3] = np.where((x - 16) ** 2 + (y - 16) ** 2 < 200, 255, 0)
    pl.ibr.add_billboards([[-2, -2, 0.5]], image)
    pl.ibr.add_spheres(
        [[2, 0, 0.4], [2.5, 1, 0.4]],
        0.4,
        scalars=[0.0, 1.0],
        cmap='viridis',
        show_scalar_bar=False,
    )
    pl.ibr.add_cylinders([[-2, 1, 0]], [[-2, 1, 1.5]], 0.3, color='red')
    pl.ibr.add(pvibr.Shadows())


def photo():
    image = np.zeros((16, 16, 3), np.uint8)
    image[:8, :8], image[8:, 8:], image[:8, 8:] = (255, 0, 0), (0, 0, 255), (200, 200, 0)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, -2, 6), (0, 0, 0), (0, 1, 0)
    return pvibr.Projector(image, camera)


def shot(page, picture_of, url, ready):
    """Return the picture of a page once it is ready and stays the same."""
    page.set_viewport_size({'width': SIZE[0], 'height': SIZE[1]})
    page.goto(url)
    page.wait_for_function(ready)
    last = picture_of(page)
    for _ in range(40):
        page.wait_for_timeout(250)
        now = picture_of(page)
        if np.array_equal(now, last) and now.std() > 1:
            return now.astype(int)
        last = now
    msg = 'the page does not come to rest, or is empty'
    raise AssertionError(msg)


def html_page(export, page, picture_of, files, quiet):
    quiet.append(_OFFLINE)
    export(files.folder / 'scene.html')
    ready = "document.querySelector('canvas') !== null"
    return shot(page, picture_of, f'{files.url}/scene.html', ready)


def baked(pl, **options):
    pl.show(auto_close=False)
    return pl.screenshot().astype(int), pl.ibr.to_plain_plotter(**options)


def test_a_page_that_draws_by_itself_shows_what_is_baked(plotter, page, picture_of, files, quiet):
    pytest.importorskip('trame_pyvista')
    fill(plotter)
    plotter.ibr.add(pvibr.Sky())
    here, made = baked(plotter)
    there = html_page(made.trame.export_html, page, picture_of, files, quiet)
    made.close()
    assert there.shape == here.shape
    assert np.abs(there - here).mean() < 3
    assert (np.abs(there - here).max(2) > 60).mean() < 0.02
    # Colours of things, and a shadow.
    for color in ((255, 0, 0), (68, 1, 84), (253, 231, 37)):
        near = np.abs(
            here / np.maximum(here.max(2, keepdims=True), 1) - np.array(color) / max(color)
        )
        assert ((near.max(2) < 0.1) & (np.abs(there - here).max(2) < 30)).sum() > 40


def test_a_page_shows_draped_pictures_and_outlines(plotter, page, picture_of, files, quiet):
    pytest.importorskip('trame_pyvista')
    plotter.ibr.add(photo())
    plotter.ibr.add(pvibr.Outline(color=(0, 1, 0)))
    here, made = baked(plotter, texture=256, triangles=40_000)
    there = html_page(made.trame.export_html, page, picture_of, files, quiet)
    made.close()
    assert np.abs(there - here).mean() < 5
    green = (there[..., 1] > 150) & (there[..., 0] < 100) & (there[..., 2] < 100)
    assert green.sum() > 150


def test_far_from_the_origin_a_page_shows_the_same(page, picture_of, files, quiet):
    pytest.importorskip('trame_pyvista')
    pictures = []
    centers, eye = np.array([[0, 0, 0], [2, 0, 0]]), np.array([5, -8, 5])
    for shift in (np.zeros(3), np.array([1e6, -1e6, 0])):
        pl = pv.Plotter(off_screen=True, window_size=SIZE)
        pl.ibr.add_spheres(centers + shift, 1.0, colors=[[255, 0, 0], [0, 0, 255]])
        pl.camera_position = [eye + shift, shift, (0, 0, 1)]
        _, made = baked(pl)
        pictures.append(html_page(made.trame.export_html, page, picture_of, files, quiet))
        made.close()
        pl.close()
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.5


def test_a_page_of_three_js_reads_the_glb(plotter, page, picture_of, three):
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    fill(plotter)
    plotter.ibr.add(photo())
    plotter.show(auto_close=False)
    here = plotter.screenshot().astype(int)
    plotter.ibr.export_glb(three / 'scene.glb', texture=256, triangles=40_000)
    (three / 'index.html').write_text(_PAGE, encoding='utf-8')
    with ThreadingHTTPServer(('127.0.0.1', 0), partial(Quiet, directory=three)) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        url = f'http://127.0.0.1:{server.server_port}/index.html'
        there = shot(page, picture_of, url, "document.title === 'drawn'")
        server.shutdown()
        thread.join()
    # Its light is computed otherwise: what is lit is as dark or bright within a tenth or so.
    assert np.abs(there - here).mean() < 10
    draped = (here[..., 0] > 240) & (here[..., 1] < 10) & (here[..., 2] < 10)
    assert draped.sum() > 100
    assert np.abs(there - here)[draped].mean() < 6  # without light it is the same
