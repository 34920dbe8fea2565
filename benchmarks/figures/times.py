"""What a new pose of a figure costs: on the GPU, in numpy, and by VTK's own reader of glTF."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.timing import timed
from benchmarks.common.whole_frames import real_plotter
from benchmarks.figures import models
from benchmarks.figures.peers import NumpySkinning, gltf_reader, meshes_at
from pvibr.scenes.stage import Stage

CAMERA = [(16, -16, 5), (0, 0, 3.5), (0, 0, 1)]
LOOK = {'color': 'tan', 'smooth_shading': True}
_FEW = 100  # one triangle of so many, where drawing shall not count


def poses(settings, results):
    """Yield the times of a new pose and its frame; the bars are those of the largest figure."""
    for around, rings in settings.figures:
        few = models.tube(rings, around, settings.joints, look=LOOK, every=_FEW)
        found = _in_turns(few, settings.screen, settings.rounds)
        share = {way: moved - still for way, (moved, still) in found.items()}
        results.points.setdefault('poses', []).append({'vertices': around * rings, **share})
    figure = models.tube(rings, around, settings.joints, look=LOOK)
    found = _in_turns(figure, settings.screen, settings.rounds)
    frame = {way: moved for way, (moved, _) in found.items()}
    name = f'new pose of {around * rings:,} vertices, {settings.joints} joints'
    for way in share:
        yield Row(f'{name}, {way}: posing and upload', share[way], 'ms')
        yield Row(f'{name}, {way}: with its frame', frame[way], 'ms')
    pose = figure.sample(0.4)
    reference = min(timed(lambda: figure.posed(0, pose))[1] for _ in range(settings.rounds))
    yield Row(f'{name}, float64 reference: posing', 1e3 * reference, 'ms')
    for times, what, bars in ((share, '', (10, None)), (frame, ', with the frame', (None, 3))):
        for way, bar in zip(('numpy', 'vtkGLTFReader'), bars, strict=True):
            ratio = times[way] / times['pvibr']
            yield Row(f'{name}: {way} over pvibr{what}', ratio, 'x', bar, True)


def morphs(settings, results):
    """Yield the times of morph targets: frames with some active over frames with none."""
    (around, rings), count, rounds = settings.face, settings.targets, settings.rounds
    shapes = models.targets(count, around * rings)
    face = models.tube(rings, around, 2, morphs=shapes, look=LOOK)
    way = _Way(settings.screen, _by_weights, face)
    actives, nones = [], []
    for i in range(rounds + 2):
        # New weights in each frame, of targets that were active before.
        actives.append(way.ms(0.1 + 0.8 * i / rounds))
        way.ms(0.0)
        nones.append(way.ms())
    way.stage.close()
    active, none = min(actives[2:]), min(nones[2:])
    name = f'{count} morph targets on {around * rings:,} vertices'
    yield Row(f'{name}: frame with none active', none, 'ms')
    yield Row(f'{name}: frame with 4 active', active, 'ms')
    yield Row(f'{name}: 4 active over none', active / none, 'x', 2)


def moving(settings, size, on):
    """Return a figure that moves: posed on the GPU, or by numpy."""
    around, rings = settings.figures[-1]
    figure = models.tube(rings, around, settings.joints, look=LOOK)
    plotter = real_plotter(size)
    pose = (_by_gpu if on else _by_numpy)(plotter, figure)
    plotter.camera_position = CAMERA

    def draw(k):
        pose((models.SECONDS / 30 * k) % models.SECONDS)
        plotter.render_window.Render()

    return plotter, draw


class _Way:
    """A window with a figure, and the function that poses it at a time."""

    def __init__(self, screen, add, source):
        self.stage = Stage(screen)
        self.pose = add(self.stage.plotter, source)
        self.stage.look(CAMERA)

    def ms(self, moment=None) -> float:
        """Return the time of a frame, of a new pose if a time is given."""
        start = time.perf_counter()
        if moment is not None:
            self.pose(moment)
        self.stage.draw()
        return 1e3 * (time.perf_counter() - start)


def _in_turns(figure, screen, rounds):
    """Return by way the ms of a frame of a new pose, and of one in which nothing changed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'figure.glb'
        figure.save(path)
        ways = {
            'pvibr': _Way(screen, _by_gpu, figure),
            'numpy': _Way(screen, _by_numpy, figure),
            'vtkGLTFReader': _Way(screen, _by_reader, path),
        }
        least = {name: np.full(2, np.inf) for name in ways}
        for i, moment in enumerate(models.SECONDS * np.linspace(0.05, 0.9, rounds + 1)):
            for name, way in ways.items():
                found = way.ms(moment), way.ms()
                if i:  # the first round compiles and uploads
                    least[name] = np.minimum(least[name], found)
    for way in ways.values():
        way.stage.close()
    return {name: tuple(pair.tolist()) for name, pair in least.items()}


def _by_gpu(plotter, figure):
    plotter.ibr.add_animated(figure)

    def pose(moment):
        plotter.ibr.time = moment

    return pose


def _by_numpy(plotter, figure):
    skinning = NumpySkinning(figure.meshes[0])
    _add(plotter, skinning.mesh)
    return lambda moment: skinning.pose(figure.world(figure.sample(moment)))


def _by_reader(plotter, path):
    reader = gltf_reader(path, 0, 1)
    mapper = _add(plotter, meshes_at(reader, 0.0)[0]).mapper
    return lambda moment: mapper.SetInputDataObject(meshes_at(reader, moment)[0])


def _by_weights(plotter, figure):
    """Return what gives four morph targets a weight, evenly spaced over all."""
    actor = plotter.ibr.add_animated(figure)
    actor.driver = None  # a clip would be sampled anew
    count = len(figure.meshes[0].morphs)
    shown = np.linspace(0, count - 1, 4).astype(int)

    def pose(weight):
        weights = np.zeros(count)
        weights[shown] = weight
        actor.weights = weights

    return pose


def _add(plotter, mesh):
    actor = plotter.add_mesh(mesh, color=LOOK['color'])
    actor.prop.interpolation = 'Phong'  # not smooth_shading, which computes normals anew
    return actor
