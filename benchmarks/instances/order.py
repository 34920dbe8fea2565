"""Random scenes of several sets: what shows through, and whether the first frame is the last."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.ndimage import binary_erosion
from scipy.spatial.transform import Rotation

from benchmarks.common.harness import Row
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import MULTI_SAMPLES, SAMPLES, Stage, mesh_actors

SIZE = 400, 300
#: Differences between a view before white and before black, of 255: seen, and just measurable.
SEEN, MEASURABLE = 60, 8
_MESHES = {
    'ball': lambda: pv.Sphere(theta_resolution=24, phi_resolution=24),
    'can': lambda: pv.Cylinder(radius=0.4, height=1.0, resolution=40).triangulate(),
    'ring': lambda: pv.ParametricTorus(0.4, 0.12, u_res=40, v_res=20),
    'box': lambda: pv.Cube().triangulate(),
}


def measure(settings, results):
    """Yield the worst of all scenes."""
    counts = np.array([_through(_Scene(seed)) for seed in range(settings.scenes)])
    for k, samples in enumerate(MULTI_SAMPLES):
        for column, least, bar in ((0, SEEN, 0), (1, MEASURABLE, 10)):
            pixels = counts[:, k, column]
            name = f'background shows by more than {least}/255 deep inside, {samples} samples'
            yield Row(f'{name}, worst of {len(counts)} scenes', pixels.max(), 'px', bar)
            yield Row(f'{name}, all scenes', pixels.sum(), 'px')
    away = max(_first_from_third(_Scene(seed)) for seed in range(min(4, settings.scenes)))
    yield Row('first frame against third, greatest difference', away, '/255', 0)


class _Scene:
    """Two to four sets of a few hundred things of one to four meshes, small and large."""

    def __init__(self, seed):
        rng = np.random.default_rng([15, seed])
        self.sets = []
        for _ in range(rng.integers(2, 5)):
            names = rng.choice(list(_MESHES), rng.integers(1, 3), replace=False)
            count = int(rng.integers(100, 700))
            poses = np.tile(np.eye(4), (count, 1, 1))
            turns = Rotation.from_quat(rng.normal(size=(count, 4))).as_matrix()
            scales = 10 ** rng.uniform(-1, rng.uniform(0.2, 1), count)
            poses[:, :3, :3] = turns * scales[:, None, None]
            poses[:, :3, 3] = rng.uniform(-1, 1, (count, 3)) * [9, 9, rng.uniform(0.5, 6)]
            self.sets.append((list(names), poses, rng.integers(0, len(names), count)))
        away = rng.normal(size=3)
        away = away / np.linalg.norm(away) * rng.uniform(20, 45)
        self.camera = tuple(away), (0.0, 0.0, 0.0), tuple(rng.normal(size=3))

    def stage(self, **samples) -> Stage:
        """Return an empty window whose clipping planes are the scene's."""
        stage = Stage(SIZE, **samples, background='white')
        stage.bounds = (-15.0, 15.0) * 3
        return stage

    def meshes(self) -> Stage:
        """Return a window with an actor for each thing, many samples a pixel."""
        stage = self.stage(samples=SAMPLES)
        for names, poses, index in self.sets:
            stage.add(
                mesh_actors([as_parts(_MESHES[n](), color='red') for n in names], poses, index)
            )
        return stage

    def instances(self) -> Stage:
        """Return a window with the sets as instances."""
        stage = self.stage()
        for names, poses, index in self.sets:
            meshes = [_MESHES[n]() for n in names]
            add = stage.plotter.ibr.add_instances
            add(meshes, poses, index=index, color='red', bake=True, progress=False)
        return stage


def _through(scene) -> list[tuple[int, int]]:
    """Return in how many pixels deep inside what meshes cover the background shows.

    By multisamples: in how many it is seen, and in how many it can be measured.
    """
    with scene.meshes() as stage:
        # One sample a pixel may miss the hole of a thin ring.
        inside = binary_erosion(_change(stage, scene.camera) < 0.5, np.ones((3, 3)))
    counts = []
    with scene.instances() as stage:
        for samples in MULTI_SAMPLES:
            stage.window.SetMultiSamples(samples)
            change = _change(stage, scene.camera)[inside]
            counts.append(((change > SEEN).sum(), (change > MEASURABLE).sum()))
    return counts


def _change(stage, camera) -> np.ndarray:
    """Return the greatest difference between a view before white and before black, of 255."""
    found = []
    for color in ('white', 'black'):
        stage.plotter.set_background(color)
        stage.look(camera)
        stage.draw()
        stage.draw()
        found.append(255 * stage.read())
    return np.abs(found[0] - found[1]).max(-1)


def _first_from_third(scene) -> int:
    """Return by how much the first frame of a new plotter differs from the third."""
    with scene.instances() as stage:
        stage.plotter.camera_position = scene.camera
        stage.plotter.show(auto_close=False)
        frames = []
        for _ in range(3):
            frames.append(stage.pixels().astype(int))
            stage.draw()
    return np.abs(frames[0] - frames[2]).max()
