"""The command line: ``pvibr doctor``, ``demo``, ``view``, ``play``, ``bake`` and others."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter
from cyclopts.types import ExistingFile

import pvibr
from pvibr.core.errors import PvibrError

OK, WANTING, FAILED, INTERRUPTED = 0, 1, 2, 130


def _positive(type_: type, value: float | None) -> None:
    if value is not None and not (value > 0 and math.isfinite(value)):
        raise ValueError('Must be a positive number.')


def _seed(type_: type, value: int | None) -> None:
    if value is not None and value < 0:
        raise ValueError('Must be a seed of 0 or more.')


def _finite(type_: type, value: float | None) -> None:
    if value is not None and not math.isfinite(value):
        raise ValueError('Must be a finite number.')


def _nonzero(type_: type, value: float) -> None:
    if not (value and math.isfinite(value)):
        raise ValueError('Must be a finite number other than 0.')


def _in_existing_folder(type_: type, value: Path | None) -> None:
    if value is not None and not value.absolute().parent.is_dir():
        raise ValueError(f'There is no folder {value.parent}: create it first.')


_Positive = Parameter(validator=_positive)
_Moment = Annotated[float, Parameter(validator=_finite)]
_Speed = Annotated[float, Parameter(validator=_nonzero)]
_Count = Annotated[int, _Positive]
_Pixels = Annotated[float, _Positive]
_Gigabytes = Annotated[float, _Positive]
_Folder = Annotated[Path, Parameter(name=['--out', '-o'])]
_Out = Annotated[Path | None, Parameter(name=['--out', '-o'], validator=_in_existing_folder)]
_File = Annotated[Path | None, Parameter(validator=_in_existing_folder)]

app = App(
    name='pvibr',
    help='Image-based rendering for PyVista: large scenes within an error in pixels.',
    version=lambda: pvibr.__version__,
    suppress_keyboard_interrupt=False,
)
#: The folder that contains the package: the root of a clone.
ROOT = Path(__file__).resolve().parents[2]


def benchmarks() -> ModuleType | None:
    """Return the package `benchmarks` beside ``pvibr``, None if this is no clone."""
    if not (ROOT / 'benchmarks' / '__init__.py').is_file():
        return None
    # In front: a package of this name that is installed is another's.
    sys.path.insert(0, str(ROOT))
    return import_module('benchmarks')


_benchmarks = benchmarks()
_BENCH = 'Measure run time against error on this machine.'
_NO_BENCH = (
    "Benchmarks are not in the installed package, but in pvibr's repository: clone it and run "
    "python -m pip install -e '.[bench]' there."
)
bench = app.command(App(name='bench', help=_BENCH if _benchmarks else _NO_BENCH))


@app.command
def doctor() -> int:
    """Check the installation and print how to fix problems."""
    from pvibr.cli.doctor import diagnose

    diagnosis = diagnose()
    print(diagnosis)
    return WANTING if diagnosis.problems else OK


@app.command
def demo(
    *,
    out: _Folder = Path('out'),
    count: _Count = 10_000,
    max_error: _Pixels = 1.0,
    frames: _Count | None = None,
    window: bool = False,
    movie: _File = None,
    size: str = '1024x768',
) -> None:
    """Compare VTK and pvibr on a landscape with trees."""
    pixels = _size(size)
    from pvibr.cli.demo import main

    _require_gl(window=window)
    main(
        out=out,
        count=count,
        max_error=max_error,
        frames=frames,
        window=window,
        movie=movie,
        size=pixels,
    )


@app.command
def view(
    mesh: ExistingFile,
    *,
    poses: ExistingFile | None = None,
    max_error: _Pixels = 1.0,
    out: _Out = None,
    size: str = '1280x720',
    scalars: str | None = None,
    cmap: str | None = None,
    columns: str | None = None,
    scale: _Pixels = 1.0,
    window: bool | None = None,
) -> None:
    """Draw a mesh at every pose in a file, or alone on the ground.

    Without --out a window opens; without a display, or with --no-window, an image is written to a
    new folder and its path printed. Images are .png, .jpg, .tif, .webp or .bmp.

    Meshes are read from glTF (.glb, .gltf), CityJSON (.json, .cityjson; needs the extra city), and
    all formats of PyVista and trimesh: .ply, .stl, .obj, .off, .3mf, .vtk, .vtp, .vtu, .vti, .vtr,
    .vts, .vtm, .vtkhdf, .case, .foam, .cgns, .msh, .inp, .xdmf and others.
    Poses are read from tables (.csv, .tsv, .txt, each also .gz; .parquet needs the extra parquet),
    point clouds (.las, .laz; need the extra las) and numpy arrays (.npy).
    """
    pixels, names = _size(size), _columns(columns)
    window = out is None and _has_display() if window is None else window
    from pvibr.cli.view import main

    _require_gl(window=window)
    main(
        mesh,
        poses,
        max_error=max_error,
        out=out,
        size=pixels,
        scalars=scalars,
        cmap=cmap,
        columns=names,
        scale=scale,
        window=window,
    )


@app.command
def play(
    file: ExistingFile,
    *,
    clip: str | None = None,
    movie: _File = None,
    time: _Moment | None = None,
    out: _Out = None,
    fps: Annotated[float, _Positive] = 30.0,
    size: str = '1280x720',
    speed: _Speed = 1.0,
    seconds: Annotated[float | None, _Positive] = None,
    skinning: Literal['linear', 'dual'] = 'linear',
) -> None:
    """Play an animated file in a window, or write a movie or an image.

    Animations are read from glTF (.glb, .gltf); other formats of ``pvibr view`` are shown at rest.
    Movies are .mp4, .gif and others that imageio writes, images as in ``pvibr view``.
    """
    pixels = _size(size)
    from pvibr.cli.play import main

    _require_gl(window=movie is None and time is None and out is None)
    main(
        file,
        clip=clip,
        movie=movie,
        time=time,
        out=out,
        fps=fps,
        size=pixels,
        speed=speed,
        seconds=seconds,
        skinning=skinning,
    )


@app.command
def bake(
    *meshes: ExistingFile,
    processes: _Count | None = None,
    color: str | None = None,
    scalars: str | None = None,
    cmap: str | None = None,
    smooth_shading: bool | None = None,
    out: _Out = None,
    sheet: _File = None,
) -> int:
    """Bake the images of meshes into the cache, where scenes find them.

    Meshes are read as in ``pvibr view``; looks must be those of the scene, as in add_mesh. What is
    in the cache is not baked again, so that a call that was stopped goes on. --processes bakes
    that many at a time. For one mesh, --out writes the images to an .npz file, and --sheet a
    picture of all views.
    """
    from pvibr.cli.bake import fill_cache, save_atlas
    from pvibr.instances.bake_queue import PROCESSES

    if not meshes:
        raise ValueError('meshes must be one or more files, got none')
    options = {'color': color, 'scalars': scalars, 'cmap': cmap, 'smooth_shading': smooth_shading}
    looks = {name: value for name, value in options.items() if value is not None}
    _require_gl()
    if out is None and sheet is None:
        return OK if fill_cache(meshes, processes or PROCESSES, looks) else FAILED
    if len(meshes) > 1:
        raise ValueError(f'--out and --sheet are for one mesh, got {len(meshes)}')
    save_atlas(meshes[0], out, sheet, looks)
    return OK


@app.command
def build(
    mesh: ExistingFile,
    *,
    out: Annotated[Path, Parameter(name=['--out', '-o'])],
    workers: _Count | None = None,
    memory: _Gigabytes = 2.0,
) -> None:
    """Build the hierarchy of a large mesh into a .pvl file, which add_large_mesh draws.

    Binary PLY files of triangles, binary STL files and heights in GeoTIFF files are read in
    pieces, all others whole, as in ``pvibr view``. A file of that name is replaced once the new
    one is complete. Until then, what is built is in a folder beside it, from which the same
    command goes on after Ctrl+C.

    Parameters
    ----------
    workers
        Number of processes; by default one per core, at most 8, as far as the memory allows.
    memory
        Memory of all processes, GB, at least 0.5: what does not fit is on the disk, which needs
        about 150 bytes per triangle.
    """
    from pvibr.large.build_file import write_large

    try:
        path = write_large(mesh, out, workers=workers, memory=memory)
    except KeyboardInterrupt:
        print('pvibr: stopped; the same command goes on from here', file=sys.stderr)
        raise
    print(f'wrote {path}: {path.stat().st_size / 1e6:.1f} MB')


def _bench_command(name):
    def command(
        *, out: _Folder = Path('out'), quick: bool = False, compare: ExistingFile | None = None
    ) -> int:
        """Measure, and write a table and a plot; --compare an earlier bench_NAME.json of these.

        Exit code 1: something is slower or less accurate than then, beyond the noise.
        """
        return _measure(name, out, compare, quick=quick)

    return command


def _surveyed_command(name):
    def command(
        *,
        out: _Folder = Path('out'),
        quick: bool = False,
        compare: ExistingFile | None = None,
        survey: Annotated[int | None, Parameter(validator=_seed)] = None,
        heavy: bool = False,
    ) -> int:
        """Measure, and write tables and a plot; or survey random scenes from a seed.

        --heavy surveys meshes of 20 000 to 110 000 triangles; --compare an earlier bench_NAME.json
        of the same. Exit code 1: something is slower or less accurate than then, beyond the noise.
        """
        return _measure(name, out, compare, quick=quick, survey=survey, heavy=heavy)

    return command


def _no_benchmarks(*_names: Annotated[str, Parameter(allow_leading_hyphen=True)]) -> None:
    raise FileNotFoundError(_NO_BENCH)


if _benchmarks:
    for _name, _help in _benchmarks.BENCHES.items():
        _make = _surveyed_command if _name in _benchmarks.SURVEYS else _bench_command
        bench.command(_make(_name), name=_name, help=_help)
else:
    bench.default(_no_benchmarks)


def _measure(name, out, compare, **how):
    from benchmarks import main
    from benchmarks.common.comparison import is_no_worse, read_run

    earlier = read_run(compare) if compare else None
    _require_gl()
    results = main(name, out=out, **how)
    return OK if earlier is None or is_no_worse(earlier, results.as_dict()) else WANTING


def main(tokens: Sequence[str] | None = None) -> int:
    """Run one command."""
    try:
        return _run(sys.argv[1:] if tokens is None else list(tokens))
    except KeyboardInterrupt:
        return INTERRUPTED
    except (CycloptsError, PvibrError, ImportError, OSError, ValueError) as error:
        if os.environ.get('PVIBR_DEBUG'):
            raise
        print(f'pvibr: error: {_one_line(error)}', file=sys.stderr)
        return FAILED


def _run(tokens: list[str]) -> int:
    result = app(tokens, print_error=False, exit_on_error=False, result_action='return_value')
    return result if isinstance(result, int) else OK


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split()) or type(error).__name__


def _size(text: str) -> tuple[int, int]:
    width_text, _, height_text = text.lower().partition('x')
    if not (
        width_text.isdecimal() and height_text.isdecimal() and int(width_text) and int(height_text)
    ):
        raise ValueError(f'--size must be like 1280x720, in pixels, got {text!r}.')
    return int(width_text), int(height_text)


def _columns(text: str | None) -> tuple[str | None, ...] | None:
    if text is None:
        return None
    names = tuple(None if name.strip() == '-' else name.strip() for name in text.split(','))
    if len(names) != 3 or '' in names:
        raise ValueError(
            f'--columns must name three columns like gx,gy,- (- stands for zero), got {text!r}.'
        )
    return names


def _has_display() -> bool:
    return not sys.platform.startswith('linux') or bool(os.environ.get('DISPLAY'))


def _require_gl(*, window: bool = False) -> None:
    from pvibr.cli.doctor import prefer_egl, require_gl

    if window and not _has_display():
        raise ValueError(
            '--window needs a display, but the environment variable DISPLAY is not set.'
        )
    prefer_egl()
    require_gl()
