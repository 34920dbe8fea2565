"""Stored views as a thing: interpolated by the depth of each, recoloured and lit again."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from pvibr.cluster.view_database import grid_of, row_of
from pvibr.cluster.view_files import read_row, read_table
from pvibr.instances.atlas import MARGIN, Atlas
from pvibr.instances.bake import fill_depth
from pvibr.instances.instances import Instances
from pvibr.instances.levels import LodModel
from pvibr.instances.limits import checked_force
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.instances.support import table_of
from pvibr.maths import octahedral
from pvibr.maths.views import corners
from pvibr.things.appearance import color_table, map_scalars

#: Three views: a single one misses what is hidden from it.
_LEVEL = 'blended'


class _Step(NamedTuple):
    """The views of one time, on the grid."""

    bounds: np.ndarray
    center: np.ndarray
    radius: float
    #: Channels by name, (side, side, size, size, ...), lowest row first.
    channels: dict[str, np.ndarray]


def read_views(path) -> StoredViews:
    """Read an image database that :func:`pvibr.cluster.views` wrote, as a thing for plotters.

    Parameters
    ----------
    path : path
        The folder, with ``data.csv``.

    Returns
    -------
    pvibr.cluster.StoredViews
        For ``plotter.ibr.add``.

    Raises
    ------
    FileNotFoundError
        If there is no such database.
    ValueError
        If its views are not those of a whole grid, or no squares of a power of two of pixels.
    ImportError
        If the extra ``cluster`` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> import pyvista as pv
    >>> import pvibr
    >>> import pvibr.cluster
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pvibr.cluster.ViewWriter(folder, 6, size=16).step(pv.Sphere(), 0.0)
    ...     stored = pvibr.read_views(folder)
    >>> stored.times
    (0.0,)
    """
    return StoredViews(path)


class StoredViews(Instances):
    """Views of a scene from all around, drawn as cards from any side.

    Each pixel blends the three nearest views where their depths agree, lit by the lights of the
    plotter. Of the times that are stored, that nearest to
    ``plotter.ibr.time`` is shown.

    Parameters
    ----------
    path : path
        The folder of the database.
    name : str, optional
        Name in the plotter and in reports.

    Raises
    ------
    FileNotFoundError, ValueError
        As for :func:`pvibr.read_views`.
    """

    FOR_USERS = ('times', 'arrays', 'color_by')

    def __init__(self, path, *, name=None):
        self._path = Path(path)
        self._by: tuple[str | None, dict] = None, {}
        self._rows: dict[float, dict] = {}
        for time, phi, theta, file in read_table(path):
            self._rows.setdefault(time, {})[phi, theta] = file
        if not self._rows:
            raise ValueError(f'path must have views, got none in {str(path)!r}')
        step = _read(self._path, self._rows[self.times[0]])
        proxy = pv.Box(step.bounds)
        super().__init__(proxy, np.zeros((1, 3)), bake=False, name=name, pickable=False)
        self._shown_time = self.times[0]
        self._show_step(step)
        self._force_level = _LEVEL
        self._forced = checked_force(_LEVEL)

    @property
    def times(self) -> tuple[float, ...]:
        """The stored times, seconds."""
        return tuple(sorted(self._rows))

    @property
    def arrays(self) -> tuple[str, ...]:
        """Names of the values that can colour it."""
        own = {'rgba', 'albedo', 'depth', 'normal'}
        return tuple(sorted(set(self._step.channels) - own))

    def color_by(self, scalars, **options):
        """Colour it by values, or as it was stored.

        Parameters
        ----------
        scalars : str, optional
            One of `arrays`; None shows the stored colours.
        **options
            ``cmap``, ``clim`` and others as in ``add_mesh``.

        Raises
        ------
        KeyError
            If there are no such values.
        """
        if scalars is not None and scalars not in self.arrays:
            names = ', '.join(self.arrays) or 'none'
            raise KeyError(f'scalars must be one of {names}, got {scalars!r}')
        self._by = scalars, options
        self._show_step(self._step)

    def follow(self):
        """Show the step nearest to the plotter's time."""
        super().follow()
        nearest = min(self.times, key=lambda time: abs(time - self._now()))
        if nearest != self._shown_time:
            self._shown_time = nearest
            self._show_step(_read(self._path, self._rows[nearest]))

    def _show_step(self, step):
        self._step = step
        parts = self._models.meshes[0]
        self._models.by_mesh = {0: LodModel([MeshLevel(list(parts))], self._atlas(step))}
        self._rebuild()

    def _atlas(self, step) -> Atlas:
        channels, (scalars, options) = step.channels, self._by
        side, _, size, _ = channels['depth'].shape
        coverage = channels['albedo'][..., 3:] / 255
        distance = channels['depth']
        toward_eye = 2.0 - np.where(np.isfinite(distance), distance / step.radius, 2.0)
        normal = channels['normal'] * coverage * 0.5 + 0.5
        color = channels['albedo'][..., :3]
        if scalars is not None:
            has_value = np.isfinite(channels[scalars])
            values = channels[scalars][has_value]
            own = map_scalars(color_table(values, **options), values)[:, :3]
            color = color.copy()
            color[has_value] = np.rint(own * coverage[has_value])
        height = (toward_eye / MARGIN * 0.5 + 0.5)[..., None]
        geometry = np.concatenate([height, coverage, normal[..., :2]], -1)
        geometry = np.rint(255 * np.clip(geometry, 0, 1)).astype(np.uint8)
        normal_z = np.rint(255 * normal[..., 2:]).astype(np.uint8)
        albedo = np.concatenate([color, normal_z], -1)
        geometry, albedo = (_side_by_side(image) for image in (geometry, albedo))
        fill_depth(geometry, size)
        (box,) = corners(step.bounds)
        support = table_of((box - step.center) / step.radius)
        # Levels are taken only from atlases that were measured.
        measured = {'stored': np.zeros(0)}
        sphere = step.center, step.radius
        return Atlas(geometry, albedo, *sphere, support, side, size, errors=measured)


def _side_by_side(tiles) -> np.ndarray:
    side, _, size, _, channels = tiles.shape
    return np.ascontiguousarray(tiles.transpose(0, 2, 1, 3, 4)).reshape(
        side * size, side * size, channels
    )


def _read(folder, files) -> _Step:
    """Read the views of one time."""
    try:
        return _step_of(folder, files)
    except (LookupError, TypeError, ValueError) as error:
        raise ValueError(f'{folder}: {error}') from error


def _step_of(folder, files) -> _Step:
    """Return the views of one time, which are those of a whole grid."""
    side = next((n for n in range(2, 200) if len(grid_of(n)) >= len(files)), 0)
    directions = octahedral.view_directions(side)
    names = [files.get(row_of(0.0, d)[1:]) for d in directions.reshape(-1, 3)]
    if None in names or len(set(names)) != len(files):
        raise ValueError(
            f'it must have the views of a whole octahedral grid, got {len(files)} others: '
            'pvibr.cluster.views and ViewWriter store such'
        )
    read = {name: read_row(folder / name) for name in dict.fromkeys(names)}
    channels, meta = next(iter(read.values()))
    size = len(channels['depth'])
    if size & (size - 1) or channels['depth'].shape != (size, size):
        raise ValueError(
            f'views must be squares of a power of two of pixels, got {channels["depth"].shape}'
        )
    stacked = {
        name: np.stack([read[k][0][name][::-1] for k in names]).reshape(
            side, side, *channels[name].shape
        )
        for name in channels
    }
    return _Step(meta['bounds'], meta['center'], float(meta['radius']), stacked)
