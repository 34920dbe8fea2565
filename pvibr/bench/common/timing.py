"""Plotters without anti-aliasing, and the time of their frames."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pyvista as pv


def plotter(size, **options):
    """Return an empty off-screen plotter without anti-aliasing."""
    pl = pv.Plotter(off_screen=True, window_size=list(size), **options)
    pl.disable_anti_aliasing()
    return pl


def look(pl, eye, focus=(0, 0, 0)):
    """Look from a point at another, z up."""
    pl.camera.position, pl.camera.focal_point, pl.camera.up = eye, focus, (0, 0, 1)
    pl.renderer.ResetCameraClippingRange()


def seconds(window, job=None) -> float:
    """Return the seconds of a job on the GPU; by default of a frame."""
    window.WaitForCompletion()
    start = time.perf_counter()
    (job or window.Render)()
    window.WaitForCompletion()
    return time.perf_counter() - start


def spent(stage) -> tuple[float, float]:
    """Return the seconds of a frame, of the wall and of the processors."""
    start = time.process_time()
    wall = stage.draw()
    return wall, time.process_time() - start


def timed(job):
    """Return the result of a job on the CPU, and its seconds."""
    start = time.perf_counter()
    found = job()
    return found, time.perf_counter() - start


def least(rounds, jobs) -> dict:
    """Return the least seconds of each of some jobs, which take turns and time themselves."""
    best = dict.fromkeys(jobs, np.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            best[name] = min(best[name], job())
    return best


def least_ms(size, put, eyes, focus=(0, 0, 0)) -> float:
    """Return the least ms of a frame while the camera moves; the first does not count."""
    pl = plotter(size)
    put(pl)
    found = []
    for eye in eyes:
        look(pl, eye, focus)
        found.append(1e3 * seconds(pl.render_window))
    for actor in list(pl.renderer.GetActors()):  # their mappers may be shown elsewhere
        actor.ReleaseGraphicsResources(pl.render_window)
    pl.close()
    return min(found[1:])


def warm_up(stage, substitute, cameras):
    """Draw in full and with a substitute at some cameras."""
    for enabled in (False, True):
        substitute.enabled = enabled
        for camera in cameras:
            stage.look(camera)
            stage.draw()


def beside_full(stage, substitute, cameras, every) -> Iterator[tuple[bool, tuple[float, float]]]:
    """Yield whether a frame used a substitute, and its ms of the wall and of the processors.

    Of so many frames one is drawn in full as well.
    """
    for k, camera in enumerate(cameras):
        for enabled in (True, False) if k % every == every - 1 else (True,):
            substitute.enabled = enabled
            stage.look(camera)
            wall, cpu = spent(stage)
            yield enabled, (1e3 * wall, 1e3 * cpu)
        substitute.enabled = True


def pictures(stage, cameras) -> list:
    """Return the pictures that some cameras take."""
    found = []
    for camera in cameras:
        stage.look(camera)
        found.append(stage.picture())
    return found
