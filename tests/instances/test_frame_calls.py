"""Calls of Python functions and of built-ins in a frame: a cost that no machine changes."""

import numpy as np
import pytest
import pyvista as pv

from tests.calls import calls_of
from tests.pictures import place

BALL = pv.Sphere(theta_resolution=24, phi_resolution=20)
CAMERA = (90, -80, 40), (0, 0, 0)


@pytest.fixture(params=[(1, 10_000), (25, 100)], ids=['one set', 'sets'])
def scene(request):
    set_count, item_count = request.param
    rng = np.random.default_rng(4)
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    for _ in range(set_count):
        places = rng.uniform(-50, 50, (item_count, 3)) * (1, 1, 0.1)
        pl.ibr.add_instances(BALL, places)
    place(pl, *CAMERA)
    pl.show(auto_close=False)
    for _ in range(3):
        pl.camera.Azimuth(0.5)
        pl.render()
    return pl, set_count


def test_frames_with_a_still_camera(scene):
    """Little is called, and programs hold the uniforms that they were given."""
    pl, set_count = scene
    pl.render()
    calls = calls_of(pl.render)
    assert len(calls) < (700 if set_count == 1 else 340 * set_count)
    assert not [name for name in calls if name.startswith('SetUniform')]


def test_frames_with_a_moving_camera(scene):
    pl, set_count = scene

    def move():
        pl.camera.Azimuth(0.5)
        pl.render()

    assert len(calls_of(move)) < (1500 if set_count == 1 else 1200 * set_count)
