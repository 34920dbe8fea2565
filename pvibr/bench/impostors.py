"""Impostors on the fly: time, error and how often images are drawn again."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

from pvibr.bench.plot import save, two_axes
from pvibr.bench.rows import Row
from pvibr.bench.runs import run
from pvibr.capture.offscreen import Stage

#: Degrees of the orbit and world units of the fly-by from one frame to the next: a turn in 24 s
#: at 60 frames a second, and the same pace straight on.
TURN, STEP = 0.25, 0.2


@dataclass
class Settings:
    """How much is measured."""

    size: tuple = (1280, 720)
    actors: int = 200
    many: int = 5000
    cells: int = 40_000
    few_cells: int = 10_000
    crowd_cells: int = 8000
    frames: int = 40
    errors: tuple = (0.5, 1.0, 2.0, 4.0)


QUICK = Settings((160, 90), 8, 40, 2000, 500, 500, 10, (1.0,))


def measure(out, *, quick=False) -> list:
    """Measure everything, and write the table and the plot."""
    parts = {
        'orbit and fly-by': _paths,
        'outlines': _outlines,
        'nailboards': _nailboards,
        'hierarchy': _hierarchy,
    }
    return run('impostors', parts, QUICK if quick else Settings(), plot, out, quick=quick)


def knot(cells) -> pv.PolyData:
    """Return a knot of about so many triangles, with normals."""
    t = np.linspace(0, 2 * np.pi, max(cells // 48, 12))
    ring = 2 + np.cos(3 * t)
    line = np.c_[ring * np.cos(2 * t), ring * np.sin(2 * t), np.sin(3 * t)]
    return pv.Spline(line, len(t)).tube(radius=0.5, n_sides=24).triangulate().compute_normals()


def torus(cells) -> pv.PolyData:
    """Return a torus of about so many triangles, with normals."""
    side = int(np.sqrt(cells / 4)) + 1
    return pv.ParametricTorus(u_res=2 * side, v_res=side).compute_normals()


def scatter(count, cells, spacing, seed=0) -> list:
    """Return actors on a square, turned at random, about 2 units large."""
    rng = np.random.default_rng(seed)
    meshes, columns = (knot(cells), torus(cells)), int(np.ceil(np.sqrt(count)))
    found = []
    for i in range(count):
        mesh = meshes[i % 2]
        actor = pv.Actor(mapper=pv.DataSetMapper(mesh.copy(deep=False)))
        actor.prop.color, actor.prop.interpolation = rng.random(3), 'Phong'
        actor.scale, actor.orientation = (2 / mesh.length,) * 3, rng.random(3) * 360
        place = np.array(divmod(i, columns)) - (columns - 1) / 2 + 0.5 * rng.random(2)
        actor.position = (*(spacing * place), 0.0)
        found.append(actor)
    return found


def orbit(frames, radius, turn=TURN) -> list:
    """Return cameras around the origin."""
    angles = np.radians(turn * np.arange(frames))
    eyes = np.stack([np.cos(angles), np.sin(angles), np.full(frames, 0.5)], 1) * radius
    return [(eye, (0, 0, 0), (0, 0, 1)) for eye in eyes.tolist()]


def fly_by(frames, radius, step=STEP) -> list:
    """Return cameras that go past the origin, looking ahead and down."""
    eyes = np.array([0.3, -1.0, 0.5]) * radius + np.arange(frames)[:, None] * [0, step, 0]
    return [
        (e, np.add(e, (-0.3 * radius, radius, -0.5 * radius)), (0, 0, 1)) for e in eyes.tolist()
    ]


def _stage(settings, actors, size=None, samples=1):
    stage = Stage(size or settings.size, samples=samples)
    stage.add(actors)
    bounds = np.array([a.bounds for a in actors])
    ends = np.stack([bounds[:, ::2].min(0), bounds[:, 1::2].max(0)], 1)
    stage.bounds = tuple(ends.ravel().tolist())
    return stage


def _paths(settings, results):
    radius = 5.0 * np.sqrt(settings.actors)
    for name, path in {'orbit': orbit, 'fly-by': fly_by}.items():
        cameras = path(settings.frames, radius)
        actors = scatter(settings.actors, settings.cells, 4.0)
        with _stage(settings, actors) as stage:
            stage.look(cameras[0])
            impostor = stage.plotter.ibr.add_impostor(actors)
            for max_error in settings.errors if name == 'orbit' else (1.0,):
                impostor.max_error = max_error
                found = _timed(stage, impostor, cameras)
                results.points.setdefault(name, {})[max_error] = found
                if max_error == 1.0:
                    _tell(results, name, len(actors), found, 20)


def _timed(stage, impostor, cameras, every=10) -> dict:
    """Return mean milliseconds of frames, each so many with one of meshes between them."""
    for enabled in (False, True):
        impostor.enabled = enabled
        stage.look(cameras[0])
        stage.draw()
    times: dict = {True: [], False: []}
    before, frames, worst = impostor.rendered, 0, 0.0
    for k, camera in enumerate(cameras):
        for enabled in (True, False) if k % every == every - 1 else (True,):
            impostor.enabled = enabled
            stage.look(camera)
            start, drawn = time.process_time(), impostor.rendered
            wall = stage.draw()
            times[enabled].append((1e3 * wall, 1e3 * (time.process_time() - start)))
            frames += impostor.rendered > drawn
        impostor.enabled = True
        worst = max(worst, impostor.report()['error_px'])
    (ms, cpu), (mesh_ms, mesh_cpu) = (np.mean(times[k], axis=0).tolist() for k in (True, False))
    return {
        'ms': ms,
        'cpu': cpu,
        'mesh_ms': mesh_ms,
        'mesh_cpu': mesh_cpu,
        'error': worst,
        'drawn': (impostor.rendered - before) / len(cameras),
        'frames': frames / len(cameras),
    }


def _tell(results, name, count, found, bar):
    results.rows += [
        Row(f'{name}: {count} meshes', found['mesh_ms'], 'ms'),
        Row(f'{name}: impostors, images drawn again included', found['ms'], 'ms'),
        Row(f'{name}: faster than the meshes', found['mesh_ms'] / found['ms'], 'x', bar, True),
        Row(f'{name}: less processor time', found['mesh_cpu'] / found['cpu'], 'x'),
        Row(f'{name}: images drawn again in a frame', found['drawn']),
        Row(f'{name}: frames in which any was', 100 * found['frames'], '%'),
        Row(f'{name}: largest error shown', found['error'], 'px', 1.0),
    ]


def displaced(mesh, card) -> np.ndarray:
    """Return how far wrong pixels are from where they would be right, pixels."""
    k = len(mesh) // len(card)
    middle = slice(k // 2, None, k), slice(k // 2, None, k)
    away = np.where(mesh, distance_transform_edt(mesh), distance_transform_edt(~mesh))
    return away[middle][mesh[middle] != card] / k


def _outlines(settings, results):
    """Measure single objects on a walk around them."""
    worst: dict = dict.fromkeys(settings.errors, 0.0)
    for mesh in (knot(settings.few_cells), torus(settings.few_cells)):
        actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
        actor.prop.color, actor.prop.lighting = 'black', False
        cameras = orbit(settings.frames, 6 * mesh.length, 0.37)
        with _stage(settings, [actor], (160, 160), 4) as stage:
            fine = _covers(stage, cameras)
        for max_error in settings.errors:
            with _stage(settings, [actor], (160, 160)) as stage:
                stage.plotter.ibr.add_impostor(actor, max_error=max_error, only_if_faster=False)
                for pair in zip(fine, _covers(stage, cameras), strict=True):
                    found = displaced(*pair).max(initial=0.0)
                    worst[max_error] = max(worst[max_error], float(found))
    results.points['outline'] = worst
    for max_error, found in worst.items():
        name = f'outline displaced at most, max_error {max_error:g}'
        results.rows.append(Row(name, found, 'px', max_error + 0.5))


def _covers(stage, cameras):
    stage.plotter.set_background('white')
    found = []
    for camera in cameras:
        stage.look(camera)
        stage.draw()
        found.append(stage.pixels().mean(-1) < 128)
    return found


def _nailboards(settings, results):
    """Measure depth, and the line where two objects meet."""
    (fine, _), (mesh, depths), (card, found) = (
        _meeting(settings, images, samples) for images, samples in ((0, 4), (0, 1), (1, 1))
    )
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
    results.rows += [
        Row('nailboards: depth, of a step of 8 bits', max(off) / step, 'steps', 1.0),
        Row('nailboards: line of intersection displaced (99 %)', np.percentile(line, 99), 'px', 1),
    ]


def _meeting(settings, images, samples):
    """Return where a ball and a torus are seen that interpenetrate, and their depth, twice."""
    ball = pv.Sphere(theta_resolution=200, phi_resolution=200)
    actors = [pv.Actor(mapper=pv.DataSetMapper(m)) for m in (ball, torus(40_000))]
    for actor, color in zip(actors, ('red', 'blue'), strict=True):
        actor.prop.color, actor.prop.lighting = color, False
    actors[0].scale, actors[0].position = (2.0,) * 3, (0.8, 0.3, 0.3)
    masks, depths = [], []
    with _stage(settings, actors, (480, 360), samples) as stage:
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
    """Measure a slow walk beside a crowd: 1.2 m/s at 60 frames a second."""
    actors = scatter(settings.many, settings.crowd_cells, 2.2)
    side = 2.2 * np.sqrt(settings.many)
    start = np.array([0.0, -0.8 * side, 0.1 * side])
    cameras = [(np.add(start, (x, 0, 0)), (x, 0, 0), (0, 0, 1)) for x in np.arange(60) * 0.02]
    with _stage(settings, actors) as stage:
        stage.look(cameras[0])
        impostor = stage.plotter.ibr.add_impostor(actors, hierarchical=True)
        _tell(results, 'hierarchy', len(actors), _timed(stage, impostor, cameras, 20), 50)
        told = impostor.report()
        results.rows += [
            Row('hierarchy: images shown', told['shown']),
            Row('hierarchy: actors drawn as meshes', _meshes(told)),
            Row('hierarchy: memory', told['bytes'] / 2**20, 'MiB', impostor.memory / 2**20),
        ]


def _meshes(told):
    return sum(count for why, count in told['meshes'].items() if why != 'out of view')


def plot(results, path):
    """Draw time against error: the orbit at the left, outlines at the right."""
    figure, (cost, error) = two_axes((11, 4.5))
    points = results.points['orbit']
    cost.plot([p['ms'] for p in points.values()], list(points), 'o-', label='impostors')
    cost.axvline(
        np.mean([p['mesh_ms'] for p in points.values()]), ls='--', color='0.5', label='meshes'
    )
    cost.set(xscale='log', xlabel='ms a frame', ylabel='max_error, px', title='orbit')
    outline = results.points['outline']
    error.plot(list(outline), list(outline.values()), 'o-', label='measured')
    error.plot(list(outline), [e + 0.5 for e in outline], '--', color='0.5', label='bar')
    error.set(xlabel='max_error, px', ylabel='px', title='largest displacement of an outline')
    for axes in (cost, error):
        axes.legend(fontsize='small')
    save(figure, 'impostors', results, path)
