"""The same bits in six runs, whatever the clock says."""

import os
import subprocess
import sys
import time

import pytest
import pyvista as pv

import pvibr
from pvibr.core.determinism import elapsed, is_deterministic
from tests.refusals import refused

RUN = """
import hashlib, sys, time
import numpy as np, pyvista as pv, pvibr
from pvibr.instances import measure

measure.LAYOUTS = (measure.Layout(8, (8, 16, 32)),)
pvibr.deterministic()
real = time.perf_counter
pv.OFF_SCREEN = True
# Every run has a clock of its own, and some stand still for a while.
for rate in sys.argv[1:]:
    time.perf_counter = lambda: real() * float(rate)
    digest = hashlib.blake2b()
    pl = pv.Plotter(window_size=(128, 64), shape=(1, 2))
    knots = [pl.add_mesh(pv.ParametricTorus(), color='red') for _ in range(6)]
    for k, knot in enumerate(knots):
        knot.position = (3 * k, 9.0 * (k % 2), 0)
    pl.ibr.add_impostor(knots, budget_ms=0.01)
    balls = [pl.add_mesh(pv.Sphere(center=(3 * k, -9, 2))) for k in range(4)]
    pl.ibr.add_image_layers([balls[:2], balls[2:]], budget_ms=0.01)
    pl.ibr.add(pvibr.Bloom(threshold=0.5))
    pl.ibr.add(pvibr.ToneMapping())
    pl.subplot(0, 1)
    places = np.random.default_rng(0).uniform(-9, 9, (200, 3))
    pl.ibr.add_instances(pv.Cone(resolution=40), places, bake=True)
    pl.ibr.add(pvibr.NightVision())
    pl.ibr.add(pvibr.DepthOfField())
    pl.add_mesh(pv.Plane(i_size=20, j_size=20), color='white')
    pl.ibr.add(pvibr.Shadows())
    for k in range(4):
        for renderer in pl.renderers:
            renderer.camera_position = [(20, 30 - k, 8), (5, 2, 0), (0, 0, 1)]
        pl.ibr.time = k / 10
        digest.update(np.asarray(pl.screenshot(return_img=True)).tobytes())
    pl.close()
    print(digest.hexdigest())
"""


@pytest.mark.slow
def test_runs_have_the_same_bits(tmp_path):
    runs = [
        subprocess.run(
            [sys.executable, '-W', 'error', '-c', RUN, *rates],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {'PVIBR_CACHE': str(tmp_path)},
        )
        for rates in (('1', '0.001', '7'), ('1000', '0', '1'))
    ]
    assert not [run.stderr for run in runs if run.returncode]
    digests = [line for run in runs for line in run.stdout.split()]
    assert len(digests) == 6
    assert len(set(digests)) == 1


def test_it_is_on_for_a_block_a_function_or_from_now_on():
    assert not is_deterministic()
    with pvibr.deterministic():
        assert is_deterministic()
        with pvibr.deterministic(False):
            assert not is_deterministic()
        assert is_deterministic()
    assert not is_deterministic()
    pvibr.deterministic()
    assert is_deterministic()
    pvibr.deterministic(False)
    assert not is_deterministic()

    @pvibr.deterministic()
    def inside():
        return is_deterministic()

    pvibr.deterministic(False)
    refused('True or False', pvibr.deterministic, 'yes', kind=TypeError)
    assert not is_deterministic()
    assert inside() in (True, False)


def test_what_is_measured_is_what_is_written_down():
    start = time.perf_counter() - 5
    assert elapsed(start, 0.25) > 4
    with pvibr.deterministic():
        assert elapsed(start, 0.25) == 0.25


def test_frames_that_move_are_full():
    pl = pv.Plotter(off_screen=True)
    pl.ibr.interactive_frame_ms = 1e-6
    with pvibr.deterministic():
        pl.show(auto_close=False)
        for _ in range(5):
            pl.render_window.SetDesiredUpdateRate(30)
            pl.render()
            assert pl.ibr.quality == 1
