"""Views of a scene from all around, stored as colour, depth, normals and values."""

from __future__ import annotations

import hashlib
import uuid
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.cluster import stages
from pvibr.cluster.clients import Cluster
from pvibr.cluster.sent_scenes import scene_of
from pvibr.cluster.shard_pictures import reaching
from pvibr.cluster.shards import ShardView, drawn_view, light_values
from pvibr.cluster.view_files import (
    read_table,
    rounded_depth,
    rounded_normal,
    write_row,
    write_table,
)
from pvibr.core.arguments import checked_number, checked_whole
from pvibr.core.errors import PvibrError
from pvibr.core.progress import baking
from pvibr.instances.atlas import MARGIN
from pvibr.maths import octahedral
from pvibr.maths.views import View
from pvibr.things.thing import Thing

#: Colours of a map that show values as steps of grey.
_GREYS = 256
#: Samples of pixels of outlines.
_SAMPLES = 8


def views(
    make_scene,
    angles,
    times,
    path,
    *,
    client=None,
    args=(),
    kwargs=None,
    size=256,
    progress=None,
) -> Path:
    """Store views of a scene from all around in an image database, by a Dask cluster's workers.

    The layout is that of Cinema databases, specification D: ``data.csv`` and an HDF5 file a view,
    with the channels ``rgba``, ``albedo``, ``depth``, ``normal`` and one for each array that
    colours an actor. Files appear when they are complete; the same call resumes.

    Parameters
    ----------
    make_scene : callable
        As in :func:`pvibr.cluster.movie`.
    angles : int
        Most views from all around: they lie on an octahedral grid.
    times : sequence of float
        Values of ``plotter.ibr.time``, seconds.
    path : path
        The folder, which the workers must see.
    client : distributed.Client, optional
        The cluster, by default the client that is open.
    args : tuple
        Arguments of `make_scene`.
    kwargs : dict, optional
        Keyword arguments of `make_scene`.
    size : int
        Width and height of the pictures, in pixels.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    TypeError, ValueError
        If an argument is not allowed, or cannot be sent to the workers.
    FileNotFoundError
        If a worker does not see the folder.
    ImportError
        If the extra ``cluster`` is not installed.
    PvibrError
        If the scene or a view fails on a worker.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> import pvibr.cluster
    >>> from distributed import Client
    >>> def ball():
    ...     pl = pv.Plotter(off_screen=True)
    ...     _ = pl.add_mesh(pv.Sphere())
    ...     return pl
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / 'ball.cdb'
    ...     with Client(processes=False, n_workers=1, dashboard_address=':0') as client:
    ...         _ = pvibr.cluster.views(ball, 6, [0.0], path, client=client, size=16)
    ...     len(list(path.glob('*.h5')))
    6
    """
    cluster = Cluster(client)
    scene = scene_of(cluster, make_scene, args, kwargs)
    size = checked_whole('size', size, 8, 4096)
    directions = directions_of(angles)
    times = [checked_number(f'times[{k}]', time) for k, time in enumerate(times)]
    path = Path(path).absolute()
    path.mkdir(parents=True, exist_ok=True)
    cluster.check_paths('path', [path])
    rows = {row_of(t, d): (t, d) for t in times for d in directions}
    done = [row for row in rows if (path / _file(row, scene.key, size)).exists()]
    missing = rows.keys() - done
    todo = [(str(path), row, *rows[row], size) for row in rows if row in missing]
    try:
        with baking(progress, 'Storing views') as advance:
            for (_, row, *_), (_, failure) in cluster.results(_stored, todo, scene):
                if failure:
                    raise PvibrError(f'view {row}: {failure}')
                done.append(row)
                _tell(path, done, scene.key, size)
                advance(len(done) / len(rows))
        _tell(path, done, scene.key, size)
    finally:
        cluster.client.run(stages.leave, scene.key, on_error='ignore')
    return path


def _tell(path, done, key, size):
    write_table(path, [(*row, _file(row, key, size)) for row in done])


def directions_of(angles) -> np.ndarray:
    """Return the unit vectors of the largest octahedral grid of at most so many views."""
    angles = checked_whole('angles', angles, 6, 100_000)
    side, grid = 3, grid_of(3)
    while len(larger := grid_of(side + 1)) <= angles:
        side, grid = side + 1, larger
    return grid


def grid_of(side) -> np.ndarray:
    """Return the different directions of an octahedral grid, (n, 3)."""
    directions = octahedral.view_directions(side).reshape(-1, 3)
    _, first = np.unique(np.round(directions, 9) + 0.0, axis=0, return_index=True)
    return directions[np.sort(first)]


def row_of(time, direction) -> tuple[float, float, float]:
    """Return time, azimuth and elevation, degrees, of a view."""
    x, y, z = np.round(direction, 9) + 0.0  # without -0, which has another azimuth
    phi, theta = np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1, 1)))
    return time, round(float(phi), 6) + 0.0, round(float(theta), 6) + 0.0


def _file(row, key, size) -> str:
    text = repr((row, key, size)).encode()
    return f'{hashlib.blake2b(text, digest_size=8).hexdigest()}.h5'


# -- on workers ------------------------------------------------------------------------------


def _stored(folder, row, time, direction, size, scene):
    file = Path(folder) / _file(row, scene.key, size)
    return stages.told('make_scene', _store, file, time, direction, size, scene, failed=None)


def _store(file, time, direction, size, scene):
    plotter = stages.stage_of(scene).plotter
    plotter.ibr.time = time
    store_view(file, plotter, time, direction, size)


def store_view(file, plotter, time, direction, size):
    """Write what a plotter shows from a direction."""
    bounds = np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
    center = bounds.mean(1)
    radius = _radius(plotter, center, bounds)
    view = _around(center, radius, np.asarray(direction))
    shown = ShardView(view, (size, size), 0, time, light_values(plotter.renderer))
    color, depth, normal = drawn_view(plotter, shown)
    covered = color[..., 3] > 0
    world_normal = normal @ view.view_from_world[:3, :3]
    with _unlit(plotter):
        albedo = drawn_view(plotter, replace(shown, samples=_SAMPLES), has_normals=False)[0]
    depth = reaching(albedo, depth)
    channels = {
        'rgba': color,
        'albedo': albedo,
        'depth': rounded_depth(depth, 2 * radius),
        'normal': rounded_normal(world_normal * covered[..., None]),
        **_scalars(plotter, shown),
    }
    channels = {name: array[::-1] for name, array in channels.items()}  # top row first
    meta = {
        'bounds': bounds.ravel(),
        'center': center,
        'radius': radius,
        'direction': direction,
        'time': time,
    }
    write_row(file, channels, meta)


def _radius(plotter, center, bounds) -> float:
    """Return how far the scene reaches from a point: exactly if it is of plain meshes."""
    reach = 0.0
    for actor in plotter.renderer.GetActors():
        data = actor.GetMapper().GetInputDataObject(0, 0)
        if isinstance(actor, Thing) or not isinstance(data, pv.DataSet):
            return float(np.linalg.norm(np.ptp(bounds, axis=1)) / 2) or 1.0
        world = pv.array_from_vtkmatrix(actor.GetMatrix())
        points = np.asarray(data.points) @ world[:3, :3].T + world[:3, 3]
        if actor.GetVisibility():
            reach = max(reach, float(np.linalg.norm(points - center, axis=1).max(initial=0.0)))
    return reach or 1.0


def _around(center, radius, direction) -> View:
    """Return the parallel view of a sphere, with its middle at twice its radius."""
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = octahedral.frame(direction)
    view_from_world[:3, 3] = -view_from_world[:3, :3] @ center - [0, 0, 2 * radius]
    near, far, reach = 0.9 * radius, 3.1 * radius, MARGIN * radius
    clip = np.diag([1 / reach, 1 / reach, -2 / (far - near), 1.0])
    clip[2, 3] = -(far + near) / (far - near)
    return View(view_from_world, clip, near, far, True)


class _unlit:
    """Draws actors without light, and back."""

    def __init__(self, plotter):
        self._props = [actor.GetProperty() for actor in plotter.renderer.GetActors()]
        self._lit = [prop.GetLighting() for prop in self._props]

    def __enter__(self):
        for prop in self._props:
            prop.SetLighting(False)

    def __exit__(self, *_):
        for prop, lit in zip(self._props, self._lit, strict=True):
            prop.SetLighting(lit)


def _scalars(plotter, shown) -> dict[str, np.ndarray]:
    """Return the values that actors show, to 1/255 of their range, NaN elsewhere."""
    mappers = [a.GetMapper() for a in plotter.renderer.GetActors() if a.GetVisibility()]
    mappers = [m for m in mappers if m.GetScalarVisibility() and m.GetArrayName()]
    names = sorted({m.GetArrayName() for m in mappers})
    return {
        name: _values(plotter, shown, [m for m in mappers if m.GetArrayName() == name])
        for name in names
    }


def _values(plotter, shown, mappers) -> np.ndarray:
    low, high = mappers[0].GetScalarRange()
    greys = pv.LookupTable('gray', n_values=_GREYS, scalar_range=(low, high))
    others = [a for a in plotter.renderer.GetActors() if a.GetMapper() not in mappers]
    looks = [(a.GetMapper().GetScalarVisibility(), a.GetProperty().GetColor()) for a in others]
    tables = [mapper.GetLookupTable() for mapper in mappers]
    try:
        for mapper in mappers:
            mapper.SetLookupTable(greys)
        for actor in others:  # in a colour that is no grey
            actor.GetMapper().SetScalarVisibility(False)
            actor.GetProperty().SetColor(0.0, 0.0, 1.0)
        with _unlit(plotter):
            color = drawn_view(plotter, shown, has_normals=False)[0].astype(int)
    finally:
        for mapper, table in zip(mappers, tables, strict=True):
            mapper.SetLookupTable(table)
            mapper.SetScalarRange(low, high)
        for actor, (shows, own) in zip(others, looks, strict=True):
            actor.GetMapper().SetScalarVisibility(shows)
            actor.GetProperty().SetColor(own)
    is_value = (color[..., 3] > 0) & (abs(color[..., 2] - color[..., 0]) <= 2)
    values = low + (high - low) * color[..., 0] / 255
    return np.where(is_value, values, np.nan).astype(np.float32)


class ViewWriter:
    """Stores views of a mesh step by step, as a simulation goes on.

    Parameters
    ----------
    path : path
        The folder of the database; steps are added to those that are there.
    angles : int
        As in :func:`pvibr.cluster.views`.
    size : int
        Width and height of the pictures, in pixels.
    **look
        As of :meth:`pyvista.Plotter.add_mesh`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> import pvibr.cluster
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     writer = pvibr.cluster.ViewWriter(folder, 6, size=16, color='tan')
    ...     for time in (0.0, 0.5):
    ...         writer.step(pv.Sphere(radius=1 + time), time)
    ...     len(list(pathlib.Path(folder).glob('*.h5')))
    12
    """

    def __init__(self, path, angles=162, *, size=256, **look):
        self._folder, self._look = Path(path), look
        self._directions = directions_of(angles)
        self._size = checked_whole('size', size, 8, 4096)
        self._folder.mkdir(parents=True, exist_ok=True)

    def step(self, mesh, time):
        """Store all views of a mesh at a time; they appear together when all are written.

        Parameters
        ----------
        mesh : pyvista.DataSet
            The mesh at this time.
        time : float
            The time in seconds; a step of the same time is replaced.
        """
        time = checked_number('time', time)
        try:
            present = read_table(self._folder)
        except FileNotFoundError:
            present = []
        kept = [row for row in present if row[0] != time]
        key = uuid.uuid4().hex  # files of a step that is replaced stay whole until then
        plotter = pv.Plotter(off_screen=True, window_size=[self._size, self._size])
        try:
            plotter.add_mesh(mesh, **self._look)
            rows = []
            for direction in self._directions:
                row = row_of(time, direction)
                rows.append((*row, _file(row, key, self._size)))
                store_view(self._folder / rows[-1][-1], plotter, time, direction, self._size)
        finally:
            plotter.close()
        write_table(self._folder, [*kept, *rows])
        for *_, name in set(present) - set(kept):
            (self._folder / name).unlink(missing_ok=True)
