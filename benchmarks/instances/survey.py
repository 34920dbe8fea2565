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

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.timing import mean_flip, timed
from benchmarks.instances.unseen_meshes import HEAVY_KINDS, KINDS, STANDING, unseen
from pvibr.cli.peers import glyph_actors
from pvibr.cli.timing import medians_ms, spent
from pvibr.instances.sharpness import sharpness
from pvibr.scenes.stage import MULTI_SAMPLES, SAMPLES, Stage, mesh_actors, spheres

SIZE = 480, 270
#: Of the eye above the ground, degrees.
ELEVATIONS = 5, 15, 30, 60, 85
#: The max_error in pixels of each way to draw.
WAYS = {'ours': 1.0, 'fine': 0.5, 'cards': 100.0}
#: From how many triangles on an opaque kind has a speed of its own to reach.
MANY_TRIANGLES = 10_000
#: Geometric means of the speed over VTK's own way that are asked for, by multisamples.
SPEEDS, HEAVY_SPEEDS = {8: 20.0, 0: 14.5}, {8: 25.0, 0: 25.0}
#: Bars of the least speed, of frames over flat cards, of FLIP over the meshes' own, of sharpness.
SPEED, OVER_CARDS, WORST_OVER_CARDS, FLIP, SHARPNESS, FINE_FLIP = 8.0, 2.5, 6.0, 1.05, 0.88, 1.15
#: Degrees that a camera turns from one frame that is timed to the next.
_STEP = 0.2
_BACKGROUND = 'white'


@dataclass
class MeshResult:
    """What a survey measures of one mesh; times are means over the elevations of medians.

    Keys are a way to draw and the multisamples, as ``'ours, 8'``.
    """

    name: str
    triangles: int
    opaque: bool = True
    add_s: list[float] = field(default_factory=list)  # into an empty cache, then from it
    image_bytes: int = 0
    levels: str = ''
    ms: dict[str, dict[str, float]] = field(default_factory=dict)  # by clock
    flip: dict[str, list[float]] = field(default_factory=dict)  # over the base's, by elevation
    sharpness: dict[str, list[float]] = field(default_factory=dict)  # over the truth, likewise
    error: str = ''  # why it could not be measured

    def speed(self, samples, clock='CPU') -> float:
        """Return how many times as fast as VTK's own way it is."""
        return self.ms[f'peer, {samples}'][clock] / self.ms[f'ours, {samples}'][clock]

    def over_cards(self, samples) -> float:
        """Return the frame over that of flat cards alone."""
        return self.ms[f'ours, {samples}']['CPU'] / self.ms[f'cards, {samples}']['CPU']

    def worst_flip(self, samples) -> float:
        """Return the greatest FLIP over that of the meshes at one sample."""
        return max(self.flip[f'ours, {samples}'])

    def worst_sharpness(self, samples) -> float:
        """Return the least sharpness beside the truth."""
        return min(self.sharpness[f'ours, {samples}'])

    def noise(self, samples) -> float:
        """Return the greatest sharpness over that of the meshes at one sample, which alias."""
        return float(np.divide(self.sharpness[f'ours, {samples}'], self.sharpness['base']).max())

    @property
    def fine_flip(self) -> float:
        """The greatest FLIP of ``max_error=0.5`` over that of the meshes, both at defaults."""
        meshes = self.flip[f'meshes, {MULTI_SAMPLES[0]}']
        return float(np.divide(self.flip[f'fine, {MULTI_SAMPLES[0]}'], meshes).max())


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

    def stage(self, **samples) -> Stage:
        """Return an empty window whose clipping planes are the field's."""
        stage = Stage(SIZE, **samples, background=_BACKGROUND)
        centers, radii = spheres([self.make()], self.poses, self.index)
        low, high = (centers - radii[:, None]).min(0), (centers + radii[:, None]).max(0)
        stage.bounds = tuple(np.stack([low, high], 1).ravel())
        return stage

    def meshes(self, **samples) -> Stage:
        """Return a window with an actor for each instance."""
        stage = self.stage(**samples)
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


def measured(name, make, settings, seed) -> MeshResult:
    """Measure a field of one mesh."""
    scene, parts = field_of(name, make, settings.instances, seed), make()
    result = MeshResult(name, sum(part.mesh.n_cells for part in parts))
    result.opaque = all(part.actor.GetProperty().GetOpacity() == 1 for part in parts)
    with scene.meshes(samples=SAMPLES) as stage:
        truth = [_picture(stage, camera) for camera in scene.cameras]
    with TemporaryDirectory() as folder, ExitStack() as stack:
        stages = {way: stack.enter_context(scene.stage()) for way in WAYS}
        for way, max_error in WAYS.items():
            add = partial(stages[way].plotter.ibr.add_instances, cache=folder, progress=False)
            add = partial(add, scene.make(), scene.poses, max_error=max_error)
            things, seconds = timed(partial(add, bake=True, show_scalar_bar=False))
            result.add_s.append(seconds)
            if way == 'ours':
                ours = things
        stages['meshes'] = stack.enter_context(scene.meshes(multi_samples=0))
        stages['peer'] = stack.enter_context(_peer(scene))
        pairs = list(zip(scene.cameras, truth, strict=True))
        base, result.sharpness['base'] = _errors(stages['meshes'], pairs)
        for samples in MULTI_SAMPLES:
            for stage in stages.values():
                stage.window.SetMultiSamples(samples)
            default = samples == MULTI_SAMPLES[0]
            for way in ('meshes', *WAYS) if default else WAYS:
                key = f'{way}, {samples}'
                flips, result.sharpness[key] = _errors(stages[way], pairs)
                result.flip[key] = np.divide(flips, base).tolist()
            _time(stages, scene, samples, settings, result)
        result.image_bytes = sum(atlas.nbytes for atlas in ours.atlases)
        result.levels = ours.report()['atlas 0']
    return result


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


def _errors(stage, pairs) -> tuple[list, list]:
    """Return FLIP, and the sharpness, of what each camera shows beside the truth."""
    pictures = [(_picture(stage, camera), truth) for camera, truth in pairs]
    flips = [max(mean_flip([picture], [truth]), 1e-6) for picture, truth in pictures]
    return flips, [sharpness(*pair) for pair in pictures]


def _time(stages, scene, samples, settings, result):
    """Note the ms of frames that are drawn by turns while the camera turns."""
    times: dict[str, list] = {way: [] for way in (*WAYS, 'peer')}
    for camera in scene.cameras:
        rounds: dict[str, list] = {way: [] for way in times}
        for k in range(settings.frames + 1):
            for way in WAYS if k <= settings.frames - settings.peer_frames else times:
                rounds[way].append(_frame(stages[way], camera, k))
        for way, frames in rounds.items():
            # The first frame from where another camera was is no frame of a turning one.
            times[way].append(medians_ms(frames[way != 'peer' :]))
    for way, medians in times.items():
        means = {clock: float(np.mean([ms[clock] for ms in medians])) for clock in medians[0]}
        result.ms[f'{way}, {samples}'] = means


def _frame(stage, camera, k) -> tuple[float, float]:
    """Return the seconds of a frame of a camera that turns, of both clocks."""
    stage.look(camera)
    stage.plotter.camera.Azimuth(_STEP * k)
    return spent(stage.window)


# -- the whole survey ----------------------------------------------------------------------------


def survey(seed, *, heavy=False) -> Bench:
    """Return the bench of the meshes of a seed: of all kinds, or of heavier ones."""
    kinds = HEAVY_KINDS if heavy else KINDS
    return Bench(
        parts={'survey': partial(_measure, seed, kinds, HEAVY_SPEEDS if heavy else SPEEDS)},
        plot=_plot,
        outside={},
        tables=_tables,
        settings={
            'seed': (seed, seed),
            'instances': (400, 60),
            'triangles': ((20_000, 110_000) if heavy else (10_000, 100_000), (3_000, 6_000)),
            'kinds': (len(kinds), 3),
            'frames': (5, 2),
            'peer_frames': (1, 1),
        },
    )


def _measure(seed, kinds, speeds, settings, results):
    measured_meshes: list[MeshResult] = []
    for name, make in list(unseen(seed, settings.triangles, kinds))[: settings.kinds]:
        try:
            result = measured(name, make, settings, seed)
        except Exception as error:  # the others are measured all the same
            result = MeshResult(name, 0, error=_told(error))
        sys.stderr.write(f'{_line(result)}\n')
        measured_meshes.append(result)
        measured_meshes.sort(key=_badness, reverse=True)
        results.points['survey'] = [asdict(r) for r in measured_meshes]
    yield from rows(measured_meshes, speeds)


def _line(result) -> str:
    if result.error:
        return f'{result.name}: {result.error}'
    columns = [
        f'at {n} samples over VTK {result.speed(n):.1f}x, over cards {result.over_cards(n):.2f}, '
        f'FLIP {result.worst_flip(n):.2f}, sharpness {result.worst_sharpness(n):.2f}'
        for n in MULTI_SAMPLES
    ]
    return f'{result.name}: {"; ".join(columns)}'


def _told(error) -> str:
    """Return an error and where it was raised in pvibr, in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    last = [f for f in frames if '/pvibr/' in Path(f.filename).as_posix()][-1]
    return f'{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})'


def _badness(result) -> float:
    """Return by how much the farthest bar is missed."""
    if result.error:
        return np.inf
    missed = [SPEED / result.speed(MULTI_SAMPLES[0]), result.fine_flip / FINE_FLIP]
    missed.append(result.over_cards(MULTI_SAMPLES[0]) / WORST_OVER_CARDS)
    for n in MULTI_SAMPLES:
        missed += [result.worst_flip(n) / FLIP, SHARPNESS / result.worst_sharpness(n)]
    return max(missed)


def rows(results, speeds):
    """Yield means and the worst of some meshes, with their bars; times are the processors'."""
    yield Row('meshes that could not be measured', sum(bool(r.error) for r in results), '', 0)
    results = [r for r in results if not r.error]
    if not results:
        return
    opaque = [r for r in results if r.opaque]
    for samples in MULTI_SAMPLES:
        bar = speeds[samples]
        for name, row in _rows_at(results, opaque, samples, bar):
            yield Row(f'{samples} samples: {name}', *row)
    fine = max(r.fine_flip for r in results)
    yield Row(
        "max_error=0.5: FLIP over the meshes', both at 8 samples, worst", fine, 'x', FINE_FLIP
    )
    largest = max(r.image_bytes for r in results) / 2**20
    yield Row('memory of the images of one mesh, largest', largest, 'MiB', 110)
    yield Row('empty cache: baked in, longest', max(r.add_s[0] for r in results), 's')
    yield Row('from the cache: added in, longest', max(r.add_s[1] for r in results), 's', 0.2)


def _rows_at(results, opaque, samples, speed):
    """Yield names, and values with their bars, of so many multisamples."""
    default = samples == MULTI_SAMPLES[0]
    speeds = [r.speed(samples) for r in results]
    yield 'over VTK, geometric mean', (_mean(speeds), 'x', speed, True)
    yield (
        'over VTK on the wall, geometric mean',
        (_mean(r.speed(samples, 'wall') for r in results), 'x'),
    )
    yield 'over VTK, least', (min(speeds), 'x')
    heavy = [r.speed(samples) for r in opaque if r.triangles > MANY_TRIANGLES]
    if heavy:
        name = f'over VTK, least of the opaque over {MANY_TRIANGLES:,} triangles'
        yield name, (min(heavy), 'x', SPEED if default else None, True)
    over = _mean(r.over_cards(samples) for r in results)
    yield 'over flat cards, geometric mean', (over, 'x', OVER_CARDS if default else None)
    if opaque:
        worst = max(r.over_cards(samples) for r in opaque)
        yield 'over flat cards, worst opaque', (worst, 'x', WORST_OVER_CARDS if default else None)
    flips = [r.worst_flip(samples) for r in results]
    title = "FLIP over the meshes' at one sample"
    yield f'{title}, geometric mean', (_mean(flips), 'x')
    yield f'{title}, worst', (max(flips), 'x', FLIP)
    sharp = min(r.worst_sharpness(samples) for r in results)
    yield 'sharpness, worst', (sharp, 'x', SHARPNESS, True)
    noise = max(r.noise(samples) for r in results)
    yield "sharpness over the meshes' at one sample, greatest", (noise, 'x', 1.0)


def _mean(values) -> float:
    return float(np.exp(np.mean(np.log(list(values)))))


def _tables(points) -> list[Table]:
    """Return a table of the meshes for each number of multisamples, worst case first."""
    results = [MeshResult(**values) for values in points['survey']]
    return [_table(results, samples) for samples in MULTI_SAMPLES]


def _table(results, samples) -> Table:
    default = samples == MULTI_SAMPLES[0]
    table = Table(
        'mesh', 'triangles', 'over VTK', 'wall', 'CPU ms', 'over cards', 'FLIP, worst (mean)',
        'sharpness, worst', 'FLIP of cards', title=f'fields of unseen meshes, {samples} samples',
    )  # fmt: skip
    for title in ('max_error=0.5', 'MiB', 'empty cache, s', 'from it, s') if default else ():
        table.add_column(title)
    for r in results:
        if r.error:
            table.add_row(r.name, r.error)
            continue
        own = f'ours, {samples}'
        flips, sharp = r.flip[own], r.sharpness[own]
        row = [
            r.name, f'{r.triangles:,}', f'{r.speed(samples):.1f}x',
            f'{r.speed(samples, "wall"):.1f}x', f'{r.ms[own]["CPU"]:.1f}',
            f'{r.over_cards(samples):.2f}',
            f'{max(flips):.2f} at {ELEVATIONS[int(np.argmax(flips))]} ({np.mean(flips):.2f})',
            f'{min(sharp):.2f} at {ELEVATIONS[int(np.argmin(sharp))]}',
            f'{max(r.flip[f"cards, {samples}"]):.2f}',
        ]  # fmt: skip
        if default:
            row += [f'{r.fine_flip:.2f}', f'{r.image_bytes / 2**20:.0f}']
            row += [f'{r.add_s[0]:.1f}', f'{r.add_s[1]:.2f}']
        table.add_row(*row)
    return table


def _plot(points, figure):
    """Draw FLIP and the ratio to flat cards by how much faster each field is, at defaults."""
    left, right = plots.subplots(figure, 1, 2)
    samples = MULTI_SAMPLES[0]
    for r in (MeshResult(**values) for values in points['survey'] if not values['error']):
        speed = r.speed(samples)
        for axes, y in ((left, r.worst_flip(samples)), (right, r.over_cards(samples))):
            axes.plot(speed, y, 'o')
            plots.note(axes, r.name, speed, y)
    left.set(ylabel="FLIP over the meshes' at one sample, worst")
    right.set(ylabel='frame over flat cards alone')
    for axes, bar in ((left, FLIP), (right, WORST_OVER_CARDS)):
        axes.set(xscale='log', xlabel=f'times faster than VTK, {samples} samples')
        plots.bar(axes, bar)
