"""A crowd of figures, each at its own time: its frames against posed meshes, and its error."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.timing import mean_flip, python_ms, timed
from pvibr.maths.image_error import displacements
from pvibr.scenes.stage import SAMPLES, Stage
from pvibr.scenes.walker import walker

#: Triangles of a figure.
TRIANGLES = 5400
#: Separate actors that are timed.
PART = 50
#: Frames that are timed, and seconds of the clip between them.
FRAMES, STEP = 5, 0.037
#: Times at which the error is measured, seconds.
MOMENTS = 0.0, 0.13, 0.31
#: Metres between two figures.
SPACING = 1.1


def measure(settings, results):
    """Yield the rows of the crowd."""
    crowd = _Crowd(settings)
    own = yield from crowd.own_ms()
    posed, drawn = crowd.separate_ms()
    triangles = crowd.figure.meshes[0].mesh.n_cells
    name = f'crowd of {settings.crowd:,} figures of {triangles:,} triangles'
    part = f'extrapolated from {PART}'
    yield Row(f'{name}: a frame', own, 'ms')
    yield Row(f'{name}: posed meshes as separate actors, {part}', posed, 'ms')
    yield Row(f'{name}: faster than these', posed / own, 'x', 100.0, at_least=True)
    yield Row(f'{name}: faster than the same at rest, {part}', drawn / own, 'x')
    yield from crowd.error()


class _Crowd:
    """A figure, where each of many copies stands, its time, and a camera that sees all."""

    def __init__(self, settings):
        rng = np.random.default_rng(0)
        columns = int(np.ceil(settings.crowd**0.5))
        grid = np.stack(np.divmod(np.arange(settings.crowd), columns), 1)[:, ::-1] - columns / 2
        self.settings = settings
        self.places = np.zeros((settings.crowd, 3))
        self.places[:, :2] = SPACING * (grid + rng.uniform(-0.3, 0.3, (settings.crowd, 2)))
        self.figure = walker(TRIANGLES)
        self.times = rng.uniform(0, 1, settings.crowd)
        reach = np.abs(self.places).max()
        away = np.array([0.0, -3.6, 2.2]) * reach
        self.camera = [tuple(away), (0.0, -0.1 * reach, 0.0), (0.0, 0.0, 1.0)]

    def own_ms(self):
        """Yield rows of the crowd, and return the ms of a frame in which all move."""
        with self._stage() as stage:
            crowd = self._show(stage, slice(None))
            stage.draw()
            found, python = [], []
            for i in range(FRAMES):
                start = time.perf_counter()
                stage.plotter.ibr.time = STEP * (i + 1)
                stage.draw()
                found.append(time.perf_counter() - start)
                python.append(python_ms(stage))
            report = crowd.report()
            meshes = sum(v for k, v in report.items() if k.startswith('mesh '))
            yield Row('crowd: Python a frame while all move', np.median(python), 'ms')
            yield Row('crowd: members drawn as meshes', meshes)
            yield Row('crowd: bytes on the GPU', report['bytes'] / 2**20, 'MiB')
            yield Row('crowd: bake', crowd.atlases[0].seconds, 's')
        return 1e3 * float(np.median(found))

    def separate_ms(self):
        """Return the ms of a frame of separate actors: posed anew, and left as they are."""
        some = self._some(PART, seed=1)
        moved, still = [], []
        with self._stage() as stage:
            meshes = self._add_meshes(stage, some)
            stage.look(self.camera)
            stage.draw()
            for i in range(FRAMES):
                times = self.times[some] + STEP * (i + 1)
                _, posing = timed(lambda times=times: self._pose(meshes, times))
                moved.append(posing + stage.draw())
                still.append(stage.draw())
        with self._stage() as stage:
            stage.look(self.camera)
            empty = np.median([stage.draw() for _ in range(FRAMES)])
        scale = 1e3 * len(self.places) / len(some)
        return [float(np.median(s) - empty) * scale for s in (moved, still)]

    def error(self):
        """Yield the error of some of the crowd beside posed meshes, at several times."""
        some = self._some(self.settings.crowd_part, seed=2)
        truth, covered = self._full(some, samples=SAMPLES)
        once, _ = self._full(some, multi_samples=0)
        with self._stage() as stage:
            self._show(stage, some)
            own = []
            for t in MOMENTS:
                stage.plotter.ibr.time = t
                stage.look(self.camera)
                own.append(stage.picture())
            stage.window.SetMultiSamples(0)
            drawn = stage.coverage()
        base, ours = mean_flip(once, truth), mean_flip(own, truth)
        away = np.percentile(displacements(drawn, covered), 99)
        yield Row(f'crowd: FLIP of posed meshes at one sample ({len(some)} figures)', base)
        yield Row('crowd: FLIP over that of posed meshes at one sample', ours / base, 'x', 1.0)
        yield Row('crowd: p99 of how far outlines are off', away, 'px', 1.5)

    def _full(self, some, **samples):
        """Return pictures of posed meshes at some times, and what they cover at the last one."""
        found = []
        with self._stage(**samples) as stage:
            meshes = self._add_meshes(stage, some)
            for t in MOMENTS:
                self._pose(meshes, self.times[some] + t)
                stage.look(self.camera)
                found.append(stage.picture())
            return found, stage.coverage()

    def _stage(self, **samples):
        return Stage(self.settings.screen, **samples)

    def _some(self, count, seed):
        count = min(count, len(self.places))
        return np.random.default_rng(seed).permutation(len(self.places))[:count]

    def _show(self, stage, some):
        times, add = self.times[some], stage.plotter.ibr.add_animated
        crowd = add(self.figure, self.places[some], times=times, progress=False)
        stage.look(self.camera)
        return crowd

    def _add_meshes(self, stage, some):
        meshes = [self.figure.mesh(t) for t in self.times[some]]
        look = self.figure.meshes[0].look
        for mesh, place in zip(meshes, self.places[some], strict=True):
            stage.plotter.add_mesh(mesh, **look).position = place
        return meshes

    def _pose(self, meshes, times):
        for mesh, t in zip(meshes, times, strict=True):
            points, normals = self.figure.posed(0, self.figure.sample(t))
            mesh.points[:] = points
            mesh.point_data['Normals'][:] = normals
            mesh.GetPoints().Modified()
            mesh.Modified()
