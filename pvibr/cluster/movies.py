"""A movie whose frames are drawn by the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from numbers import Real
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.capture.movies import Film, write_movie
from pvibr.cluster import stages
from pvibr.cluster.clients import Cluster
from pvibr.cluster.sent_scenes import scene_of
from pvibr.cluster.stages import Moment
from pvibr.core.arguments import checked_number, checked_numbers, checked_positive
from pvibr.core.errors import PvibrError
from pvibr.core.params import checked_flag

#: Names of cameras that ``plotter.camera_position`` takes.
_VIEWS = 'xy', 'xz', 'yz', 'yx', 'zx', 'zy', 'iso'
#: Frames of a block, which one worker draws, at most; and blocks for each worker, at least.
_BLOCK, _BLOCKS_EACH = 8, 4


def movie(
    make_scene,
    cameras_or_times,
    path,
    *,
    client=None,
    args=(),
    kwargs=None,
    fps=30.0,
    samples=1,
    resume=True,
    progress=None,
) -> Path:
    """Record a movie whose frames the workers of a Dask cluster draw.

    Each worker calls `make_scene` once and keeps its plotter until the movie is complete. Frames
    are written as they come. Those of a worker that dies are drawn by another one; after an error
    or Ctrl+C the same call resumes, in any process, as :meth:`plotter.ibr.movie` does.

    Parameters
    ----------
    make_scene : callable
        Called as ``make_scene(*args, **kwargs)`` by the workers, with the theme of this process;
        it returns a plotter. It is sent as Dask sends functions: of a script as it is, of a
        module by its name, so that workers must have the module.
    cameras_or_times : sequence
        What each frame shows: a time in seconds, which becomes ``plotter.ibr.time``; a camera as
        ``plotter.camera_position`` takes it, or a ``pyvista.Camera``; or a pair of both. A frame
        must depend on these alone.
    path : path
        As in :meth:`plotter.ibr.movie`: a movie, a GIF or a folder of PNG files, written by this
        process.
    client : distributed.Client, optional
        The cluster, by default the client that is open.
    args, kwargs : sequence and dict, optional
        Arguments of `make_scene`. Those that are ``pathlib.Path`` must be there for all workers.
    fps : float
        Frames per second.
    samples : int
        Samples of each pixel, as for :meth:`plotter.ibr.screenshot`.
    resume : bool
        Whether to reuse frames of an earlier call with the same scene.
    progress : bool, optional
        Whether to show a progress bar on standard error; by default on terminals.

    Returns
    -------
    pathlib.Path
        The movie or the folder.

    Raises
    ------
    TypeError, ValueError
        If an argument is not allowed, or cannot be sent to the workers.
    FileNotFoundError
        If a path among the arguments is not there for a worker.
    ImportError
        If the extra ``cluster``, or ``movie`` for a movie, is not installed.
    PvibrError
        If a frame or the scene fails on a worker; the message has its number and traceback.
    OSError
        If a file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> import pvibr.cluster
    >>> from distributed import Client
    >>> def cone(color):
    ...     pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    ...     _ = pl.add_mesh(pv.Cone(), color=color)
    ...     return pl
    >>> cameras = [((5, y, 2), (0, 0, 0), (0, 0, 1)) for y in (-1, 0, 1)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / 'cone.gif'
    ...     with Client(processes=False, n_workers=1, dashboard_address=':0') as client:
    ...         pvibr.cluster.movie(cone, cameras, path, client=client, args=('tan',)).name
    'cone.gif'
    """
    cluster = Cluster(client)
    scene = scene_of(cluster, make_scene, args, kwargs, samples)
    moments = _moments(cameras_or_times)
    marks = {'scene': scene.key, 'moments': [list(map(repr, vars(m).values())) for m in moments]}
    film = Film(
        path,
        count=len(moments),
        fps=checked_positive('fps', fps),
        marks=marks,
        resume=checked_flag('resume', resume),
    )

    def drawn(missing) -> Iterator[tuple[int, bytes]]:
        blocks = [(k, [moments[i] for i in k]) for k in _blocks(missing, cluster)]
        for (numbers, _), drawn_block in cluster.results(stages.draw_frames, blocks, scene):
            pictures, failure = drawn_block
            yield from zip(numbers, pictures, strict=not failure)
            if failure:
                what, _, told = failure.partition('\n')
                raise PvibrError(f'{what}. {film.recovery}\n{told}')

    try:
        write_movie(film, drawn, checked_flag('progress', progress, optional=True))
    finally:
        with suppress(Exception):  # a cluster that is gone has closed it
            cluster.client.run(stages.leave, scene.key, on_error='ignore')
    return film.path


def _moments(cameras_or_times) -> list[Moment]:
    if isinstance(cameras_or_times, str) or not np.iterable(cameras_or_times):
        raise TypeError(
            'cameras_or_times must be a sequence of times or cameras, got '
            f'{cameras_or_times!r:.80}'
        )
    moments = [_moment(f'cameras_or_times[{k}]', v) for k, v in enumerate(cameras_or_times)]
    if not moments:
        raise ValueError('cameras_or_times must have at least one frame, got none')
    return moments


def _moment(name, value) -> Moment:
    """Return what one frame shows."""
    if isinstance(value, Real):
        return Moment(checked_number(name, value))
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return Moment(checked_number(f'{name}[0]', value[0]), **_camera(f'{name}[1]', value[1]))
    return Moment(**_camera(name, value))


def _camera(name, camera) -> dict:
    """Return what a camera sets, as plain values."""
    if isinstance(camera, pv.Camera):
        scale = camera.parallel_scale if camera.parallel_projection else None
        place = camera.position, camera.focal_point, camera.up
        return {'position': place, 'view_angle': camera.view_angle, 'parallel_scale': scale}
    if isinstance(camera, str):
        if camera not in _VIEWS:
            raise ValueError(f'{name} must be one of {", ".join(_VIEWS)}, got {camera!r}')
        return {'position': camera}
    places = checked_numbers(name, list(camera) if np.iterable(camera) else camera, (3, 3))
    return {'position': tuple(map(tuple, places.tolist()))}


def _blocks(missing, cluster) -> list[list[int]]:
    """Divide frames into blocks: several for each worker, so that all end together."""
    size = min(_BLOCK, max(1, len(missing) // (_BLOCKS_EACH * cluster.worker_count)))
    return [missing[k : k + size] for k in range(0, len(missing), size)]
