"""How far posed figures are from their float64 reference, and from VTK's own reader of glTF."""

from __future__ import annotations

import contextlib
import warnings

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.meshes import DATA
from benchmarks.figures import models as tubes
from benchmarks.figures.peers import reader_error, size_of
from pvibr.animation.clip import Clip, Track
from pvibr.animation.read_gltf import read_gltf
from pvibr.core.errors import PvibrWarning
from pvibr.maths.quaternions import from_axis_angle
from pvibr.scenes.stage import Stage

#: Clips of one model that are compared.
CLIPS = 3


@contextlib.contextmanager
def shown(figure, **settings):
    """Show a figure in a small window."""
    with Stage((64, 64)) as stage:
        actor = stage.plotter.ibr.add_animated(figure, **settings)
        stage.look('iso')
        yield actor


def gpu_errors(actor) -> tuple:
    """Return how far the posed vertices on the GPU are from the float64 reference."""
    pose, figure = actor.pose, actor.figure
    truth = [figure.posed(i, pose, actor.skinning, actor.bulge) for i in range(len(figure.meshes))]
    size = size_of([points for points, _ in truth])
    worst = np.zeros(2)
    for index, points, normals in actor.download_posed():
        expected, upright = truth[index]
        away = np.linalg.norm(points - expected, axis=1).max() / size
        worst = np.maximum(worst, [away, _degrees(normals, upright)])
    return tuple(worst.tolist())


def _degrees(normals, expected):
    lit = np.linalg.norm(expected, axis=1) > 0.5
    sine = np.linalg.norm(np.cross(normals[lit], expected[lit]), axis=1)
    return np.degrees(np.arctan2(sine, (normals * expected)[lit].sum(1))).max(initial=0)


def posed(settings, results):
    """Yield the errors of what the GPU poses: skins, morph targets and key frames."""
    rings, around = settings.small
    n = rings * around
    for offset in settings.offsets:
        morphs = tubes.targets(8, n)
        worm = tubes.tube(rings, around, 16, offset=offset, morphs=morphs)
        worm.clips = (_with_weights(worm.clips[0], len(morphs)),)
        cases = {
            'linear blending and morph targets': (worm, {}),
            'dual quaternions and morph targets': (worm, {'skinning': 'dual'}),
            'key frames': (tubes.swelling(rings, around, offset=offset), {}),
        }
        for name, (figure, how) in cases.items():
            where = f'posed on the GPU, {name}, offset {offset:g}'
            yield from _rows(where, _worst(figure, settings.times, **how))


def _with_weights(clip, n):
    keys = np.random.default_rng(1).uniform(-0.5, 1.5, (3, n))
    times = np.array([0, clip.duration / 2, clip.duration])
    track = Track(0, 'weights', times, keys)
    return Clip(clip.name, [*clip.tracks, track])


def _worst(figure, times, clips=1, **how):
    """Return the largest errors at times of clips."""
    worst = np.zeros(2)
    with shown(figure, **how) as actor:
        for clip in figure.clips[:clips]:
            for time in np.linspace(0, clip.duration, times):
                actor.pose = figure.sample(time, clip, loop=False)
                actor.pipeline.window.Render()
                worst = np.maximum(worst, gpu_errors(actor))
    return worst


def _rows(name, worst):
    yield Row(f'{name}: position over size', worst[0], '', 1e-5)
    yield Row(f'{name}: normals', worst[1], 'degrees', 0.1)


def models(settings, results):
    """Yield the errors of real models: the GPU against float64, and that against vtkGLTFReader."""
    paths = model_files()[: settings.models]
    if not paths:
        results.points['models'] = 'not measured: there is no ../shared/data'
        return
    worst = np.zeros(2)
    for path in paths:
        figure = quiet_read(path)
        worst = np.maximum(worst, _worst(figure, settings.times, CLIPS))
        away = reader_error(path, figure, settings.times, CLIPS)
        yield Row(f'{path.stem} against vtkGLTFReader', away, 'of its size', 1e-4)
    yield from _rows(f'posed on the GPU, {len(paths)} models', worst)


def model_files() -> list:
    """Return the files of real models that move, the smallest first."""
    folder = DATA / 'gltf'
    files = [p for p in folder.rglob('*.gl*') if p.suffix in ('.glb', '.gltf')]
    return sorted(files, key=lambda path: path.stat().st_size)


def quiet_read(path):
    """Return a figure, without warnings of what only its looks lack."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', PvibrWarning)
        return read_gltf(path)


def twists(settings, results):
    """Yield how much of its cross-section a twisted tube keeps where it is least."""
    for degrees in (90, 150):
        for how, bar in (('dual', 0.95), ('linear', None)):
            left = cross_section(degrees, how)
            name = f'{how} blending, cross-section left at {degrees} degrees of twist'
            yield Row(name, left, '', bar, at_least=True)


def cross_section(degrees, how) -> float:
    """Return how much of the cross-section of a tube is left after a twist, in the middle."""
    figure = tubes.tube(41, 32, 2)
    body = figure.meshes[0]
    share = np.clip(body.points[:, 2] / tubes.LENGTH, 0, 1)
    body.skin.joints = np.tile([0, 1], (len(share), 1))
    body.skin.weights = np.stack([1 - share, share], 1)
    twist = from_axis_angle([0, 0, 1.0], np.radians(degrees))
    rest = figure.skeleton.rest
    pose = rest.replaced(rotation=np.stack([rest.rotation[0], twist]))
    across = figure.posed(0, pose, how)[0].reshape(41, 32, 3)[..., :2]
    radii = np.linalg.norm(across - across.mean(1, keepdims=True), axis=2)
    return float(((radii / tubes.RADIUS) ** 2).mean(1).min())
