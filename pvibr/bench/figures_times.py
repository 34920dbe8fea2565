"""What a new pose of a figure costs: on the GPU, in numpy, and by VTK's own reader of glTF."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.bench import figures_models
from pvibr.bench.figures_peers import NumpySkinning, gltf_reader, meshes_at
from pvibr.bench.rows import Row
from pvibr.capture.offscreen import Stage

CAMERA = [(16, -16, 5), (0, 0, 3.5), (0, 0, 1)]
LOOK = {'color': 'tan', 'smooth_shading': True}
_FEW = 100  # one triangle of so many, where drawing shall not count


def poses(settings, results):
    """Add the rows of a new pose and its frame; the bars are those of the largest figure."""
    sizes = settings.joints, settings.screen, settings.rounds
    for around, rings in settings.figures:
        share = pose_times(rings, around, *sizes)
        results.points.setdefault('poses', []).append({'vertices': around * rings, **share})
    frame = frame_times(rings, around, *sizes)
    name = f'new pose of {around * rings:,} vertices, {settings.joints} joints'
    for way in share:
        results.rows += [
            Row(f'{name}, {way}: posing and upload', share[way], 'ms'),
            Row(f'{name}, {way}: with its frame', frame[way], 'ms'),
        ]
    results.rows.append(
        Row(
            f'{name}, float64 reference: posing',
            reference_time(rings, around, settings.joints, settings.rounds),
            'ms',
        )
    )
    for times, what, bars in ((share, '', (10, None)), (frame, ', with the frame', (None, 3))):
        for way, bar in zip(('numpy', 'vtkGLTFReader'), bars, strict=True):
            ratio = times[way] / times['pvibr']
            results.rows.append(Row(f'{name}: {way} over pvibr{what}', ratio, 'x', bar, True))


def pose_times(rings, around, joints, screen, rounds) -> dict:
    """Time posing and upload alone: of all vertices, where few triangles are drawn."""
    figure = figures_models.tube(rings, around, joints, look=LOOK, every=_FEW)
    found = _in_turns(figure, screen, rounds)
    return {way: moved - still for way, (moved, still) in found.items()}


def reference_time(rings, around, joints, rounds) -> float:
    """Time the float64 reference."""
    figure = figures_models.tube(rings, around, joints)
    pose, least = figure.sample(0.4), np.inf
    for _ in range(rounds):
        start = time.perf_counter()
        figure.posed(0, pose)
        least = min(least, time.perf_counter() - start)
    return 1e3 * least


def frame_times(rings, around, joints, screen, rounds) -> dict:
    """Time frames of a new pose."""
    figure = figures_models.tube(rings, around, joints, look=LOOK)
    return {way: moved for way, (moved, _) in _in_turns(figure, screen, rounds).items()}


def _in_turns(figure, screen, rounds):
    """Return by way the ms of a frame of a new pose, and of one in which nothing changed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'figure.glb'
        figure.save(path)
        ways: dict[str, Any] = {
            'pvibr': _Gpu(figure, screen),
            'numpy': _Numpy(figure, screen),
            'vtkGLTFReader': _Reader(path, screen),
        }
        least = {name: np.full(2, np.inf) for name in ways}
        for i, moment in enumerate(figures_models.SECONDS * np.linspace(0.05, 0.9, rounds + 1)):
            for name, way in ways.items():
                found = _milliseconds(way, moment), _milliseconds(way)
                if i:  # the first round compiles and uploads
                    least[name] = np.minimum(least[name], found)
    for way in ways.values():
        way.stage.close()
    return {name: tuple(pair.tolist()) for name, pair in least.items()}


def _milliseconds(way, moment=None):
    start = time.perf_counter()
    if moment is not None:
        way.pose(moment)
    way.stage.draw()
    return 1e3 * (time.perf_counter() - start)


class _Gpu:
    def __init__(self, figure, screen):
        self.stage = Stage(screen)
        self.stage.plotter.ibr.add_animated(figure)
        self.stage.look(CAMERA)

    def pose(self, moment):
        self.stage.plotter.ibr.time = moment


class _Numpy:
    def __init__(self, figure, screen):
        self.figure, self.stage = figure, Stage(screen)
        self.skinning = NumpySkinning(figure.meshes[0])
        _add(self.stage, self.skinning.mesh)

    def pose(self, moment):
        self.skinning.pose(self.figure.world(self.figure.sample(moment)))


class _Reader:
    def __init__(self, path, screen):
        self.stage, self.reader = Stage(screen), gltf_reader(path, 0, 1)
        self.actor = _add(self.stage, meshes_at(self.reader, 0.0)[0])

    def pose(self, moment):
        self.actor.mapper.SetInputDataObject(meshes_at(self.reader, moment)[0])


def _add(stage, mesh):
    actor = stage.plotter.add_mesh(mesh, color=LOOK['color'])
    actor.prop.interpolation = 'Phong'  # not smooth_shading, which computes normals anew
    stage.look(CAMERA)
    return actor


def morphs(settings, results):
    """Add the rows of morph targets: frames with some active over frames with none."""
    (around, rings), count = settings.face, settings.targets
    found = morph_times(around, rings, count, settings.screen, settings.rounds)
    name = f'{count} morph targets on {around * rings:,} vertices'
    results.rows += [
        Row(f'{name}: frame with none active', found['none'], 'ms'),
        Row(f'{name}: frame with 4 active', found['active'], 'ms'),
        Row(f'{name}: 4 active over none', found['active'] / found['none'], 'x', 2),
    ]


def morph_times(around, rings, count, screen, rounds) -> dict:
    """Time frames of a mesh with morph targets, in turns: none of any weight, and four of them."""
    n = around * rings
    shapes = figures_models.targets(count, n)
    figure = figures_models.tube(rings, around, 2, morphs=shapes, look=LOOK)
    way = _Weights(figure, screen, count)
    times: dict[str, list[float]] = {'none': [], 'active': []}
    for i in range(rounds + 2):
        # New weights in each frame, of targets that were active before.
        times['active'].append(_milliseconds(way, 0.1 + 0.8 * i / rounds))
        _milliseconds(way, 0.0)
        times['none'].append(_milliseconds(way))
    way.stage.close()
    return {name: min(found[2:]) for name, found in times.items()}


class _Weights:
    def __init__(self, figure, screen, count):
        self.stage = Stage(screen)
        self.actor = self.stage.plotter.ibr.add_animated(figure)
        self.actor.driver = None  # a clip would be sampled anew
        self.stage.look(CAMERA)
        self.weights = np.zeros(count)
        self.shown = np.linspace(0, count - 1, 4).astype(int)

    def pose(self, moment):
        weights = self.weights.copy()
        weights[self.shown] = moment
        self.actor.weights = weights
