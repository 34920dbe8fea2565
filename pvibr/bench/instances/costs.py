"""What is paid beside frames: new poses, the same mesh again, small meshes, a first bake."""

from __future__ import annotations

import time
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.bench.common.meshes import knot
from pvibr.bench.common.timing import timed
from pvibr.capture.offscreen import Stage
from pvibr.instances.limits import limits_of

#: Triangles of the bake, and repetitions of what is short.
HEAVY, ROUNDS = 100_000, 5


def measure(settings, results):
    """Yield the rows of new poses, of added meshes and of sharp ones."""
    for count, bar in zip(settings.moved, (2.0, 250.0), strict=True):
        yield Row(f'new poses of {count:,}, setter and upload', _new_poses(count), 'ms', bar)
    heavy = knot(HEAVY)
    with TemporaryDirectory() as folder:
        again = partial(_added, heavy, folder, bake=True)
        yield Row(f'first bake of {heavy.n_cells:,} triangles', again(), 's', 6.0)
        yield Row('the same mesh again', min(again() for _ in range(3)), 's', 0.2)
    with TemporaryDirectory() as folder:
        yield Row('a cone of six triangles, one instance', _added(pv.Cone(), folder), 's', 0.1)
    yield Row('flat hexagonal prism, images serve to', _prism(), 'px', 90, at_least=True)


def _added(mesh, folder, *, bake=None) -> float:
    """Return the seconds until a mesh is drawn once."""
    with Stage((64, 64)) as stage:
        stage.look([(0, 0, 9), (0, 0, 0), (0, 1, 0)])
        stage.draw()
        add = partial(stage.plotter.ibr.add_instances, cache=folder, progress=False)
        _, adding = timed(partial(add, mesh, [[0, 0, 0]], bake=bake))
        return adding + stage.draw()


def _new_poses(count) -> float:
    """Return the median ms that new poses take over a frame of a camera that turns."""
    rng = np.random.default_rng(1)
    mesh = pv.ParametricTorus(0.4, 0.1, u_res=40, v_res=20)
    with Stage((64, 64)) as stage:
        points = [rng.uniform(-1, 1, (count, 3)) * 60 for _ in range(2)]
        things = stage.plotter.ibr.add_instances(mesh, points[0], bake=True, progress=False)
        stage.look([(0, -200, 0), (0, 0, 0), (0, 0, 1)])
        stage.draw()
        frames: dict[bool, list[float]] = {True: [], False: []}
        for k in range(-1, ROUNDS):
            for moved in frames:
                stage.plotter.camera.Azimuth(0.2)
                start = time.perf_counter()
                if moved:
                    things.poses = points[k % 2]
                stage.draw()  # waits for completion
                if k >= 0:
                    frames[moved].append(time.perf_counter() - start)
    return 1e3 * (np.median(frames[True]) - np.median(frames[False]))


def _prism() -> float:
    """Return the diameter up to which images of a flat prism that has normals keep the error."""
    prism = pv.Cylinder(radius=0.5, height=1.0, resolution=6).triangulate().subdivide(4)
    prism = prism.compute_normals(split_vertices=False)
    with Stage((64, 64)) as stage:
        add = stage.plotter.ibr.add_instances
        things = add(prism, [[0, 0, 0]], max_error=2.0, bake=True, progress=False, cache=False)
        # By their error: where a mesh costs less it takes over before.
        return float(limits_of(things.atlases[0].errors, 1, things.max_error).mesh.min())
