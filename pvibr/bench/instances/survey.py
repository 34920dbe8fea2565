"""A survey of fields of meshes that are made anew from a seed: whole frames beside VTK's own."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.table import Table
from scipy.spatial.transform import Rotation

from pvibr.bench.common import plots, whole_frames
from pvibr.bench.common.harness import Bench, Row
from pvibr.bench.common.peers import glyph_actors
from pvibr.bench.common.timing import mean_flip, timed
from pvibr.bench.instances.unseen_meshes import KINDS, STANDING, unseen
from pvibr.capture.offscreen import SAMPLES, Stage, mesh_actors, spheres

SIZE = 480, 270
#: Of the eye above the ground, degrees.
ELEVATIONS = 5, 15, 30, 60, 85
#: The max_error in pixels of each way to draw.
WAYS = {'ours': 1.0, 'coarse': 2.0, 'cards': 100.0}
#: Degrees that a camera turns from one frame that is timed to the next.
_STEP = 0.2
_BACKGROUND = 'white'


@dataclass
class Found:
    """What a survey finds of one mesh; times are means over the elevations of medians."""

    name: str
    triangles: int
    add_s: list[float] = field(default_factory=list)  # baked, then from the cache
    bytes: int = 0
    levels: str = ''
    ms: dict[str, float] = field(default_factory=dict)  # by way and samples per pixel
    flip: dict[str, list[float]] = field(default_factory=dict)  # over the meshes', by elevation
    error: str = ''  # why it could not be measured

    @property
    def speed(self) -> float:
        """How many times faster than VTK's own way."""
        return self.ms['peer, 0'] / self.ms['ours, 0']

    @property
    def over_cards(self) -> float:
        """The frame over that of flat cards alone."""
        return self.ms['ours, 0'] / self.ms['cards, 0']

    @property
    def over_coarse(self) -> float:
        """The frame over that of ``max_error=2``."""
        return self.ms['ours, 0'] / self.ms['coarse, 0']

    def worst_flip(self, samples) -> float:
        """Return the greatest FLIP over that of the meshes."""
        return max(self.flip[f'ours, {samples}'])


@dataclass(frozen=True)
class Field:
    """Instances of one mesh beside, on and in one another, and how they are looked at."""

    make: Callable[[], list]  # parts of their own for each window
    poses: np.ndarray
    cameras: list

    @property
    def index(self) -> np.ndarray:
        """The mesh of each instance."""
        return np.zeros(len(self.poses), int)

    def stage(self, samples=1) -> Stage:
        """Return an empty window whose clipping planes are the field's."""
        stage = Stage(SIZE, samples=samples, background=_BACKGROUND)
        centers, radii = spheres([self.make()], self.poses, self.index)
        low, high = (centers - radii[:, None]).min(0), (centers + radii[:, None]).max(0)
        stage.bounds = tuple(np.stack([low, high], 1).ravel())
        return stage

    def meshes(self, samples=1) -> Stage:
        """Return a window with an actor for each instance."""
        stage = self.stage(samples)
        stage.add(mesh_actors([self.make()], self.poses, self.index))
        return stage


def field_of(name, make, count, seed) -> Field:
    """Return a field whose poses and cameras vary with the seed."""
    rng = np.random.default_rng([seed, *name.encode()])
    _, (radius,) = spheres([make()], np.eye(4)[None], [0])
    side = int(np.ceil(np.sqrt(count)))
    spacing = radius * rng.uniform(0.9, 1.8)  # at most 2 radii would stand free
    places = np.stack(np.divmod(np.arange(count), side), 1) - (side - 1) / 2
    places = np.c_[places + rng.uniform(-0.4, 0.4, (count, 2)), np.zeros(count)] * spacing
    turns = Rotation.from_quat(rng.normal(size=(count, 4)))
    if name in STANDING:
        turns = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi, (count, 1)) * [0.0, 0.0, 1.0])
    else:
        places[:, 2] = rng.uniform(-0.3, 0.3, count) * spacing
    poses = np.tile(np.eye(4), (count, 1, 1))
    scales = (
        rng.uniform(0.6, 1.4, count) if rng.random() < 0.7 else np.exp(rng.normal(0, 0.5, count))
    )
    poses[:, :3, :3] = turns.as_matrix() * scales[:, None, None]
    poses[:, :3, 3] = places
    return Field(make, poses, [_camera(e, side * spacing, rng) for e in ELEVATIONS])


def _camera(elevation, size, rng):
    azimuth, height = rng.uniform(0, 2 * np.pi), np.radians(elevation)
    away = np.array([np.cos(azimuth), np.sin(azimuth), np.tan(height)]) * np.cos(height)
    return tuple(rng.uniform(0.8, 1.3) * size * away), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def measured(name, make, settings, seed) -> Found:
    """Measure a field of one mesh."""
    scene, parts = field_of(name, make, settings.instances, seed), make()
    found = Found(name, sum(part.mesh.n_cells for part in parts))
    with scene.meshes(SAMPLES) as stage:
        truth = [_picture(stage, camera) for camera in scene.cameras]
    with TemporaryDirectory() as folder, ExitStack() as stack:
        stages = {way: stack.enter_context(scene.stage()) for way in WAYS}
        things = {}
        for way, max_error in WAYS.items():
            add = partial(stages[way].plotter.ibr.add_instances, cache=folder, progress=False)
            add = partial(add, scene.make(), scene.poses, max_error=max_error)
            things[way], seconds = timed(partial(add, bake=True, show_scalar_bar=False))
            found.add_s.append(seconds)
        stages['meshes'] = stack.enter_context(scene.meshes())
        stages['peer'] = stack.enter_context(_peer(scene))
        for samples in whole_frames.SAMPLES:
            for stage in stages.values():
                stage.window.SetMultiSamples(samples)
            _compare(stages, scene, truth, samples, found)
            _time(stages, scene, samples, settings, found)
        report = things['ours'].report()
        found.bytes, found.levels = report['bytes'], report['atlas 0']
    return found


def _peer(scene) -> Stage:
    """Return a window with VTK's own instances; with actors where these show no texture."""
    parts = scene.make()
    if any(part.actor.GetTexture() for part in parts):
        return scene.meshes()
    stage = scene.stage()
    stage.add(glyph_actors([parts], scene.poses, scene.index))
    return stage


def _picture(stage, camera):
    stage.look(camera)
    return stage.picture()


def _compare(stages, scene, truth, samples, found):
    """Note FLIP over that of the meshes, at each elevation."""
    for camera, reference in zip(scene.cameras, truth, strict=True):
        base = mean_flip([_picture(stages['meshes'], camera)], [reference])
        for way in WAYS:
            flip = mean_flip([_picture(stages[way], camera)], [reference])
            found.flip.setdefault(f'{way}, {samples}', []).append(flip / max(base, 1e-6))


def _time(stages, scene, samples, settings, found):
    """Note the ms of frames that are drawn by turns while the camera turns."""
    times: dict[str, list] = {way: [] for way in (*WAYS, 'peer')}
    for camera in scene.cameras:
        rounds: dict[str, list] = {way: [] for way in times}
        for k in range(settings.frames + 1):
            for way in WAYS if k <= settings.frames - settings.peer_frames else times:
                rounds[way].append(_frame(stages[way], camera, k))
        for way, seconds in rounds.items():
            # The first frame from where another camera was is no frame of a turning one.
            times[way].append(1e3 * np.median(seconds[way != 'peer' :]))
    found.ms |= {f'{way}, {samples}': float(np.mean(ms)) for way, ms in times.items()}


def _frame(stage, camera, k) -> float:
    """Return the seconds of a frame of a camera that turns."""
    stage.look(camera)
    stage.plotter.camera.Azimuth(_STEP * k)
    return stage.draw()


# -- the whole survey ----------------------------------------------------------------------------


def survey(seed) -> Bench:
    """Return the bench of the meshes of a seed."""
    return Bench(
        parts={'survey': partial(_measure, seed)},
        plot=_plot,
        outside={},
        tables=_tables,
        settings={
            'seed': (seed, seed),
            'instances': (400, 60),
            'triangles': ((10_000, 100_000), (3_000, 6_000)),
            'kinds': (len(KINDS), 3),
            'frames': (5, 2),
            'peer_frames': (1, 1),
        },
    )


def _measure(seed, settings, results):
    found: list[Found] = []
    for name, make in list(unseen(seed, settings.triangles))[: settings.kinds]:
        try:
            found.append(measured(name, make, settings, seed))
        except Exception as error:  # the others are measured all the same
            found.append(Found(name, 0, error=_told(error)))
        sys.stderr.write(f'{_line(found[-1])}\n')
        found.sort(key=_badness, reverse=True)
        results.points['survey'] = [asdict(f) for f in found]
    yield from rows(found)


def _line(found) -> str:
    if found.error:
        return f'{found.name}: {found.error}'
    flips = ' and '.join(f'{found.worst_flip(n):.2f}' for n in whole_frames.SAMPLES)
    return (
        f'{found.name}: over VTK {found.speed:.1f}x, over cards {found.over_cards:.2f}, '
        f'1 over 2 {found.over_coarse:.2f}, FLIP {flips}'
    )


def _told(error) -> str:
    """Return an error and where it was raised in pvibr, in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    last = [f for f in frames if '/pvibr/' in Path(f.filename).as_posix()][-1]
    return f'{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})'


def _badness(found) -> float:
    """Return by how much the farthest bar is missed."""
    if found.error:
        return np.inf
    return max(
        20 / found.speed, found.over_cards / 3, found.over_coarse / 1.6, found.worst_flip(0)
    )


def rows(found):
    """Yield means and the worst of some meshes, with their bars."""

    def mean(values):
        return np.exp(np.mean(np.log(list(values))))

    yield Row('meshes that could not be measured', sum(bool(f.error) for f in found), '', 0)
    found = [f for f in found if not f.error]
    if not found:
        return
    yield Row('over VTK, geometric mean', mean(f.speed for f in found), 'x', 50, at_least=True)
    yield Row('over VTK, least', min(f.speed for f in found), 'x', 20, at_least=True)
    yield Row('over flat cards, geometric mean', mean(f.over_cards for f in found), 'x', 2)
    yield Row('over flat cards, worst', max(f.over_cards for f in found), 'x', 3)
    yield Row('max_error 1 over 2, worst', max(f.over_coarse for f in found), 'x', 1.6)
    for samples, bar in zip(whole_frames.SAMPLES, (1.0, 1.05), strict=True):
        flips = [f.worst_flip(samples) for f in found]
        title = f"FLIP over the meshes', {samples} samples per pixel"
        yield Row(f'{title}, geometric mean', mean(flips), 'x')
        yield Row(f'{title}, worst', max(flips), 'x', bar)
    yield Row('bake, longest', max(f.add_s[0] for f in found), 's')
    yield Row('added again, longest', max(f.add_s[1] for f in found), 's', 0.2)


def _tables(points) -> list[Table]:
    """Return the table of the meshes, worst case first."""
    table = Table(
        'mesh', 'triangles', 'over VTK', 'ms', 'over cards', '1 over 2', 'FLIP, worst (mean)',
        f'FLIP at {whole_frames.SAMPLES[1]} samples', 'FLIP of cards', 'MiB', 'bake s', 'again s',
        title='fields of unseen meshes, worst first',
    )  # fmt: skip
    for f in (Found(**values) for values in points['survey']):
        if f.error:
            table.add_row(f.name, f.error)
            continue
        by_elevation = f.flip['ours, 0']
        at = ELEVATIONS[int(np.argmax(by_elevation))]
        table.add_row(
            f.name, f'{f.triangles:,}', f'{f.speed:.1f}x', f'{f.ms["ours, 0"]:.1f}',
            f'{f.over_cards:.2f}', f'{f.over_coarse:.2f}',
            f'{max(by_elevation):.2f} at {at} ({np.mean(by_elevation):.2f})',
            f'{f.worst_flip(whole_frames.SAMPLES[1]):.2f}', f'{max(f.flip["cards, 0"]):.2f}',
            f'{f.bytes / 2**20:.0f}', f'{f.add_s[0]:.1f}', f'{f.add_s[1]:.2f}',
        )  # fmt: skip
    return [table]


def _plot(points, figure):
    """Draw FLIP and the ratio to flat cards by how much faster each field is."""
    left, right = plots.subplots(figure, 1, 2)
    for f in (Found(**values) for values in points['survey'] if not values['error']):
        for axes, y in ((left, f.worst_flip(0)), (right, f.over_cards)):
            axes.plot(f.speed, y, 'o')
            plots.note(axes, f.name, f.speed, y)
    left.set(xscale='log', xlabel='times faster than VTK', ylabel="FLIP over the meshes', worst")
    right.set(xscale='log', xlabel='times faster than VTK', ylabel='frame over flat cards alone')
    plots.bar(left, 1.0)
    plots.bar(right, 3.0)
