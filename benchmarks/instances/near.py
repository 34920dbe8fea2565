"""Trees near enough to show their leaves, and what the trees of README's example take."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from benchmarks.common import whole_frames
from benchmarks.common.harness import Row
from benchmarks.common.timing import mean_flip
from pvibr.cli.timing import CLOCKS, frame_at, medians_ms
from pvibr.instances.atlas import bounding_sphere
from pvibr.instances.sharpness import sharpness
from pvibr.scenes.stage import MULTI_SAMPLES, SAMPLES, Stage, mesh_actors
from pvibr.scenes.trees import tree_parts

#: The diameter of a tree on the screen, and how far apart trees stand, px.
DIAMETER, SPACING = 200, 210
_ANGLE = 10.0  # vertical, of the view: all trees are about as far away
_STEP = 0.05  # degrees that the camera turns from one frame that is timed to the next
_LEAN = 60.0  # degrees that trees lean towards the camera at most: as seen from above


def measure(settings, results):
    """Yield the rows of trees at one size, over their full meshes."""
    scene = _Trees(settings.size)
    with ExitStack() as stack:
        stages = {name: stack.enter_context(scene.stage()) for name in ('pvibr', 'meshes')}
        add = stages['pvibr'].plotter.ibr.add_instances
        add(tree_parts(), scene.poses, bake=True, progress=False, show_scalar_bar=False)
        with scene.stage(samples=SAMPLES) as stage:
            truth = scene.picture(scene.filled(stage))
        scene.filled(stages['meshes']).window.SetMultiSamples(0)
        base = _errors(scene.picture(stages['meshes']), truth)
        for samples in MULTI_SAMPLES:
            for stage in stages.values():
                stage.window.SetMultiSamples(samples)
            flip, sharp = _errors(scene.picture(stages['pvibr']), truth)
            ms = _times(scene, stages, settings.near_frames)
            title = f'{len(scene.poses)} trees at {DIAMETER} px, {samples} samples'
            for clock in CLOCKS:
                over = ms['pvibr'][clock] / ms['meshes'][clock]
                bar = 0.4 if clock == 'CPU' else None
                yield Row(f'{title}: frame over that of the full meshes, {clock}', over, 'x', bar)
            yield Row(f"{title}: FLIP over the meshes' at one sample", flip / base[0], 'x', 1.05)
            yield Row(f'{title}: sharpness', sharp, 'x', 0.88, True)


class _Trees:
    """Trees in rows before the camera, each turned and leaning as one does from another side."""

    def __init__(self, size, seed=0):
        rng = np.random.default_rng(seed)
        self.size = size
        points = np.concatenate([part.mesh.points for part in tree_parts()])
        center, radius = bounding_sphere(points)
        width, height = (max((n - 1) // SPACING, 1) for n in size)
        across, up = np.meshgrid(np.arange(width), np.arange(height))
        away = np.stack([across - (width - 1) / 2, np.zeros_like(up), up - (height - 1) / 2], -1)
        count = width * height
        angles = np.c_[rng.uniform(0, _LEAN, count), rng.uniform(0, 360, count)]
        turns = Rotation.from_euler('XZ', angles, degrees=True)  # about its trunk, then leaning
        self.poses = np.tile(np.eye(4), (count, 1, 1))
        self.poses[:, :3, :3] = turns.as_matrix()
        world = 2 * radius / DIAMETER  # of a pixel, where the trees stand
        self.poses[:, :3, 3] = away.reshape(-1, 3) * SPACING * world - turns.apply(center)
        distance = size[1] / 2 * world / np.tan(np.radians(_ANGLE / 2))
        self.camera = (0.0, -distance, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
        reach = float(np.abs(self.poses[:, :3, 3]).max() + 3 * radius)
        self.bounds = (-reach, reach) * 3

    def stage(self, **samples) -> Stage:
        """Return an empty window."""
        stage = Stage(self.size, view_angle=_ANGLE, **samples)
        stage.bounds = self.bounds
        return stage

    def filled(self, stage) -> Stage:
        """Return a window with an actor for each tree."""
        stage.add(mesh_actors([tree_parts()], self.poses, np.zeros(len(self.poses), int)))
        return stage

    def picture(self, stage) -> np.ndarray:
        """Return what the camera shows."""
        stage.look(self.camera)
        return stage.picture()


def _errors(picture, truth) -> tuple[float, float]:
    return mean_flip([picture], [truth]), sharpness(picture, truth)


def _times(scene, stages, frames) -> dict:
    """Return the median ms of frames by turns while the camera turns, of both clocks."""
    times: dict[str, list] = {name: [] for name in stages}
    for k in range(-1, frames):
        angle = np.radians(_STEP * (k + 1))
        eye = np.array(scene.camera[0]) @ Rotation.from_rotvec([0, 0, angle]).as_matrix().T
        for name, stage in stages.items():
            seconds = frame_at(stage, (tuple(eye), *scene.camera[1:]))
            if k >= 0:  # the first uploads
                times[name].append(seconds)
    return {name: medians_ms(frames) for name, frames in times.items()}


# -- README's example ----------------------------------------------------------------------------


def readme(count, size, on) -> pv.Plotter:
    """Return the plotter of README's example, with its trees or without."""
    hills = pv.examples.load_random_hills().scale(80).subdivide(2)
    places = np.random.default_rng(0).choice(hills.points, count, replace=False)
    pl = pv.Plotter(off_screen=True, window_size=list(size))
    pl.add_mesh(hills, color='darkkhaki', smooth_shading=True)
    if on:
        pl.ibr.add_instances(tree_parts(), places, max_error=1.0)
    pl.camera_position = [(-1040, -640, 560), (0, 720, 200), (0, 0, 1)]
    return pl


def measure_readme(settings, results):
    """Yield what the trees of README's example add to a frame."""

    def make(settings, size, on):
        pl = readme(settings.trees, size, on)
        return pl, whole_frames.turning(pl)

    found = whole_frames.measured(make, settings, settings.size, settings.near_frames)
    for samples, times in found.items():
        with_trees, without = (medians_ms(times[name]) for name in ('with', 'without'))
        for clock in CLOCKS:
            added = with_trees[clock] - without[clock]
            asked = 230 if clock == 'CPU' and samples == MULTI_SAMPLES[0] else None
            title = f"README's example, {samples} samples: its trees add, {clock}"
            yield Row(title, added, 'ms', asked)
