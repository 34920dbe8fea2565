"""Plotters of quadrics, and render passes to draw them in."""

from __future__ import annotations

import dataclasses

import numpy as np
import pyvista as pv

from pvibr.points.quadrics import Quadrics
from pvibr.things.frame import Frame

SIZE = (150, 90)
PASSES = {
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'msaa': lambda pl: pl.enable_anti_aliasing('msaa'),
    'peeling': lambda pl: pl.enable_depth_peeling(number_of_peels=12),
    'edl': lambda pl: pl.enable_eye_dome_lighting(),
    'ssao': lambda pl: pl.enable_ssao(radius=0.5),
    'glass': lambda pl: None,
}


def plotter(eye=(0, -6, 1), size=SIZE, light=None):
    """Return a plotter with one light, by default a headlight."""
    pl = pv.Plotter(off_screen=True, window_size=size, lighting='none')
    pl.disable_anti_aliasing()
    pl.set_background('black')
    pl.add_light(light or pv.Light(light_type='headlight'))
    aim(pl, eye)
    return pl


def aim(pl, eye, focus=(0, 0, 0), parallel=None, clip=None):
    pl.camera.position, pl.camera.focal_point, pl.camera.up = eye, focus, (0, 0.1, 1)
    if parallel:
        pl.camera.parallel_projection = True
        pl.camera.parallel_scale = parallel
    pl.renderer.ResetCameraClippingRange()
    if clip:
        pl.camera.clipping_range = clip


def floor_and_lamp():
    """Return a plotter with a floor, lit from above, and the floor."""
    pl = plotter(light=pv.Light(position=(0, 0, 10), light_type='scene light'))
    return pl, pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='white')


def pixels(pl, points):
    """Return columns and rows of points on the screen."""
    frame = Frame.of(pl.renderer)
    clip = np.c_[points, np.ones(len(points))] @ (frame.clip_from_view @ frame.view_from_world).T
    return ((clip[:, :2] / clip[:, 3:] * [1, -1] + 1) / 2 * SIZE).T.astype(int)


def points_up_to(largest, monkeypatch):
    """Have point sprites drawn up to a size in pixels, below 0 never."""

    def shape(items):
        return dataclasses.replace(items.geometry.shape, largest_sprite_px=largest)

    monkeypatch.setattr(Quadrics, 'shape', property(shape))
