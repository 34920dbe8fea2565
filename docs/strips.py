"""Strips: one scene under a setting from low to high, for the guides.

`python docs/pictures.py shadows_strip` writes `docs/images/shadows_strip.jpg` from
:func:`shadows_strip`.
"""

from __future__ import annotations

from unittest import mock

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr
from pvibr.capture.adaptive_quality import Budget
from pvibr.capture.montage import compose

SIZE = 320, 240  # of a picture
SAMPLES = 4
SHINY = {'smooth_shading': True, 'specular': 0.5, 'specular_power': 30}


def strip(plotter, name, values, change):
    """Return captioned pictures of a plotter, one for each value of a setting."""

    def picture(value):
        taken = change(value)
        return plotter.ibr.screenshot(samples=SAMPLES) if taken is None else taken

    pictures = [(picture(v)[..., :3] / 255, f'{name} = {v!r}') for v in values]
    plotter.close()
    return compose(pictures, len(values))


def setting(thing, name):
    """Return a function that changes a setting."""
    return lambda value: setattr(thing, name, value)


def table(**look):
    """Return a plotter with things on a ground, and its look."""
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    cup = pv.Cylinder(center=(0, 0, 0.8), direction=(0, 0, 1), height=1.6, radius=0.6)
    pl.add_mesh(cup, color='#c9b79c', smooth_shading=True, split_sharp_edges=True)
    pl.add_mesh(pv.Sphere(radius=0.7, center=(1.8, -0.5, 0.7)), color='#b5533c', **SHINY)
    pl.add_mesh(pv.Cube(center=(-1.5, 1.4, 0.8), x_length=1.2, z_length=1.6), color='#3f6f8a')
    pl.add_mesh(
        pv.ParametricTorus(0.6, 0.2).translate((-1.2, -1.2, 0.2)), color='#d9a441', **SHINY
    )
    pl.camera_position = [(2.5, -8.5, 4.2), (0.2, 0, 0.6), (0, 0, 1)]
    pl.camera.view_angle = 30
    return pl, pl.ibr.look('studio', **look)


def shadows_strip():
    """Show the size of the sun."""
    pl, look = table()
    return strip(pl, 'angle', (0.5, 3.0, 10.0, 30.0), setting(look.effects['Shadows'], 'angle'))


def occlusion_strip():
    """Show how far corners are searched."""
    pl, look = table()
    occlusion = look.effects['AmbientOcclusion']
    occlusion.strength = 1.5
    return strip(pl, 'radius', (0.1, 0.5, 1.5, 4.0), setting(occlusion, 'radius'))


def lens_strip():
    """Show how wide a lens is open."""
    pl, _ = table()
    lens = pl.ibr.add(pvibr.DepthOfField(distance=8.6))
    return strip(pl, 'radius', (0.0, 0.1, 0.3, 0.8), setting(lens, 'radius'))


def bloom_strip():
    """Show how much light spreads."""
    pl, _ = table()
    pl.add_mesh(pv.Sphere(radius=0.3, center=(0, 0, 2.1)), color='#ffe9b0', lighting=False)
    pl.ibr.look('dusk')
    bloom = pl.ibr.add(pvibr.Bloom(0.8))
    return strip(pl, 'intensity', (0.0, 0.3, 1.0, 3.0), setting(bloom, 'intensity'))


def fog_strip():
    """Show how far one sees in fog."""
    pl, _ = knots(SIZE)
    pl.ibr.look('daylight')
    fog = pl.ibr.add(pvibr.Fog(1e4))
    return strip(pl, 'visibility', (2000.0, 300.0, 120.0, 50.0), setting(fog, 'visibility'))


def knots(size=SIZE, count=400):
    """Return a plotter with heavy knots to the horizon, and their handle."""
    t = np.linspace(0, 2 * np.pi, 300)
    ring = (2 + np.cos(3 * t)) * np.exp(2j * t)
    line = pv.Spline(np.c_[ring.real, ring.imag, np.sin(3 * t)], 400)
    pl = pv.Plotter(off_screen=True, window_size=size)
    side = int(np.sqrt(count))
    places = np.stack([*np.divmod(np.arange(side**2), side), np.zeros(side**2)], 1) * 9.0
    mesh = line.tube(radius=0.45, n_sides=30)
    made = pl.ibr.add_instances(mesh, places, color='#c58f3d', smooth_shading=True)
    pl.camera_position = [(-22, -26, 20), (40, 40, -12), (0, 0, 1)]
    return pl, made


def error_strip():
    """Show how far outlines may be off."""
    pl, made = knots()
    return strip(pl, 'max_error', (1.0, 8.0, 32.0, 128.0), setting(made, 'max_error'))


def quality_strip():
    """Show what a moving view is reduced to."""
    pl, _ = knots()
    pl.ibr.look('studio')
    pl.show(auto_close=False)
    pl.ibr.interactive_frame_ms = 1e9
    pl.render_window.SetDesiredUpdateRate(30.0)

    def drag(value):
        with mock.patch.object(Budget, 'quality', value):
            pl.render()
        return pl.image

    return strip(pl, 'quality', (1.0, 0.5, 0.25, 0.0625), drag)


def impostors_strip():
    """Show images that are kept while the eye moves on."""
    rng = np.random.default_rng(0)
    knot = pv.ParametricTorus(ringradius=3, u_res=80, v_res=40).scale(2)
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    tints = '#b5533c', '#d9a441', '#5f7a4f', '#3f6f8a'
    actors = [
        pl.add_mesh(knot.rotate_x(k * 40).translate(p), color=tints[k % 4], smooth_shading=True)
        for k, p in enumerate(rng.uniform(-14, 14, (12, 3)))
    ]
    pl.camera_position = [(0, -70, 20), (0, 0, 0), (0, 0, 1)]
    images = pl.ibr.add_impostor(actors, only_if_faster=False)

    def turn(value):
        images.max_error = value
        pl.camera.azimuth = -40.0
        for _ in range(20):
            pl.camera.azimuth += 2.0
            pl.render()

    return strip(pl, 'max_error', (0.5, 2.0, 4.0, 8.0), turn)


def layers_strip():
    """Show the blur of the layer behind."""
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    hills = [pl.add_mesh(examples.load_random_hills(), color='#6f7f45', smooth_shading=True)]
    near = [
        pl.add_mesh(pv.Sphere(radius=0.8, center=(x, -22, 7.9)), color='#b5533c', **SHINY)
        for x in (-3, 0, 3)
    ]
    pl.set_background('#eef3f8', top='#9dbfe0')
    pl.camera_position = [(0, -31, 12), (0, 0, 2.5), (0, 0, 1)]
    layers = pl.ibr.add_image_layers([near, hills], only_if_faster=False)
    return strip(pl, 'blur', ((0, 0), (0, 2), (0, 5), (0, 12)), setting(layers, 'blur'))


def feather_strip():
    """Show how softly a photograph ends."""
    pl, _ = table()
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (2, -9, 7), (0, 0, 0.5), (0, 0, 1)
    camera.view_angle = 32
    image = pl.ibr.add(pvibr.Projector(examples.mapfile, camera))
    return strip(pl, 'feather', (0.0, 0.1, 0.25, 0.5), setting(image, 'feather'))
