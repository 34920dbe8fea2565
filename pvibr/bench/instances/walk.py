"""A walk through ten thousand trees: time, error and popping."""

from __future__ import annotations

import numpy as np

from pvibr.bench.common.harness import Row
from pvibr.bench.common.peers import PART, glyph_seconds
from pvibr.bench.common.timing import pictures
from pvibr.capture.offscreen import SAMPLES, Stage, in_view, mesh_actors, spheres
from pvibr.maths.flip import flip
from pvibr.scenes.landscape import landscape
from pvibr.scenes.scenery import plant

#: Frames of the whole walk that are timed: at max_error 1, at others, and of VTK's own ways.
FRAMES, FEW_FRAMES, PEER_FRAMES = 24, 8, 3
#: Share of the trail that is walked from one frame to the next where popping is looked for:
#: 0.4 m, a run at 30 frames a second.
STEP = 0.4 / 750


def measure(settings, results):
    """Yield the rows of the walk."""
    scene = landscape(settings.trees)
    with Stage(settings.size, scene.terrain, scene.view_angle, lights=scene.lights()) as stage:
        stage.bounds = scene.terrain.bounds
        trees = plant(stage.plotter, scene, max_error=1.0)
        curve = _curve(stage, trees, scene, settings)
        trees.max_error = 1.0
        results.points['pvibr'] = curve
        milliseconds = dict(curve)[1.0]['ms']
        yield from _peers(scene, settings, results, milliseconds)
        yield from _error(stage, trees, scene, settings, results, curve)
        yield from _popping(stage, trees, scene, settings)


def _curve(stage, trees, scene, settings):
    """Return time by max_error."""
    curve = []
    for max_error in dict.fromkeys((*settings.errors, 1.0)):
        trees.max_error = max_error
        seconds = stage.seconds(scene.path(FRAMES if max_error == 1.0 else FEW_FRAMES))
        curve.append((max_error, {'ms': float(np.median(seconds)) * 1e3}))
    return curve


def _peers(scene, settings, results, milliseconds):
    cameras = scene.path(2 * PEER_FRAMES)[1::2]
    yield Row('walk: pvibr, max_error 1', milliseconds, 'ms')
    for name, lod, bar in (('glyphs', False, 200), ('glyphs, culling + LOD', True, 25)):
        own = glyph_seconds(scene, cameras, settings.size, lod=lod) * 1e3
        measured = f'{min(PART, settings.trees)} trees, extrapolated'
        yield Row(f'walk: {name} ({measured})', own, 'ms')
        yield Row(f'walk: faster than {name}', own / milliseconds, 'x', bar, at_least=True)
        results.points[name] = {'ms': own}


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


def _error(stage, trees, scene, settings, results, curve):
    base: list = []
    own: dict[float, list] = {max_error: [] for max_error, _ in curve}
    for camera in scene.path(2 * settings.cameras + 1)[1::2]:
        stage.look(camera)
        rows = _part(stage.frame(), scene, settings.part)
        (reference,) = _full(scene, rows, [camera], settings.size, SAMPLES)
        (once,) = _full(scene, rows, [camera], settings.size, 1)
        base.append(flip(once, reference).mean())
        _show(trees, rows)
        for max_error, found in own.items():
            trees.max_error = max_error
            found.append(flip(stage.picture(), reference).mean())
    for max_error, point in curve:
        point['flip'] = float(np.mean(own[max_error]))
    trees.max_error = 1.0
    results.points['glyphs']['flip'] = float(np.mean(base))
    yield Row(f'walk: FLIP of full meshes ({settings.part} trees)', np.mean(base))
    ratio = np.mean(own[1.0]) / np.mean(base)
    yield Row('walk: FLIP over that of full meshes', ratio, 'x', 0.9)


def _full(scene, rows, cameras, size, samples):
    """Return pictures of full meshes."""
    with Stage(size, scene.terrain, scene.view_angle, samples, lights=scene.lights()) as stage:
        stage.bounds = scene.terrain.bounds
        stage.add(mesh_actors(scene.parts(), scene.matrices[rows], scene.index[rows]))
        return pictures(stage, cameras)


def _popping(stage, trees, scene, settings):
    cameras = scene.path(settings.steps, 0.2, 0.2 + STEP * (settings.steps - 1))
    stage.look(cameras[0])
    rows = _part(stage.frame(), scene, settings.part)
    _show(trees, rows)
    own = _changes(pictures(stage, cameras))
    full = _changes(_full(scene, rows, cameras, settings.size, 1))
    yield Row('popping: p99 of FLIP between frames, full meshes', full)
    yield Row('popping: p99 of FLIP between frames, pvibr over that', own / full, 'x', 1.2)


def _changes(pictures):
    """Return the 99th percentile over pixels of FLIP from frame to frame."""
    pairs = zip(pictures[1:], pictures, strict=False)
    return float(np.percentile(np.stack([flip(new, old) for new, old in pairs]), 99))
