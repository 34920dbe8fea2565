"""Measure movies and bakes by one and by two workers of a Dask cluster on this machine."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pyvista as pv

import pvibr.cluster
from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from pvibr.capture.movies import encoded
from pvibr.cluster import stages


def _scene(size, resolution):
    ball = pv.Sphere(theta_resolution=resolution, phi_resolution=resolution)
    pl = pv.Plotter(off_screen=True, window_size=size)
    for k in range(4):
        pl.add_mesh(ball.translate((k, 0, 0)), smooth_shading=True, specular=1.0)
    return pl


def _cameras(frames) -> list:
    angles = np.linspace(0, 2 * np.pi, frames, endpoint=False)
    return [((1.5 + 5 * np.cos(a), 5 * np.sin(a), 2), (1.5, 0, 0), (0, 0, 1)) for a in angles]


@contextlib.contextmanager
def _clients(folder):
    """Yield clients of one and of two workers, each of which draws by one thread."""
    from distributed import Client, LocalCluster

    options = {'threads_per_worker': 1, 'dashboard_address': ':0', 'local_directory': folder}
    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.dict(os.environ, LP_NUM_THREADS='1'))
        clients = []
        for count in (1, 2):
            cluster = stack.enter_context(LocalCluster(n_workers=count, **options))
            clients.append(stack.enter_context(Client(cluster)))
        yield clients


def _movies(settings, results):
    """Yield how much faster two workers draw a movie, and its CPU beside that of one process."""
    cameras, scene = _cameras(settings.frames), (settings.size, settings.resolution)
    with tempfile.TemporaryDirectory() as folder, _clients(folder) as clients:
        path, costs = Path(folder) / 'movie', []
        walls: dict[int, list[float]] = {1: [], 2: []}
        for turn in range(settings.turns + 1):
            for count, client in enumerate(clients, 1):
                shutil.rmtree(path, ignore_errors=True)
                before = _processor_seconds(client)
                start = time.perf_counter()
                pvibr.cluster.movie(_scene, cameras, path, client=client, args=scene)
                seconds = time.perf_counter() - start
                spent = _processor_seconds(client) - before
                local = clients[0].submit(_local, *scene, cameras, pure=False).result()
                if turn:  # at first all is imported and compiled
                    walls[count].append(seconds)
                    costs.append(spent / local)
        results.points['movie'] = walls
    speedup = np.median(walls[1]) / np.median(walls[2])
    yield Row('movie: two workers over one', speedup, 'x', 1.7, True)
    yield Row('movie: CPU of a frame over a local one', np.median(costs), 'x', 1.15)


def _local(size, resolution, cameras) -> float:
    """Return the processor time of the frames in one process, its scene included."""
    return stages.drawing(_local_seconds, size, resolution, cameras)


def _local_seconds(size, resolution, cameras) -> float:
    start = time.process_time()
    pl = _scene(size, resolution)
    for camera in cameras:
        pl.camera_position = camera
        encoded(pl.ibr.screenshot())
    pl.close()
    return time.process_time() - start


def _processor_seconds(client) -> float:
    return sum(client.run(time.process_time).values())


def _bakes(settings, results):
    """Yield how much faster two workers bake."""
    meshes = [
        pv.Sphere(theta_resolution=n, phi_resolution=n)
        for n in range(settings.resolution, settings.resolution + settings.meshes)
    ]
    with tempfile.TemporaryDirectory() as folder, _clients(folder) as clients:
        for name in settings.bakes:
            walls = []
            for turn in range(2):
                for count, client in enumerate(clients, 1):
                    cache = Path(folder) / f'{name}{turn}{count}'
                    start = time.perf_counter()
                    one = meshes[:1] if turn == 0 else meshes  # all is imported and compiled
                    pvibr.cluster.bake(
                        one, client=client, cache=cache, large=name == 'hierarchies'
                    )
                    walls.append(time.perf_counter() - start)
            results.points[name] = {1: [walls[2]], 2: [walls[3]]}
            yield Row(f'bake, {name}: two workers over one', walls[2] / walls[3], 'x', 1.7, True)


def plot(points, figure):
    """Draw the seconds by one and by two workers."""
    axes = plots.subplots(figure, 1, 1)
    for name, walls in points.items():
        axes.plot([1, 2], [np.median(walls[1]), np.median(walls[2])], 'o-', label=name)
    axes.set(xlabel='workers', ylabel='s', xticks=[1, 2], ylim=(0, None))


BENCH = Bench(
    parts={'movie': _movies, 'bake': _bakes},
    plot=plot,
    outside={},
    settings={
        'size': ((1280, 720), (320, 240)),
        'resolution': (300, 60),
        'frames': (96, 8),
        'turns': (3, 1),
        'meshes': (6, 2),
        'bakes': (('hierarchies', 'images'), ('hierarchies',)),
    },
)
