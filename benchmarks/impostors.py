"""Measure impostors on the fly against the meshes that they stand for."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.meshes import knot, scatter, torus
from benchmarks.common.timing import beside_full, mean_flip, pictures, warm_up
from benchmarks.common.whole_frames import real_plotter, turning
from pvibr.scenes.stage import Stage

#: Degrees of the orbit and world units of the fly-by from one frame to the next: a turn in 24 s
#: at 60 frames a second, and the same pace straight on.
TURN, STEP = 0.25, 0.2


def orbit(frames, radius, turn=TURN) -> list:
    """Return cameras around the origin."""
    angles = np.radians(turn * np.arange(frames))
    eyes = np.stack([np.cos(angles), np.sin(angles), np.full(frames, 0.5)], 1) * radius
    return [(eye, (0, 0, 0), (0, 0, 1)) for eye in eyes.tolist()]


def fly_by(frames, radius, step=STEP) -> list:
    """Return cameras that go past the origin, looking ahead and down."""
    eyes = np.array([0.3, -1.0, 0.5]) * radius + np.arange(frames)[:, None] * [0, step, 0]
    ahead = np.array([-0.3, 1.0, -0.5]) * radius
    return [(eye, ahead + eye, (0, 0, 1)) for eye in eyes.tolist()]


def _stage(actors, size, **samples):
    stage = Stage(size, **samples)
    stage.add(actors)
    stage.bounds = stage.renderer.ComputeVisiblePropBounds()
    return stage


def _paths(settings, results):
    radius = 5.0 * np.sqrt(settings.actors)
    for name, path in {'orbit': orbit, 'fly-by': fly_by}.items():
        cameras = path(settings.frames, radius)
        actors = scatter(settings.actors, settings.cells, 4.0)
        with _stage(actors, settings.size) as stage:
            stage.look(cameras[0])
            impostor = stage.plotter.ibr.add_impostor(actors)
            for max_error in settings.errors if name == 'orbit' else (1.0,):
                impostor.max_error = max_error
                found = _timed(stage, impostor, cameras)
                results.points.setdefault(name, {})[max_error] = found
                if max_error == 1.0:
                    yield from _rows(name, len(actors), found, 20)


def _timed(stage, impostor, cameras, every=10) -> dict:
    """Return mean milliseconds of frames, each so many with one of meshes between them."""
    warm_up(stage, impostor, cameras[:1])
    rendered, errors = [impostor.rendered], [0.0]

    def note(enabled):
        if enabled:
            rendered.append(impostor.rendered)
            errors.append(impostor.report()['error_px'])

    return beside_full(stage, impostor, cameras, every, note) | {
        'error': max(errors),
        'drawn': (rendered[-1] - rendered[0]) / len(cameras),
        'frames': np.count_nonzero(np.diff(rendered)) / len(cameras),
    }


def _rows(name, count, found, bar):
    yield Row(f'{name}: {count} meshes', found['full_ms'], 'ms')
    yield Row(f'{name}: impostors, images drawn again included', found['ms'], 'ms')
    yield Row(f'{name}: faster than the meshes', found['full_ms'] / found['ms'], 'x', bar, True)
    yield Row(f'{name}: less processor time', found['full_cpu'] / found['cpu'], 'x')
    yield Row(f'{name}: images drawn again in a frame', found['drawn'])
    yield Row(f'{name}: frames in which any was', 100 * found['frames'], '%')
    yield Row(f'{name}: largest error shown', found['error'], 'px', 1.0)


def displaced(mesh, card) -> np.ndarray:
    """Return how far wrong pixels are from where they would be right, pixels."""
    k = len(mesh) // len(card)
    middle = slice(k // 2, None, k), slice(k // 2, None, k)
    away = np.where(mesh, distance_transform_edt(mesh), distance_transform_edt(~mesh))
    return away[middle][mesh[middle] != card] / k


def _outlines(settings, results):
    """Yield how far outlines are displaced on a walk around single objects."""
    worst: dict = dict.fromkeys(settings.errors, 0.0)
    for mesh in (knot(settings.few_cells), torus(settings.few_cells)):
        actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
        actor.prop.color, actor.prop.lighting = 'black', False
        cameras = orbit(settings.frames, 6 * mesh.length, 0.37)
        with _stage([actor], (160, 160), samples=4) as stage:
            fine = _covers(stage, cameras)
        for max_error in settings.errors:
            with _stage([actor], (160, 160), multi_samples=0) as stage:
                stage.plotter.ibr.add_impostor(actor, max_error=max_error, only_if_faster=False)
                for pair in zip(fine, _covers(stage, cameras), strict=True):
                    away = float(displaced(*pair).max(initial=0.0))
                    worst[max_error] = max(worst[max_error], away)
    results.points['outline'] = worst
    for max_error, away in worst.items():
        name = f'outline displaced at most, max_error {max_error:g}'
        yield Row(name, away, 'px', max_error + 0.5)


def _parts(settings, scale=1, seed=3):
    """Return unlike parts in a block, a quarter with edges and a tenth translucent."""
    rng = np.random.default_rng(seed)
    side, actors = int(np.ceil(settings.parts ** (1 / 3))), []
    for k in range(settings.parts):
        cells = int(settings.part_cells * rng.uniform(0.2, 1.8))
        edge = max(int(np.sqrt(cells / 2)), 3)
        meshes = (
            torus(cells),
            pv.Cylinder(radius=rng.uniform(0.3, 1), height=rng.uniform(0.5, 2), resolution=edge),
            pv.Cube(x_length=rng.uniform(0.5, 2), y_length=rng.uniform(0.5, 2)),
            pv.Sphere(theta_resolution=edge, phi_resolution=edge),
        )
        actor = pv.Actor(mapper=pv.DataSetMapper(meshes[k % 4]))
        actor.scale, actor.orientation = (2 / meshes[k % 4].length,) * 3, rng.random(3) * 360
        place = np.array(np.unravel_index(k, (side,) * 3)) - (side - 1) / 2
        actor.position = tuple(2.2 * place + 0.3 * rng.random(3))
        actor.prop.color = rng.uniform(0.2, 1, 3)
        actor.prop.show_edges, actor.prop.line_width = k % 16 < 4, scale
        if k % 10 == 9:
            actor.prop.opacity = 0.4
        actors.append(actor)
    return actors


def _assembly(settings, results):
    """Yield speed and error of an assembly at PyVista's defaults."""
    cameras = orbit(settings.frames, 6.0 * settings.parts ** (1 / 3))
    last = cameras[-3:]
    actors = _parts(settings)
    with _stage(actors, settings.size) as stage:
        stage.look(cameras[0])
        plain = pictures(stage, last)
        stage.look(cameras[0])
        impostor = stage.plotter.ibr.add_impostor(actors)
        found = _timed(stage, impostor, cameras)
        images = pictures(stage, last)
    with _stage(_parts(settings, scale=3), settings.size, samples=3) as stage:
        fine = pictures(stage, last)
    results.points['assembly'] = found
    yield from _rows('assembly', settings.parts, found, 10)
    ratio = mean_flip(images, fine) / mean_flip(plain, fine)
    yield Row('assembly: mean FLIP over that of the meshes', ratio, '', 1.25)


def _covers(stage, cameras):
    stage.plotter.set_background('white')
    found = []
    for camera in cameras:
        stage.look(camera)
        stage.draw()
        found.append(stage.pixels().mean(-1) < 128)
    return found


def _nailboards(settings, results):
    """Yield errors of depth, and of the line where two objects meet."""
    fine, _ = _meeting(images=False, samples=4)
    mesh, depths = _meeting(images=False, samples=1)
    card, found = _meeting(images=True, samples=1)
    line, off = [0.0], [0.0]
    for k, depth in enumerate(depths):
        both = mesh[k].any(-1) & card[k].any(-1)
        wrong = np.where(both, card[k][..., 0], mesh[k][..., 0])
        line += displaced(fine[k][..., 0], wrong).tolist()
        # Within a surface: before another one, a pixel is a step of its own.
        flat = maximum_filter(depth, 5) - minimum_filter(depth, 5) < 0.3
        same = both & (mesh[k] == card[k]).all(-1)
        deep = distance_transform_edt(same & flat) > 2
        off.append(np.abs(depth - found[k])[deep].max(initial=0.0))
    step = 2 * 1.5 / 255
    yield Row('nailboards: depth, of a step of 8 bits', max(off) / step, 'steps', 1.0)
    away = np.percentile(line, 99)
    yield Row('nailboards: line of intersection displaced (99 %)', away, 'px', 1)


def _meeting(images, samples):
    """Return where a ball and a torus are seen that interpenetrate, and their depth, twice."""
    ball = pv.Sphere(theta_resolution=200, phi_resolution=200)
    actors = [pv.Actor(mapper=pv.DataSetMapper(m)) for m in (ball, torus(40_000))]
    for actor, color in zip(actors, ('red', 'blue'), strict=True):
        actor.prop.color, actor.prop.lighting = color, False
    actors[0].scale, actors[0].position = (2.0,) * 3, (0.8, 0.3, 0.3)
    masks, depths = [], []
    with _stage(actors, (480, 360), samples=samples, multi_samples=0) as stage:
        if images:
            stage.plotter.ibr.add_impostor(actors, only_if_faster=False)
        for eye in ((3.0, -14.0, 9.0), (3.05, -14.0, 9.0)):
            stage.look((eye, (0, 0, 0), (0, 0, 1)))
            stage.draw()
            pixels = stage.pixels().astype(int)
            masks.append(np.stack([pixels[..., k] - pixels[..., 1] > 128 for k in (0, 2)], -1))
            depths.append(_linear(stage))
    return masks, depths


def _linear(stage):
    near, far = stage.renderer.GetActiveCamera().GetClippingRange()
    depth = stage.depth().astype(float)
    return np.where(depth < 1, near * far / (far - depth * (far - near)), 0.0)


def _hierarchy(settings, results):
    """Yield the rows of a slow walk beside a crowd: 1.2 m/s at 60 frames a second."""
    actors = scatter(settings.many, settings.crowd_cells, 2.2)
    side = 2.2 * np.sqrt(settings.many)
    start = np.array([0.0, -0.8 * side, 0.1 * side])
    cameras = [(np.add(start, (x, 0, 0)), (x, 0, 0), (0, 0, 1)) for x in np.arange(60) * 0.02]
    with _stage(actors, settings.size) as stage:
        stage.look(cameras[0])
        impostor = stage.plotter.ibr.add_impostor(actors, hierarchical=True)
        yield from _rows('hierarchy', len(actors), _timed(stage, impostor, cameras, 20), 50)
        told = impostor.report()
        meshes = sum(count for why, count in told['meshes'].items() if why != 'out of view')
        yield Row('hierarchy: images shown', told['shown'])
        yield Row('hierarchy: actors drawn as meshes', meshes)
        yield Row('hierarchy: memory', told['bytes'] / 2**20, 'MiB', impostor.memory / 2**20)


def plot(points, figure):
    """Draw time against error: the orbit at the left, outlines at the right."""
    cost, error = plots.subplots(figure, 1, 2)
    orbits, outline = points['orbit'], points['outline']
    cost.plot([p['ms'] for p in orbits.values()], list(orbits), 'o-', label='impostors')
    meshes = np.mean([p['full_ms'] for p in orbits.values()])
    cost.axvline(meshes, ls='--', color='0.5', label='meshes')
    cost.set(xscale='log', xlabel='ms a frame', ylabel='max_error, px', title='orbit')
    error.plot(list(outline), list(outline.values()), 'o-', label='measured')
    error.plot(list(outline), [e + 0.5 for e in outline], '--', color='0.5', label='bar')
    error.set(xlabel='max_error, px', ylabel='px', title='largest displacement of an outline')


def _scattered(settings, size, on):
    """Return heavy actors, as impostors or as they are."""
    actors = scatter(settings.actors, settings.cells, 4.0)
    pl = real_plotter(size, actors)
    pl.camera_position = orbit(1, 5.0 * np.sqrt(settings.actors))[0]
    if on:
        pl.ibr.add_impostor(actors)
    return pl, turning(pl, TURN)


BENCH = Bench(
    parts={
        'orbit and fly-by': _paths,
        'outlines': _outlines,
        'assembly': _assembly,
        'nailboards': _nailboards,
        'hierarchy': _hierarchy,
    },
    plot=plot,
    outside={'impostors': _scattered},
    settings={
        'size': ((1024, 768), (160, 90)),
        'actors': (200, 8),
        'many': (5000, 40),
        'cells': (40_000, 2000),
        'few_cells': (10_000, 500),
        'crowd_cells': (8000, 500),
        'parts': (800, 27),
        'part_cells': (20_000, 400),
        'frames': (40, 10),
        'errors': ((0.5, 1.0, 2.0, 4.0), (1.0,)),
    },
)
