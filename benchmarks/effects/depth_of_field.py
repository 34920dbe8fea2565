"""Depth of field against an accumulation of pictures from points of the lens."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from pvibr.effects.depth_of_field import DepthOfField
from pvibr.maths.image_error import psnr
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.octahedral import frame
from pvibr.scenes.stage import Stage


def measure(settings, results):
    """Yield the error and time of the lens; the bar is for the most samples."""
    found = results.points['lens'] = []
    with spheres_in_a_row(settings.lens) as stage:
        camera, effects = stage.plotter.camera, stage.plotter.ibr
        focus = float(np.linalg.norm(np.subtract(camera.focal_point, camera.position)))
        off = stage.picture()
        for radius in settings.radii:
            reference = accumulated(stage, radius, focus, settings.lenses)
            plain = _least_ms(stage)
            for count in settings.samples:
                lens = effects.add(DepthOfField(radius=radius, samples=count, limit=0.1))
                error, ms = psnr(stage.picture(), reference), _least_ms(stage) - plain
                effects.remove(lens)
                point = {'radius': radius, 'samples': count, 'ms': ms, 'psnr': error}
                found.append(point | {'psnr_off': psnr(off, reference)})
                name = f'depth of field, radius {radius:g}, {count} samples'
                bar = 42 if count == max(settings.samples) else None
                yield Row(f'{name}: PSNR', error, 'dB', bar, at_least=True)
                yield Row(f'{name}: time', ms, 'ms')


def _least_ms(stage) -> float:
    return 1e3 * min(stage.draw() for _ in range(5))


def spheres_in_a_row(size) -> Stage:
    """Return a window that shows five spheres in a row away from the camera, over a floor."""
    stage = Stage(size, view_angle=35, background='#405060')
    floor = pv.Plane(center=(0, 0, -0.5), i_size=30, j_size=30, i_resolution=30, j_resolution=30)
    floor.cell_data['odd'] = np.indices((30, 30)).sum(axis=0).ravel() % 2
    look: dict = {'cmap': ['#808080', '#c0b090'], 'lighting': False, 'show_scalar_bar': False}
    stage.plotter.add_mesh(floor, scalars='odd', **look)
    for k, color in enumerate(['red', 'gold', 'teal', 'orchid', 'white']):
        ball = pv.Sphere(radius=0.5, center=(0.8 * k - 1.2, 3.0 - 1.8 * k, 0))
        stage.plotter.add_mesh(ball, color=color, smooth_shading=True)
    stage.look([(0, -8, 1.2), (0.4, -0.6, 0), (0, 0, 1)])
    stage.plotter.camera.clipping_range = (0.5, 40)
    return stage


def accumulated(stage, radius, focus, lenses=256):
    """Return the mean of the pictures from points spread evenly over a lens.

    The accumulation buffer of Haeberli and Akeley, SIGGRAPH 1990: the camera is moved within the
    lens, and its picture shifted so that the plane in focus stays where it is.
    """
    camera = stage.plotter.camera
    eye, focal = np.array(camera.position), np.array(camera.focal_point)
    span = camera.clipping_range
    right, up, _ = frame((eye - focal) / np.linalg.norm(eye - focal))
    width, height = stage.plotter.window_size
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
        total = total + stage.picture()
    shifted(0, 0)
    return total / lenses
