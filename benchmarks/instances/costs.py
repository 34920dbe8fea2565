"""What is paid beside frames: new poses, the same mesh again, small meshes, a first bake."""

from __future__ import annotations

import time
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from benchmarks.common.harness import Row
from benchmarks.common.meshes import knot
from benchmarks.common.timing import timed
from benchmarks.common.whole_frames import real_plotter
from pvibr.instances.limits import limits_of
from pvibr.maths.transforms import trs
from pvibr.scenes.stage import Stage

#: Triangles of the bake, and repetitions of what is short.
HEAVY, ROUNDS = 100_000, 15
#: PyVista's own window.
SIZE = 1024, 768


def measure(settings, results):
    """Yield the rows of new poses, of added meshes and of sharp ones."""
    few, many = settings.moved
    what = [(few, 8, 5.0, 'points'), (few, 8, 5.0, 'matrices')]
    what += [(few, 0, 5.0, 'points'), (few, 0, 5.0, 'matrices'), (many, 0, 250.0, 'points')]
    for count, samples, bar, kind in what:
        added = _new_poses(count, samples, turned=kind == 'matrices')
        yield Row(f'new {kind} of {count:,} over a frame, {samples} samples', added, 'ms', bar)
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


def _new_poses(count, samples, *, turned) -> float:
    """Return the median ms of the processors that new poses add to a frame of a moving camera."""
    # In PyVista's own window and light, as users draw. Poses are shuffled, so that both frames
    # show the same. Turned ones lie on a plane: any of them may reach highest.
    rng = np.random.default_rng(1)
    poses = rng.uniform(-60, 60, (count, 3))
    if turned:
        poses = trs(poses * [1, 1, 0])
        poses[:, :3, :3] = Rotation.random(count, rng).as_matrix()
    plotter = real_plotter(SIZE)
    window = plotter.ren_win
    window.SetMultiSamples(samples)
    mesh = pv.ParametricTorus(0.4, 0.1, u_res=80, v_res=40)
    things = plotter.ibr.add_instances(mesh, poses, bake=True, progress=False)
    plotter.show(auto_close=False)
    orders = [rng.permutation(count) for _ in range(2)]
    frames: dict[bool, list[float]] = {False: [], True: []}
    for k in range(-1, ROUNDS):  # the first two settle
        for moved, found in frames.items():
            new = poses[orders[k % 2]]
            plotter.camera.Azimuth(0.2)
            start = time.process_time()
            if moved:
                things.poses = new
            window.Render()
            window.WaitForCompletion()
            found.append(time.process_time() - start)
    plotter.close()
    return 1e3 * float(np.median(np.subtract(frames[True], frames[False])[1:]))


def _prism() -> float:
    """Return the diameter up to which images of a flat prism that has normals keep the error."""
    prism = pv.Cylinder(radius=0.5, height=1.0, resolution=6).triangulate().subdivide(4)
    prism = prism.compute_normals(split_vertices=False)
    with Stage((64, 64)) as stage:
        add = stage.plotter.ibr.add_instances
        things = add(prism, [[0, 0, 0]], max_error=2.0, bake=True, progress=False, cache=False)
        # By their error: where a mesh costs less it takes over before.
        return float(limits_of(things.atlases[0].errors, 1, things.max_error).mesh_from.min())
