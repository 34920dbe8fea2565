"""Depth of field against an accumulation of pictures from points of the lens."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.effects.depth_of_field import DepthOfField
from pvibr.maths.kernels import vogel_disk


def stage(size=(640, 480)):
    """Return a plotter that shows five spheres in a row away from the camera, over a floor."""
    pl: Any = pv.Plotter(off_screen=True, window_size=size)
    pl.disable_anti_aliasing()
    pl.set_background('#405060')
    floor = pv.Plane(center=(0, 0, -0.5), i_size=30, j_size=30, i_resolution=30, j_resolution=30)
    floor.cell_data['odd'] = np.indices((30, 30)).sum(axis=0).ravel() % 2
    looks: dict[str, Any] = {
        'cmap': ['#808080', '#c0b090'],
        'lighting': False,
        'show_scalar_bar': False,
    }
    pl.add_mesh(floor, scalars='odd', **looks)
    for k, color in enumerate(['red', 'gold', 'teal', 'orchid', 'white']):
        ball = pv.Sphere(radius=0.5, center=(0.8 * k - 1.2, 3.0 - 1.8 * k, 0))
        pl.add_mesh(ball, color=color, smooth_shading=True)
    pl.camera.position, pl.camera.focal_point = (0, -8, 1.2), (0.4, -0.6, 0)
    pl.camera.up, pl.camera.view_angle = (0, 0, 1), 35
    pl.camera.clipping_range = (0.5, 40)
    pl.show(auto_close=False)
    return pl


def shot(pl):
    """Return one new frame."""
    pl.render_window.Render()
    return np.asarray(pl.screenshot(return_img=True), float)


def accumulated(pl, radius, focus, lenses=256):
    """Return the mean of the pictures from points spread evenly over a lens.

    The accumulation buffer of Haeberli and Akeley, SIGGRAPH 1990: the camera is moved within the
    lens, and its picture shifted so that the plane in focus stays where it is.
    """
    camera = pl.camera
    eye, focal, span = (
        np.array(x) for x in (camera.position, camera.focal_point, camera.clipping_range)
    )
    ahead = (focal - eye) / np.linalg.norm(focal - eye)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    width, height = pl.window_size
    half = focus * np.tan(np.radians(camera.view_angle) / 2)
    total = 0.0
    for x, y in radius * vogel_disk(lenses):
        move = x * right + y * up
        camera.SetPosition(*(eye + move))
        camera.SetFocalPoint(*(focal + move))
        camera.SetWindowCenter(-x / (half * width / height), -y / half)
        camera.SetClippingRange(*span)
        total = total + shot(pl)
    camera.SetPosition(*eye)
    camera.SetFocalPoint(*focal)
    camera.SetWindowCenter(0, 0)
    camera.SetClippingRange(*span)
    return total / lenses


def psnr(picture, reference) -> float:
    """Return the peak signal to noise ratio."""
    error = np.mean((np.asarray(picture) - reference) ** 2)
    return float(10 * np.log10(255**2 / error))


def measure(size=(640, 480), radii=(0.1, 0.2), samples=(16, 48, 128), lenses=256) -> list[dict]:
    """Return run time and error of settings, against the mean of pinhole pictures."""
    pl = stage(size)
    focus = float(np.linalg.norm(np.subtract(pl.camera.focal_point, pl.camera.position)))
    off, rows = shot(pl), []
    for radius in radii:
        reference = accumulated(pl, radius, focus, lenses)
        plain = _seconds(pl)
        for count in samples:
            lens = pl.ibr.add(DepthOfField(radius=radius, samples=count, limit=0.1))
            on = shot(pl)
            rows.append(
                {
                    'radius': radius,
                    'samples': count,
                    'ms': 1e3 * (_seconds(pl) - plain),
                    'psnr': psnr(on, reference),
                    'psnr_off': psnr(off, reference),
                }
            )
            pl.ibr.remove(lens)
    pl.close()
    return rows


def _seconds(pl) -> float:
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        pl.render_window.Render()
        pl.render_window.WaitForCompletion()
        best = min(best, time.perf_counter() - start)
    return best
