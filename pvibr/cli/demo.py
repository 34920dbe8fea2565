"""``pvibr demo``: a walk through a landscape of heavy trees, rendered by VTK and by pvibr."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from pvibr.bench.common.peers import LOD_REDUCTION, PART, glyph_seconds
from pvibr.capture.montage import compose, error_colors, save
from pvibr.capture.offscreen import SAMPLES, Stage, covered, in_view, mesh_actors, spheres
from pvibr.core.errors import require
from pvibr.maths.flip import flip
from pvibr.maths.image_error import psnr, silhouette_iou
from pvibr.scenes.landscape import landscape
from pvibr.scenes.scenery import plant, scenery

#: Timed frames of the walk, frames of a movie, and frames per second.
FRAMES, MOVIE_FRAMES, FPS = 24, 360, 30
#: Frames at which VTK's own methods are timed.
PEER_FRAMES = 3
#: Seconds after which timing stops.
TIMING_SECONDS = 20.0
#: Seconds allowed for the full meshes of the error measurement, and their cost relative to
#: VTK's glyphs per tree: all are in view, and drawn with many samples.
ERROR_SECONDS, DEARER = 30.0, 7.0
#: Position of the images on the trail.
PLACE = 0.4


@dataclass
class Numbers:
    """Measurements of the demo, written as JSON beside the images."""

    instances: int
    triangles: int
    max_error: float
    size: tuple[int, int]
    driver: str
    notes: list[str] = field(default_factory=list)
    milliseconds: dict[str, float] = field(default_factory=dict)
    speed_up: dict[str, float] = field(default_factory=dict)
    error: dict[str, dict[str, float]] = field(default_factory=dict)
    bake_seconds: float = 0.0
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
    size=(1280, 720),
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
    stage = Stage(size, scene.terrain, scene.view_angle, lights=scene.lights())
    with stage, console.status('pvibr') as status:
        stage.bounds = scene.terrain.bounds
        trees = plant(stage.plotter, scene, max_error)
        numbers = Numbers(len(scene.index), triangles, max_error, size, stage.driver())
        numbers.bake_seconds = sum(atlas.seconds for atlas in trees.atlases)
        seconds = stage.seconds(scene.path(frames), limit=TIMING_SECONDS)
        if len(seconds) < frames:
            numbers.notes.append(
                f'pvibr is timed at {len(seconds)} of {frames} frames: rendering is slow here.'
            )
        numbers.milliseconds['pvibr'] = float(np.median(seconds)) * 1e3
        numbers.gpu_bytes = _gpu_bytes(stage.plotter)
        status.update("VTK's own methods")
        _time_peers(scene, frames, numbers)
        status.update('full meshes, many samples per pixel')
        _compare(stage, trees, scene, numbers, out)
    numbers.seconds = time.perf_counter() - start
    return numbers


def _gpu_bytes(plotter):
    return sum(row['bytes'] for row in plotter.ibr.report().as_dict()['rows'])


def _time_peers(scene, frames, numbers):
    every = max(1, frames // PEER_FRAMES)
    cameras = scene.path(frames)[every // 2 :: every][:PEER_FRAMES]
    for name, lod in (('VTK glyphs', False), ('VTK glyphs, culling + LOD', True)):
        seconds = glyph_seconds(scene, cameras, numbers.size, lod=lod)
        numbers.milliseconds[name] = seconds * 1e3
        numbers.speed_up[name] = seconds * 1e3 / numbers.milliseconds['pvibr']
    part = min(PART, numbers.instances)
    if part < numbers.instances:
        numbers.notes.append(
            f"VTK's own methods are measured with {part} of {numbers.instances} trees, "
            'drawn at random, and extrapolated linearly.'
        )
    numbers.notes.append(
        f'LOD: one level with {LOD_REDUCTION:.0%} of the triangles gone, the one that VTK draws.'
    )


def _compare(stage, trees, scene, numbers, out):
    """Draw some of the trees by pvibr and as full meshes, and write the images."""
    camera = scene.path(1, PLACE, PLACE)[0]
    stage.look(camera)
    rows = in_view(stage.frame(), *spheres(scene.parts(), scene.matrices, scene.index))
    each = DEARER * numbers.milliseconds['VTK glyphs'] / 1e3 / numbers.instances
    shown = rows[: max(1, int(ERROR_SECONDS / each))]
    numbers.notes.append(
        f'Error: at {PLACE:.0%} of the trail, with the {len(shown)} nearest of the {len(rows)} '
        f'trees in view, against the full meshes at {SAMPLES**2} samples a pixel.'
    )
    mask = np.zeros(len(scene.index), bool)
    mask[shown] = True
    trees.visible = mask
    on, on_cover = stage.picture(), stage.coverage()
    trees.visible = np.ones(len(mask), bool)
    reference, cover, _ = _full(scene, shown, camera, numbers.size, SAMPLES)
    off, off_cover, seconds = _full(scene, shown, camera, numbers.size, 1)
    numbers.milliseconds[f'full meshes, the {len(shown)} of the pictures'] = seconds * 1e3
    maps = {'VTK, one sample a pixel': (off, off_cover), 'pvibr': (on, on_cover)}
    errors = {name: flip(picture, reference) for name, (picture, _) in maps.items()}
    for name, (picture, coverage) in maps.items():
        numbers.error[name] = {
            'flip': float(errors[name].mean()),
            'psnr': psnr(picture, reference),
            'iou': silhouette_iou(coverage, cover),
        }
    _write(out, off, on, errors, numbers)


def _full(scene, rows, camera, size, samples):
    """Return image, coverage and seconds of the full meshes."""
    with Stage(size, scene.terrain, scene.view_angle, samples, lights=scene.lights()) as stage:
        stage.bounds = scene.terrain.bounds
        stage.look(camera)
        stage.draw()
        ground = stage.depth()
        stage.add(mesh_actors(scene.parts(), scene.matrices[rows], scene.index[rows]))
        seconds = stage.draw()
        return stage.read(), covered(stage.depth(), ground, samples), seconds


# -- showing -----------------------------------------------------------------------------------


def _write(out, off, on, errors, numbers):
    out.mkdir(parents=True, exist_ok=True)
    error = error_colors(errors['pvibr'])
    for name, picture in (('off', off), ('on', on), ('error', error)):
        save(out / f'{name}.png', picture)
    flips = {name: value['flip'] for name, value in numbers.error.items()}
    (vtk_flip, own_flip) = flips.values()
    save(
        out / 'demo.png',
        compose(
            [
                (off, f'VTK: full meshes, one sample a pixel. FLIP {vtk_flip:.3f}'),
                (on, f'pvibr: max_error={numbers.max_error:g} px. FLIP {own_flip:.3f}'),
                (error, 'FLIP of pvibr against 16 samples a pixel (black 0, white 1)'),
            ]
        ),
    )


def _tell(numbers, out):
    (out / 'demo.json').write_text(json.dumps(asdict(numbers), indent=1) + '\n', encoding='utf-8')
    console = Console()
    console.print(_times(numbers), _errors(numbers))
    console.print(
        f'Baked in {numbers.bake_seconds:.1f} s; {numbers.gpu_bytes / 2**20:.0f} MiB on the GPU. '
        f'{numbers.driver}'
    )
    for note in numbers.notes:
        console.print(note)
    console.print(f'{out / "demo.png"} and {out / "demo.json"}, in {numbers.seconds:.0f} s.')


def _times(numbers):
    trees = f'{numbers.instances} trees of >= {numbers.triangles} triangles'
    table = Table('drawn by', 'ms a frame', 'pvibr is faster', title=trees)
    for name, milliseconds in sorted(numbers.milliseconds.items(), key=lambda item: -item[1]):
        faster = numbers.speed_up.get(name)
        table.add_row(name, f'{milliseconds:,.0f}', f'{faster:,.0f}x' if faster else '')
    return table


def _errors(numbers):
    table = Table('picture', 'mean FLIP', 'PSNR', 'silhouette IoU')
    for name, error in numbers.error.items():
        table.add_row(
            name, f'{error["flip"]:.4f}', f'{error["psnr"]:.1f} dB', f'{error["iou"]:.3f}'
        )
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
