"""``pvibr demo``: a walk through a landscape of detailed trees, by VTK and by pvibr."""

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
from pvibr.cli.peers import LOD_REDUCTION, beside_peers, tree_glyphs
from pvibr.cli.timing import CLOCKS, medians_ms
from pvibr.core.errors import require
from pvibr.maths.flip import flip
from pvibr.maths.image_error import psnr, silhouette_iou
from pvibr.scenes.landscape import landscape
from pvibr.scenes.stage import (
    MULTI_SAMPLES,
    SAMPLES,
    covered,
    in_view,
    mesh_actors,
    plant,
    scenery,
    spheres,
    stage,
)

#: Timed frames of the walk, frames of a movie, and frames per second.
FRAMES, MOVIE_FRAMES, FPS = 24, 360, 30
#: Frames at which VTK's own methods are timed, and their number of trees.
PEER_FRAMES, PART = 3, 200
#: VTK's own methods, and whether they have levels of detail.
PEERS = {'VTK glyphs': False, 'VTK glyphs, culling + LOD': True}
#: Seconds of pvibr's frames after which timing stops.
TIMING_SECONDS = 20.0
#: Seconds for the full meshes of the error measurement, and their cost per tree over that of VTK's
#: glyphs, as all are in view and drawn with many samples.
ERROR_SECONDS, DEARER = 30.0, 7.0
#: Position of the images along the trail.
PLACE = 0.4


@dataclass
class Numbers:
    """Measurements of the demo, written as JSON; times by method, multisamples and clock."""

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
    """Measure and write images, or with `window` or `movie` show the walk alone."""
    if movie is not None:
        require('imageio_ffmpeg', 'movie', 'Movies')
    tree_landscape = landscape(count)
    if window:
        _walk(tree_landscape, max_error, frames or MOVIE_FRAMES, size)
    if movie is not None:
        _film(tree_landscape, max_error, frames or MOVIE_FRAMES, size, Path(movie))
    if not window and movie is None:
        _tell(_measure(tree_landscape, max_error, frames or FRAMES, size, Path(out)), Path(out))


# -- measuring ---------------------------------------------------------------------------------


def _measure(scene, max_error, frames, size, out):
    start_time = time.perf_counter()
    console = Console(stderr=True)
    triangles = min(sum(p.mesh.n_cells for p in parts) for parts in scene.parts())
    with console.status('pvibr') as status, ExitStack() as stack:
        first_frame = _first_frame(scene, max_error, size)
        own_stage = stack.enter_context(stage(scene, size))
        numbers = Numbers(len(scene.index), triangles, max_error, size, own_stage.driver())
        tree_instances = plant(own_stage.plotter, scene, max_error)
        numbers.bake_seconds = sum(atlas.seconds for atlas in tree_instances.atlases)
        was_baked = first_frame > numbers.bake_seconds  # otherwise the images were cached
        numbers.first_frame['empty cache' if was_baked else 'images in the cache'] = first_frame
        if was_baked:
            numbers.first_frame['images in the cache'] = _first_frame(scene, max_error, size)
        status.update("pvibr and VTK's own methods, alternating")
        _time(own_stage, scene, frames, numbers)
        report = own_stage.plotter.ibr.report().as_dict()
        numbers.gpu_bytes = sum(row['bytes'] for row in report['rows'])
        status.update('full meshes, many samples per pixel')
        _compare(own_stage, tree_instances, scene, numbers, out)
    numbers.seconds = time.perf_counter() - start_time
    return numbers


def _first_frame(scene, max_error, size) -> float:
    """Return the seconds until the trees are drawn once."""
    with stage(scene, size) as empty_stage:
        empty_stage.look(scene.path(1)[0])
        empty_stage.draw()
        start_time = time.perf_counter()
        plant(empty_stage.plotter, scene, max_error)
        empty_stage.draw()
        return time.perf_counter() - start_time


def _time(own_stage, scene, frames, numbers):
    """Time the walk at defaults, then at one sample per pixel."""
    new_glyphs = partial(tree_glyphs, scene, numbers.size, part=PART)
    with ExitStack() as stack:
        peers = {name: stack.enter_context(new_glyphs(lod=lod)) for name, lod in PEERS.items()}
        measured_count = peers['VTK glyphs'].part
        for samples in MULTI_SAMPLES:
            own_stage.window.SetMultiSamples(samples)
            for peer in peers.values():
                peer.sample(samples)
            peer_interval = max(1, frames // PEER_FRAMES)
            cameras = scene.path(frames)
            times = beside_peers(own_stage, peers, cameras, peer_interval, TIMING_SECONDS)
            _note(times, samples, frames, numbers)
    if measured_count < numbers.instances:
        numbers.notes.append(
            f"VTK's own methods are measured with {measured_count} of {numbers.instances} trees, "
            'chosen at random, and extrapolated linearly.'
        )
    numbers.notes.append(
        f'LOD: one level with {LOD_REDUCTION:.0%} of the triangles removed, all that VTK draws.'
    )


def _note(frame_seconds, samples, frames, numbers):
    """Record the medians of frames at a number of multisamples, and pvibr's speed-up."""
    if len(frame_seconds['pvibr']) < frames:
        numbers.notes.append(
            f'pvibr is timed at {len(frame_seconds["pvibr"])} of {frames} frames at {samples} '
            'samples, as rendering is slow here.'
        )
    own_ms = medians_ms(frame_seconds['pvibr'])
    for name, seconds in frame_seconds.items():
        median_ms = medians_ms(seconds)
        numbers.milliseconds.setdefault(name, {})[str(samples)] = median_ms
        if name in PEERS:
            speed_up = {clock: median_ms[clock] / own_ms[clock] for clock in CLOCKS}
            numbers.speed_up.setdefault(name, {})[str(samples)] = speed_up


def _compare(own_stage, trees, scene, numbers, out):
    """Draw some trees by pvibr and as full meshes, and write the images."""
    camera = scene.path(1, PLACE, PLACE)[0]
    own_stage.look(camera)
    visible_ids = in_view(own_stage.frame(), *spheres(scene.parts(), scene.matrices, scene.index))
    glyph_ms = numbers.milliseconds['VTK glyphs'][str(MULTI_SAMPLES[-1])]['wall']
    seconds_per_tree = DEARER * glyph_ms / 1e3 / numbers.instances
    compared_ids = visible_ids[: max(1, int(ERROR_SECONDS / seconds_per_tree))]
    numbers.notes.append(
        f'Error: at {PLACE:.0%} of the trail, with the {len(compared_ids)} nearest of the '
        f'{len(visible_ids)} trees in view, against full meshes at {SAMPLES**2} samples per pixel.'
    )
    mask = np.zeros(len(scene.index), bool)
    mask[compared_ids] = True
    trees.visible = mask
    pictures = {'pvibr': {n: _pictured(own_stage, n) for n in MULTI_SAMPLES}}
    pvibr_coverage = own_stage.coverage()  # at one sample per pixel, set last
    trees.visible = np.ones(len(mask), bool)
    with _full(scene, compared_ids, camera, numbers.size, samples=SAMPLES) as (full, ground):
        reference, reference_coverage = full.picture(), covered(full.depth(), ground, SAMPLES)
    with _full(scene, compared_ids, camera, numbers.size, multi_samples=0) as (full, ground):
        full.draw()
        vtk_coverage = covered(full.depth(), ground, 1)
        pictures['VTK, full meshes'] = {n: _pictured(full, n) for n in MULTI_SAMPLES}
    coverages = {'pvibr': pvibr_coverage, 'VTK, full meshes': vtk_coverage}
    flip_maps = {
        (method, samples): flip(picture, reference)
        for method, by_samples in pictures.items()
        for samples, picture in by_samples.items()
    }
    for (method, samples), error in flip_maps.items():
        picture = pictures[method][samples]
        errors = {'flip': float(error.mean()), 'psnr': psnr(picture, reference)}
        if not samples:  # coverage needs one sample per pixel
            errors['iou'] = silhouette_iou(coverages[method], reference_coverage)
        numbers.error[f'{method}, {samples} samples'] = errors
    default = MULTI_SAMPLES[0]
    off, on = pictures['VTK, full meshes'][default], pictures['pvibr'][default]
    _write(out, off, on, flip_maps['pvibr', default], numbers)


def _pictured(stage, samples):
    """Return a stage's picture at a number of multisamples."""
    stage.window.SetMultiSamples(samples)
    return stage.picture()


@contextmanager
def _full(scene, tree_ids, camera, size, **samples):
    """Yield a stage of full meshes and the depth of its ground."""
    with stage(scene, size, **samples) as full_stage:
        full_stage.look(camera)
        full_stage.draw()
        ground_depth = full_stage.depth()
        full_stage.add(mesh_actors(scene.parts(), scene.matrices[tree_ids], scene.index[tree_ids]))
        yield full_stage, ground_depth


# -- showing -----------------------------------------------------------------------------------


def _write(out, off, on, on_error, numbers):
    out.mkdir(parents=True, exist_ok=True)
    error_picture = error_colors(on_error)
    for name, picture in (('off', off), ('on', on), ('error', error_picture)):
        save(out / f'{name}.png', picture)
    sample_text = f'{MULTI_SAMPLES[0]} samples'
    vtk_flip, pvibr_flip = (
        numbers.error[f'{method}, {sample_text}']['flip']
        for method in ('VTK, full meshes', 'pvibr')
    )
    save(
        out / 'demo.png',
        compose(
            [
                (off, f'VTK: full meshes, {sample_text}. FLIP {vtk_flip:.3f}'),
                (on, f'pvibr: max_error={numbers.max_error:g} px. FLIP {pvibr_flip:.3f}'),
                (
                    error_picture,
                    f'FLIP of pvibr, {SAMPLES**2} samples per pixel (black 0, white 1)',
                ),
            ]
        ),
    )


def _tell(numbers, out):
    (out / 'demo.json').write_text(json.dumps(asdict(numbers), indent=1) + '\n', encoding='utf-8')
    console = Console()
    width, height = numbers.size
    scene_text = f'{numbers.instances} trees of >= {numbers.triangles} triangles'
    console.print(f'{scene_text}, {width}x{height}, light kit; medians of alternating frames.')
    console.print(*(_times(numbers, samples) for samples in MULTI_SAMPLES), _errors(numbers))
    first_frames = ', '.join(f'{name} {s:.1f} s' for name, s in numbers.first_frame.items())
    console.print(
        f'First frame: {first_frames}. Images were baked in {numbers.bake_seconds:.1f} s; '
        f'{numbers.gpu_bytes / 2**20:.0f} MiB on the GPU. {numbers.driver}'
    )
    for note in numbers.notes:
        console.print(note)
    console.print(f'{out / "demo.png"} and {out / "demo.json"}, in {numbers.seconds:.0f} s.')


def _times(numbers, samples):
    """Return a table of times at a number of multisamples, the slowest first."""
    title = f"{samples} samples, PyVista's default" if samples else 'one sample per pixel'
    table = Table('method', 'CPU ms', 'wall ms', 'speed-up, CPU', 'speed-up, wall', title=title)
    by_name = {name: median_ms[str(samples)] for name, median_ms in numbers.milliseconds.items()}
    for name, median_ms in sorted(by_name.items(), key=lambda item: -item[1]['CPU']):
        speed_up = numbers.speed_up.get(name, {}).get(str(samples), {})
        ratios = [f'{speed_up[clock]:,.0f}x' if speed_up else '' for clock in CLOCKS]
        table.add_row(name, *(f'{median_ms[clock]:,.0f}' for clock in CLOCKS), *ratios)
    return table


def _errors(numbers):
    table = Table('image', 'mean FLIP', 'over meshes at one sample', 'PSNR', 'silhouette IoU')
    base_flip = numbers.error[f'VTK, full meshes, {MULTI_SAMPLES[-1]} samples']['flip']
    for name, error in numbers.error.items():
        iou = f'{error["iou"]:.3f}' if 'iou' in error else ''
        ratio = f'{error["flip"] / base_flip:.2f}'
        table.add_row(name, f'{error["flip"]:.4f}', ratio, f'{error["psnr"]:.1f} dB', iou)
    return table


# -- walking -----------------------------------------------------------------------------------


def _walk(scene, max_error, frames, size):
    window_plotter = scenery(scene, max_error, size, off_screen=False)
    window_plotter.show(interactive_update=True, auto_close=False)
    for camera in scene.path(frames):
        if window_plotter.render_window is None:  # closed by the user
            return
        window_plotter.camera_position = camera
        window_plotter.reset_camera_clipping_range()
        window_plotter.update()
    window_plotter.show()


def _film(scene, max_error, frames, size, file):
    movie_plotter = scenery(scene, max_error, size, off_screen=True)
    cameras = scene.path(frames)

    def walk(seconds):
        movie_plotter.camera_position = cameras[round(seconds * FPS)]
        movie_plotter.reset_camera_clipping_range()

    movie_plotter.ibr.movie(file, frames / FPS, fps=FPS, each=walk, progress=True)
    movie_plotter.close()
