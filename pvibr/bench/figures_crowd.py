"""A crowd of figures, each at its own time: its frames against posed meshes, and its error."""

from __future__ import annotations

import time

import numpy as np

from pvibr.bench.rows import Row
from pvibr.capture.offscreen import SAMPLES, Stage
from pvibr.maths.image_error import flip, outline_distances
from pvibr.scenes.walker import walker

#: Triangles of a figure.
TRIANGLES = 5400
#: Separate actors that are timed.
PART = 50
#: Frames that are timed, and seconds of the clip between them.
FRAMES, STEP = 5, 0.037
#: Metres between two figures.
SPACING = 1.1
VIEW_ANGLE = 30.0


def measure(settings, results):
    """Add the rows of the crowd."""
    figure, places, times = _scene(settings.crowd)
    camera = _camera(places)
    own = _own(figure, places, times, camera, settings, results)
    posed, drawn = _separate(figure, places, times, camera, settings)
    name = f'crowd of {settings.crowd:,} figures of {figure.meshes[0].mesh.n_cells:,} triangles'
    part = f'extrapolated from {PART}'
    results.rows += [
        Row(f'{name}: a frame', own, 'ms'),
        Row(f'{name}: posed meshes as separate actors, {part}', posed, 'ms'),
        Row(f'{name}: faster than these', posed / own, 'x', 100.0, at_least=True),
        Row(f'{name}: faster than the same at rest, {part}', drawn / own, 'x'),
    ]
    _error(figure, places, times, camera, settings, results)


def _scene(count):
    """Return a figure, where each one stands, and its time."""
    rng = np.random.default_rng(0)
    columns = int(np.ceil(count**0.5))
    grid = np.stack(np.divmod(np.arange(count), columns), 1)[:, ::-1] - columns / 2
    places = np.zeros((count, 3))
    places[:, :2] = SPACING * (grid + rng.uniform(-0.3, 0.3, (count, 2)))
    return walker(TRIANGLES), places, rng.uniform(0, 1, count)


def _camera(places):
    """Return a camera that has all figures in view, from above."""
    reach = np.abs(places).max()
    away = np.array([0.0, -3.6, 2.2]) * reach
    return [tuple(away), (0.0, -0.1 * reach, 0.0), (0.0, 0.0, 1.0)]


def _own(figure, places, times, camera, settings, results):
    """Return the milliseconds of a frame in which all move."""
    with Stage(settings.screen, view_angle=VIEW_ANGLE) as stage:
        crowd = stage.plotter.ibr.add_animated(figure, places, times=times, progress=False)
        stage.look(camera)
        stage.draw()
        found, python = [], []
        for i in range(FRAMES):
            start = time.perf_counter()
            stage.plotter.ibr.time = STEP * (i + 1)
            stage.draw()
            found.append(time.perf_counter() - start)
            rows = stage.plotter.ibr.report().as_dict()['rows']
            python.append(sum(row['ms'] for row in rows))
        report = crowd.report()
        results.rows += [
            Row('crowd: Python a frame while all move', float(np.median(python)), 'ms'),
            Row('crowd: members drawn as meshes', _meshes(report)),
            Row('crowd: bytes on the GPU', report['bytes'] / 2**20, 'MiB'),
            Row('crowd: bake', crowd.atlases[0].seconds, 's'),
        ]
    return float(np.median(found)) * 1e3


def _meshes(report) -> int:
    return sum(v for k, v in report.items() if k.startswith('mesh '))


def _separate(figure, places, times, camera, settings):
    """Return the milliseconds of a frame of separate actors: posed anew, and left as they are."""
    count = min(PART, len(places))
    lot = np.random.default_rng(1).permutation(len(places))[:count]
    with Stage(settings.screen, view_angle=VIEW_ANGLE) as stage:
        meshes = [figure.mesh(t) for t in times[lot]]
        look = figure.meshes[0].look
        for mesh, place in zip(meshes, places[lot], strict=True):
            stage.plotter.add_mesh(mesh, **look).position = place
        stage.look(camera)
        stage.draw()
        found: dict[bool, list] = {True: [], False: []}
        for i in range(FRAMES):
            for moving, seconds in found.items():
                start = time.perf_counter()
                if moving:
                    for mesh, t in zip(meshes, times[lot] + STEP * (i + 1), strict=True):
                        points, normals = figure.posed(0, figure.sample(t))
                        mesh.points[:] = points
                        mesh.point_data['Normals'][:] = normals
                        mesh.GetPoints().Modified()
                        mesh.Modified()
                stage.draw()
                seconds.append(time.perf_counter() - start)
        empty = _empty(settings.screen, camera)
    scale = 1e3 * len(places) / count
    return [(float(np.median(s)) - empty) * scale for s in found.values()]


def _empty(size, camera):
    """Return the seconds of a frame with nothing in it."""
    with Stage(size, view_angle=VIEW_ANGLE) as stage:
        stage.look(camera)
        return float(np.median([stage.draw() for _ in range(FRAMES)]))


def _error(figure, places, times, camera, settings, results):
    """Add the error of some of the crowd beside posed meshes, at several times."""
    count = min(settings.crowd_part, len(places))
    lot = np.random.default_rng(2).permutation(len(places))[:count]
    seconds = [0.0, 0.13, 0.31]
    part = figure, places[lot], times[lot], camera, settings.screen
    truth, covered = _full(*part, SAMPLES, seconds)
    once, _ = _full(*part, 1, seconds)
    with Stage(settings.screen, view_angle=VIEW_ANGLE) as stage:
        stage.plotter.ibr.add_animated(figure, places[lot], times=times[lot], progress=False)
        own = []
        for t in seconds:
            stage.plotter.ibr.time = t
            stage.look(camera)
            own.append(stage.picture())
        drawn = stage.coverage()
    pairs = (drawn, covered), (covered, drawn)
    away = np.concatenate([outline_distances(*pair)[1] for pair in pairs])
    base = np.mean([flip(a, b).mean() for a, b in zip(once, truth, strict=True)])
    ours = np.mean([flip(a, b).mean() for a, b in zip(own, truth, strict=True)])
    results.rows += [
        Row(f'crowd: FLIP of posed meshes ({count} figures)', float(base)),
        Row('crowd: FLIP over that of posed meshes', float(ours / base), 'x', 1.0),
        Row('crowd: p99 of how far outlines are off', float(np.percentile(away, 99)), 'px', 1.5),
    ]


def _full(figure, places, times, camera, size, samples, seconds):
    """Return pictures of posed meshes at some times, and what they cover at the last one."""
    found = []
    with Stage(size, view_angle=VIEW_ANGLE, samples=samples) as stage:
        look = figure.meshes[0].look
        meshes = [figure.mesh(t) for t in times]
        for mesh, place in zip(meshes, places, strict=True):
            stage.plotter.add_mesh(mesh, **look).position = place
        for t in seconds:
            for mesh, own in zip(meshes, times + t, strict=True):
                points, normals = figure.posed(0, figure.sample(own))
                mesh.points = points
                mesh.point_data.active_normals = normals
            stage.look(camera)
            found.append(stage.picture())
        return found, stage.coverage()
