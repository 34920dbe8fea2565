"""Depth of field against an accumulation of pictures from points of the lens."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.bench.common.timing import plotter, seconds
from pvibr.effects.depth_of_field import DepthOfField
from pvibr.maths.image_error import psnr
from pvibr.maths.kernels import vogel_disk


def measure(settings, results):
    """Yield the error and time of the lens; the bar is for the most samples."""
    found = results.points['lens'] = _points(settings)
    for point in found:
        name = f'depth of field, radius {point["radius"]:g}, {point["samples"]} samples'
        bar = 32 if point['samples'] == max(settings.samples) else None
        yield Row(f'{name}: PSNR', point['psnr'], 'dB', bar, at_least=True)
        yield Row(f'{name}: time', point['ms'], 'ms')


def _points(settings):
    """Return run time and error of settings, against the mean of pinhole pictures."""
    pl = stage(settings.lens)
    focus = float(np.linalg.norm(np.subtract(pl.camera.focal_point, pl.camera.position)))
    off, found = shot(pl), []
    for radius in settings.radii:
        reference = accumulated(pl, radius, focus, settings.lenses)
        plain = _least_ms(pl)
        for count in settings.samples:
            lens = pl.ibr.add(DepthOfField(radius=radius, samples=count, limit=0.1))
            on = shot(pl)
            point = {'radius': radius, 'samples': count, 'ms': _least_ms(pl) - plain}
            point |= {'psnr': psnr(on, reference), 'psnr_off': psnr(off, reference)}
            found.append(point)
            pl.ibr.remove(lens)
    pl.close()
    return found


def _least_ms(pl) -> float:
    return 1e3 * min(seconds(pl.render_window) for _ in range(5))


def stage(size=(640, 480)):
    """Return a plotter that shows five spheres in a row away from the camera, over a floor."""
    pl = plotter(size)
    pl.set_background('#405060')
    floor = pv.Plane(center=(0, 0, -0.5), i_size=30, j_size=30, i_resolution=30, j_resolution=30)
    floor.cell_data['odd'] = np.indices((30, 30)).sum(axis=0).ravel() % 2
    pl.add_mesh(
        floor, scalars='odd', cmap=['#808080', '#c0b090'], lighting=False, show_scalar_bar=False
    )
    for k, color in enumerate(['red', 'gold', 'teal', 'orchid', 'white']):
        ball = pv.Sphere(radius=0.5, center=(0.8 * k - 1.2, 3.0 - 1.8 * k, 0))
        pl.add_mesh(ball, color=color, smooth_shading=True)
    pl.camera.position, pl.camera.focal_point = (0, -8, 1.2), (0.4, -0.6, 0)
    pl.camera.up, pl.camera.view_angle = (0, 0, 1), 35
    pl.camera.clipping_range = (0.5, 40)
    pl.show(auto_close=False)
    return pl


def shot(pl):
    """Return one new frame, 0 to 1."""
    pl.render_window.Render()
    return np.asarray(pl.screenshot(return_img=True)) / 255


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

    def shifted(x, y):
        move = x * right + y * up
        camera.SetPosition(*(eye + move))
        camera.SetFocalPoint(*(focal + move))
        camera.SetWindowCenter(-x / (half * width / height), -y / half)
        camera.SetClippingRange(*span)

    total = 0.0
    for x, y in radius * vogel_disk(lenses):
        shifted(x, y)
        total = total + shot(pl)
    shifted(0, 0)
    return total / lenses
