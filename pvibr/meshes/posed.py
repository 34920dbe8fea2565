"""Poses from points, matrices, rotations, tables and datasets with vectors."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import as_array, check_finite, checked_number, naming
from pvibr.core.errors import warn
from pvibr.core.nan_rows import filled
from pvibr.core.spelling import nearest
from pvibr.io.tables import columns_table
from pvibr.maths.quaternions import to_matrices
from pvibr.maths.transforms import trs
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.pose_files import read_poses_and, table_poses
from pvibr.meshes.poses import as_poses

#: Size of items of size 0, as in VTK's glyphs: matrices stay invertible.
_MIN_SCALE = 1e-10
#: Largest scale and factor: float32 holds the square of each.
_MAX_SCALE = 1e18


class Source(NamedTuple):
    """Poses as the user passed them, and the arrays beside them by name, None without any."""

    poses: np.ndarray
    arrays: Mapping | None = None
    dataset: pv.DataSet | None = None
    #: Names of a table's columns.
    columns: tuple[str, ...] = ()

    def array(self, argument, name):
        """Return the array that an argument names."""
        arrays = self.arrays or {}
        if name in arrays:
            return np.asarray(arrays[name])
        if self.arrays is None:
            raise TypeError(
                f'{argument} must not be a name, got {name!r}: the points must be a dataset or a '
                'table with this array'
            )
        available = self.columns or tuple(arrays)
        if self.dataset is not None:
            available = *self.dataset.point_data, *self.dataset.cell_data
        names = ', '.join(map(repr, available)) or 'none'
        raise ValueError(
            f'{argument} must name an array of points or cells, which are {names}, got {name!r}'
            + nearest(name, available)
        )

    def scalars(self, name):
        """Return the values that `name` selects, with that name for their scalar bar."""
        values = self.array('scalars', name)
        if values.ndim != 1:
            raise ValueError(
                f'scalars must be an array of numbers or words, got {name!r}, vectors'
            )
        return named(values, name)


class _Named(np.ndarray):
    """An array with a name, like a column of a table."""

    name = ''


def named(values, name):
    """Return a copy of values with a name."""
    copy = np.array(values).view(_Named)
    copy.name = name
    return copy


def source_of(poses, *names, argument='poses', oriented=True, nan_rows=None) -> Source:
    """Return the poses of a file, table or dataset, and its arrays of these names.

    Unless oriented, columns of rotations and scales are arrays like any other.
    """
    if isinstance(poses, str | Path):
        return Source(*read_poses_and(poses, names, nan_rows))
    if isinstance(poses, _vtk.vtkDataSet):
        dataset = _at_arrays(poses if isinstance(poses, pv.DataSet) else pv.wrap(poses), names)
        return Source(dataset.points, dataset.point_data, dataset)
    with naming(argument, poses):
        table = columns_table(poses)
        if table is not None:
            # Three columns of any other names are positions, as those of an array.
            are_positions = len(table.names) == 3 and table.find('x') is None
            axes = table.names if are_positions else None
            reading = {'oriented': oriented, 'nan_rows': nan_rows}
            table_matrices, arrays = table_poses(table, names, axes, **reading)
            return Source(table_matrices, arrays, columns=tuple(table.names))
    return Source(_plain(poses))


def _at_arrays(dataset, names):
    """Return a dataset, or the centres of its cells if names are those of arrays of its cells."""
    on_points, on_cells = (
        [name for name in names if name in data and name not in others]
        for data, others in permutations((dataset.point_data, dataset.cell_data))
    )
    if on_points and on_cells:
        raise ValueError(
            'orient, scale and scalars must be arrays of either points or cells, got '
            f'{on_points[0]!r} of the points and {on_cells[0]!r} of the cells'
        )
    return dataset.cell_centers() if on_cells else dataset


def posed(poses, orient=None, scale=None, factor=1.0, nan_rows=None):
    """Return checked poses, scaled, then turned, then placed, shape (n, 3) or (n, 4, 4)."""
    source = source_of(poses, *array_names(poses, orient, scale), nan_rows=nan_rows)
    return posed_source(source, orient, scale, factor, nan_rows)


def posed_source(source, orient=None, scale=None, factor=1.0, nan_rows=None):
    """Return the same for the poses of a source."""
    poses = as_poses(source.poses, nan_rows)
    rotations = _turns(source, orient, len(poses), nan_rows)
    sizes = _sizes(source, scale, factor, len(poses), nan_rows)
    if rotations is None and sizes is None:
        return poses
    poses = trs(poses) if poses.ndim == 2 else poses.copy()
    if rotations is not None:
        poses[:, :3, :3] = poses[:, :3, :3] @ rotations
    if sizes is not None:
        poses[:, :3, :3] *= np.reshape(sizes, (-1, 1, 1))
    return poses


def matrices(points, orient=None, scale=None, factor=1.0):
    """Return matrices that scale, turn and place items as PyVista's ``glyph`` does.

    Parameters
    ----------
    points : array_like, shape (n, 3) or (n, 4, 4), dataset, table, transforms or path
        Points or matrices, world units; the points of a dataset; a table (pandas, polars, dict of
        columns, file) with columns x, y and z, optionally quaternions and scales, see
        :func:`pvibr.read_poses`; or transforms of PyVista, VTK or scipy.
    orient : array_like, str, sequence of str, bool or scipy.spatial.transform.Rotation, optional
        Vectors, shape (n, 3), toward which x is turned; quaternions (w, x, y, z), shape (n, 4);
        matrices, shape (n, 3, 3); the name of an array of these, or names of columns. True: the
        active vectors; False: none. By default the vectors of a dataset with a single array of
        them, other than normals and colours.
    scale : float, array_like, shape (n,) or (n, 3), str or bool, optional
        Factors, vectors whose lengths are the factors, or the name of an array of these. True:
        the active scalars. By default none.
    factor : float
        Factor applied to all.

    Returns
    -------
    numpy.ndarray, shape (n, 4, 4), float64
        World from model.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Notes
    -----
    Vectors turn as in ``glyph``: by half a turn about the direction halfway between x and the
    vector, so that horizontal vectors turn z down. For upright items, pass rotations about z
    instead. Zero vectors turn nothing.

    Examples
    --------
    >>> import pvibr
    >>> poses = pvibr.matrices([[5.0, 0, 0]], orient=[[0, 0, 3.0]], scale=[2.0])
    >>> (poses[0] @ [1, 0, 0, 1]).tolist()
    [5.0, 0.0, 2.0, 1.0]
    """
    with naming('points', points):
        poses = posed(points, orient, scale, factor)
    return trs(poses) if poses.ndim == 2 else poses


def toward(vectors):
    """Return rotations of x toward vectors, shape (n, 3, 3), as VTK's glyphs turn."""
    x_axis = np.eye(3)[0]
    units = unit_vectors(vectors)
    halfway = unit_vectors(units + x_axis)
    rotations = 2 * halfway[:, :, None] * halfway[:, None, :] - np.eye(3)
    along_x = ~units[:, 1:].any(1)
    rotations[along_x] = np.where(
        units[along_x, 0, None, None] < 0, np.diag([-1.0, 1, -1]), np.eye(3)
    )
    return rotations


def vectors_of(dataset):
    """Return the name of the only or active vectors of a dataset, None without any."""
    if dataset.active_vectors_name in dataset.point_data:
        return dataset.active_vectors_name
    data = dataset.point_data
    names = [name for name in data if _is_vectors(data[name])]
    names = [name for name in names if name not in ('Normals', data.active_normals_name)]
    if len(names) > 1:
        warn(
            f'nothing is turned, as the points have several arrays of vectors, {names}; name one: '
            f'orient={names[0]!r}'
        )
    return names[0] if len(names) == 1 else None


def _is_vectors(array):
    return array.ndim == 2 and array.shape[1] == 3 and array.dtype.kind == 'f'


def array_names(poses, orient, scale, scalars=None) -> list:
    """Return the names of the arrays that arguments select."""
    names = [name for name in (scalars, orient, scale) if isinstance(name, str)]
    if isinstance(poses, pv.DataSet):
        active = (poses.active_scalars_name, scale), (poses.active_vectors_name, orient)
        names += [name for name, selected in active if selected is True and name is not None]
    return names + names_in(orient)


def names_in(orient) -> list:
    """Return the names of columns that form vectors or quaternions."""
    are_names = isinstance(orient, list | tuple) and all(isinstance(n, str) for n in orient)
    return list(orient) if are_names else []


def _plain(poses):
    """Return transforms as matrices, anything else unchanged."""
    if isinstance(poses, list | tuple) and poses and all(_is_transform(p) for p in poses):
        return np.stack([_plain(p) for p in poses])
    if isinstance(poses, _vtk.vtkMatrix4x4):
        return pv.array_from_vtkmatrix(poses)
    if isinstance(poses, pv.Transform):
        return poses.matrix
    if isinstance(poses, _vtk.vtkTransform):
        return pv.array_from_vtkmatrix(poses.GetMatrix())
    if hasattr(poses, 'as_matrix'):
        matrices = np.asarray(poses.as_matrix())
        if matrices.shape[-2:] != (4, 4):
            raise TypeError(
                'poses must have positions, got a rotation; pass points and orient=rotation'
            )
        return matrices
    return poses


def _is_transform(pose):
    kinds = pv.Transform, _vtk.vtkTransform, _vtk.vtkMatrix4x4
    return isinstance(pose, kinds) or hasattr(pose, 'as_matrix')


def _turns(source, orient, count, nan_rows):
    """Return matrices, shape (n, 3, 3) or (1, 3, 3), None if nothing is turned."""
    if orient is None or orient is True:
        name = None if source.dataset is None else vectors_of(source.dataset)
        if name is None and orient:
            raise ValueError('orient=True requires points of a dataset with an array of vectors')
        orient = name
    if orient is None or orient is False:
        return None
    if isinstance(orient, str):
        return _turned('orient', source.array('orient', orient), count, nan_rows)
    if names_in(orient):
        columns = [source.array('orient', name) for name in orient]
        return _turned('orient', np.stack(columns, 1), count, nan_rows)
    if hasattr(orient, 'as_matrix'):
        orient = orient.as_matrix()
    return _turned('orient', orient, count, nan_rows)


def _turned(name, values, count, nan_rows):
    values = _numbers(name, values, nan_rows, count)
    shapes = [(n, *rest) for n in (count, 1) for rest in ((3,), (4,), (3, 3))]
    if values.shape in ((3,), (4,), (3, 3)) and values.shape not in shapes:
        values = values[None]
    if values.shape not in shapes:
        raise ValueError(
            f'{name} must be vectors, ({count}, 3), quaternions (w, x, y, z), ({count}, 4), or '
            f'matrices, ({count}, 3, 3), got shape {values.shape}'
        )
    if values.ndim == 3:
        return values
    if values.shape[1] == 3:
        return toward(values)
    zero_length = np.flatnonzero(~values.any(1))
    if len(zero_length):
        raise ValueError(
            f'{name}[{zero_length[0]}] must be a quaternion (w, x, y, z), got one of length 0'
        )
    return to_matrices(unit_vectors(values))


def _sizes(source, scale, factor, count, nan_rows):
    """Return factors, shape (n,) or (), None if nothing is scaled."""
    factor = checked_factor(factor)
    if scale is True:
        name = None if source.dataset is None else source.dataset.active_scalars_name
        if name is None:
            raise ValueError('scale=True requires points of a dataset with active scalars')
        scale = name
    if scale is None or scale is False:
        return None if factor == 1 else np.array(factor)
    if isinstance(scale, str) and scale.lower() == 'scale' and source.dataset is None:
        return None if factor == 1 else np.array(factor)  # the table's poses contain this column
    values = source.array('scale', scale) if isinstance(scale, str) else scale
    values = _numbers('scale', values, nan_rows, count)
    if values.shape == (count, 3):
        values = np.linalg.norm(values, axis=1)
    if values.shape not in ((), (count,)):
        raise ValueError(
            f'scale must be one number, ({count},) factors or ({count}, 3) vectors, got shape '
            f'{values.shape}'
        )
    if np.abs(values).max(initial=0.0) > _MAX_SCALE:
        raise ValueError(f'scale must be at most {_MAX_SCALE:g}, got {np.abs(values).max():g}')
    return nonzero_scales(values * factor)


def nonzero_scales(sizes):
    """Return sizes with the smallest scale in place of 0."""
    return np.where(sizes == 0, _MIN_SCALE, sizes)


def checked_factor(factor) -> float:
    """Return a checked factor of all sizes, not 0."""
    return checked_number('factor', factor, -_MAX_SCALE, _MAX_SCALE) or _MIN_SCALE


def _numbers(name, values, nan_rows, count):
    try:
        array = as_array(name, values, np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} must be numbers, got {values!r:.80}') from error
    if array.shape[:1] == (count,):  # a row per item
        array = filled(nan_rows, name, array)
    check_finite(name, array)
    return array


def scalars_of(points, scalars):
    """Return scalars; a string is the name of an array of the dataset or table `points`."""
    if not isinstance(scalars, str):
        return scalars
    return source_of(points, scalars, argument='points', oriented=False).scalars(scalars)
