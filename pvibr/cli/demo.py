"""``pvibr demo``: a walk through a landscape of heavy trees, rendered by VTK and by pvibr."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from pvibr.capture.montage import compose, error_colors, save
from pvibr.capture.offscreen import (
    MULTI_SAMPLES,
    SAMPLES,
    covered,
    in_view,
    mesh_actors,
    spheres,
)
from pvibr.cli.peers import LOD_REDUCTION, beside_peers, tree_glyphs
from pvibr.cli.timing import CLOCKS, medians_ms
from pvibr.core.errors import require
from pvibr.maths.flip import flip
from pvibr.maths.image_error import psnr, silhouette_iou
from pvibr.scenes.landscape import landscape
from pvibr.scenes.scenery import plant, scenery, stage

#: Timed frames of the walk, frames of a movie, and frames per second.
FRAMES, MOVIE_FRAMES, FPS = 24, 360, 30
#: Frames at which VTK's own methods are timed, and with how many trees.
PEER_FRAMES, PART = 3, 200
#: VTK's own methods, and whether they have levels of detail.
PEERS = {'VTK glyphs': False, 'VTK glyphs, culling + LOD': True}
#: Seconds of pvibr's frames after which timing stops.
TIMING_SECONDS = 20.0
#: Seconds allowed for the full meshes of the error measurement, and their cost relative to
#: VTK's glyphs per tree: all are in view, and drawn with many samples.
ERROR_SECONDS, DEARER = 30.0, 7.0
#: Position of the images on the trail.
PLACE = 0.4


@dataclass
class Numbers:
    """Measurements of the demo, written as JSON beside the images.

    Times, and how many times faster pvibr is, are by what draws, multisamples and clock.
    """

    instances: int
    triangles: int
    max_error: float
    size: tuple[int, int]
    driver: str
    notes: list[str] = field(default_factory=list)
    milliseconds: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    speed_up: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    error: dict[str, dict[str, float]] = field(default_factory=dict)
    bake_seconds: float = 0.0
    first_frame: dict[str, float] = field(default_factory=dict)
    gpu_bytes: int = 0
    seconds: float = 0.0


def main(
    *,
    out=Path('out'),
    count=10_000,
    max_error=1.0,
    frames=None,
    window=False,
    movie=None,
    size=(1024, 768),
):
    """Measure and write images; or with `window` or `movie` only show the walk."""
    if movie is not None:
        require('imageio_ffmpeg', 'movie', 'Movies')
    scene = landscape(count)
    if window:
        _walk(scene, max_error, frames or MOVIE_FRAMES, size)
    if movie is not None:
        _film(scene, max_error, frames or MOVIE_FRAMES, size, Path(movie))
    if not window and movie is None:
        numbers = _measure(scene, max_error, frames or FRAMES, size, Path(out))
        _tell(numbers, Path(out))


# -- measuring ---------------------------------------------------------------------------------


def _measure(scene, max_error, frames, size, out):
    start = time.perf_counter()
    console = Console(stderr=True)
    triangles = min(sum(p.mesh.n_cells for p in parts) for parts in scene.parts())
    with console.status('pvibr') as status, ExitStack() as stack:
        first_frame = _first_frame(scene, max_error, size)
        own = stack.enter_context(stage(scene, size))
        numbers = Numbers(len(scene.index), triangles, max_error, size, own.driver())
        trees = plant(own.plotter, scene, max_error)
        numbers.bake_seconds = sum(atlas.seconds for atlas in trees.atlases)
        baked = first_frame > numbers.bake_seconds  # else the images were in the cache
        numbers.first_frame['empty cache' if baked else 'images in the cache'] = first_frame
        if baked:
            numbers.first_frame['images in the cache'] = _first_frame(scene, max_error, size)
        status.update("pvibr and VTK's own methods by turns")
        _time(own, scene, frames, numbers)
        numbers.gpu_bytes = _gpu_bytes(own.plotter)
        status.update('full meshes, many samples per pixel')
        _compare(own, trees, scene, numbers, out)
    numbers.seconds = time.perf_counter() - start
    return numbers


def _first_frame(scene, max_error, size) -> float:
    """Return the seconds until the trees are drawn once."""
    with stage(scene, size) as first:
        first.look(scene.path(1)[0])
        first.draw()
        start = time.perf_counter()
        plant(first.plotter, scene, max_error)
        first.draw()
        return time.perf_counter() - start


def _gpu_bytes(plotter):
    return sum(row['bytes'] for row in plotter.ibr.report().as_dict()['rows'])


def _time(own, scene, frames, numbers):
    """Note the times of the walk at defaults, then at one sample per pixel."""
    make = partial(tree_glyphs, scene, numbers.size, part=PART)
    with ExitStack() as stack:
        peers = {name: stack.enter_context(make(lod=lod)) for name, lod in PEERS.items()}
        part = peers['VTK glyphs'].part
        for samples in MULTI_SAMPLES:
            own.window.SetMultiSamples(samples)
            for peer in peers.values():
                peer.sample(samples)
            every = max(1, frames // PEER_FRAMES)
            times = beside_peers(own, peers, scene.path(frames), every, TIMING_SECONDS)
            _note(times, samples, frames, numbers)
    if part < numbers.instances:
        numbers.notes.append(
            f"VTK's own methods are measured with {part} of {numbers.instances} trees, "
            'drawn at random, and extrapolated linearly.'
        )
    numbers.notes.append(
        f'LOD: one level with {LOD_REDUCTION:.0%} of the triangles gone, the one that VTK draws.'
    )


def _note(times, samples, frames, numbers):
    """Note the medians of frames at so many multisamples, and how much faster pvibr is."""
    if len(times['pvibr']) < frames:
        numbers.notes.append(
            f'pvibr is timed at {len(times["pvibr"])} of {frames} frames at {samples} samples: '
            'rendering is slow here.'
        )
    own = medians_ms(times['pvibr'])
    for name, seconds in times.items():
        ms = medians_ms(seconds)
        numbers.milliseconds.setdefault(name, {})[str(samples)] = ms
        if name in PEERS:
            faster = {clock: ms[clock] / own[clock] for clock in CLOCKS}
            numbers.speed_up.setdefault(name, {})[str(samples)] = faster


def _compare(own, trees, scene, numbers, out):
    """Draw some of the trees by pvibr and as full meshes, and write the images."""
    camera = scene.path(1, PLACE, PLACE)[0]
    own.look(camera)
    rows = in_view(own.frame(), *spheres(scene.parts(), scene.matrices, scene.index))
    one_sample = str(MULTI_SAMPLES[-1])
    each = numbers.milliseconds['VTK glyphs'][one_sample]['wall'] / 1e3 / numbers.instances
    shown = rows[: max(1, int(ERROR_SECONDS / (DEARER * each)))]
    numbers.notes.append(
        f'Error: at {PLACE:.0%} of the trail, with the {len(shown)} nearest of the {len(rows)} '
        f'trees in view, against the full meshes at {SAMPLES**2} samples a pixel.'
    )
    mask = np.zeros(len(scene.index), bool)
    mask[shown] = True
    trees.visible = mask
    drawn = {'pvibr': {n: _pictured(own, n) for n in MULTI_SAMPLES}}
    on_cover = own.coverage()  # at one sample, the last
    trees.visible = np.ones(len(mask), bool)
    with _full(scene, shown, camera, numbers.size, samples=SAMPLES) as (full, ground):
        reference, cover = full.picture(), covered(full.depth(), ground, SAMPLES)
    with _full(scene, shown, camera, numbers.size, multi_samples=0) as (full, ground):
        full.draw()
        off_cover = covered(full.depth(), ground, 1)
        drawn['VTK, full meshes'] = {n: _pictured(full, n) for n in MULTI_SAMPLES}
    covers = {'pvibr': on_cover, 'VTK, full meshes': off_cover}
    maps = {(way, n): flip(p, reference) for way, by in drawn.items() for n, p in by.items()}
    for (way, samples), error in maps.items():
        picture = drawn[way][samples]
        errors = {'flip': float(error.mean()), 'psnr': psnr(picture, reference)}
        if not samples:  # one sample per pixel tells what is covered
            errors['iou'] = silhouette_iou(covers[way], cover)
        numbers.error[f'{way}, {samples} samples'] = errors
    off, on = (drawn[way][MULTI_SAMPLES[0]] for way in ('VTK, full meshes', 'pvibr'))
    _write(out, off, on, maps['pvibr', MULTI_SAMPLES[0]], numbers)


def _pictured(shown, samples):
    """Return a stage's picture at so many multisamples."""
    shown.window.SetMultiSamples(samples)
    return shown.picture()


@contextmanager
def _full(scene, rows, camera, size, **samples):
    """Yield a stage of full meshes, and the depths of its ground."""
    with stage(scene, size, **samples) as full:
        full.look(camera)
        full.draw()
        ground = full.depth()
        full.add(mesh_actors(scene.parts(), scene.matrices[rows], scene.index[rows]))
        yield full, ground


# -- showing -----------------------------------------------------------------------------------


def _write(out, off, on, on_error, numbers):
    out.mkdir(parents=True, exist_ok=True)
    error = error_colors(on_error)
    for name, picture in (('off', off), ('on', on), ('error', error)):
        save(out / f'{name}.png', picture)
    samples = f'{MULTI_SAMPLES[0]} samples'
    vtk_flip, own_flip = (
        numbers.error[f'{way}, {samples}']['flip'] for way in ('VTK, full meshes', 'pvibr')
    )
    save(
        out / 'demo.png',
        compose(
            [
                (off, f'VTK: full meshes, {samples}. FLIP {vtk_flip:.3f}'),
                (on, f'pvibr: max_error={numbers.max_error:g} px. FLIP {own_flip:.3f}'),
                (error, f'FLIP of pvibr against {SAMPLES**2} samples a pixel (black 0, white 1)'),
            ]
        ),
    )


def _tell(numbers, out):
    (out / 'demo.json').write_text(json.dumps(asdict(numbers), indent=1) + '\n', encoding='utf-8')
    console = Console()
    width, height = numbers.size
    trees = f'{numbers.instances} trees of >= {numbers.triangles} triangles'
    console.print(f'{trees}, {width}x{height}, the light kit; medians of frames by turns.')
    console.print(*(_times(numbers, samples) for samples in MULTI_SAMPLES), _errors(numbers))
    first = ', '.join(f'{name} {s:.1f} s' for name, s in numbers.first_frame.items())
    console.print(
        f'First frame: {first}. Images were baked in {numbers.bake_seconds:.1f} s; '
        f'{numbers.gpu_bytes / 2**20:.0f} MiB on the GPU. {numbers.driver}'
    )
    for note in numbers.notes:
        console.print(note)
    console.print(f'{out / "demo.png"} and {out / "demo.json"}, in {numbers.seconds:.0f} s.')


def _times(numbers, samples):
    """Return a table of times at so many multisamples, the slowest first."""
    title = f"{samples} samples, PyVista's default" if samples else 'one sample per pixel'
    table = Table('drawn by', 'CPU ms', 'wall ms', 'pvibr is faster', 'on the wall', title=title)
    by_name = {name: ms[str(samples)] for name, ms in numbers.milliseconds.items()}
    for name, ms in sorted(by_name.items(), key=lambda item: -item[1]['CPU']):
        faster = numbers.speed_up.get(name, {}).get(str(samples), {})
        ratios = [f'{faster[clock]:,.0f}x' if faster else '' for clock in CLOCKS]
        table.add_row(name, *(f'{ms[clock]:,.0f}' for clock in CLOCKS), *ratios)
    return table


def _errors(numbers):
    table = Table('picture', 'mean FLIP', 'over meshes at one sample', 'PSNR', 'silhouette IoU')
    base = numbers.error[f'VTK, full meshes, {MULTI_SAMPLES[-1]} samples']['flip']
    for name, error in numbers.error.items():
        iou = f'{error["iou"]:.3f}' if 'iou' in error else ''
        ratio = f'{error["flip"] / base:.2f}'
        table.add_row(name, f'{error["flip"]:.4f}', ratio, f'{error["psnr"]:.1f} dB', iou)
    return table


# -- walking -----------------------------------------------------------------------------------


def _walk(scene, max_error, frames, size):
    plotter = scenery(scene, max_error, size, off_screen=False)
    plotter.show(interactive_update=True, auto_close=False)
    for camera in scene.path(frames):
        if plotter.render_window is None:  # closed on the way
            return
        plotter.camera_position = camera
        plotter.reset_camera_clipping_range()
        plotter.update()
    plotter.show()


def _film(scene, max_error, frames, size, file):
    plotter = scenery(scene, max_error, size, off_screen=True)
    cameras = scene.path(frames)

    def walk(seconds):
        plotter.camera_position = cameras[round(seconds * FPS)]
        plotter.reset_camera_clipping_range()

    plotter.ibr.movie(file, frames / FPS, fps=FPS, each=walk, progress=True)
    plotter.close()
