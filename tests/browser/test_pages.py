"""Pages that draw by themselves, opened from disk: what they show, and what they say."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import socket
import subprocess
import time

import imageio.v3 as imageio
import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.maths.flip import flip
from pvibr.scenes.walker import walker

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
    until(lambda: page.evaluate('!window.pvibr || pvibr.settled'), 240)
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
    mixed = pv.MultipleLines([[3, -3, 0.5], [3.5, -3, 1.5], [4, -3, 0.5]])
    for kind, shift in (('surface', 0), ('wireframe', 1), ('points', 2)):
        few = pv.Cube(center=(3, -2.5, 0.5 + shift), x_length=0.6, y_length=0.6, z_length=0.6)
        few = few.append_polydata(mixed)
        few.cell_data['cell'] = np.arange(few.n_cells)
        look = {'style': kind, 'point_size': 5, 'line_width': 3, 'show_scalar_bar': False}
        pl.add_mesh(few, scalars='cell', cmap='turbo', **look)
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
    assert flip_of(picture(page), here) < 0.03
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


@pytest.mark.parametrize('shift', [0, 4e6])
def test_parallel_views_far_from_the_origin(shift, page, tmp_path, until):
    pl = plotter()
    place = np.array([shift, -shift, 0])
    ring = pv.ParametricTorus().translate(place)
    ring['height'] = ring.points[:, 2]
    pl.add_mesh(ring, scalars='height', show_scalar_bar=False)
    pl.ibr.add_instances(pv.Cone(resolution=50), np.eye(3) * 2 + place, color='navy')
    pl.camera_position = [place + np.array([4, -6, 5]), place, (0, 0, 1)]
    pl.enable_parallel_projection()
    here = opened(page, pl, tmp_path / 'parallel.html', until)
    assert flip_of(picture(page), here) < 0.03
    pl.close()


def test_what_a_page_does_not_draw_itself_is_baked(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='tan')
    pl.ibr.add_spheres([[0, 0, 1], [1.5, 0, 1]], 0.6, colors=['red', 'blue'])
    pl.ibr.add_instances(pv.Cube(), [[-1.5, 0, 0.5]], color='green')
    pl.ibr.add(pvibr.Shadows())
    pl.add_light(pv.Light(position=(4, -3, 8), light_type='scene light'))
    here = opened(page, pl, tmp_path / 'baked.html', until)
    assert flip_of(picture(page), here) < 0.05
    pl.close()


def test_the_ground_is_in_the_page(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Sphere(), color='orange')
    pl.ibr.add(pvibr.Ground('navy'))
    here = opened(page, pl, tmp_path / 'ground.html', until)
    there = picture(page)
    assert flip_of(there, here) < 0.03
    np.testing.assert_allclose(there[-60:, ::60], here[-60:, ::60], atol=3)
    pl.close()


def annotated(pl):
    ball = pv.Sphere()
    ball['height'] = ball.points[:, 2]
    pl.add_mesh(ball, scalars='height', name='ball')
    pl.add_text('Corner', font_size=12)
    pl.add_text('Two\nlines', position=(30, 120), font_size=12, color='red')
    pl.add_point_labels([[0, 0, 0.5], [0, -0.5, 0]], ['north', 'south'], font_size=14)
    pl.add_legend([['first', 'red'], ['second', 'blue']])
    pl.add_axes()


def boxes(page, css):
    """Return text, left, top, width and height of elements."""
    return page.evaluate(
        """css => [...document.querySelectorAll(css)].map(e => {
          const b = e.getBoundingClientRect();
          return [e.textContent, b.left, b.top, b.width, b.height]})""",
        css,
    )


def test_text_bars_and_axes_are_where_they_are_here(page, tmp_path, until):
    pl = plotter()
    annotated(pl)
    here = opened(page, pl, tmp_path / 'texts.html', until)
    there = picture(page)
    assert flip_of(there, here) < 0.06  # the fonts are others
    texts = [box[0] for box in boxes(page, '.view svg text')]
    for text in ('Corner', 'Twolines', 'height', 'first', 'second', 'X', 'Y', 'Z', 'north'):
        assert text in texts
    # The red text covers the same pixels but for its font.
    red = [(p[..., 0] > 200) & (p[..., 1:] < 80).all(-1) for p in (here, there)]
    red = [mask[:, :150] for mask in red]
    places = [np.argwhere(mask) for mask in red]
    np.testing.assert_allclose(places[0].mean(0), places[1].mean(0), atol=4)
    pl.close()


def test_labels_that_surfaces_hide_are_hidden(page, tmp_path, until):
    pl = plotter()
    ball = pv.Sphere()
    pl.add_mesh(ball, color='orange')
    sides = {'front': (0, -0.5, 0), 'back': (0, 0.5, 0), 'top': (0, -0.1, 0.49)}
    names, places = list(sides), np.array(list(sides.values()))
    pl.add_point_labels(places, names, show_points=False)
    pl.camera_position = [(0, -3, 0.3), (0, 0, 0), (0, 0, 1)]
    opened(page, pl, tmp_path / 'hidden.html', until)

    def shown():
        return {text for text, *_, height in boxes(page, '[role=listitem]') if height}

    until(lambda: shown() == {'front', 'top'})
    page.evaluate('v => { window.pvibr.cameras[0].position = v; window.pvibr.moved() }', [0, 3, 0])
    until(lambda: shown() == {'back'})
    pl.close()


def test_subplots_are_linked_as_here(page, tmp_path, until):
    pl = plotter(shape=(1, 3))
    for column, color in enumerate(('red', 'green', 'blue')):
        pl.subplot(0, column)
        pl.add_mesh(pv.Cube(), color=color)
        pl.add_text(color, font_size=8)
    pl.link_views((0, 2))
    here = opened(page, pl, tmp_path / 'subplots.html', until)
    assert flip_of(picture(page), here) < 0.03
    before = picture(page)
    page.mouse.move(60, 200)
    page.mouse.down()
    page.mouse.move(100, 220, steps=4)
    page.mouse.up()
    until(lambda: not page.evaluate('window.pvibr.resting'))
    after = picture(page)
    pairs = zip(thirds(before), thirds(after), strict=True)
    moved = [np.abs(a.astype(int) - b).mean() for a, b in pairs]
    assert moved[0] > 1
    assert moved[2] > 1
    assert moved[1] == 0
    page.keyboard.press('r')
    pl.close()


def thirds(image):
    return np.split(image, 3, axis=1)


def test_a_drag_turns_as_vtk_does(page, tmp_path, until):
    pl = plotter()
    meshes(pl)
    opened(page, pl, tmp_path / 'turned.html', until)
    page.mouse.move(200, 200)
    page.mouse.down()
    page.mouse.move(248, 164)
    page.mouse.up()
    until(lambda: not page.evaluate('window.pvibr.resting'))
    style = pl.iren.interactor
    pl.iren.initialize()
    style.SetEventInformation(200, SIZE[1] - 1 - 200)
    style.LeftButtonPressEvent()
    style.SetEventInformation(248, SIZE[1] - 1 - 164)
    style.MouseMoveEvent()
    style.LeftButtonReleaseEvent()
    camera = page.evaluate('window.pvibr.cameras[0]')
    np.testing.assert_allclose(camera['position'], pl.camera.position, atol=0.2)
    pl.close()


def clicked(pl, page, thing, places):
    """Click in pvibr and in its page; return for each place the index in both, None for a miss."""
    pairs = []
    for x, y in places:
        hit = thing.pick(x, SIZE[1] - 1 - y)
        page.mouse.click(x + 0.5, y + 0.5)
        name, *rest = status(page).replace(',', '').split() or ['']
        index = int(rest[0]) if name == thing.name else None
        pairs.append((None if hit is None else hit.index, index))
        if index is not None:
            assert float(rest[-1]) == float(index)
    return pairs


def places_of(thing, pl, count):
    """Return pixels whose neighbours all show the same item or all show none."""
    shown = pl.screenshot(return_img=True).astype(int)
    random, places = np.random.default_rng(5), []
    while len(places) < count:
        x, y = random.integers((40, 120), (440, 340)).tolist()
        around = [(x + i, y + j) for i in (-2, 0, 2) for j in (-2, 0, 2)]
        hits = [thing.pick(i, SIZE[1] - 1 - j) for i, j in around]
        if len({None if hit is None else hit.index for hit in hits}) == 1:
            places.append((x, y))
    assert np.ptp(shown) > 100
    return places


@pytest.mark.parametrize('kind', ['instances', 'spheres', 'cylinders'])
def test_a_click_says_what_it_hits(kind, page, tmp_path, until):
    pl = plotter()
    values = {'scalars': np.arange(400.0), 'show_scalar_bar': False}
    if kind == 'instances':
        thing = cones(pl, **values)
    else:
        pl.add_mesh(pv.Plane(center=(0, 30, -0.5), i_size=80, j_size=90), color='tan')
        places = np.random.default_rng(3).uniform((-20, -5, 0), (20, 60, 0), (400, 3))
        ends = (places, np.add(places, (0, 0, 1.5))) if kind == 'cylinders' else (places,)
        del values['show_scalar_bar']
        thing = getattr(pl.ibr, f'add_{kind}')(*ends, 0.7, name='shapes', **values)
        pl.remove_scalar_bar() if pl.scalar_bars else None
        pl.camera_position = [(0, -14, 6), (0, 10, 0), (0, 0, 1)]
    opened(page, pl, tmp_path / 'picked.html', until)
    pairs = clicked(pl, page, thing, places_of(thing, pl, 12))
    assert [here for here, _ in pairs] == [there for _, there in pairs]
    assert sum(here is not None for here, _ in pairs) >= 4
    pl.close()


def test_colours_and_range_change_in_the_page(page, tmp_path, until):
    pl = plotter()
    annotated(pl)
    opened(page, pl, tmp_path / 'colours.html', until, '')
    before = picture(page)
    page.get_by_text('Settings').click()
    page.get_by_label('Colors').select_option('gray')
    page.get_by_label('To').fill('2')
    page.get_by_label('To').press('Enter')
    page.get_by_text('Settings').click()
    after = picture(page)
    ball = after[150:210, 210:270].astype(int)
    assert np.ptp(ball, axis=2).max() < 12
    assert np.ptp(before[150:210, 210:270].astype(int), axis=2).max() > 60
    assert any(box[0].strip() in ('2.00', '2.000', '2.0') for box in boxes(page, '.view svg text'))
    pl.close()


def test_a_file_that_is_cut_off_says_so(page, tmp_path, until, quiet):
    pl = plotter()
    meshes(pl)
    pl.show(auto_close=False)
    pl.ibr.export_html(tmp_path / 'whole.html')
    text = (tmp_path / 'whole.html').read_text(encoding='utf-8')
    at = text.index('data-chunk="1"') + 40
    flipped = text[:at] + ('B' if text[at] == 'A' else 'A') + text[at + 1 :]
    cut = [text[: int(share * len(text))] for share in (0.02, 0.3, 0.9)]
    for number, damaged in enumerate([*cut, flipped]):
        path = tmp_path / f'{number}.html'
        path.write_text(damaged, encoding='utf-8')
        page.goto(path.as_uri())
        until(lambda: re.search('damaged|incomplete', message(page)))
    pl.close()


def test_no_webgl_and_a_lost_context_are_said(page, tmp_path, until):
    pl = plotter()
    meshes(pl)
    opened(page, pl, tmp_path / 'lost.html', until)
    before = picture(page)
    page.evaluate("""() => { window.lose = window.pvibr.gl.getExtension('WEBGL_lose_context');
      window.lose.loseContext() }""")
    until(lambda: 'taken away' in message(page))
    page.evaluate('window.lose.restoreContext()')
    until(lambda: not message(page))
    assert np.abs(picture(page).astype(int) - before).mean() < 0.1
    page.add_init_script('HTMLCanvasElement.prototype.getContext = () => null')
    page.goto((tmp_path / 'lost.html').as_uri() + '#')
    page.reload()
    until(lambda: 'WebGL 2' in message(page))
    pl.close()


def test_fingers_turn_and_zoom(chromium, tmp_path):
    pl = plotter()
    meshes(pl)
    pl.show(auto_close=False)
    pl.ibr.export_html(tmp_path / 'touched.html')
    context = chromium.new_context(has_touch=True, viewport={'width': 480, 'height': 360})
    page = context.new_page()
    page.goto((tmp_path / 'touched.html').as_uri() + '#bare')
    page.wait_for_selector('html[data-state=drawn]')
    session = context.new_cdp_session(page)

    def touch(kind, *points):
        places = [{'x': x, 'y': y, 'id': i} for i, (x, y) in enumerate(points)]
        session.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': places})

    def position():
        return np.array(page.evaluate('window.pvibr.cameras[0].position'))

    center = np.array(pl.camera.focal_point)
    start = position()
    touch('touchStart', (200, 200))
    touch('touchMove', (240, 200))
    touch('touchMove', (280, 200))
    touch('touchEnd')
    turned = position()
    assert np.linalg.norm(turned - start) > 1
    distances = [np.linalg.norm(p - center) for p in (start, turned)]
    np.testing.assert_allclose(*distances, rtol=1e-3)
    touch('touchStart', (200, 200), (280, 200))
    touch('touchMove', (160, 200), (320, 200))
    touch('touchEnd')
    assert (
        np.linalg.norm(position() - page.evaluate('window.pvibr.cameras[0].focal_point'))
        < 0.7 * distances[0]
    )
    context.close()
    pl.close()


def test_axe_finds_nothing_critical(page, tmp_path, until):
    npm = shutil.which('npm')
    if npm is None:
        pytest.skip('needs npm')
    command = [npm, 'install', 'axe-core@4.14.1', '--no-audit', '--no-fund', '--prefix', tmp_path]
    try:
        subprocess.run(command, capture_output=True, timeout=60, check=True)
    except subprocess.SubprocessError as error:
        pytest.skip(f'needs a registry of npm packages: {error}')
    pl = plotter()
    annotated(pl)
    pl.ibr.add_animated(walker(), name='walker')  # there is a slider
    opened(page, pl, tmp_path / 'axe.html', until, '')
    page.get_by_text('Settings').click()
    # The page's policy allows no script but its own; the debugger's is not the page's.
    script = (tmp_path / 'node_modules/axe-core/axe.min.js').read_text(encoding='utf-8')
    page.evaluate(script)
    found = page.evaluate('axe.run().then(r => r.violations.map(v => [v.impact, v.id]))')
    assert not [row for row in found if row[0] in ('critical', 'serious')]
    pl.close()


class Firefox:
    """Firefox, told by WebDriver BiDi what to do."""

    def __init__(self, program, folder):
        websocket = pytest.importorskip('websocket')
        with socket.socket() as free:
            free.bind(('127.0.0.1', 0))
            port = free.getsockname()[1]
        (folder / 'user.js').write_text('user_pref("webgl.force-enabled", true);', 'utf-8')
        command = [
            program,
            '--headless',
            '--profile',
            folder,
            '--remote-debugging-port',
            str(port),
        ]
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        self.process = subprocess.Popen(command, **quiet)
        end = time.monotonic() + 60
        while True:
            try:
                self.socket = websocket.create_connection(
                    f'ws://127.0.0.1:{port}/session', suppress_origin=True, timeout=60
                )
                break
            except OSError:
                assert time.monotonic() < end, 'Firefox does not listen'
                time.sleep(0.2)
        self.tell('session.new', capabilities={})
        self.tab = self.tell('browsingContext.getTree')['contexts'][0]['context']

    def tell(self, method, **params):
        self.socket.send(json.dumps({'id': 1, 'method': method, 'params': params}))
        while (answer := json.loads(self.socket.recv())).get('id') != 1:
            pass
        assert answer['type'] == 'success', answer
        return answer['result']

    def evaluate(self, expression):
        target = {'target': {'context': self.tab}, 'awaitPromise': True}
        found = self.tell('script.evaluate', expression=expression, **target)
        return found['result'].get('value')

    def close(self):
        self.socket.close()
        self.process.terminate()
        self.process.wait(30)


def test_firefox_draws_the_same(tmp_path, until):
    program = shutil.which('firefox-esr') or shutil.which('firefox')
    if program is None:
        pytest.skip('needs Firefox: apt-get install firefox-esr')
    if not os.environ.get('DISPLAY'):
        pytest.skip('needs a display: without one, Firefox has no WebGL')
    pl = plotter()
    meshes(pl)
    pl.show(auto_close=False)
    here = pl.screenshot(return_img=True)
    pl.ibr.export_html(tmp_path / 'page.html')
    (tmp_path / 'profile').mkdir()
    firefox = Firefox(program, tmp_path / 'profile')
    try:
        view = {'viewport': {'width': SIZE[0], 'height': SIZE[1]}, 'devicePixelRatio': 1.0}
        firefox.tell('browsingContext.setViewport', context=firefox.tab, **view)
        address = f'{(tmp_path / "page.html").as_uri()}#bare'
        firefox.tell('browsingContext.navigate', context=firefox.tab, url=address, wait='complete')
        until(lambda: firefox.evaluate('document.documentElement.dataset.state'))
        assert firefox.evaluate("document.getElementById('message').textContent") == ''
        image = firefox.tell('browsingContext.captureScreenshot', context=firefox.tab)['data']
    finally:
        firefox.close()
    there = imageio.imread(io.BytesIO(base64.b64decode(image)))[..., :3]
    assert flip_of(there, here) < 0.04
    pl.close()


def test_a_notebooks_frame_draws(page, until):
    pl = plotter()
    pl.add_mesh(pv.Cube(), color='red')
    shown = pl.ibr.show_web(height=SIZE[1])
    page.set_viewport_size({'width': SIZE[0], 'height': SIZE[1]})
    page.set_content(f'<body style="margin: 0">{shown._repr_html_()}')
    state = 'document.documentElement.dataset.state'
    until(lambda: page.frames[-1].evaluate(state) == 'drawn')
    red = picture(page).astype(int)
    assert ((red[..., 0] > 100) & (red[..., 1] < 60)).mean() > 0.05
    pl.close()
