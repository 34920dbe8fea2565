"""``pvibr view``: a mesh at every pose in a file, or alone on the ground."""

from __future__ import annotations

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pyvista as pv
from rich.console import Console

from pvibr.capture.montage import check_image, save
from pvibr.maths.transforms import trs
from pvibr.meshes.pose_files import read_poses
from pvibr.scenes.stage import Stage

#: Timed frames, and azimuth step of the camera in degrees.
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
    pose_matrices, looks, name = np.zeros((1, 3)), {}, Path(mesh).stem
    if poses is None and (scalars is not None or columns is not None):
        option = '--columns' if scalars is None else '--scalars'
        raise ValueError(f'{option} requires a table of poses: add --poses FILE.')
    if poses is not None:
        pose_matrices, table = read_poses(poses, columns)
        if not len(pose_matrices):
            raise ValueError(f'{poses} must have rows below its header, got no rows.')
        looks, name = _looks(poses, table, scalars, cmap), f'{name} at {Path(poses).name}'
    looks |= {'name': scalars or name, 'max_error': max_error}

    def fill(plotter):
        instances = plotter.ibr.add_instances(str(mesh), _scaled(pose_matrices, scale), **looks)
        if poses is None:
            plotter.ibr.look('studio')
        return instances

    if window:
        plotter = pv.Plotter(window_size=list(size))
        fill(plotter)
        plotter.show()
        return
    with Stage(size) as stage:
        instances = fill(stage.plotter)
        stage.bounds = instances.bounds
        _tell(stage, instances, _orbit(stage))
        out = out or Path(mkdtemp(prefix='pvibr-')) / f'{Path(mesh).stem}.png'
        save(out, stage.picture())
        Console().print(f'wrote {out}', soft_wrap=True)


def _looks(poses, table, scalars, cmap):
    if scalars is None:
        return {}
    if scalars not in table:
        names = ', '.join(table) or 'none'
        raise ValueError(f'--scalars must be a column of {poses} ({names}), got {scalars!r}.')
    if table[scalars].dtype.kind not in 'fiu':
        raise ValueError(
            f'--scalars must be a column of numbers in {poses}, got {scalars!r}, a column of text.'
        )
    return {'scalars': table[scalars], 'cmap': cmap}


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
    """Return the seconds of frames on an orbit that ends at the isometric view."""
    plotter = stage.plotter
    plotter.view_isometric(render=False)
    plotter.camera.azimuth = 0.0
    start_view = [tuple(v) for v in plotter.camera_position]
    cameras = []
    for k in range(FRAMES):
        plotter.camera_position = start_view
        plotter.camera.Azimuth(TURN * (FRAMES - 1 - k))
        cameras.append([tuple(v) for v in plotter.camera_position])
    return stage.seconds(cameras)


def _tell(stage, instances, frame_seconds):
    console = Console()
    console.print(str(stage.plotter.ibr.report()), highlight=False)
    console.print(
        f'{instances.n_instances:,} instances, {np.median(frame_seconds) * 1e3:.0f} ms per frame '
        f'({stage.window.GetSize()[0]}x{stage.window.GetSize()[1]}, the camera moving)'
    )
