"""A scene with any one of pvibr's effects and things, off screen or as a trame application.

``python everything.py --port 0 --server`` serves it; tests build the same off screen and compare.
The page's ``trame.trigger`` calls what :func:`serve` names.
"""

from __future__ import annotations

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr
from pvibr.animation import Clip, FigureMesh, Skeleton, Track

_Y, _X = np.mgrid[-1:1:64j, -1:1:64j]
_DISC = np.stack([200 + 0 * _X, 60 + 0 * _X, 150 + 0 * _X, 255.0 * (np.hypot(_X, _Y) < 0.9)], -1)
DISC = _DISC.astype(np.uint8)
STRIPES = np.where((np.arange(64) // 8 % 2)[:, None, None], [255, 220, 0], [0, 60, 160])
STRIPES = np.broadcast_to(STRIPES, (64, 64, 3)).astype(np.uint8)
RINGS = np.array([[x, y, 1.5] for x in (-1.5, 0, 1.5) for y in (-1.5, 0, 1.5)])
INVERT = 'vec4 effect(vec2 uv) { vec4 c = color_at(uv); return vec4(amount - c.rgb, c.a); }'


def _camera(position):
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = position, (0, 0, 0), (0, 1, 0)
    return camera


def _ball(pl):
    return pl.renderer.actors['ball']


def _figure():
    still = np.eye(4)[None, :, :]
    clip = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2]])])
    body = FigureMesh(
        pv.Sphere(radius=0.8, center=(0.6, -0.6, 0.5), theta_resolution=12, phi_resolution=12),
        node=0,
    )
    return pvibr.Figure([body], Skeleton([-1], still), [clip])


def _cone(pl):
    cone = pv.Cone(center=(0, 0, 2.5), height=3, radius=1, resolution=99)
    return pl.add_mesh(cone, name='wall', color='red')


def _wall():
    wall = pv.Plane(center=(0, 2, 1), direction=(0, -1, 0), i_size=2, j_size=4)
    wall.active_texture_coordinates = (wall.points[:, [0, 2]] / [4, 2] + [0.5, 0]).astype('f4')
    return wall


def _mirror(pl):
    mirror = pl.ibr.add(pvibr.Mirror((-2, 2, 0), (4, 0, 0), (0, 0, 2)))
    pl.add_mesh(_wall(), lighting=False, texture=mirror.texture, name='wall')


def _live(pl):
    live = pl.ibr.add(pvibr.LiveTexture(_camera((0, 0, 9)), size=(128, 128)))
    pl.add_mesh(_wall(), lighting=False, texture=live.texture, name='wall')


def _projectors(pl):
    pl.ibr.add(pvibr.Projector([STRIPES] * 2, [_camera((0, 0, 9)), _camera((3, 0, 8))]))


def _sample(name):
    return lambda pl: pl.ibr.add(getattr(pvibr, name).sample([_ball(pl)]))


def _add(name, *args, **settings):
    return lambda pl: pl.ibr.add(getattr(pvibr, name)(*args, **settings))


def _add_to_ball(name, **settings):
    return lambda pl: pl.ibr.add(getattr(pvibr, name)(_ball(pl), **settings))


#: What adds each of them to a plotter.
EFFECTS = {name: _sample(name) for name in pvibr.EFFECTS} | {
    'Shadows': _add('Shadows'),
    'Projector': _add('Projector', STRIPES, _camera((0, 0, 9))),
    'Projector, two images': _projectors,
    'Backdrop': _add('Backdrop', STRIPES),
    'DepthOfField': _add('DepthOfField', radius=1.0, distance=4.0),
    'Glow': _add_to_ball('Glow', intensity=4.0),
    'Afterglow': _add_to_ball('Afterglow', intensity=4.0),
    'Bloom': _add('Bloom', threshold=0.2, intensity=1.0),
    'ToneMapping': _add('ToneMapping', curve='aces', exposure=1.0),
    'Outline': _add('Outline', width=6.0),
    'ShaderEffect': _add('ShaderEffect', INVERT, amount=1.0),
    'ImageOverlay': _add('ImageOverlay', STRIPES, place=(0.1, 0.1, 0.4, 0.4)),
    'Vignette': _add('Vignette', intensity=1.0),
    'Flash': _add('Flash', at=0.2),
    'Iris': _add('Iris', opening=0.6),
    'LiveTexture': _live,
    'Mirror': _mirror,
}


def _photos(pl):
    K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
    camera = pvibr.Pinhole(K, np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 5.0], (2048, 1024))
    mesh = pv.Plane(center=(0, 0, 1), i_size=4, j_size=2, i_resolution=8, j_resolution=4)
    pl.ibr.add_photos(mesh, pvibr.Photo('a.jpg', camera, examples.mapfile))


def _large_mesh(pl):
    hill = pv.Sphere(radius=1.5, center=(0, 1, 1), theta_resolution=120, phi_resolution=120)
    hill['height'] = hill.points[:, 2]
    pl.ibr.add_large_mesh(hill, cmap='viridis', show_scalar_bar=False, cache=False)


THINGS = {
    'Instances': lambda pl: pl.ibr.add_instances(pv.Cone(resolution=24), RINGS, color='green'),
    'Billboards': lambda pl: pl.ibr.add_billboards(RINGS, DISC, size=0.9),
    'Spheres': lambda pl: pl.ibr.add_spheres(RINGS, 0.5, color='navy'),
    'Cylinders': lambda pl: pl.ibr.add_cylinders(RINGS, RINGS + np.eye(3)[2], 0.3, color='navy'),
    'Ellipsoids': lambda pl: pl.ibr.add_ellipsoids(RINGS, (0.6, 0.4, 0.2), color='navy'),
    'Impostor': lambda pl: pl.ibr.add_impostor(_cone(pl)),
    'ImageLayers': lambda pl: pl.ibr.add_image_layers([_cone(pl)]),
    'AnimatedActor': lambda pl: pl.ibr.add_animated(_figure(), clip='rise'),
    'Crowd': lambda pl: pl.ibr.add_animated(_figure(), RINGS, clip='rise', max_error=8),
    'PhotoMesh': _photos,
    'LargeMesh': _large_mesh,
}
EVERYTHING = EFFECTS | THINGS


def lighter():
    """Return what makes bakes take less time, while it is entered."""
    return mock.patch.multiple('pvibr.figures.pose_atlas', VIEWS=6, TILES=(32,))


def base(pl):
    """Put in what there always is: a ball over a floor, a light, a cloud of a volume, a text."""
    pl.set_background('#405060', top='#8090a0')
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='tan', name='floor')
    ball = pv.Sphere(center=(-1, -1, 1), radius=0.8)
    pl.add_mesh(ball, color='orange', smooth_shading=True, name='ball')
    pane = pv.Plane(center=(1.5, -2, 1), direction=(0, 1, 0), i_size=1.5, j_size=1.5)
    pl.add_mesh(pane, color='cyan', opacity=0.4, name='pane')
    pl.add_text('Text', font_size=12)
    pl.add_light(pv.Light(position=(4, -3, 8), light_type='scene light', intensity=0.7))


def begin(pl):
    """Look at each subplot from where one begins, at the time that shows everything."""
    for renderer in pl.renderers:
        renderer.camera_position = [(2, -11, 6), (0, 0, 0.5), (0, 0, 1)]
    pl.ibr.time = 0.4


def show_only(pl, name):
    """Have one of them in the active subplot of a plotter; none where the name is empty."""
    pl.ibr.clear()
    pl.remove_actor('wall', render=False)
    if name:
        EVERYTHING[name](pl)


def plotter(shape=(1, 1), size=(480, 320), multi_samples=0):
    """Return a plotter with the scene in each of its subplots."""
    pl = pv.Plotter(off_screen=True, shape=shape, window_size=size, lighting='light kit')
    pl.render_window.SetMultiSamples(multi_samples)
    for place in np.ndindex(*shape):
        pl.subplot(*place)
        base(pl)
    pl.subplot(0, 0)
    begin(pl)
    return pl


def view_of(pl):
    """Return what makes another plotter's picture the same."""
    camera = pl.camera
    looks = [camera.position, camera.focal_point, camera.up]
    return {'camera': np.array(looks).tolist(), 'size': list(pl.window_size), 'time': pl.ibr.time}


def serve():
    """Serve it until Ctrl+C."""
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame_pyvista.ui import plotter_ui

    server = get_server(client_type='vue3')
    server.cli.add_argument('--columns', type=int, default=1)
    server.cli.add_argument('--multi-samples', type=int, default=0)
    server.cli.add_argument('--rca', action='store_true')
    server.cli.add_argument('--panel', action='store_true')
    asked, _ = server.cli.parse_known_args()
    pl = plotter((1, asked.columns), multi_samples=asked.multi_samples)
    with VAppLayout(server):
        if asked.rca:
            from trame_pyvista.widgets import PyVistaRCAView

            view = PyVistaRCAView(pl, style='width: 100%; height: 100%')
            view.update = view.render
            pl.add_on_render_callback(lambda _: view.render(), render_event=False)
        elif asked.panel:
            from pvibr_widgets import trame_panel

            trame_panel(pl, server, picture=True)
            view = SimpleNamespace(update=pl.render)
        else:
            view = plotter_ui(pl, mode='server', add_menu=False)

    @server.trigger('begin')
    def again():
        begin(pl)
        show_only(pl, '')
        view.update()

    @server.trigger('show')
    def show(name, column=0):
        pl.subplot(0, column)
        show_only(pl, name)
        view.update()

    @server.trigger('change')
    def change(setting, value):
        setattr(pl.ibr.effects[0], setting, value)
        view.update()

    @server.trigger('play')
    def play(speed):
        pl.ibr.play(speed) if speed else pl.ibr.stop()

    server.trigger('look')(lambda: view_of(pl))
    server.trigger('details')(lambda: [row.details for row in pl.ibr.report().rows])
    server.trigger('states')(lambda: [row.state for row in pl.ibr.report().rows])
    server.start()
    pl.close()


if __name__ == '__main__':
    with lighter():
        serve()
