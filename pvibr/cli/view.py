"""``pvibr view``: a mesh at every pose in a file, or on a ground of its own."""

from __future__ import annotations

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pyvista as pv
from rich.console import Console

from pvibr.capture.montage import check_image, save
from pvibr.capture.offscreen import Stage
from pvibr.maths.transforms import trs
from pvibr.meshes.pose_files import read_poses

#: Timed frames, and the camera's azimuth step in degrees.
FRAMES, TURN = 12, 2.0


def main(
    mesh,
    poses=None,
    *,
    max_error=1.0,
    out=None,
    size=(1280, 720),
    scalars=None,
    cmap=None,
    columns=None,
    scale=1.0,
    window=False,
):
    """Draw a mesh at every pose in a file, and print a report and the frame time."""
    if out is not None:
        check_image(out)
    matrices, looks, name = np.zeros((1, 3)), {}, Path(mesh).stem
    of_tables = {'--scalars': scalars, '--columns': columns}
    if poses is None and any(given := [n for n, value in of_tables.items() if value is not None]):
        raise ValueError(f'{" and ".join(given)} name columns of a table: add --poses, its file.')
    if poses is not None:
        matrices, found = read_poses(poses, columns)
        if not len(matrices):
            raise ValueError(f'{poses} names columns and has no rows: there is nothing to show.')
        looks, name = _looks(poses, found, scalars, cmap), f'{name} at {Path(poses).name}'
    looks |= {'name': scalars or name, 'max_error': max_error}

    def fill(plotter):
        drawn = plotter.ibr.add_instances(str(mesh), _scaled(matrices, scale), **looks)
        if poses is None:
            plotter.ibr.look('studio')
        return drawn

    if window:
        plotter = pv.Plotter(window_size=list(size))
        fill(plotter)
        plotter.show()
        return
    with Stage(size) as stage:
        drawn = fill(stage.plotter)
        stage.bounds = drawn.bounds
        seconds = _orbit(stage)
        _tell(stage, drawn, seconds)
        out = out or Path(mkdtemp(prefix='pvibr-')) / f'{Path(mesh).stem}.png'
        save(out, stage.picture())
        Console().print(f'wrote {out}', soft_wrap=True)


def _looks(poses, found, scalars, cmap):
    if scalars is None:
        return {}
    if scalars not in found:
        raise ValueError(
            f'--scalars is {scalars!r}; {poses} has the columns {", ".join(found) or "(none)"}.'
        )
    if found[scalars].dtype.kind not in 'fiu':
        raise ValueError(
            f'--scalars is {scalars!r}, a column of text in {poses}; name one of numbers.'
        )
    return {'scalars': found[scalars], 'cmap': cmap}


def _scaled(poses, scale):
    """Return poses scaled about their own origins."""
    if scale == 1.0:
        return poses
    if poses.ndim == 2:
        return trs(poses, None, np.full(len(poses), float(scale)))
    poses = poses.copy()
    poses[:, :3, :3] *= scale
    return poses


def _orbit(stage):
    """Return the seconds of frames of an orbit that ends at the isometric view."""
    plotter = stage.plotter
    plotter.view_isometric(render=False)
    plotter.camera.azimuth = 0.0
    start = [tuple(v) for v in plotter.camera_position]
    cameras = []
    for k in range(FRAMES):
        plotter.camera_position = start
        plotter.camera.Azimuth(TURN * (FRAMES - 1 - k))
        cameras.append([tuple(v) for v in plotter.camera_position])
    return stage.seconds(cameras)


def _tell(stage, drawn, seconds):
    console = Console()
    console.print(str(stage.plotter.ibr.report()), highlight=False)
    console.print(
        f'{drawn.n_instances:,} instances, {np.median(seconds) * 1e3:.0f} ms per frame '
        f'({stage.window.GetSize()[0]}x{stage.window.GetSize()[1]}, the camera moving)'
    )
