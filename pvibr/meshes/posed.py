"""Poses from what users have: points, matrices, rotations, tables, datasets with vectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.spelling import nearest
from pvibr.formats.tables import columns_table
from pvibr.maths.arguments import as_array, check_finite, checked_number, naming
from pvibr.maths.quaternions import to_matrices
from pvibr.maths.transforms import trs
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.pose_files import read_poses_and, table_poses
from pvibr.meshes.poses import as_poses

#: Size of items of size 0, as VTK's glyphs have it: matrices keep an inverse.
_LEAST = 1e-10
#: The largest scale and factor: single floats hold the square of each.
_MOST = 1e18


class Source(NamedTuple):
    """Poses as they were given, and the arrays that came with them by name, None of bare ones."""

    poses: np.ndarray
    arrays: Mapping | None = None
    dataset: pv.DataSet | None = None
    #: Names of the columns of a table.
    columns: tuple[str, ...] = ()

    def array(self, argument, name):
        """Return the array that an argument names."""
        arrays = self.arrays or {}
        if name in arrays:
            return np.asarray(arrays[name])
        if self.arrays is None:
            raise TypeError(
                f'{argument} is {name!r}, a name: it needs points that are a dataset or a table '
                'with this array'
            )
        known = ', '.join(map(repr, self.columns or arrays)) or 'none'
        msg = f'{argument} is {name!r}; the arrays of the points are: {known}'
        raise ValueError(msg + nearest(name, self.columns or arrays))

    def scalars(self, name):
        """Return the values that scalars name: their scalar bar has that name."""
        values = self.array('scalars', name)
        if values.ndim != 1:
            raise ValueError(
                f'scalars is {name!r}, an array of vectors; name one of numbers or words'
            )
        return named(values, name)


class _Named(np.ndarray):
    """An array with a name, as a column of a table has it."""

    name = ''


def named(values, name):
    """Return a copy of values that has a name."""
    made = np.array(values).view(_Named)
    made.name = name
    return made


def source_of(poses, *names, argument='poses', oriented=True) -> Source:
    """Return poses and the arrays of some names, of a file, a table or a dataset.

    If they are not oriented, columns of rotations and scales are arrays as others are.
    """
    if isinstance(poses, str | Path):
        return Source(*read_poses_and(poses, names))
    if isinstance(poses, _vtk.vtkDataSet):
        dataset = poses if isinstance(poses, pv.DataSet) else pv.wrap(poses)
        return Source(dataset.points, dataset.point_data, dataset)
    with naming(argument, poses):
        table = columns_table(poses)
        if table is not None:
            # Of three columns by other names, those are: as of an array.
            bare = len(table.names) == 3 and table.find('x') is None
            axes = table.names if bare else None
            found, arrays = table_poses(table, names, axes, oriented=oriented)
            return Source(found, arrays, columns=tuple(table.names))
    return Source(_plain(poses))


def posed(poses, orient=None, scale=None, factor=1.0):
    """Return checked poses, shape (n, 3) or (n, 4, 4): turned, scaled, then where they are."""
    named = [name for name in (orient, scale) if isinstance(name, str)]
    return posed_source(source_of(poses, *named, *names_in(orient)), orient, scale, factor)


def posed_source(source, orient=None, scale=None, factor=1.0):
    """Return the checked poses of a source."""
    poses = as_poses(source.poses)
    turns = _turns(source, orient, len(poses))
    sizes = _sizes(source, scale, factor, len(poses))
    if turns is None and sizes is None:
        return poses
    poses = trs(poses) if poses.ndim == 2 else poses.copy()
    if turns is not None:
        poses[:, :3, :3] = poses[:, :3, :3] @ turns
    if sizes is not None:
        poses[:, :3, :3] *= np.reshape(sizes, (-1, 1, 1))
    return poses


def matrices(points, orient=None, scale=None, factor=1.0):
    """Return matrices that scale, turn and move, as PyVista's ``glyph`` places its glyphs.

    Parameters
    ----------
    points : array_like, shape (n, 3) or (n, 4, 4), dataset, table, transforms or path
        Points or matrices, world units. A dataset has its points, a table (pandas, polars, dict of
        columns, file) has them in columns x, y and z and may have quaternions and scales, see
        :func:`pvibr.read_poses`. Transforms are ``pyvista.Transform``, VTK's, or one of scipy.
    orient : array_like, str, sequence of str, bool or scipy.spatial.transform.Rotation, optional
        Vectors, shape (n, 3), toward which x is turned; quaternions (w, x, y, z), shape (n, 4);
        matrices, shape (n, 3, 3); a name of an array of these, or names of columns. True: the
        active vectors; False: none. By default the vectors of a dataset that has one array of
        them, normals and colours left out.
    scale : float, array_like, shape (n,) or (n, 3), str or bool, optional
        Factors, or vectors whose lengths are the factors, or a name of an array of these. True:
        the active scalars. By default none.
    factor : float
        Factor of all.

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
    Vectors turn as those of ``glyph`` do: by half a turn about the direction in the middle of x
    and the vector, so that level vectors turn z down: for what stands upright, give turns about
    z. Zero vectors turn nothing.

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
    ahead = np.eye(3)[0]
    units = unit_vectors(vectors)
    middle = unit_vectors(units + ahead)
    turns = 2 * middle[:, :, None] * middle[:, None, :] - np.eye(3)
    along = ~units[:, 1:].any(1)
    turns[along] = np.where(units[along, 0, None, None] < 0, np.diag([-1.0, 1, -1]), np.eye(3))
    return turns


def vectors_of(dataset):
    """Return the name of the vectors that turn what stands at the points, None without any."""
    if dataset.active_vectors_name in dataset.point_data:
        return dataset.active_vectors_name
    data = dataset.point_data
    names = [name for name in data if _is_vectors(data[name])]
    names = [name for name in names if name not in ('Normals', data.active_normals_name)]
    if len(names) > 1:
        warn(
            f'the points have several arrays of vectors, {names}: name one, as in '
            f'orient={names[0]!r}; nothing is turned'
        )
    return names[0] if len(names) == 1 else None


def _is_vectors(array):
    return array.ndim == 2 and array.shape[1] == 3 and array.dtype.kind == 'f'


def names_in(orient) -> list:
    """Return the names of columns that are vectors or quaternions together."""
    several = isinstance(orient, list | tuple) and all(isinstance(n, str) for n in orient)
    return list(orient) if several else []


def _plain(poses):
    """Return transforms as matrices, all else as it is."""
    if isinstance(poses, list | tuple) and poses and all(_is_transform(p) for p in poses):
        return np.stack([_plain(p) for p in poses])
    if isinstance(poses, _vtk.vtkMatrix4x4):
        return pv.array_from_vtkmatrix(poses)
    if isinstance(poses, pv.Transform):
        return poses.matrix
    if isinstance(poses, _vtk.vtkTransform):
        return pv.array_from_vtkmatrix(poses.GetMatrix())
    if hasattr(poses, 'as_matrix'):
        found = np.asarray(poses.as_matrix())
        if found.shape[-2:] != (4, 4):
            raise TypeError('poses is a rotation without points: give points and orient=rotation')
        return found
    return poses


def _is_transform(pose):
    kinds = pv.Transform, _vtk.vtkTransform, _vtk.vtkMatrix4x4
    return isinstance(pose, kinds) or hasattr(pose, 'as_matrix')


def _turns(source, orient, count):
    """Return matrices, shape (n, 3, 3) or (1, 3, 3), None if nothing is turned."""
    if orient is None or orient is True:
        name = None if source.dataset is None else vectors_of(source.dataset)
        if name is None and orient:
            raise ValueError(
                'orient is True: it needs points that are a dataset with an array of vectors'
            )
        orient = name
    if orient is None or orient is False:
        return None
    if isinstance(orient, str):
        return _turned('orient', source.array('orient', orient), count)
    if names_in(orient):
        columns = [source.array('orient', name) for name in orient]
        return _turned('orient', np.stack(columns, 1), count)
    if hasattr(orient, 'as_matrix'):
        orient = orient.as_matrix()
    return _turned('orient', orient, count)


def _turned(name, values, count):
    values = _numbers(name, values)
    shapes = [(n, *rest) for n in (count, 1) for rest in ((3,), (4,), (3, 3))]
    if values.shape in ((3,), (4,), (3, 3)) and values.shape not in shapes:
        values = values[None]
    if values.shape not in shapes:
        raise ValueError(
            f'{name} has shape {values.shape}; it must be ({count}, 3), vectors, ({count}, 4), '
            f'quaternions (w, x, y, z), or ({count}, 3, 3), matrices'
        )
    if values.ndim == 3:
        return values
    if values.shape[1] == 3:
        return toward(values)
    still = np.flatnonzero(~values.any(1))
    if len(still):
        raise ValueError(
            f'{name}[{still[0]}] is a quaternion of length 0; it must be (w, x, y, z)'
        )
    return to_matrices(unit_vectors(values))


def _sizes(source, scale, factor, count):
    """Return factors, shape (n,) or (), None if nothing is scaled."""
    factor = checked_factor(factor)
    if scale is True:
        name = None if source.dataset is None else source.dataset.active_scalars_name
        if name is None:
            raise ValueError(
                'scale is True: it needs points that are a dataset with active scalars'
            )
        scale = name
    if scale is None or scale is False:
        return None if factor == 1 else np.array(factor)
    if isinstance(scale, str) and scale.lower() == 'scale' and source.dataset is None:
        return None if factor == 1 else np.array(factor)  # tables scale by this column anyway
    values = source.array('scale', scale) if isinstance(scale, str) else scale
    values = _numbers('scale', values)
    if values.shape == (count, 3):
        values = np.linalg.norm(values, axis=1)
    if values.shape not in ((), (count,)):
        raise ValueError(
            f'scale has shape {values.shape}; it must be one number, ({count},) factors, or '
            f'({count}, 3) vectors'
        )
    if np.abs(values).max(initial=0.0) > _MOST:
        raise ValueError(f'scale is up to {np.abs(values).max():g}; it must be at most {_MOST:g}')
    return kept_apart(values * factor)


def kept_apart(sizes):
    """Return sizes, those of 0 as the least."""
    return np.where(sizes == 0, _LEAST, sizes)


def checked_factor(factor) -> float:
    """Return a factor of all sizes."""
    return checked_number('factor', factor, -_MOST, _MOST) or _LEAST


def _numbers(name, values):
    try:
        array = as_array(name, values, np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f'{name} is {values!r:.80}; it must be numbers') from error
    check_finite(name, array)
    return array
