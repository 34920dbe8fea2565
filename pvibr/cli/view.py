"""``pvibr view``: a mesh at every pose in a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from rich.console import Console

from pvibr.capture.montage import save
from pvibr.capture.offscreen import Stage
from pvibr.maths.transforms import trs
from pvibr.meshes.pose_files import read_poses

#: Timed frames, and the camera's azimuth step in degrees.
FRAMES, TURN = 12, 2.0


def main(
    mesh,
    poses,
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
    matrices, found = read_poses(poses, columns)
    if not len(matrices):
        msg = f'{poses} names columns and has no rows: there is nothing to show.'
        raise ValueError(msg)
    looks = _looks(poses, found, scalars, cmap)
    matrices = _scaled(matrices, scale)
    name = f'{Path(mesh).stem} at {Path(poses).name}'
    looks |= {'name': scalars or name, 'max_error': max_error}
    if window:
        plotter = pv.Plotter(window_size=list(size))
        plotter.ibr.add_instances(str(mesh), matrices, **looks)
        plotter.show()
        return
    with Stage(size) as stage:
        drawn = stage.plotter.ibr.add_instances(str(mesh), matrices, **looks)
        stage.bounds = drawn.bounds
        seconds = _orbit(stage)
        _tell(stage, drawn, seconds)
        if out is not None:
            save(out, stage.picture())
            Console().print(f'wrote {out}')


def _looks(poses, found, scalars, cmap):
    if scalars is None:
        return {}
    if scalars not in found:
        msg = f'--scalars is {scalars!r}; {poses} has the columns {", ".join(found) or "(none)"}.'
        raise ValueError(msg)
    if found[scalars].dtype.kind not in 'fiu':
        msg = f'--scalars is {scalars!r}, a column of text in {poses}; name one of numbers.'
        raise ValueError(msg)
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
