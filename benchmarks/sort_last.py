"""Measure frames of shards drawn by 1, 2 and 4 workers, and say what more workers would bring."""

from __future__ import annotations

import tempfile
import time

import numpy as np
import pyvista as pv

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from pvibr.cluster.shard_frames import FAN
from pvibr.cluster.shard_pictures import ShardPicture, composited

#: Seconds that Dask's scheduler needs for a task, by its documentation: about one in 1 ms.
_TASK_SECONDS = 1e-3
_SIMULATED = (1, 4, 16, 64, 256, 1000)


def _shard(index, count, spheres):
    rng = np.random.default_rng(index)
    places = rng.uniform(-3, 3, (spheres // count, 3))
    places[:, 0] = (places[:, 0] + 3) / count - 3 + 6 * index / count
    pl = pv.Plotter(off_screen=True)
    pl.ibr.add_spheres(places, 0.03, color='tan')
    return pl


def _frames(client, count, spheres, size, turns) -> tuple[float, float]:
    """Return the median seconds and the bytes of a frame."""
    pl = pv.Plotter(off_screen=True, window_size=size)
    pl.disable_anti_aliasing()
    shards = pl.ibr.distribute(client, _shard, count=count, args=(spheres,))
    pl.show(auto_close=False)
    seconds = []
    for _ in range(turns + 1):
        pl.camera.azimuth += 5
        start = time.perf_counter()
        pl.render()
        seconds.append(time.perf_counter() - start)
    received = shards.report()['received_bytes']
    pl.close()
    return float(np.median(seconds[1:])), float(received)


def _measured(settings, results):
    """Yield what a frame takes, and the model fitted to it."""
    from distributed import Client, LocalCluster

    samples = []
    with tempfile.TemporaryDirectory() as folder:
        for count in (1, 2, 4):
            options = {'threads_per_worker': 1, 'dashboard_address': ':0'}
            with (
                LocalCluster(n_workers=count, local_directory=folder, **options) as cluster,
                Client(cluster) as client,
            ):
                for spheres in settings.spheres:
                    for size in settings.sizes:
                        seconds, received = _frames(client, count, spheres, size, settings.turns)
                        samples.append((count, spheres, size[0] * size[1], seconds, received))
    counts, spheres, pixels, seconds, received = np.array(samples).T
    # All workers share this machine's cores: what they draw adds up, as if by one.
    terms = np.stack([np.ones_like(counts), counts, spheres, counts * pixels], 1)
    fixed, per_worker, per_item, per_pixel = _least_squares(terms, seconds)
    merge = _merge_seconds(settings.sizes[-1])
    results.points['measured'] = [list(map(float, row)) for row in samples]
    yield Row('fixed', 1e3 * fixed, 'ms')
    yield Row('a worker more', 1e3 * per_worker, 'ms')
    yield Row('1M items', 1e9 * per_item, 'ms')
    yield Row('1M pixels of a worker', 1e9 * per_pixel, 'ms')
    yield Row('two pictures composited, 1M pixels', 1e9 * merge, 'ms')
    yield Row('bytes a pixel', float(np.median(received / (counts * pixels))), 'B')
    model = fixed, per_item, per_pixel, merge
    for items in (1e7, 1e9):
        times = [simulated(n, items, 1e6, *model) for n in _SIMULATED]
        results.points[f'{items:.0e}'] = times
        best = _SIMULATED[int(np.argmin(times))]
        yield Row(f'{items:.0e} items, 1M pixels: workers that are fastest', best, '')
        yield Row(f'{items:.0e} items, 1M pixels: a frame of these', 1e3 * min(times), 'ms')


def _least_squares(terms, seconds) -> np.ndarray:
    """Return coefficients that are at least 0."""
    from scipy.optimize import nnls

    scale = terms.max(0)
    # Relative errors: all sizes count alike.
    return nnls(terms / scale / seconds[:, None], np.ones_like(seconds))[0] / scale


def _merge_seconds(size) -> float:
    """Return seconds per pixel in which one pair of full pictures is composited."""
    rng, shape = np.random.default_rng(0), size[::-1]
    pair = [
        ShardPicture.of(
            np.full((*shape, 4), 255, np.uint8), rng.uniform(1, 2, shape).astype(np.float32)
        )
        for _ in range(2)
    ]
    packed = [picture.packed() for picture in pair]
    start = time.process_time()
    composited(map(ShardPicture.unpacked, packed)).packed()
    return (time.process_time() - start) / (size[0] * size[1])


def simulated(workers, items, pixels, fixed, per_item, per_pixel, merge) -> float:
    """Return seconds of a frame whose workers have cores of their own."""
    draw = per_item * items / workers + per_pixel * pixels
    # A shard of many covers less, but not less than the outline of its box: n^(-2/3) of all.
    covered = pixels * workers ** (-2 / 3)
    composite, tasks, pictures = 0.0, workers, workers
    while pictures > 1:
        composite += (FAN - 1) * merge * min(covered, pixels)
        covered, pictures = covered * FAN ** (2 / 3), -(-pictures // FAN)
        tasks += pictures if pictures > FAN else 0
    return fixed + draw + composite + _TASK_SECONDS * tasks


def plot(points, figure):
    """Draw simulated milliseconds of a frame against workers."""
    axes = plots.subplots(figure, 1, 1)
    for name, times in points.items():
        if name != 'measured':
            axes.plot(_SIMULATED, 1e3 * np.array(times), 'o-', label=f'{name} items')
    axes.set(xlabel='workers', ylabel='ms a frame', xscale='log', yscale='log')


BENCH = Bench(
    parts={'frames': _measured},
    plot=plot,
    outside={},
    settings={
        'spheres': ((100_000, 1_000_000), (1000, 10_000)),
        'sizes': (((320, 240), (1024, 768)), ((80, 60), (160, 120))),
        'turns': (5, 2),
    },
)
