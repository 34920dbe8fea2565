"""A million instances in view: time, Python's share, bytes; and the bake of a heavy mesh."""

from __future__ import annotations

import tracemalloc
from functools import partial
from itertools import product

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import python_ms, timed
from pvibr.cli.timing import CLOCKS, frame_at, medians_ms
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import MULTI_SAMPLES, Stage

VIEW_ANGLE = 30.0
#: Frames that are timed.
FRAMES = 7
#: Of an instance's radius, in the spacing between instances.
SHARE = 0.3


def measure(settings, results):
    """Yield the rows of the crowd and of the bake."""
    yield from _bake()
    mesh, points, cameras = _scene(settings.crowd)
    own = yield from _drawn(mesh, points, cameras, settings.size)
    flat = _quads(points, cameras, settings.size)
    for samples, clock in product(MULTI_SAMPLES, CLOCKS):
        name = f'crowd of {settings.crowd:,}, {samples} samples'
        ms, peer = own[samples][clock], flat[samples][clock]
        yield Row(f'{name}: pvibr, {clock}', ms, 'ms')
        yield Row(f'{name}: unlit quads, {clock}', peer, 'ms')
        bar = 1.5 if clock == 'CPU' else None
        yield Row(f'{name}: over unlit quads, {clock}', ms / peer, 'x', bar)


def _bake():
    mesh = pv.ParametricTorus(u_res=251, v_res=201)
    with Stage((64, 64)) as stage:
        add = partial(stage.plotter.ibr.add_instances, cache=False, progress=False)
        ring, seconds = timed(lambda: add(mesh, [[0, 0, 0]], bake=True))
        (atlas,) = ring.atlases
        yield Row(f'bake of {mesh.n_cells:,} triangles', seconds, 's', 3.0)
        yield Row('its atlas', atlas.nbytes / 2**20, 'MiB', 110.0)


def _scene(count):
    """Return a mesh, points that fill the view, and cameras that turn a little."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (count, 3)) * [1.6, 0.9, 0.9]
    mesh = pv.Sphere(theta_resolution=50, phi_resolution=50, radius=SHARE * 2 / count ** (1 / 3))
    eyes = [(0.02 * k, -5.2, 0.01 * k) for k in range(FRAMES)]
    return mesh, points, [(eye, (0, 0, 0), (0, 0, 1)) for eye in eyes]


def _drawn(mesh, points, cameras, size):
    """Yield the rows of a crowd, and return the ms of its frame by multisamples and clock."""
    with Stage(size, view_angle=VIEW_ANGLE) as stage:
        parts = [as_parts(mesh)]
        first = stage.plotter.ibr.add_instances(parts, points[:1], bake=True)
        stage.seconds(cameras[:1])
        alone = first.report()['bytes']
        first.remove()
        # Baked before the measured call, and kept on disk: the bytes are the instances'.
        tracemalloc.start()
        many = stage.plotter.ibr.add_instances(parts, points, bake=True)
        stage.seconds(cameras[:1])
        held, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        python = []
        for camera in (*cameras, *cameras[-1:] * FRAMES):
            stage.look(camera)
            stage.draw()
            python.append(python_ms(stage))
        moving, still = np.split(np.array(python), 2)
        n, gpu = len(points), many.report()['bytes'] - alone
        bakes = sum(a.geometry.nbytes + a.albedo.nbytes for a in many.atlases)
        yield Row('crowd: Python a frame, nothing moved', np.median(still), 'ms', 0.2)
        yield Row('crowd: Python a frame, camera moving', np.median(moving), 'ms', 5.0)
        yield Row('crowd: CPU bytes an instance', max(held - bakes, 0) / n, 'B', 96.0)
        yield Row('crowd: GPU bytes an instance', max(gpu, 0) / n, 'B', 64.0)
        return _ms(stage, cameras)


def _ms(stage, cameras) -> dict[int, dict[str, float]]:
    """Return the median ms of frames by multisamples and clock."""
    by_samples = {}
    for samples in MULTI_SAMPLES:
        stage.window.SetMultiSamples(samples)
        frame_at(stage, cameras[0])
        by_samples[samples] = medians_ms([frame_at(stage, camera) for camera in cameras])
    return by_samples


def _quads(points, cameras, size):
    """Return the ms of as many quads, each the size of the bounding sphere."""
    radius = SHARE * 2 / len(points) ** (1 / 3)
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * radius
    places = (points[:, None] + corners).astype(np.float32).reshape(-1, 3)
    quads = np.arange(4 * len(points)).reshape(-1, 4)
    cells: np.ndarray = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    with Stage(size, view_angle=VIEW_ANGLE) as stage:
        stage.plotter.add_mesh(pv.PolyData.from_regular_faces(places, cells), lighting=False)
        return _ms(stage, cameras)
