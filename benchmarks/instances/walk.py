"""A walk through ten thousand trees: time, error and what changes from frame to frame."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.timing import mean_flip, pictures
from pvibr.cli.peers import beside_peers, tree_glyphs
from pvibr.cli.timing import CLOCKS, medians_ms
from pvibr.maths.flip import flip
from pvibr.scenes.landscape import landscape
from pvibr.scenes.stage import MULTI_SAMPLES, SAMPLES, in_view, mesh_actors, plant, spheres, stage

#: Frames of the whole walk that are timed: at max_error 1, at others, and of VTK's own ways.
FRAMES, FEW_FRAMES, PEER_FRAMES = 24, 8, 3
#: VTK's own ways: whether with levels, and how many times faster is asked for.
PEERS = {'VTK glyphs': (False, 100), 'VTK glyphs, culling + LOD': (True, 15)}
#: Share of the trail that is walked from one frame to the next where popping is looked for:
#: 0.4 m, a run at 30 frames a second.
STEP = 0.4 / 750


def measure(settings, results):
    """Yield the rows of the walk: at defaults, then at one sample."""
    scene = landscape(settings.trees)
    results.points['walk'] = {}
    with stage(scene, settings.size) as own, ExitStack() as stack:
        trees = plant(own.plotter, scene, max_error=1.0)
        peers = {
            name: stack.enter_context(tree_glyphs(scene, settings.size, lod=lod))
            for name, (lod, _) in PEERS.items()
        }
        for samples in MULTI_SAMPLES:
            yield from _times(own, trees, peers, scene, settings, results.points['walk'], samples)
        yield from _errors(own, trees, scene, settings, results.points['walk'])
        yield from _motion(own, trees, scene, settings)


def _times(own, trees, peers, scene, settings, walk, samples):
    """Yield the times of frames, and note them by max_error."""
    own.window.SetMultiSamples(samples)
    for peer in peers.values():
        peer.sample(samples)
    times = beside_peers(own, peers, scene.path(FRAMES), FRAMES // PEER_FRAMES)
    ms = {name: medians_ms(frames) for name, frames in times.items()}
    by_error = [(1.0, dict(ms['pvibr']))]
    for max_error in [e for e in settings.errors if e != 1.0]:
        trees.max_error = max_error
        frames = beside_peers(own, {}, scene.path(FEW_FRAMES), 1)['pvibr']
        by_error.append((max_error, medians_ms(frames)))
    trees.max_error = 1.0
    peer_ms = {name: ms[name] for name in peers}
    walk[str(samples)] = {'pvibr': sorted(by_error), 'peers': peer_ms}
    title = f'walk, {samples} samples'
    for clock in CLOCKS:
        yield Row(f'{title}: pvibr, max_error 1, {clock}', ms['pvibr'][clock], 'ms')
        for name, (_, bar) in PEERS.items():
            part = f'{peers[name].part} trees, extrapolated'
            yield Row(f'{title}: {name} ({part}), {clock}', ms[name][clock], 'ms')
            faster = ms[name][clock] / ms['pvibr'][clock]
            asked = bar if clock == 'CPU' and samples == MULTI_SAMPLES[0] else None
            yield Row(f'{title}: faster than {name}, {clock}', faster, 'x', asked, at_least=True)


def _part(frame, scene, count, seed=0):
    """Return some of the trees in view: the nearest quarter, and others drawn by lot."""
    rows = in_view(frame, *spheres(scene.parts(), scene.matrices, scene.index))
    near, far = rows[: count // 4], rows[count // 4 :]
    lot = np.random.default_rng(seed).permutation(far)[: count - len(near)]
    return np.concatenate([near, lot])


def _show(trees, rows):
    mask = np.zeros(len(trees), bool)
    mask[rows] = True
    trees.visible = mask


def _errors(own, trees, scene, settings, points):
    """Yield FLIP over that of the full meshes at one sample, and note it by max_error."""
    meshes: list = []
    flips: dict = {n: {e: [] for e, _ in points[str(n)]['pvibr']} for n in MULTI_SAMPLES}
    for camera in scene.path(2 * settings.cameras + 1)[1::2]:
        own.look(camera)
        rows = _part(own.frame(), scene, settings.part)
        truth = _full(scene, rows, [camera], settings.size, samples=SAMPLES)
        once = _full(scene, rows, [camera], settings.size, multi_samples=0)
        meshes.append(mean_flip(once, truth))
        _show(trees, rows)
        for samples, by_error in flips.items():
            own.window.SetMultiSamples(samples)
            for max_error, by_camera in by_error.items():
                trees.max_error = max_error
                by_camera.append(mean_flip([own.picture()], truth))
    trees.max_error = 1.0
    base = points['meshes'] = float(np.mean(meshes))
    yield Row(f'walk: FLIP of the full meshes at one sample ({settings.part} trees)', base)
    for samples, by_error in flips.items():
        for max_error, point in points[str(samples)]['pvibr']:
            point['flip'] = float(np.mean(by_error[max_error]))
        ratio = np.mean(by_error[1.0]) / base
        yield Row(f'walk, {samples} samples: FLIP over that', ratio, 'x', 0.9)


def _full(scene, rows, cameras, size, **samples):
    """Return pictures of full meshes."""
    with stage(scene, size, **samples) as full:
        full.add(mesh_actors(scene.parts(), scene.matrices[rows], scene.index[rows]))
        return pictures(full, cameras)


def _motion(own, trees, scene, settings):
    """Yield what changes from frame to frame beyond what does in a reference, over the meshes'."""
    cameras = scene.path(settings.steps, 0.2, 0.2 + STEP * (settings.steps - 1))
    own.look(cameras[0])
    rows = _part(own.frame(), scene, settings.part)
    _show(trees, rows)
    truth = _changes(_full(scene, rows, cameras, settings.size, samples=SAMPLES))
    for samples in MULTI_SAMPLES:
        own.window.SetMultiSamples(samples)
        changes = {
            'pvibr': _changes(pictures(own, cameras)),
            'meshes': _changes(_full(scene, rows, cameras, settings.size, multi_samples=samples)),
        }
        beyond = {way: np.maximum(flips - truth, 0).mean() for way, flips in changes.items()}
        most = {way: np.percentile(flips, 99) for way, flips in changes.items()}
        title = f'motion, {samples} samples: FLIP between frames'
        yield Row(f"{title} beyond the reference's, meshes", beyond['meshes'])
        yield Row(f'{title}, pvibr over that', beyond['pvibr'] / beyond['meshes'], 'x', 1.2)
        yield Row(f'{title}, p99, pvibr over meshes', most['pvibr'] / most['meshes'], 'x', 1.2)
    trees.visible = np.ones(len(trees), bool)


def _changes(pictures) -> np.ndarray:
    """Return FLIP from frame to frame, (frames - 1, h, w)."""
    pairs = zip(pictures[1:], pictures, strict=False)
    return np.stack([flip(new, old) for new, old in pairs])
